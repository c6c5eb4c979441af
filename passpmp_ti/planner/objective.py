"""What a plan costs: eqs. 5, 8, 18 and 19."""

from __future__ import annotations

import numpy as np

from passpmp_ti.kernels.tree import CHILDREN
from passpmp_ti.planner.guide import GuideField, mean_cost
from passpmp_ti.planner.tree import Tree
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory


def horizon(settings: Settings) -> float:
    """Duration of the longest plan that a tree holds, less its braking tail [s]."""
    return settings.cycle + sum(settings.primitives)


def leaf_costs(tree: Tree, settings: Settings) -> np.ndarray:
    """f of eq. 5 for the plan that ends at each leaf.

    w_ps is 1 for every plan of the tree: all its nodes are proven p-safe (eq. 8). A node that is
    not a leaf costs infinitely much: no plan ends there.

    Returns:
        [n] float32, one a node.
    """
    elapsed = tree.elapsed
    if settings.distance == "final":
        distance = tree.cost[:, 1].astype(np.float64)
    else:
        span = np.maximum(horizon(settings), elapsed)
        distance = (tree.cost[:, 0] + (span - elapsed) * tree.cost[:, 1]) / span
        # a plan that ends early waits: what is averaged over the horizon lasts as long
        elapsed = span
    f = settings.weight_distance * distance + settings.weight_time * elapsed
    f[tree.link[:, CHILDREN] != 0] = np.inf
    return f.astype(np.float32)


def trajectory_cost(
    trajectory: Trajectory, start: float, guide: GuideField, settings: Settings
) -> float:
    """f of eq. 5 for what is left of a trajectory from `start` on, judged as a leaf's plan is."""
    turn = float(trajectory.times[trajectory.brakes_from])
    end = turn if turn > start + 1e-9 else max(trajectory.end, start)
    samples = max(2, 1 + round((end - start) / 0.05))
    times = np.linspace(start, end, samples)
    costs = guide.at(trajectory.sampled(times))
    if settings.distance == "final":
        distance = float(costs[-1])
    else:
        distance = mean_cost(times - start, costs, horizon(settings))
    taken = end - start
    if settings.distance == "mean":
        taken = max(taken, horizon(settings))
    return settings.weight_distance * distance + settings.weight_time * taken
