"""Input space sampling (ISS): a fan of motions, of which the free one nearest to the goal is taken.

Sec. 5.1.5, after Howard, Green, Kelly & Ferguson, "State space sampling of feasible motions for
high-performance mobile robot navigation in complex environments", J. Field Robotics 25, 2008.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from passpmp_ti import door
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.kernels.rollouts import LAST, STEPS
from passpmp_ti.planner.baselines.cycle import Reactive, Sight
from passpmp_ti.planner.baselines.motion import Motion
from passpmp_ti.planner.baselines.obstacles import Obstacles
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

MOTIONS = 11
"""Sec. 5.1.5."""
HORIZON = 2.0
"""[s]"""


class InputSpaceSampling(Reactive):
    """ISS: 11 constant inputs, spread evenly from the sharpest turn right to the sharpest left.

    Each is followed by the robot's own dynamics over a horizon. Those along which the robot meets a
    return of the latest scan are dropped; nothing is said of what moves, nor of what comes after.
    Of the others the one that ends nearest to the goal is taken; where there is none the robot
    brakes. All are driven at one speed: the top speed, or less where the horizon would reach beyond
    the goal.

    Args:
        horizon: how far ahead [s]. The paper gives none: with 2 s the robot does what Figs. 15 and
            17 show.
    """

    def __init__(
        self,
        robot: Robot,
        settings: Settings,
        goal: tuple[float, float] | Sequence[tuple[float, float]],
        static_map: StaticMap | None = None,
        *,
        seed: int | np.random.Generator = 0,
        horizon: float = HORIZON,
    ) -> None:
        """See `Navigator`; nothing is random."""
        door.finite("InputSpaceSampling", "horizon", horizon, least=settings.time_step, unit="s")
        super().__init__(Fan(robot, settings, horizon).plan, robot, settings, goal, static_map)


class Fan:
    """The motions that are tried, and the choice among them."""

    def __init__(self, robot: Robot, settings: Settings, horizon: float) -> None:
        self._motion = Motion(robot, settings)
        self._steps = settings.steps_of(horizon)
        self._horizon = self._steps * settings.time_step
        self._turns = np.linspace(-1.0, 1.0, MOTIONS)

    def plan(self, sight: Sight) -> Trajectory | None:
        """The free motion that ends nearest to the goal, ties to the right; None: none is free."""
        motion = self._motion
        robot, settings = motion.robot, motion.settings
        here = (float(sight.root[0]), float(sight.root[1]))
        away = math.dist(here, sight.goal)
        speed = min(robot.top_speed, away / self._horizon)
        targets = motion.inputs(np.full(MOTIONS, speed), self._turns)
        reach = robot.top_speed * self._horizon + robot.radius
        obstacles = Obstacles.seen(sight.scans, here, reach, settings.cell)
        found = obstacles.tried(motion, sight.root, sight.goal, targets[:, None], self._steps)
        free = found[:, STEPS] >= self._steps
        if not free.any():
            return None
        best = int(np.argmin(np.where(free, found[:, LAST], np.inf)))
        return motion.towards(sight.root, sight.start, targets[best : best + 1], self._steps)
