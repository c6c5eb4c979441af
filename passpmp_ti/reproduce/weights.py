"""Tables III and IV: what the weights of distance and time choose from one tree."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from passpmp_ti.planner.swarm import Swarm
from passpmp_ti.planner.tree import Tree
from passpmp_ti.reproduce import paper
from passpmp_ti.reproduce.cycle import PAPERS, AcceleratingCar, Ground, leaf_distances
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, table
from passpmp_ti.settings import Settings

SCENARIO, OBJECT_SPEED, AFTER = "crowded", 5.0, 2.0
"""The cycle that is looked at: objects of at most so many m/s, so many seconds after the start."""
PRIMITIVES = (0.4,) * 4
"""[s] With the paper's 0.88 s and longer hardly any plan is longer than another here."""
CAPACITY = 100_000
"""Never reached: the trees are whole."""
BEARINGS = tuple(range(-60, 61, 10))
"""Of the goals of Table IV, from the car's heading [deg]."""
AWAY = (20.0, 40.0, 60.0, 90.0)
"""How far they are from it [m]."""
WEIGHTS = tuple(round(0.1 * k, 1) for k in range(1, 10))
"""w_d that are tried for each goal."""
SMALL = 1e-6
"""Costs that differ by less are equal [m, s]."""


@dataclass(frozen=True)
class _Choice:
    """The best leaf by some weights."""

    cost_d: float
    cost_t: float
    f: float


def _choice(away: np.ndarray, taken: np.ndarray, w_d: float) -> _Choice:
    f = w_d * away + (1 - w_d) * taken
    k = int(np.argmin(f))
    return _Choice(float(away[k]), float(taken[k]), float(f[k]))


def _settings(base: Settings) -> Settings:
    return base.changed(
        **PAPERS, primitives=PRIMITIVES, capacity=CAPACITY, particles=paper.PARTICLES
    )


def _tree(asked: Asked) -> tuple[Tree, tuple[float, float]]:
    """The tree of the cycle, and the scenario's goal [m]."""
    run = asked.runs.drive(
        SCENARIO, object_speed=OBJECT_SPEED, duration=min(AFTER + 0.2, asked.longest)
    )
    goal = run.scenario.goals[0]
    settings = _settings(run.scenario.settings)
    ground = Ground.of(run.nearest(AFTER), AcceleratingCar(), settings, goal)
    return ground.grow(settings), goal


def run_one_goal(asked: Asked) -> Found:
    """Table III."""
    asked.see("table3: one tree, six pairs of weights")
    tree, goal = _tree(asked)
    away, taken = leaf_distances(tree, goal)
    columns = [_choice(away, taken, w_d) for w_d in paper.WEIGHTS]
    swarm = [_by_swarm(tree, goal, w_d) for w_d in paper.WEIGHTS]
    numbers: Numbers = {
        "nodes": tree.count, "leaves": len(away),
        **{key: [getattr(c, key) for c in columns] for key in ("cost_d", "cost_t", "f")},
        "swarm_f": swarm,
    }  # fmt: skip
    falls = bool((np.diff(numbers["cost_d"]) <= SMALL).all())
    rises = bool((np.diff(numbers["cost_t"]) >= -SMALL).all())
    k = paper.WEIGHTS.index(paper.W_D)
    ours = f"{numbers['cost_d'][k]:.1f} m in {numbers['cost_t'][k]:.2f} s"
    last = f"{numbers['cost_d'][-1]:.1f} m in {numbers['cost_t'][-1]:.2f} s"
    between = numbers["cost_t"][k] < numbers["cost_t"][-1] - SMALL
    return Found(
        numbers=numbers,
        claims=(
            Claim(
                says="the greater w_d, the nearer to the goal the plan ends, and the longer it is",
                ours=f"cost_d {'never rises' if falls else 'rises somewhere'}, cost_t"
                f" {'never falls' if rises else 'falls somewhere'}",
                holds=falls and rises,
            ),
            Claim(
                says="w_d = 0.2, w_t = 0.8 weighs both: a shorter plan than by distance alone",
                ours=f"{ours}; by distance alone {last}", holds=between,
            ),
        ),
    )  # fmt: skip


def _by_swarm(tree: Tree, goal: tuple[float, float], w_d: float) -> float:
    """f of eq. 5 of what the swarm chooses, worked out as `_choice` does."""
    settings = _settings(tree.model.settings).changed(
        weight_distance=w_d, weight_time=round(1 - w_d, 1)
    )
    swarm = Swarm(tree.model.robot, settings)
    leaf, _, _ = swarm.choose(tree, np.random.default_rng(0))
    host = tree.on_host()
    away = math.dist(host.states[leaf, :2], goal)
    return w_d * away + (1 - w_d) * float(host.elapsed[leaf])


def tell_one_goal(numbers: Numbers) -> str:
    """Table III as markdown."""
    printed = paper.TABLE_3
    rows: list[list[object]] = [
        ["w_t", *(f"{1 - w:.1f}" for w in paper.WEIGHTS)],
        ["cost_d, paper [m]", *printed["cost_d"]],
        ["cost_d, ours [m]", *numbers["cost_d"]],
        ["cost_t, paper [s]", *printed["cost_t"]],
        ["cost_t, ours [s]", *numbers["cost_t"]],
        ["f, paper", *printed["f"]],
        ["f, ours: least of all leaves", *numbers["f"]],
        ["f, ours: found by the swarm", *numbers["swarm_f"]],
    ]
    return "\n\n".join(
        [
            table(["w_d", *(f"{w:g}" for w in paper.WEIGHTS)], rows),
            f"One tree of {numbers['nodes']} nodes and {numbers['leaves']} plans, grown as the"
            f" paper does (the car only accelerates), {AFTER:g} s after the start of `{SCENARIO}`"
            f" with objects of at most {OBJECT_SPEED:g} m/s, primitives of {PRIMITIVES[0]:g} s."
            " Plans are of different lengths because some end in a braking trajectory. The scene is"
            " ours, so digits cannot agree; what can be compared is where the choice changes."
            " At w_d = 0 all plans of the shortest duration are equal, and the first is taken.",
        ]
    )  # fmt: skip


def run_many_goals(asked: Asked) -> Found:
    """Table IV."""
    rows: list[dict[str, Any]] = []
    asked.see("table4: one tree, many goals")
    tree, _ = _tree(asked)
    x, y, heading = (float(v) for v in tree.on_host().states[0, :3])
    for bearing in BEARINGS:
        angle = heading + math.radians(bearing)
        for far in AWAY:
            goal = (x + far * math.cos(angle), y + far * math.sin(angle))
            rows.append({"bearing": bearing, "far": far, **_best_weights(tree, goal)})
    both = [r for r in rows if r["w_d"] is not None]
    first = [next(r for r in both if r["w_d"] == w) for w in sorted({r["w_d"] for r in both})]
    trend = float(spearmanr([r["w_d"] for r in both], [r["farther"] for r in both])[0])
    return Found(
        numbers={"goals": len(rows), "both": len(both), "rows": first, "trend": trend},
        claims=(
            Claim(
                says="the greater the w_d that still weighs both, the less distance it gives up",
                ours=f"rank correlation {trend:+.2f} over {len(both)} goals", holds=trend < 0,
            ),
        ),
    )  # fmt: skip


def _best_weights(tree: Tree, goal: tuple[float, float]) -> dict[str, Any]:
    """The greatest w_d by which a shorter plan is chosen than by distance alone, and what that
    plan costs; w_d is None where there is no such plan."""
    away, taken = leaf_distances(tree, goal)
    nearest = _choice(away, taken, 1.0)
    for w_d in reversed(WEIGHTS):
        best = _choice(away, taken, w_d)
        if best.cost_t < nearest.cost_t - SMALL:
            return {
                "w_d": w_d, "cost_d": best.cost_d, "cost_t": best.cost_t, "f": best.f,
                "farther": best.cost_d - nearest.cost_d, "sooner": nearest.cost_t - best.cost_t,
            }  # fmt: skip
    return {"w_d": None}


def tell_many_goals(numbers: Numbers) -> str:
    """Table IV as markdown."""
    printed = paper.TABLE_4
    keys = ("cost_d", "cost_t", "f", "farther", "sooner")
    theirs = [
        ["paper", w, 1 - w, *(printed[key][k] for key in keys)]
        for k, w in enumerate(printed["w_d"])
    ]
    ours = [
        [f"ours, {r['far']:g} m at {r['bearing']:+.0f} deg", r["w_d"], 1 - r["w_d"],
         *(r[key] for key in keys)]
        for r in numbers["rows"]
    ]  # fmt: skip
    head = ["goal", "w_d", "w_t", "cost_d [m]", "cost_t [s]", "f", "Diff_d+ [m]", "Diff_t- [s]"]
    return "\n\n".join(
        [
            table(head, [*theirs, *ours]),
            f"The tree of Table III and {numbers['goals']} goals in front of the car. The paper"
            " does not say what makes weights the best; here it is the greatest w_d that still"
            f" chooses a shorter plan than distance alone does. {numbers['both']} of the goals have"
            " such weights; for each w_d the first goal is shown. For the others the plan that ends"
            " nearest is also among the shortest. That the loss shrinks is no property of a scene:"
            " weights choose a plan only if what it loses, Diff_d+, is at most w_t / w_d times what"
            " it gains, Diff_t-.",
        ]
    )
