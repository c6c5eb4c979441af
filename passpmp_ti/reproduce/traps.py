"""Figs. 14, 16 and 17: the U."""

from __future__ import annotations

import math
from typing import Any

from passpmp_ti.reproduce.crowds import row_of, snapshots, table_of
from passpmp_ti.reproduce.figure import strip
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers
from passpmp_ti.reproduce.runs import PATIENCE, Glimpse, Run
from passpmp_ti.reproduce.sampling import fan_panel
from passpmp_ti.reproduce.scene import snapshot

SCENARIO = "u_shape"
LONGEST = 60.0
"""Who is not out by then is trapped [s]."""
SHORT_HORIZON = 1.1
"""Of ISS in Fig. 16 [s]; the paper gives none. In Fig. 17 it is the default, 2 s."""
EARLY = 3.0
"""Of the first picture, after the start [s]."""
VIEW = (30.0, 45.0, 155.0, 135.0)
"""What the pictures show of the scene [m]."""
NO_WAY = "no motion is free"


def _runs(asked: Asked, item: str, planner: str, **options: Any) -> list[Run]:
    runs = []
    for seed in range(asked.seeds):
        asked.see(f"{item}: {SCENARIO}, {planner}, seed {seed}")
        runs.append(
            asked.runs.drive(
                SCENARIO,
                planner,
                seed,
                duration=min(LONGEST, asked.longest),
                between=0.1 if planner == "iss" else 0.5,
                **options,
            )
        )
    return runs


def run_minimum(asked: Asked) -> Found:
    """Fig. 14."""
    ours = _runs(asked, "fig14", "passpmp-pso")
    before = _runs(asked, "fig14", "passpmp")
    rows = [row_of("PASSPMP-PSO", ours), row_of("PASSPMP", before)]
    moving = sum(r["moving"] for r in rows)
    return Found(
        numbers={"rows": rows},
        claims=(
            Claim(
                says="PASSPMP-PSO leaves the U, PASSPMP is trapped in it",
                ours=f"goals: {rows[0]['reached']} of {rows[0]['episodes']} and"
                f" {rows[1]['reached']} of {rows[1]['episodes']}",
                holds=rows[0]["reached"] == rows[0]["episodes"] and rows[1]["reached"] == 0,
            ),
            Claim(
                says="both are p-safe", ours=f"{moving} contacts while moving", holds=moving == 0
            ),
        ),
        figures={
            "PASSPMP-PSO, then PASSPMP, each early and at its end: executed in dark red, planned to"
            " rest in green; grey: braking ICS of the heading and speed that the plan begins with,"
            " by that scan alone": strip(
                "Two planners in the U",
                [
                    snapshot(
                        run, g, f"{name}: {g.time - run.glimpses[0].time:.1f} s", VIEW, ics=True
                    )
                    for name, run in (("PASSPMP-PSO", ours[0]), ("PASSPMP", before[0]))
                    for g in (run.nearest(EARLY), run.glimpses[-1])
                ],
                4,
            )
        },
    )


def tell_minimum(numbers: Numbers) -> str:
    """Fig. 14 as markdown."""
    return "\n\n".join(
        [
            table_of(numbers["rows"], "planner"),
            f"At most {LONGEST:g} s, objects of at most 5 m/s; the U is ours. A robot that stood"
            f" for {PATIENCE:g} s is taken to stay. What leads out is the guide, not the swarm:"
            " both grow the same safe tree, and PASSPMP takes the leaf nearest to the goal as the"
            " crow flies. The swarm with the paper's own distance stays in the U as well, see"
            " [Deeper trees against better guidance](#trees).",
        ]
    )


def run_no_way_out(asked: Asked) -> Found:
    """Fig. 16."""
    runs = _runs(asked, "fig16", "iss", horizon=SHORT_HORIZON)
    rows = [row_of(f"ISS, {SHORT_HORIZON:g} s", runs)]
    stuck = [run for run in runs if _first_stuck(run) is not None]
    shown = stuck[0] if stuck else runs[0]
    last = _first_stuck(shown) or shown.glimpses[-1]
    chosen = [shown.nearest(last.time - shown.glimpses[0].time - back) for back in (2.4, 1.2, 0.4)]
    return Found(
        numbers={"rows": rows, "stuck": len(stuck)},
        claims=(
            Claim(
                says="ISS can end in the U where no collision-free trajectory is left",
                ours=f"in {len(stuck)} of {len(runs)} drives with a horizon of {SHORT_HORIZON:g} s",
                holds=bool(stuck),
            ),
        ),
        figures={
            "ISS in the U: blue, the 11 motions that are free; orange, those that are not; green,"
            " the chosen one": strip(
                "ISS in the U",
                [
                    fan_panel(shown, g, SHORT_HORIZON, f"{g.time - shown.glimpses[0].time:.1f} s",
                              VIEW)
                    for g in (*chosen, last)
                ],
                4,
            )
        },
    )  # fmt: skip


def _first_stuck(run: Run) -> Glimpse | None:
    """The first glimpse in which no motion was free."""
    return next((g for g in run.glimpses if g.reason == NO_WAY), None)


def tell_no_way_out(numbers: Numbers) -> str:
    """Fig. 16 as markdown."""
    return "\n\n".join(
        [
            table_of(numbers["rows"], "planner, horizon"),
            "The horizon is ours. One that sees 1.1 s ahead, 22 m at full speed, finds out too late"
            " that the U has a bottom: braking from 20 m/s takes 2.9 s. The simulator counts a"
            " touch and lets the robot go on: a goal that is reached after one is none.",
        ]
    )


def run_for_ever(asked: Asked) -> Found:
    """Fig. 17."""
    runs = _runs(asked, "fig17", "iss")
    rows = [row_of("ISS, 2 s", runs)]
    trapped = rows[0]["reached"] == 0
    inside = sum(_inside(run) for run in runs)
    return Found(
        numbers={"rows": rows, "inside": inside},
        claims=(
            Claim(
                says="ISS goes on in the concave region and does not get out",
                ours=f"{rows[0]['reached']} of {rows[0]['episodes']} goals;"
                f" {rows[0]['driven']:.0f} m driven, {inside} drives end inside the U",
                holds=trapped,
            ),
        ),
        figures={"ISS circles in the U: executed in dark red": snapshots(runs[0], bounds=VIEW)},
    )


def _inside(run: Run) -> bool:
    """Whether the robot ends between the arms of the U, or less than 10 m in front of them."""
    x, y = run.trail[-1]
    low, high = run.scenario.polygons[0].min(axis=0), run.scenario.polygons[0].max(axis=0)
    return bool(low[0] - 10.0 <= x <= high[0] and low[1] <= y <= high[1]) and not math.isnan(x)


def tell_for_ever(numbers: Numbers) -> str:
    """Fig. 17 as markdown."""
    return "\n\n".join(
        [
            table_of(numbers["rows"], "planner, horizon"),
            f"At most {LONGEST:g} s. What becomes of ISS in the U hangs on its horizon, which the"
            " paper does not give; with 3.1 s it turns away in time and finds round, see"
            " [baselines.md](baselines.md).",
        ]
    )
