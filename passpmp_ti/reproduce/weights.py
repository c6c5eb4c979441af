"""Tables III and IV: what the weights of distance and time choose from one tree."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

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
GOALS, AWAY = 8, 60.0
"""Of Table IV: evenly round the robot, so far from it [m]."""
WEIGHTS = tuple(round(0.1 * k, 1) for k in range(1, 10))
SMALL = 1e-6


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


def _tree(asked: Asked, goal: tuple[float, float] | None) -> tuple[Tree, tuple[float, float]]:
    """The tree of the cycle towards a goal; None: the scenario's."""
    run = asked.runs.drive(
        SCENARIO, object_speed=OBJECT_SPEED, duration=min(AFTER + 0.2, asked.longest)
    )
    goal = run.scenario.goals[0] if goal is None else goal
    settings = _settings(run.scenario.settings)
    ground = Ground.of(run.nearest(AFTER), AcceleratingCar(), settings, goal)
    return ground.grow(settings), goal


def run_one_goal(asked: Asked) -> Found:
    """Table III."""
    asked.see("table3: one tree, six pairs of weights")
    tree, goal = _tree(asked, None)
    away, taken = leaf_distances(tree, goal)
    columns = [_choice(away, taken, w_d) for w_d in paper.WEIGHTS]
    swarm = [_by_swarm(tree, goal, w_d, asked) for w_d in paper.WEIGHTS]
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


def _by_swarm(tree: Tree, goal: tuple[float, float], w_d: float, asked: Asked) -> float:
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
    rows = [
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
    run = asked.runs.drive(
        SCENARIO, object_speed=OBJECT_SPEED, duration=min(AFTER + 0.2, asked.longest)
    )
    here = run.nearest(AFTER).state
    for k in range(GOALS):
        asked.see(f"table4: goal {k + 1} of {GOALS}")
        angle = float(here[2]) + 2 * math.pi * k / GOALS
        goal = (
            float(here[0]) + AWAY * math.cos(angle), float(here[1]) + AWAY * math.sin(angle)
        )  # fmt: skip
        tree, _ = _tree(asked, goal)
        away, taken = leaf_distances(tree, goal)
        nearest = _choice(away, taken, 1.0)
        both = [
            (w, c) for w in WEIGHTS if (c := _choice(away, taken, w)).cost_t < nearest.cost_t - SMALL
        ]  # fmt: skip
        row: dict[str, Any] = {"bearing": 360 * k / GOALS, "w_d": None}
        if both:
            w_d, best = both[-1]
            row |= {
                "w_d": w_d, "cost_d": best.cost_d, "cost_t": best.cost_t, "f": best.f,
                "farther": best.cost_d - nearest.cost_d, "sooner": nearest.cost_t - best.cost_t,
            }  # fmt: skip
        rows.append(row)
    told = sorted((r for r in rows if r["w_d"] is not None), key=lambda r: float(r["w_d"]))
    # w_d (d - d*) < (1 - w_d) (t* - t) is what choosing both means
    bound = all(
        r["farther"] <= (1 - r["w_d"]) / r["w_d"] * r["sooner"] + 1e-6 for r in told
    )  # fmt: skip
    return Found(
        numbers={"rows": rows, "best": told},
        claims=(
            Claim(
                says="the greater the w_d that still weighs both, the less distance it gives up",
                ours=f"{len(told)} of {GOALS} goals have such weights; what is given up is at most"
                f" {'' if bound else 'not '}(1 - w_d) / w_d times the time gained in all of them",
                holds=bound and bool(told),
            ),
        ),
    )  # fmt: skip


def tell_many_goals(numbers: Numbers) -> str:
    """Table IV as markdown."""
    printed = paper.TABLE_4
    theirs = [
        ["paper", w, 1 - w, *(printed[key][k] for key in ("cost_d", "cost_t", "f", "farther", "sooner"))]
        for k, w in enumerate(printed["w_d"])
    ]  # fmt: skip
    ours = [
        [f"ours, goal at {r['bearing']:.0f} deg", r["w_d"], 1 - r["w_d"],
         *(r[key] for key in ("cost_d", "cost_t", "f", "farther", "sooner"))]
        for r in numbers["best"]
    ]  # fmt: skip
    without = [f"{r['bearing']:.0f}" for r in numbers["rows"] if r["w_d"] is None]
    text = (
        "The tree of Table III, with goals evenly round the robot, 60 m away. The paper does not"
        " say what makes weights the best; here it is the greatest w_d that still chooses a shorter"
        " plan than distance alone does. That the loss of distance shrinks as w_d grows is no"
        " property of a scene: w_d and w_t choose a plan only if what it loses, Diff_d+, is at most"
        " w_t / w_d times what it gains, Diff_t-."
    )
    if without:
        text += (
            f" For goals at {', '.join(without)} deg no weights do: the plan that ends nearest to"
            " the goal is also among the shortest."
        )
    head = ["", "w_d", "w_t", "cost_d [m]", "cost_t [s]", "f", "Diff_d+ [m]", "Diff_t- [s]"]
    return f"{table(head, [*theirs, *ours])}\n\n{text}"
