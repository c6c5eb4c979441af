"""Model predictive path integral control: Williams, Wagener, Goldfain, Drews, Rehg, Boots &
Theodorou, "Information theoretic MPC for model-based reinforcement learning", ICRA 2017.

Numbers are the defaults of Nav2's MPPI controller (nav2_mppi_controller, README: "Configuration").
Those with a unit are for its robot, 0.22 m in radius and 0.5 m/s fast; here they are shares of the
robot's own radius and speed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.kernels.rollouts import GAP, MEAN, STEPS
from passpmp_ti.planner.baselines.cycle import Reactive, Sight
from passpmp_ti.planner.baselines.motion import Motion
from passpmp_ti.planner.baselines.obstacles import Obstacles
from passpmp_ti.robots import CAR, Robot
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

BATCH = 1000
HORIZON = 56 * 0.05
"""[s]."""
TEMPERATURE, GAMMA = 0.3, 0.015
SPEED_NOISE = 0.2 / 0.5
"""Standard deviation of the speed, as a share of the top speed."""
TURN_NOISE, TOP_TURN = 0.4 / 1.9, 1.9
"""The same for the turn rate, and the greatest turn rate [rad/s]."""
BACKWARDS = 0.35 / 0.5
"""Greatest speed backwards, as a share of the top speed."""
GOAL_WEIGHT = 5.0 * 0.22
"""Of the mean distance to the goal [radii]."""
COLLISION_COST, CRITICAL_WEIGHT, MARGIN = 10_000.0, 20.0, 0.1 / 0.22
"""Of a touch, and of passing nearer than the margin [radii]."""


class Mppi(Reactive):
    """Samples motions about the last answer and takes their mean, weighted by exp(-cost / lambda).

    A motion costs its mean distance to the goal, passing near returns of the latest scan, touching
    them, and noise that goes against the last answer (gamma). Where every sample touches something
    the robot brakes and the next cycle begins from standing still.
    """

    def __init__(
        self,
        robot: Robot,
        settings: Settings,
        goal: tuple[float, float] | Sequence[tuple[float, float]],
        static_map: StaticMap | None = None,
        *,
        seed: int | np.random.Generator = 0,
    ) -> None:
        """See `Navigator`."""
        sampler = Sampler(robot, settings, np.random.default_rng(seed))
        super().__init__(sampler.plan, robot, settings, goal, static_map)


class Sampler:
    """The mean motion of the last cycle, and how it is improved.

    A stage lasts one cycle, so that the next cycle begins with the second stage of this one. Its
    commands are a forward speed [m/s] and a turn rate [rad/s]; a car's second one is its steering
    [rad].
    """

    def __init__(self, robot: Robot, settings: Settings, generator: np.random.Generator) -> None:
        self._motion = Motion(robot, settings)
        self._generator = generator
        self._stages = max(round(HORIZON / settings.cycle), 2)
        top = robot.top_speed
        turn = min(TOP_TURN, robot.top_turn_rate)
        if robot.kind == CAR:
            turn = float(self._motion.limits()[1][1])
        self._low = np.array([max(-BACKWARDS * top, float(robot.parameters()[1])), -turn])
        self._high = np.array([top, turn])
        self._deviation = np.array([SPEED_NOISE * top, TURN_NOISE * turn])
        self._mean = np.zeros((self._stages, 2))

    def plan(self, sight: Sight) -> Trajectory | None:
        """The mean motion after one improvement; None: every sample touches something."""
        motion = self._motion
        robot, settings = motion.robot, motion.settings
        steps = settings.steps_of(settings.cycle)
        noise = self._deviation * self._generator.standard_normal((BATCH, self._stages, 2))
        tried = np.clip(self._mean + noise, self._low, self._high)
        here = (float(sight.root[0]), float(sight.root[1]))
        way = robot.top_speed * self._stages * settings.cycle
        obstacles = Obstacles.seen(sight.scans, here, way + robot.radius, settings.cell)
        found = obstacles.tried(motion, sight.root, sight.goal, self._inputs(tried), steps)
        touches = found[:, STEPS] < self._stages * steps
        if touches.all():
            self._mean[:] = 0.0
            return None
        nearness = np.clip(1 - found[:, GAP] / (MARGIN * robot.disc_radius), 0.0, 1.0)
        against = (self._mean * (tried - self._mean) / self._deviation**2).sum(axis=(1, 2))
        cost = (
            GOAL_WEIGHT * found[:, MEAN] / robot.disc_radius
            + CRITICAL_WEIGHT * nearness
            + COLLISION_COST * touches
            + GAMMA * against
        )
        weight = np.exp(-(cost - cost.min()) / TEMPERATURE)
        weight /= weight.sum()
        mean = (weight[:, None, None] * tried).sum(axis=0)
        self._mean = np.concatenate([mean[1:], mean[-1:]])
        return motion.towards(sight.root, sight.start, self._inputs(mean), steps)

    def _inputs(self, commands: np.ndarray) -> np.ndarray:
        """[..., 2] the robot's inputs for commands [..., 2]."""
        robot = self._motion.robot
        if robot.kind == CAR:
            return commands
        half_track = robot.top_speed / robot.top_turn_rate
        speed, turn = commands[..., 0], commands[..., 1]
        wheels = np.stack([speed + half_track * turn, speed - half_track * turn], axis=-1)
        return np.clip(wheels, *self._motion.limits())
