"""Figs. 10 and 12: cycle after cycle to the goal, and what the paper's long cycles do to it."""

from __future__ import annotations

import statistics
from typing import Any

from passpmp_ti.reproduce import paper
from passpmp_ti.reproduce.figure import strip
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, percent, table
from passpmp_ti.reproduce.runs import Run
from passpmp_ti.reproduce.scene import SIDE, snapshot
from passpmp_ti.sim.world import Bounds

PANELS = 4
WIDE = 2.0
"""Scenes at least so many times wider than high have a row each."""
CAPTION = (
    "`simple`: executed in dark red, planned to rest in green; grey: braking ICS of the heading and"
    " speed that the plan begins with, by that scan alone"
)
SHORT = 60.0
"""Longest drive with a long cycle [s]: it stands, and goes on standing."""


def row_of(name: str, runs: list[Run]) -> dict[str, Any]:
    """Some runs in numbers, ready for JSON."""
    told = [run.summary for run in runs]
    times = [s["time_to_goal"] for s in told if s["reached_goal"]]
    return {
        "name": name, "episodes": len(told), "reached": len(times),
        "time": statistics.median(times) if times else None,
        "moving": sum(s["collisions_moving"] for s in told),
        "rest": sum(s["collisions_at_rest"] for s in told),
        "driven": sum(s["distance_driven"] for s in told),
        "share_moving": sum(s["share_moving"] for s in told) / len(told),
    }  # fmt: skip


def table_of(rows: list[dict[str, Any]], first: str) -> str:
    """Rows of `row_of` as markdown."""
    head = [first, "goals", "time to goal, median [s]", "contacts while moving", "at rest",
            "driven [m]", "time moving"]  # fmt: skip
    return table(
        head,
        [
            [r["name"], f"{r['reached']} of {r['episodes']}",
             None if r["time"] is None else f"{r['time']:.1f}", r["moving"], r["rest"],
             f"{r['driven']:.0f}", percent(r["share_moving"])]
            for r in rows
        ],
    )  # fmt: skip


def snapshots(
    run: Run, count: int = PANELS, bounds: Bounds | None = None, ics: bool = False
) -> str:
    """A drive in some panels; scenes that are much wider than high have a row of their own each."""
    bounds = run.scenario.bounds if bounds is None else bounds
    wide = bounds[2] - bounds[0] > WIDE * (bounds[3] - bounds[1])
    start = run.glimpses[0].time
    panels = [
        snapshot(run, g, f"{g.time - start:.1f} s", bounds, 2 * SIDE if wide else SIDE, ics)
        for g in run.spread(count)
    ]
    return strip(run.scenario.name, panels, 1 if wide else min(count, 4))


def run_simple(asked: Asked) -> Found:
    """Fig. 10."""
    rows = []
    shown = None
    for cycle in (None, 0.4, 1.0, paper.LONG_CYCLES[1]):
        runs = []
        for seed in range(asked.seeds):
            asked.see(f"fig10: simple, seed {seed}, cycle {cycle or 0.1:g} s")
            settings = None if cycle is None else {"cycle": cycle}
            longest = asked.longest if cycle is None else min(SHORT, asked.longest)
            runs.append(asked.runs.drive("simple", seed=seed, settings=settings, duration=longest))
        name = f"{runs[0].scenario.settings.cycle:g} s"
        rows.append(row_of(name, runs))
        shown = shown or runs[0]
    assert shown is not None
    ours, long = rows[0], rows[-1]
    return Found(
        numbers={"rows": rows, "object_speed": shown.scenario.settings.object_speed},
        claims=(
            Claim(
                says="cycle after cycle the robot gets to its goal, p-safe",
                ours=f"{ours['reached']} of {ours['episodes']} goals,"
                f" {sum(r['moving'] for r in rows)} contacts while moving, at a cycle of"
                f" {ours['name']}",
                holds=ours["reached"] == ours["episodes"] and not any(r["moving"] for r in rows),
            ),
            Claim(
                says="so it does with a cycle of 2.4 s",
                ours=f"{long['reached']} of {long['episodes']} goals in {long['driven']:.0f} m",
                holds=long["reached"] == long["episodes"],
            ),
        ),
        figures={CAPTION: snapshots(shown, ics=True)},
    )


def tell_simple(numbers: Numbers) -> str:
    """Fig. 10 as markdown."""
    return "\n\n".join(
        [
            table_of(numbers["rows"], "cycle"),
            "Three fixed polygons and two moving discs, as in the paper's Fig. 6; the layout is"
            f" ours, and objects are bounded by {numbers['object_speed']:g} m/s. Drives with longer"
            f" cycles end after {SHORT:g} s.",
        ]
    )


def run_crowded(asked: Asked) -> Found:
    """Fig. 12."""
    rows, shown = [], None
    for bound, cycle in ((5.0, None), (None, None), (None, paper.LONG_CYCLES[0])):
        runs = []
        for seed in range(asked.seeds):
            at_most = paper.TOP_SPEED if bound is None else bound
            asked.see(f"fig12: crowded, seed {seed}, {at_most:g} m/s, cycle {cycle or 0.1:g} s")
            settings = None if cycle is None else {"cycle": cycle}
            longest = asked.longest if cycle is None else min(SHORT, asked.longest)
            runs.append(
                asked.runs.drive(
                    "crowded", seed=seed, settings=settings, object_speed=bound, duration=longest
                )
            )
        used = runs[0].scenario.settings
        rows.append(row_of(f"{used.object_speed:g} m/s, {used.cycle:g} s", runs))
        shown = shown or runs[0]
    assert shown is not None
    moving = sum(r["moving"] for r in rows)
    return Found(
        numbers={"rows": rows},
        claims=(
            Claim(
                says="PASSPMP-PSO: no contact while moving in the crowd",
                ours=f"{moving} in {sum(r['driven'] for r in rows):.0f} m", holds=moving == 0,
            ),
            Claim(
                says="it gets through 22 movers with a cycle of 1.4 s",
                ours=f"objects of 20 m/s: {rows[2]['reached']} of {rows[2]['episodes']} goals at"
                f" 1.4 s, {rows[1]['reached']} of {rows[1]['episodes']} at 0.1 s",
                holds=rows[2]["reached"] == rows[2]["episodes"],
            ),
        ),
        figures={"`crowded`, objects of at most 5 m/s: executed in dark red, planned to rest in"
                 " green; behind each object the way of its last 1.2 s": snapshots(shown)},
    )  # fmt: skip


def tell_crowded(numbers: Numbers) -> str:
    """Fig. 12 as markdown."""
    return "\n\n".join(
        [
            table_of(numbers["rows"], "bound on objects, cycle"),
            "22 objects on B-splines, as in the paper; the layout is ours. Contacts at rest are"
            " objects that run into the standing car: passive safety does not promise against them,"
            " and nobody in the scene gives way. With a cycle of 1.4 s and objects of 20 m/s the"
            " cones have closed before a first primitive ends.",
        ]
    )
