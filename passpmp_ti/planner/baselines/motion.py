"""How a robot moves towards speeds that it is told, and to rest: trajectories for the baselines."""

from __future__ import annotations

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.body import to_poses, to_states
from passpmp_ti.kernels.check import trace
from passpmp_ti.kernels.rollouts import drive
from passpmp_ti.robots import CAR, Control, Robot
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

ROUNDING = 2**0.5
"""How much nearer than cell centres tell a return and the robot may be [cells]."""


class Motion:
    """A robot's motion model, at the settings' time step.

    Kernels compute in single precision: they are given places as seen from where a motion begins.
    """

    def __init__(self, robot: Robot, settings: Settings) -> None:
        self.robot = robot
        self.settings = settings
        self.rates = (
            robot.deceleration,
            # a car's second input steers, the other robots' is a wheel like the first
            getattr(robot, "xi_rate", robot.deceleration),
        )
        """How fast the two inputs change at most [m/s^2; m/s^2 or rad/s]."""
        offsets = [offset for offset, _ in robot.discs]
        radius = robot.disc_radius + ROUNDING * settings.cell
        self.numbers = np.array(
            [
                *robot.parameters(), settings.time_step, *self.rates, radius, robot.overhang,
                *offsets,
            ],
            dtype=np.float32,
        )  # fmt: skip
        """[11 + discs] float32, see kernels/rollouts.py."""
        self._brake = robot.braking[0]
        self._trace_numbers = np.zeros(8, dtype=np.float32)
        self._trace_numbers[1] = settings.time_step
        self._trace_numbers[2:8] = robot.parameters()

    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest [2] of the two inputs: speed [m/s] and steering [rad] of a car, or
        both wheels' speeds [m/s]."""
        numbers = self.robot.parameters().astype(np.float64)
        if self.robot.kind == CAR:
            return np.array([numbers[1], -numbers[2]]), np.array([numbers[0], numbers[2]])
        return np.full(2, numbers[1]), np.full(2, numbers[0])

    def inputs(self, speed: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """[..., 2] inputs of a forward speed [...] [m/s] and of a share [...] of the sharpest turn,
        within the limits.

        A car's turn is its steering. Other robots take from the inner wheel: at 1 the robot turns
        on the spot, to the left.
        """
        low, high = self.limits()
        if self.robot.kind == CAR:
            return np.clip(np.stack([speed, turn * high[1]], axis=-1), low, high)
        right = speed * (1 - 2 * np.maximum(-turn, 0))
        left = speed * (1 - 2 * np.maximum(turn, 0))
        return np.clip(np.stack([right, left], axis=-1), low, high)

    def towards(
        self, state: np.ndarray, start: float, targets: np.ndarray, steps: int
    ) -> Trajectory:
        """Steer the inputs to each of some targets in turn, then brake to rest.

        Args:
            state: [5] at `start`.
            start: [s].
            targets: [T, 2] inputs.
            steps: time steps of each.
        """
        anchor = (float(state[0]), float(state[1]))
        path = device.empty((len(targets) * steps + 1, 7), np.float32)
        drive(
            self.robot.kind, device.put(self.numbers), device.put(to_poses(state[None], anchor)),
            device.put(np.ascontiguousarray(targets, dtype=np.float32)), steps, path,
        )  # fmt: skip
        driven = device.host(path)
        tail = self._traced(driven[-1:].copy(), [self._brake], [-1])
        poses = np.concatenate([driven, tail[1:]])
        return self._laid(poses, anchor, start, len(driven) - 1)

    def braking(self, state: np.ndarray, start: float) -> Trajectory:
        """Brake to rest from `state` [5] at `start` [s], as straight on as it goes."""
        return self.by_controls(state, start, [], [])

    def by_controls(
        self, state: np.ndarray, start: float, controls: list[Control], steps: list[int]
    ) -> Trajectory:
        """Some controls for some time steps each, then braking to rest."""
        anchor = (float(state[0]), float(state[1]))
        pose = to_poses(state[None], anchor)
        poses = self._traced(pose, [*controls, self._brake], [*steps, -1])
        return self._laid(poses, anchor, start, min(sum(steps), len(poses) - 1))

    def _traced(self, pose: np.ndarray, controls: list[Control], steps: list[int]) -> np.ndarray:
        """[m, 7] poses along controls; -1 steps: until at rest."""
        longest = self.settings.steps_of(self.robot.longest_braking) + 4
        rows = 1 + sum(n if n >= 0 else longest for n in steps)
        path = np.empty((rows, 7), dtype=np.float32)
        length = np.zeros(1, dtype=np.int32)
        trace(
            self.robot.kind, self._trace_numbers, pose, np.array(controls, dtype=np.float32),
            np.array(steps, dtype=np.int32), path, length,
        )  # fmt: skip
        return path[: length[0]]

    def _laid(
        self, poses: np.ndarray, anchor: tuple[float, float], start: float, planned: int
    ) -> Trajectory:
        times = start + self.settings.time_step * np.arange(len(poses))
        return Trajectory(times, to_states(poses, anchor), planned)
