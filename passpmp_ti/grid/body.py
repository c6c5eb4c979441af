"""A robot and its settings as the arrays that the motion and check kernels read."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.spans import span_begins
from passpmp_ti.kernels.check import WAYS
from passpmp_ti.kernels.spans import BEGIN, LEVELS, ROUNDING
from passpmp_ti.robots import CAR, Robot
from passpmp_ti.settings import LOOK, Settings

MOST_DISCS = 8


@dataclass(frozen=True, slots=True)
class Body:
    """Constant arrays of one robot; see kernels/check.py for their layout."""

    kind: int
    numbers: device.Array
    counts: np.ndarray
    """[15] int32; the window's corner and size are filled in by `placed`."""
    braking: device.Array
    controls: device.Array

    @classmethod
    def of(cls, robot: Robot, settings: Settings) -> Body:
        """Arrays for a robot that is checked at `settings.time_step`."""
        if len(robot.discs) > MOST_DISCS:
            raise ValueError(
                f"{type(robot).__name__}.discs has {len(robot.discs)} discs; the check takes at"
                f" most {MOST_DISCS}: cover the body with fewer"
            )
        numbers = np.zeros(WAYS + 2 * LEVELS, dtype=np.float32)
        numbers[0] = 1 / settings.cell
        numbers[1] = settings.time_step
        numbers[2:8] = robot.parameters()
        numbers[8 : 8 + len(robot.discs)] = [offset for offset, _ in robot.discs]
        numbers[16] = 0.5 / (LOOK * settings.cell)
        numbers[17] = settings.object_speed * settings.time_step
        numbers[18] = robot.overhang
        numbers[19] = LOOK * settings.cell
        numbers[20] = robot.top_acceleration
        numbers[21] = 1 / settings.step_ms
        numbers[WAYS:] = ways_ahead(robot, settings).ravel()
        rates = {rate for _, rate, _ in robot.braking}
        if robot.kind == CAR and len(rates) == 1:
            numbers[22] = rates.pop()
            numbers[23] = max(abs(steering) for _, _, steering in robot.braking)
        counts = np.zeros(BEGIN + LEVELS, dtype=np.int32)
        counts[4:8] = (
            settings.step_ms, len(robot.discs), len(robot.braking), len(robot.controls),
        )  # fmt: skip
        return cls(
            robot.kind,
            numbers,
            counts,
            np.array(robot.braking, dtype=np.float32),
            np.array(robot.controls, dtype=np.float32),
        )

    def placed(self, corner: tuple[int, int], size: int) -> np.ndarray:
        """`counts` for a window: [15] int32."""
        counts = self.counts.copy()
        counts[:4] = (*corner, size, size)
        counts[BEGIN:] = span_begins(size)[:-1]
        return counts


@functools.lru_cache(maxsize=16)
def bodies(robot: Robot, settings: Settings, resident: bool) -> tuple[Body, Body]:
    """A robot's arrays for NumPy, and where the kernels run: `resident` as `device.resident` tells.

    They never change, so that a device is given them once.
    """
    host = Body.of(robot, settings)
    if not resident:
        return host, host
    numbers, braking, controls = (
        device.put(array) for array in (host.numbers, host.braking, host.controls)
    )
    return host, replace(host, numbers=numbers, braking=braking, controls=controls)


def to_poses(states: np.ndarray, anchor: tuple[float, float]) -> np.ndarray:
    """[n, 5] states in the world to [n, 7] float32 poses on the device."""
    poses = np.empty((len(states), 7), dtype=np.float32)
    poses[:, 0] = states[:, 0] - anchor[0]
    poses[:, 1] = states[:, 1] - anchor[1]
    poses[:, 2] = np.cos(states[:, 2])
    poses[:, 3] = np.sin(states[:, 2])
    poses[:, 4:7] = states[:, 2:5]
    return poses


def to_states(poses: np.ndarray, anchor: tuple[float, float]) -> np.ndarray:
    """[n, 7] poses on the device to [n, 5] float64 states in the world."""
    states = np.empty((len(poses), 5))
    states[:, 0] = poses[:, 0].astype(np.float64) + anchor[0]
    states[:, 1] = poses[:, 1].astype(np.float64) + anchor[1]
    states[:, 2:5] = poses[:, 4:7]
    return states


def ways_ahead(robot: Robot, settings: Settings) -> np.ndarray:
    """[LEVELS, 2] for each level of spans: how far ahead of the robot to look [m], and how many
    time steps x speed [m/s] it may go on before it can leave the disc that the look speaks for.

    On a way w that turns by no more than f = w x the sharpest curvature, every point is within
    w sqrt(1 + 2 f^2) / 2 of the place w / 2 straight ahead, and within w of where it begins.
    """
    ways = np.zeros((LEVELS, 2))
    for level in range(LEVELS):
        # what sticks out before and behind must stay inside as well
        radius = max((2 << level) * settings.cell - ROUNDING - robot.overhang, 0.0)
        way, ahead = radius, 0.0
        # the sharpest curvature times w: w^2 (1 + 2 k^2 w^2) = (2 radius)^2, solved for w
        k2 = 2 * robot.sharpest_curvature**2
        if math.isfinite(k2):
            longer = 2 * radius
            if k2 > 0:
                longer = math.sqrt((math.sqrt(1 + 4 * k2 * longer**2) - 1) / (2 * k2))
            if longer > way:
                way, ahead = longer, 0.5 * longer
        ways[level] = ahead, way / settings.time_step
    return ways
