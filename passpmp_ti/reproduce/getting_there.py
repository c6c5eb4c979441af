"""The guide against the paper's distance on every scenario, and trees against guidance."""

from __future__ import annotations

import math
from typing import Any

from passpmp_ti.reproduce.crowds import row_of
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, table
from passpmp_ti.reproduce.runs import Run
from passpmp_ti.reproduce.traps import LONGEST
from passpmp_ti.sim.scenario import load_scenario, shipped
from passpmp_ti.sim.sources import NobodyMoves

GUIDES = ("safe_time", "euclidean")
NEVER = ("dead_end",)
"""Scenarios whose goal cannot be reached."""
TRAP = "u_shape"
STAYS = 15.0
"""Where nobody moves, a robot that stood for so long is taken to stay [s]: longer than
`Settings.patience`, after which it backs out."""
TREES = ((40, (0.5, 1.0, 1.5)), (1200, (0.5, 1.0, 1.5)), (20_000, (0.4, 0.6, 0.8, 1.2)))
"""(capacity, primitives [s])."""


def _drive(
    asked: Asked, name: str, seed: int, settings: dict[str, Any], patience: float | None = None
) -> Run:
    """One drive; the U is given less time than its scenario gives it."""
    longest = LONGEST if name == TRAP else math.inf
    return asked.runs.drive(
        name, seed=seed, settings=settings or None, duration=min(longest, asked.longest),
        patience=patience,
    )  # fmt: skip


def run_guides(asked: Asked) -> Found:
    """The guide on every shipped scenario."""
    rows: list[dict[str, Any]] = []
    missing: dict[str, str] = {}
    for name in shipped():
        try:
            scenario = load_scenario(name)
        except (ValueError, OSError):
            missing[name] = "the recording is not at hand"
            continue
        still = STAYS if isinstance(scenario.movers, NobodyMoves) else None
        for guide in GUIDES:
            runs = []
            for seed in range(asked.seeds):
                asked.see(f"guide: {name}, {guide}, seed {seed}")
                changes = {} if guide == GUIDES[0] else {"guide": guide}
                runs.append(_drive(asked, name, seed, changes, still))
            rows.append({"scenario": name, "guide": guide, **row_of(name, runs)})
    goals = {
        guide: sum(r["reached"] for r in rows if r["guide"] == guide and r["scenario"] not in NEVER)
        for guide in GUIDES
    }
    tries = sum(
        r["episodes"] for r in rows if r["guide"] == GUIDES[0] and r["scenario"] not in NEVER
    )
    moving = sum(r["moving"] for r in rows)
    return Found(
        numbers={"rows": rows, "missing": missing, "goals": goals, "tries": tries},
        claims=(
            Claim(
                says="(ours) time at the speed that will be safe leads where the straight distance"
                " does not",
                ours=f"goals: {goals['safe_time']} of {tries} with the guide,"
                f" {goals['euclidean']} of {tries} with the distance; {moving} contacts while"
                " moving",
                holds=goals["safe_time"] > goals["euclidean"] and moving == 0,
            ),
        ),
    )


def tell_guides(numbers: Numbers) -> str:
    """The guide as markdown."""
    by = {(r["scenario"], r["guide"]): r for r in numbers["rows"]}
    rows: list[list[object]] = []
    for name in dict.fromkeys(r["scenario"] for r in numbers["rows"]):
        row: list[object] = [f"`{name}`"]
        for guide in GUIDES:
            r = by[name, guide]
            time = None if r["time"] is None else f"{r['time']:.1f}"
            row += [f"{r['reached']} of {r['episodes']}", time, f"{r['driven']:.0f}"]
        row.append(sum(by[name, guide]["moving"] for guide in GUIDES))
        rows.append(row)
    rows += [
        [f"`{name}`", why, *[""] * (3 * len(GUIDES))] for name, why in numbers["missing"].items()
    ]
    head = ["scenario", *(f"{what}, {guide}" for guide in ("guide", "distance")
                          for what in ("goals", "time [s]", "driven [m]")),
            "contacts while moving"]  # fmt: skip
    return "\n\n".join(
        [
            table(head, rows),
            "The default planner, and the same with `guide=\"euclidean\"` alone changed: tree,"
            " swarm and the average along the plan are the same. Where nobody moves, a robot that"
            f" stood for {STAYS:g} s is taken to stay: with the guide it backs out after 10 s, see"
            f" `Settings.patience`. `{TRAP}` is driven for {LONGEST:g} s at most. The goal of"
            " `dead_end` cannot be reached. Times are medians of the drives that got there.",
        ]
    )  # fmt: skip


def run_trees(asked: Asked) -> Found:
    """Deeper trees against better guidance."""
    rows = []
    for guide in GUIDES:
        for capacity, primitives in TREES:
            runs = []
            for seed in range(asked.seeds):
                asked.see(f"trees: {TRAP}, {guide}, {capacity} nodes, seed {seed}")
                changes = {"guide": guide, "capacity": capacity, "primitives": primitives}
                runs.append(_drive(asked, TRAP, seed, changes))
            rows.append(
                {"guide": guide, "capacity": capacity, "levels": 1 + len(primitives),
                 **row_of(guide, runs)}
            )  # fmt: skip
    small_guided = next(r for r in rows if r["guide"] == "safe_time")
    blind = [r for r in rows if r["guide"] == "euclidean"]
    return Found(
        numbers={"rows": rows},
        claims=(
            Claim(
                says="(ours) better guidance buys more than deeper trees",
                ours=f"out of the U: {small_guided['reached']} of {small_guided['episodes']} with"
                f" {small_guided['capacity']} nodes and the guide,"
                f" {max(r['reached'] for r in blind)} of {blind[0]['episodes']} with up to"
                f" {blind[-1]['capacity']:,} nodes and the distance",
                holds=small_guided["reached"] > max(r["reached"] for r in blind),
            ),
        ),
    )


def tell_trees(numbers: Numbers) -> str:
    """Trees as markdown."""
    rows = [
        [r["guide"], r["capacity"], r["levels"], f"{r['reached']} of {r['episodes']}",
         None if r["time"] is None else f"{r['time']:.1f}", f"{r['driven']:.0f}", r["moving"]]
        for r in numbers["rows"]
    ]  # fmt: skip
    head = ["guide", "nodes at most", "levels", "out of the U", "time to goal, median [s]",
            "driven [m]", "contacts while moving"]  # fmt: skip
    return "\n\n".join(
        [
            table(head, rows),
            "The swarm chooses, and the distance is averaged along the plan as by default. Deeper"
            " traps, more sizes and more seeds: [speed.md](speed.md).",
        ]
    )
