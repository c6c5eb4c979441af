"""How much more the swarm's plan costs than the best one, by the size of the tree."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from passpmp_ti import backend, door
from passpmp_ti.bench.trees import random_tree
from passpmp_ti.planner.swarm import Branches, Swarm, best_leaf, leaf_costs
from passpmp_ti.robots import CarLike, Robot
from passpmp_ti.settings import Settings

SIZES = (13, 40, 135, 237, 1_000, 10_000, 100_000, 1_000_000)
Grow = Callable[[int, np.random.Generator], Branches]


def measure_gap(
    nodes: Sequence[int] = SIZES,
    runs: int = 100,
    seed: int = 0,
    robot: Robot | None = None,
    settings: Settings | None = None,
    grow: Grow = random_tree,
    progress: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Search trees of each size by the swarm and through all leaves.

    Args:
        nodes: sizes of trees.
        runs: trees a size, one search each.
        seed: of trees and searches.
        robot: whose trees they are; None: a car.
        settings: the swarm's and the objective's; None: the defaults, with the last state judged,
            as `random_tree` wants it.
        grow: (nodes, generator) to a tree.
        progress: told what is measured now.

    Returns:
        One row a size, ready for JSON: in which share of runs the swarm's plan cost more than
        the best one (`missed`), and by how much: in cost (`excess_*`), and as a share of what the
        median leaf costs more than the best one (`share_*`; 0: the best, 1: as if chosen blindly).
        Means are over all runs, missed or not. `leaves`: plans to choose from, on average.
    """
    arch = backend.init()
    runs = door.whole("measure_gap", "runs", runs, least=1)
    robot = CarLike() if robot is None else robot
    settings = Settings(distance="final", weight_time=0.0) if settings is None else settings
    rows = []
    for size in nodes:
        if progress is not None:
            progress(f"gap: {size} nodes")
        generator = np.random.default_rng((seed, size))
        swarm = Swarm(robot, settings.changed(capacity=size))
        gaps = np.array([_gap(grow(size, generator), swarm, robot, settings, generator)
                         for _ in range(runs)])  # fmt: skip
        excess, share, leaves = gaps.T
        rows.append(
            {
                "nodes": size,
                "leaves": float(leaves.mean()),
                "missed": float((excess > 0).mean()),
                **_spread("excess", excess),
                **_spread("share", share),
            }
        )
    return {
        "rows": rows, "runs": runs, "seed": seed, "particles": settings.particles,
        "sub_swarms": settings.sub_swarms, "iterations": settings.iterations, "backend": arch,
    }  # fmt: skip


def _gap(
    tree: Branches,
    swarm: Swarm,
    robot: Robot,
    settings: Settings,
    generator: np.random.Generator,
) -> tuple[float, float, int]:
    """(excess, excess as a share of the median leaf's, leaves) of one search."""
    _, least = best_leaf(tree, robot, settings)
    _, _, found = swarm.choose(tree, generator)
    costs = leaf_costs(tree, robot, settings)
    costs = costs[np.isfinite(costs)]
    spread = float(np.median(costs)) - least
    excess = found - least
    return excess, excess / spread if spread > 0.0 else 0.0, len(costs)


def _spread(name: str, values: np.ndarray) -> dict[str, float]:
    return {
        f"{name}_mean": float(values.mean()),
        f"{name}_p95": float(np.quantile(values, 0.95)),
        f"{name}_worst": float(values.max()),
    }
