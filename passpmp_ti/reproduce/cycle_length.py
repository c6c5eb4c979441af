"""Table VI: nodes and plan length, by the length of the cycle and by the time for the tree."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from passpmp_ti.compare.axes import Axis
from passpmp_ti.planner.plan import trajectory_to
from passpmp_ti.planner.swarm import best_leaf
from passpmp_ti.planner.tree import ROOT, Tree
from passpmp_ti.reproduce import paper
from passpmp_ti.reproduce.cycle import PAPERS, AcceleratingCar, Ground
from passpmp_ti.reproduce.figure import curves, document
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, table
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

SHORT = (0.05, 0.1)
"""Cycles that are tried beside the paper's [s]."""
BOUNDS = (20.0, 5.0)
"""On the speed of objects [m/s]: the paper's, and a runner's."""
BUDGETS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""For the tree [s]."""
PRIMITIVES = (0.4,) * 9
MOST = 4_000_000
"""Nodes that a tree may have in memory."""
CAPTION = "Nodes of a tree by the time that it may grow, both axes logarithmic"
LATER = 100_000
"""The same where only unsafe states end it."""


def run(asked: Asked) -> Found:
    """Table VI, as the paper has it and for this machine."""
    rows = [_by_cycle(asked, bound, delay) for bound in BOUNDS for delay in (*SHORT, *paper.CYCLES)]
    budgets = [_by_budget(asked, budget) for budget in BUDGETS if budget <= asked.longest]
    by = {(r["object_speed"], r["cycle"]): r["nodes"] for r in rows}
    first, last = paper.CYCLES[0], paper.CYCLES[-1]
    grows = bool((np.diff([b["nodes"] for b in budgets]) >= 0).all())
    drawing = curves(
        "Nodes of a tree by the time for it",
        {
            "paper, the whole cycle": [
                (1e3 * c, float(n)) for c, n in zip(paper.CYCLES, paper.TABLE_6_NODES, strict=True)
            ],
            "ours, the tree alone": [(1e3 * b["budget"], float(b["nodes"])) for b in budgets],
        },
        Axis(low=1.0, high=1e4, label="time [ms]", log=True),
        Axis(low=1.0, high=1e7, label="nodes", log=True),
    )
    return Found(
        numbers={"rows": rows, "budgets": budgets},
        claims=(
            Claim(
                says="the longer the cycle, the more nodes and the longer the plan",
                ours=", ".join(
                    f"nodes with objects of {bound:g} m/s: {by[bound, first]} at {first:g} s,"
                    f" {by[bound, last]} at {last:g} s"
                    for bound in BOUNDS
                ),
                holds=all(by[bound, last] > by[bound, first] for bound in BOUNDS),
            ),
            Claim(
                says="the more time the tree has, the more nodes it gets",
                ours=f"{budgets[0]['nodes']:,} nodes in {1e3 * budgets[0]['budget']:g} ms,"
                f" {budgets[-1]['nodes']:,} in {budgets[-1]['budget']:g} s",
                holds=grows,
            ),
        ),
        figures={CAPTION: document(drawing)},
    )


def _by_cycle(asked: Asked, bound: float, delay: float) -> dict[str, Any]:
    """The whole tree from rest, `delay` after the scan."""
    asked.see(f"table6: objects of at most {bound:g} m/s, a cycle of {delay:g} s")
    run = asked.runs.drive("crowded", object_speed=bound, duration=0.4)
    settings = run.scenario.settings.changed(
        **PAPERS, weight_distance=paper.W_D, weight_time=paper.W_T, cycle=paper.PRIMITIVE,
        primitives=(paper.PRIMITIVE,) * (paper.LEVELS - 1), capacity=LATER,
    )  # fmt: skip
    first = run.glimpses[0]
    ground = Ground.of(
        first, AcceleratingCar(), settings, run.scenario.goals[0], root=first.state, delay=delay
    )
    tree = ground.grow(settings)
    return {
        "object_speed": bound, "cycle": delay, "nodes": _primitives(tree),
        "duration": _plan_time(tree, ground.robot, settings),
    }  # fmt: skip


def _primitives(tree: Tree) -> int:
    """Nodes but for the rest at the end of braking trajectories: those are no safe primitives."""
    return int(tree.count - tree.on_host().braking.sum())


def _plan_time(tree: Tree, robot: Robot, settings: Settings) -> float:
    """From the root of the plan that ends nearest to the goal to rest [s]; 0: there is none."""
    leaf, cost = best_leaf(tree, robot, settings.changed(weight_distance=1.0, weight_time=0.0))
    if leaf == ROOT or not math.isfinite(cost):
        return 0.0
    return trajectory_to(tree, leaf).duration


def _by_budget(asked: Asked, budget: float) -> dict[str, Any]:
    """A tree that only time ends, of the default car."""
    asked.see(f"table6: {1e3 * budget:g} ms for the tree")
    run = asked.runs.drive("crowded", object_speed=5.0, duration=min(2.2, asked.longest))
    goal = run.scenario.goals[0]
    settings = run.scenario.settings.changed(
        primitives=PRIMITIVES, capacity=MOST, exploration_time=budget, optimizer="exhaustive"
    )
    glimpse = run.nearest(2.0)
    began = time.perf_counter()
    ground = Ground.of(glimpse, run.scenario.robot, settings, goal)
    prepared = time.perf_counter()
    trees = [ground.grow(settings) for _ in range(3)]
    tree = max(trees, key=lambda t: t.count)
    chosen = time.perf_counter()
    leaf, _ = best_leaf(tree, ground.robot, settings)
    return {
        "budget": budget, "nodes": tree.count, "depth": tree.depth,
        "stopped_by": tree.stopped_by, "before": prepared - began,
        "choice": time.perf_counter() - chosen,
        "plan": float(tree.elapsed[leaf]) if leaf != ROOT else 0.0,
        "duration": trajectory_to(tree, leaf).duration if leaf != ROOT else 0.0,
    }  # fmt: skip


def tell(numbers: Numbers) -> str:
    """Table VI as markdown."""
    rows = []
    printed = dict(
        zip(
            paper.CYCLES,
            zip(paper.TABLE_6_NODES, paper.TABLE_6_DURATIONS, strict=True),
            strict=True,
        )
    )
    cycles = list(dict.fromkeys(r["cycle"] for r in numbers["rows"]))
    by = {(r["object_speed"], r["cycle"]): r for r in numbers["rows"]}
    for cycle in cycles:
        row: list[object] = [f"{cycle:g}", *printed.get(cycle, (None, None))]
        for bound in BOUNDS:
            row += [by[bound, cycle]["nodes"], by[bound, cycle]["duration"]]
        rows.append(row)
    head = [
        "delta_c [s]", "nodes, paper", "delta_e, paper [s]",
        *(f"{what}, ours, {bound:g} m/s" for bound in BOUNDS for what in ("nodes", "delta_e [s]")),
    ]  # fmt: skip
    timed = [
        [f"{1e3 * b['budget']:g}", b["nodes"], b["depth"], b["stopped_by"], b["plan"],
         b["duration"], f"{1e3 * b['before']:.0f}", f"{1e3 * b['choice']:.1f}"]
        for b in numbers["budgets"]
    ]  # fmt: skip
    return "\n\n".join(
        [
            table(head, rows),
            "Ours: the car at rest at the start of `crowded`, trees of primitives of 0.88 s that"
            " only accelerate, grown until nothing is safe any more, nine levels or 100,000 nodes;"
            " their root lies one cycle after the scan. A node is a p-safe one; the root alone is"
            " 1. What ended the paper's trees was time; what ends ours is the model. After 0.88 s"
            " the car drives 6 m/s and needs as long to brake, and in both together an object of 20"
            " m/s comes 35 m nearer. With 5 m/s there is room, and the longer the cycle, the less.",
            "**On this machine**, where time alone matters, the tree of the default car (nine"
            " controls, primitives of 0.4 s), 2 s into `crowded` with objects of at most 5 m/s:",
            table(
                ["time for the tree [ms]", "nodes", "levels", "stopped by", "plan [s]",
                 "plan and braking [s]", "model and guide before it [ms]", "choice after it [ms]"],
                timed,
            ),
            "The paper's machine grew 237 nodes in 5.5 s. Of three trees, one after"
            " the other, the largest is shown: the machine had others to serve. A tree that"
            " `capacity` stopped had no more room in memory.",
        ]
    )  # fmt: skip
