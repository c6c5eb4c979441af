"""What a plan costs: eqs. 5, 8, 18 and 19."""

from __future__ import annotations

import numpy as np

from passpmp_ti.kernels.tree import CHILDREN
from passpmp_ti.planner.guide import GuideField, mean_cost
from passpmp_ti.planner.tree import Tree
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

PACE = 0.05
"""Between samples of the guide along a trajectory [s]."""


def horizon(settings: Settings, robot: Robot) -> float:
    """The time over which plans are compared: the longest plan and the longest braking [s]."""
    return settings.cycle + sum(settings.primitives) + robot.longest_braking


def leaf_costs(tree: Tree, settings: Settings) -> np.ndarray:
    """f of eq. 5 for the plan that ends at each leaf.

    w_ps is 1 for every plan of the tree: all its nodes are proven p-safe (eq. 8). A node that is
    not a leaf costs infinitely much: no plan ends there.

    Returns:
        [n] float32, one a node.
    """
    elapsed = tree.elapsed
    cost = tree.cost.astype(np.float64)
    if settings.distance == "final":
        distance = cost[:, 1]
    else:
        # what is held is the plan and its braking, and rest after it: judged over one time for all
        span = horizon(settings, tree.model.robot)
        rest = np.maximum(span - elapsed - cost[:, 4], 0.0)
        distance = (cost[:, 0] + cost[:, 2] + rest * cost[:, 3]) / span
        elapsed = np.full(tree.count, span)
    f = settings.weight_distance * distance + settings.weight_time * elapsed
    f[tree.link[:, CHILDREN] != 0] = np.inf
    return f.astype(np.float32)


def trajectory_cost(
    trajectory: Trajectory, start: float, guide: GuideField, settings: Settings, robot: Robot
) -> float:
    """f of eq. 5 for what is left of a trajectory from `start` on, judged as a leaf's plan is."""
    turn = float(trajectory.times[trajectory.brakes_from])
    if settings.distance == "final":
        end = turn if turn > start + 1e-9 else max(trajectory.end, start)
        distance = float(guide.at(trajectory.at(end)[None])[0])
        taken = end - start
    else:
        end = max(trajectory.end, start)
        times = np.linspace(start, end, 2 + round((end - start) / PACE))
        taken = horizon(settings, robot)
        distance = mean_cost(times, guide.at(trajectory.sampled(times)), taken)
    return settings.weight_distance * distance + settings.weight_time * taken
