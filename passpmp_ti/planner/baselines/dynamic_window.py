"""The dynamic window approach: Fox, Burgard & Thrun, "The dynamic window approach to collision
avoidance", IEEE Robotics & Automation Magazine 4(1), 1997."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.body import to_poses
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.kernels.rollouts import follow_arcs
from passpmp_ti.planner.baselines.cycle import Reactive, Sight
from passpmp_ti.planner.baselines.motion import Motion
from passpmp_ti.planner.baselines.obstacles import Obstacles
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

INTERVAL = 0.25
"""[s] within which the inputs that are tried can be reached."""
SIDE = 21
"""Speeds tried along each input of the window."""
HEADING, CLEARANCE, VELOCITY = 0.8, 0.1, 0.1
"""alpha, beta and gamma: what facing the goal, a long free way and speed weigh."""
FAR = 2.0
"""A free way longer than this many stopping distances counts as this long."""


class DynamicWindow(Reactive):
    """Takes constant inputs that can be reached within 0.25 s and that leave room to stop.

    An input is admissible where the robot can still stop on its arc before the nearest return of
    the latest scan, after 0.25 s at that speed. The best one maximises, smoothed over its
    neighbours, 0.8 heading + 0.1 dist + 0.1 velocity, each from 0 to 1: how well the robot faces
    the goal where braking after that time would leave it, how far it gets on the arc, how fast it
    is. Nothing drives backwards. Where nothing is admissible the robot brakes.
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
        """See `Navigator`; nothing is random."""
        super().__init__(Window(robot, settings).plan, robot, settings, goal, static_map)


class Window:
    """The inputs that are tried, and the choice among them."""

    def __init__(self, robot: Robot, settings: Settings) -> None:
        self._motion = Motion(robot, settings)
        stopping = robot.top_speed**2 / (2 * robot.deceleration)
        self._longest = FAR * (stopping + robot.top_speed * INTERVAL)

    def plan(self, sight: Sight) -> Trajectory | None:
        """One cycle towards the best inputs, then braking; None: none is admissible."""
        motion = self._motion
        robot, settings = motion.robot, motion.settings
        inputs = self._window(sight.root[3:])
        speed, turning, way = self._arcs(sight, inputs).T
        to_go = math.dist(sight.root[:2], sight.goal)
        # what is driven before braking can begin
        left = np.maximum(way - np.abs(speed) * INTERVAL, 0.0)
        admissible = (speed >= 0) & (speed**2 <= 2 * robot.deceleration * left)
        # nothing is gained by being too fast to stop at the goal
        soft = np.sqrt(2 * robot.deceleration * to_go)
        admissible &= speed <= max(float(soft), float(speed.min()))
        if not admissible.any():
            return None
        score = (
            HEADING * self._facing(sight, inputs, speed, turning)
            + CLEARANCE * way / self._longest
            + VELOCITY * speed / robot.top_speed
        )
        score = np.where(admissible, smoothed(score.reshape(SIDE, SIDE)).ravel(), -np.inf)
        best = int(np.argmax(score))
        steps = settings.steps_of(settings.cycle)
        return motion.towards(sight.root, sight.start, inputs[best : best + 1], steps)

    def _window(self, now: np.ndarray) -> np.ndarray:
        """[SIDE^2, 2] inputs that can be reached within the interval from those of now [2]."""
        low, high = self._motion.limits()
        span = np.array(self._motion.rates) * INTERVAL
        least, most = np.clip(now - span, low, high), np.clip(now + span, low, high)
        first, second = np.linspace(least, most, SIDE).T
        return np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1).reshape(-1, 2)

    def _arcs(self, sight: Sight, inputs: np.ndarray) -> np.ndarray:
        """[N, 3] forward speed [m/s], turn rate [rad/s] and free way [m] along the arc of each."""
        motion = self._motion
        here = (float(sight.root[0]), float(sight.root[1]))
        reach = self._longest + motion.robot.radius
        obstacles = Obstacles.seen(sight.scans, here, reach, motion.settings.cell)
        arc = device.empty((len(inputs), 3), np.float32)
        follow_arcs(
            motion.robot.kind, device.share(), device.put(motion.numbers), obstacles.gaps,
            obstacles.frame, device.put(to_poses(sight.root[None], obstacles.centre)),
            device.put(inputs.astype(np.float32)), self._longest, arc,
        )  # fmt: skip
        return device.host(arc).astype(np.float64)

    def _facing(
        self, sight: Sight, inputs: np.ndarray, speed: np.ndarray, turning: np.ndarray
    ) -> np.ndarray:
        """[N] 1 where the robot faces the goal, 0 where it turns its back on it, after the interval
        and braking at once: on the arc, half the time of braking further."""
        motion = self._motion
        braking = np.abs(speed) / motion.robot.deceleration
        if motion.robot.sharpest_curvature == math.inf:
            # turning has to stop as well
            braking = np.abs(inputs).max(axis=1) / motion.robot.deceleration
        taken = INTERVAL + 0.5 * braking
        turn = turning * taken
        chord = speed * taken * np.sinc(turn / (2 * np.pi))
        x, y, theta = sight.root[:3]
        dx = sight.goal[0] - x - chord * np.cos(theta + 0.5 * turn)
        dy = sight.goal[1] - y - chord * np.sin(theta + 0.5 * turn)
        off = np.arctan2(dy, dx) - theta - turn
        return 1 - np.abs(np.mod(off + np.pi, 2 * np.pi) - np.pi) / np.pi


def smoothed(score: np.ndarray) -> np.ndarray:
    """[n, n] mean of each value and its eight neighbours; the border stands for what is beyond."""
    wide = np.pad(score, 1, mode="edge")
    n, m = score.shape
    shifted = [wide[r : r + n, c : c + m] for r in range(3) for c in range(3)]
    return np.mean(shifted, axis=0)
