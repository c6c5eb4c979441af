"""Fig. 13: how many particles find the optimum."""

from __future__ import annotations

import numpy as np

from passpmp_ti.compare.axes import Axis
from passpmp_ti.planner.swarm import Swarm, best_leaf
from passpmp_ti.reproduce import paper
from passpmp_ti.reproduce.cycle import Ground
from passpmp_ti.reproduce.figure import curves, document
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, percent, table

SIZES = (2, 5, 10, 15, 20, 50, 100)
"""Particles."""
TREES = (40, 240, 1200)
"""Nodes, at most: the paper's tree at its cycle of 2.4 s, its largest, and our default."""
SCENARIO, OBJECT_SPEED, AFTER = "crowded", 5.0, 2.0
FOUND = 1e-6
"""The optimum is found where nothing costs less by more than this share."""


def run(asked: Asked) -> Found:
    """Fig. 13."""
    run = asked.runs.drive(
        SCENARIO, object_speed=OBJECT_SPEED, duration=min(AFTER + 0.2, asked.longest)
    )
    base = run.scenario.settings.changed(sub_swarms=1)
    ground = Ground.of(run.nearest(AFTER), run.scenario.robot, base, run.scenario.goals[0])
    rows = []
    for capacity in TREES:
        tree = ground.grow(base.changed(capacity=capacity))
        _, least = best_leaf(tree, ground.robot, base)
        hits, plans = [], []
        for particles in SIZES:
            asked.see(f"fig13: {particles} particles, tree of {tree.count} nodes")
            swarm = Swarm(ground.robot, base.changed(capacity=capacity, particles=particles))
            found = [swarm.choose(tree, np.random.default_rng(k)) for k in range(asked.searches)]
            hits.append(float(np.mean([c <= least * (1 + FOUND) for _, _, c in found])))
            plans.append(float(np.mean([len(leaves) for _, leaves, _ in found])))
        rows.append({"nodes": tree.count, "leaves": len(tree.leaves), "hits": hits, "plans": plans})
    enough = SIZES.index(paper.ENOUGH_PARTICLES)
    least_hit = min(min(r["hits"][enough:]) for r in rows)
    drawing = curves(
        "Searches that find the optimum",
        {f"{r['nodes']} nodes": list(zip(map(float, SIZES), r["hits"], strict=True)) for r in rows},
        Axis(low=1.0, high=100.0, label="particles", log=True),
        Axis(low=0.0, high=1.05, label="optimum found", percent=True),
    )
    return Found(
        numbers={"sizes": list(SIZES), "rows": rows, "searches": asked.searches},
        claims=(
            Claim(
                says="from 20 particles on the optimum is found in 100 % of 100 runs",
                ours=f"{percent(least_hit)} or more of {asked.searches} runs, for trees of"
                f" {rows[0]['nodes']} to {rows[-1]['nodes']} nodes",
                holds=least_hit == 1.0,
            ),
        ),
        figures={"Share of searches that find the optimum, by the number of particles": document(drawing)},
    )  # fmt: skip


def tell(numbers: Numbers) -> str:
    """Fig. 13 as markdown."""
    rows = [["paper", "", "", "", "at random", "100 %", "100 %", "100 %"]]
    for r in numbers["rows"]:
        name = f"{r['nodes']} nodes, {r['leaves']} plans"
        rows.append([f"ours, {name}", *(percent(h) for h in r["hits"])])
    for r in numbers["rows"]:
        rows.append(
            [f"different plans, {r['nodes']} nodes", *(f"{p:.1f}" for p in r["plans"])]
        )  # fmt: skip
    return "\n\n".join(
        [
            table(["particles", *(str(n) for n in numbers["sizes"])], rows),
            f"{numbers['searches']} searches each of 60 iterations, one swarm, in trees of one"
            f" cycle of `{SCENARIO}`, {AFTER:g} s after the start with objects of at most"
            f" {OBJECT_SPEED:g} m/s. The optimum is known exactly: it is the cheapest of all"
            " leaves. Different plans are those that the particles hold at the end, on average.",
        ]
    )
