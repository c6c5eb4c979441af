"""What a plan costs: eqs. 5, 8, 18 and 19. A leaf's: see kernels/objective.py."""

from __future__ import annotations

import numpy as np

from passpmp_ti.grid.model import TICK
from passpmp_ti.planner.guide import GuideField, mean_cost
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

PACE = 0.05
"""Between samples of the guide along a trajectory [s]."""


def horizon(settings: Settings, robot: Robot) -> float:
    """The time over which plans are compared: the longest plan and the longest braking [s]."""
    return settings.cycle + sum(settings.primitives) + robot.longest_braking


def objective_numbers(settings: Settings, robot: Robot) -> np.ndarray:
    """[5] float32, what `kernels.objective.plan_cost` is told; see there."""
    final = settings.distance == "final"
    return np.array(
        (
            settings.weight_distance, settings.weight_time, horizon(settings, robot), final, TICK,
        ),
        dtype=np.float32,
    )  # fmt: skip


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
