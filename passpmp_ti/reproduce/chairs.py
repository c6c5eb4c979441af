"""Figs. 19 to 22: the wheelchair, in simulation here."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from passpmp_ti.reproduce import paper
from passpmp_ti.reproduce.crowds import row_of, snapshots, table_of
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers
from passpmp_ti.reproduce.runs import Run

STANDS = 0.05
"""Slower than this a wheelchair is at rest to the eye [m/s]."""


def runner(item: str, scenario: str, says: str, *, reaches: bool, waits: bool = False) -> Callable:
    """What runs one of these figures.

    Args:
        item: its name.
        scenario: that stands for the paper's experiment.
        says: what the paper's chair does.
        reaches: the goal is to be reached; else rest is.
        waits: it is to stand still on the way.
    """

    def run(asked: Asked) -> Found:
        runs = []
        for seed in range(asked.seeds):
            asked.see(f"{item}: {scenario}, seed {seed}")
            runs.append(asked.runs.drive(scenario, seed=seed, duration=asked.longest))
        row = row_of(scenario, runs)
        stood = [_slowest_on_the_way(r) for r in runs]
        ours = f"{row['reached']} of {row['episodes']} goals, {row['moving']} contacts while moving"
        holds = row["moving"] == 0 and row["reached"] == (row["episodes"] if reaches else 0)
        if waits:
            ours += f"; on the way it slows to {max(stood):.2f} m/s or less"
            holds = holds and max(stood) < STANDS
        if not reaches:
            resting = sum(_rests(r) for r in runs)
            ours += f"; at rest at the end in {resting}"
            holds = holds and resting == len(runs)
        settings = runs[0].scenario.settings
        return Found(
            numbers={"rows": [row], "slowest": stood, "cycle": settings.cycle,
                     "object_speed": settings.object_speed},
            claims=(Claim(says=says, ours=ours, holds=holds),),
            figures={f"`{scenario}`: executed in dark red, planned to rest in green":
                     snapshots(runs[0])},
        )  # fmt: skip

    return run


def _slowest_on_the_way(run: Run) -> float:
    """Least speed over half a second once the robot is under way and before it arrives [m/s]."""
    step = 0.5
    times = np.arange(run.times[0], run.times[-1] - step, step)
    places = np.stack([np.interp(times, run.times, c) for c in run.trail.T], axis=1)
    pace = np.hypot(*np.diff(places, axis=0).T) / step
    gone = np.hypot(*(places[:-1] - run.trail[0]).T)
    left = np.hypot(*(places[:-1] - run.trail[-1]).T)
    under_way = pace[(gone > 1.0) & (left > 1.0)]
    return float(under_way.min()) if len(under_way) else 0.0


def _rests(run: Run) -> bool:
    """Whether the last glimpse finds the robot at rest."""
    return bool(run.scenario.robot.at_rest(run.glimpses[-1].state))


def tell(numbers: Numbers) -> str:
    """Any of these figures as markdown."""
    return "\n\n".join(
        [
            table_of(numbers["rows"], "scenario"),
            "In simulation, with a front and a rear range finder, cycles of"
            f" {numbers['cycle']:g} s and objects of at most {numbers['object_speed']:g} m/s; the"
            " paper drives a real chair, with one range finder and a cycle of"
            f" {paper.CHAIR_CYCLE:g} s, among people, and tells what was seen. The layout is ours.",
        ]
    )
