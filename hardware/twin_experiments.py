"""The paper's four experiments with a chair (Figs. 19 to 22) on the twin, through the chain.

    python -m hardware.twin_experiments --runs 20 --out out/twin

Real time. What is in the folder is not driven again. A drive in which the twin itself was late by
more than the executor waits for feedback says little of a chair: it is driven again, and both are
counted.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Generator, Iterable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hardware.executor_settings import ExecutorSettings
from hardware.twin import Chain
from passpmp_ti import door
from passpmp_ti.bench.machine import commit, processor
from passpmp_ti.compare.job import Key, Result
from passpmp_ti.compare.ledger import Ledger

LATE = ExecutorSettings().feedback_timeout
"""A twin that was later than this at any moment was disturbed [s]."""
TRIES = 3
"""Drives of one seed; the last one counts, disturbed or not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """One of the paper's, at one length of the planner's cycle."""

    figure: int
    scenario: str
    cycle: float
    """[s]."""
    object_speed: float
    """Bound on the speed of objects [m/s]; the longer the cycle, the less is possible."""
    seconds: float
    """Longest [s]."""
    ahead: float = 0.0
    """The scenario has gone on for so long when the chair begins [s]."""

    @property
    def variant(self) -> str:
        """Its name in the ledger."""
        return f"cycle {self.cycle:g} s"


EXPERIMENTS = (
    Experiment(figure=19, scenario="narrow_passage", cycle=0.1, object_speed=0.3, seconds=60),
    Experiment(figure=20, scenario="corridor", cycle=0.1, object_speed=0.5, seconds=60),
    # slowed down, the person walks in as the chair comes near, and leaves 32 s later
    Experiment(
        figure=21, scenario="corridor_person", cycle=0.1, object_speed=0.5, seconds=75, ahead=5
    ),
    # over before a chair that came to rest there backs out, see `Settings.patience`
    Experiment(figure=22, scenario="dead_end", cycle=0.1, object_speed=0.5, seconds=24),
    Experiment(figure=19, scenario="narrow_passage", cycle=0.4, object_speed=0.1, seconds=60),
    Experiment(figure=20, scenario="corridor", cycle=0.4, object_speed=0.2, seconds=60),
    # slowed down to that, he stands there for 80 s: the chair comes when most of it is over
    Experiment(
        figure=21, scenario="corridor_person", cycle=0.4, object_speed=0.2, seconds=75, ahead=85
    ),
    Experiment(figure=22, scenario="dead_end", cycle=0.4, object_speed=0.2, seconds=24),
)


@dataclass(frozen=True, slots=True)
class Job:
    """One drive."""

    experiment: Experiment
    seed: int

    @property
    def key(self) -> Key:
        """(scenario, variant, seed)."""
        return (self.experiment.scenario, self.experiment.variant, self.seed)


def circumstances() -> dict[str, Any]:
    """What a drive was driven on, when, and beside what load."""
    return {
        "machine": processor(), "commit": commit(), "at": time.time(), "load": os.getloadavg()[0]
    }  # fmt: skip


def carry_out(job: Job, film: Path | None = None) -> Result:
    """Drive once, and again where the twin was disturbed.

    Args:
        job: what.
        film: where the last drive's video is to be, without its suffix; None: none is drawn.

    Raises:
        RuntimeError: a process did not start in any of the tries, or died on the way.
    """
    e = job.experiment
    disturbed: list[dict[str, Any]] = []
    while True:
        chain = Chain(
            e.scenario, seed=job.seed, cycle=e.cycle, object_speed=e.object_speed, threads=1,
            ahead=e.ahead,
        )  # fmt: skip
        with ExitStack() as open_:
            try:
                open_.enter_context(chain)
            except RuntimeError as why:
                # a machine on which it does not even start is disturbed
                disturbed.append(
                    {
                        "twin_latest": math.inf, "collisions_moving": 0, "reached_goal": False,
                        "why": str(why),
                    }
                )  # fmt: skip
                if len(disturbed) == TRIES:
                    raise
                continue
            # a process that dies on the way ends the campaign: that is no disturbance
            told = chain.run(e.seconds).summary()
        if told["interrupted"]:
            raise KeyboardInterrupt
        if told["twin_latest"] <= LATE:
            break
        disturbed.append({
            key: told[key] for key in ("twin_latest", "collisions_moving", "reached_goal")
        })  # fmt: skip
        if len(disturbed) == TRIES:
            break
    if film is not None:
        chain.film(film)
    scenario, variant, seed = job.key
    return told | {
        "scenario": scenario, "variant": variant, "seed": seed, "error": None, "figure": e.figure,
        "disturbed": disturbed, "quiet": len(disturbed) < TRIES,
        "timings": circumstances(),
    }  # fmt: skip


def conditions() -> dict[str, Any]:
    """What drives in one folder have in common."""
    known = {f"{e.scenario}, {e.variant}": asdict(e) for e in EXPERIMENTS}
    return {"tries": TRIES, "late": LATE, "scenarios": known}


def jobs(runs: int, only: Iterable[str] = ()) -> list[Job]:
    """Seed by seed, so that a campaign that is stopped has some of each.

    Raises:
        ValueError: no experiment of that name.
    """
    names = tuple(dict.fromkeys(e.scenario for e in EXPERIMENTS))
    wanted = {door.choice("twin_experiments", "only", name, names) for name in only} or set(names)
    return [
        Job(e, seed) for seed in range(runs) for e in EXPERIMENTS if e.scenario in wanted
    ]


def line(found: Result) -> str:
    """One line of progress."""
    goal = "-" if found["time_to_goal"] is None else f"{found['time_to_goal']:.1f} s"
    return (
        f"{found['scenario']:16s} {found['variant']:13s} seed {found['seed']:3d}   goal {goal:>7s}"
        f"   contacts moving {found['collisions_moving']}, at rest {found['collisions_at_rest']}"
        f"   stood {found['longest_stand']:.1f} s   twin late {1e3 * found['twin_latest']:.0f} ms,"
        f" disturbed {len(found['disturbed'])}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description="The paper's four experiments with a chair, on the physics twin.",
        epilog="example: python -m hardware.twin_experiments --runs 2 --out out/twin",
    )
    parser.add_argument("--runs", type=int, default=2, help="seeds of each (default: 2)")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--only", nargs="*", default=(), metavar="SCENARIO")
    parser.add_argument("--film", action="store_true", help="a video of seed 0 of each")
    given = parser.parse_args()
    try:
        wanted = jobs(door.whole("twin_experiments", "runs", given.runs, least=1), given.only)
        ledger = Ledger(given.out, conditions())
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2

    def each(left: list[Job]) -> Generator[Result, None, None]:
        for job in left:
            e = job.experiment
            filmed = given.out / f"fig{e.figure}-{round(1e3 * e.cycle)}ms.mp4"
            found = carry_out(job, filmed if given.film and job.seed == 0 else None)
            print(line(found), file=sys.stderr)
            yield found

    try:
        ledger.fill(wanted, each, lambda done: None)
    except KeyboardInterrupt:
        print("stopped; what was driven is kept", file=sys.stderr)
        return 130
    touched = sum(found["collisions_moving"] > 0 for found in ledger.results.values())
    print(f"{len(ledger.results)} drives, {touched} with a contact while the chair moved")
    return 1 if touched else 0


if __name__ == "__main__":
    sys.exit(main())
