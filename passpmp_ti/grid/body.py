"""A robot and its settings as the arrays that the motion and check kernels read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.robots import Robot
from passpmp_ti.settings import LOOK, Settings

MOST_DISCS = 8


@dataclass(frozen=True, slots=True)
class Body:
    """Constant arrays of one robot; see kernels/check.py for their layout."""

    kind: int
    numbers: np.ndarray
    counts: np.ndarray
    """[8] int32; the window's corner and size are filled in by `placed`."""
    braking: np.ndarray
    controls: np.ndarray

    @classmethod
    def of(cls, robot: Robot, settings: Settings) -> Body:
        """Arrays for a robot that is checked at `settings.time_step`."""
        if len(robot.discs) > MOST_DISCS:
            raise ValueError(
                f"{type(robot).__name__}.discs has {len(robot.discs)} discs; the check takes at"
                f" most {MOST_DISCS}: cover the body with fewer"
            )
        numbers = np.zeros(18, dtype=np.float32)
        numbers[0] = 1 / settings.cell
        numbers[1] = settings.time_step
        numbers[2:8] = robot.parameters()
        numbers[8 : 8 + len(robot.discs)] = [offset for offset, _ in robot.discs]
        numbers[16] = 0.5 / (LOOK * settings.cell)
        numbers[17] = settings.object_speed * settings.time_step
        counts = np.zeros(8, dtype=np.int32)
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
        """`counts` for a window: [8] int32."""
        counts = self.counts.copy()
        counts[:4] = (*corner, size, size)
        return counts


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
