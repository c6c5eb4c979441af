"""What the latest scan shows, taken to stand: all that a reactive planner knows of the world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.body import to_poses
from passpmp_ti.grid.distance import distance_to_zeros
from passpmp_ti.kernels.rollouts import roll_out
from passpmp_ti.planner.baselines.motion import Motion
from passpmp_ti.scan import Scan


@dataclass(frozen=True, slots=True, eq=False)
class Obstacles:
    """How far it is from each place to the nearest return."""

    gaps: device.Array
    """[J, I] float32: from each cell's centre to that of the nearest cell with a return [m]."""
    frame: device.Array
    """[3] float32: corner of cell [0, 0], counted from `centre` [m], and cells a metre."""
    centre: tuple[float, float]
    """[m]."""

    @classmethod
    def seen(
        cls, scans: Sequence[Scan], centre: tuple[float, float], reach: float, cell: float
    ) -> Obstacles:
        """The returns of some scans within `reach` of `centre`.

        Args:
            scans: of one instant.
            centre: (x, y) [m].
            reach: half the side of the square that is kept [m].
            cell: side of a cell [m].
        """
        half = math.ceil(reach / cell)
        points = np.concatenate([scan.points() for scan in scans]) - np.array(centre)
        i, j = np.floor(points / cell).astype(np.int64).T + half
        inside = (i >= 0) & (j >= 0) & (i < 2 * half) & (j < 2 * half)
        free = np.ones((2 * half, 2 * half), dtype=np.uint8)
        free[j[inside], i[inside]] = 0
        gaps = distance_to_zeros(free) * np.float32(cell)
        frame = np.array([-half * cell, -half * cell, 1 / cell], dtype=np.float32)
        return cls(device.put(gaps), device.put(frame), centre)

    def tried(
        self,
        motion: Motion,
        root: np.ndarray,
        goal: tuple[float, float],
        targets: np.ndarray,
        steps: int,
    ) -> np.ndarray:
        """How motions fare among the obstacles.

        Args:
            motion: of the robot.
            root: [5] the state that all begin at.
            goal: (x, y) [m].
            targets: [N, T, 2] inputs that each steers to in turn.
            steps: time steps of each of the T stages.

        Returns:
            [N, 4] float64, see `kernels.rollouts.roll_out`.
        """
        count, stages, _ = targets.shape
        found = device.empty((count, 4), np.float32)
        rows = np.ascontiguousarray(targets.reshape(-1, 2), dtype=np.float32)
        roll_out(
            motion.robot.kind, device.share(), device.put(motion.numbers), self.gaps, self.frame,
            device.put(to_poses(root[None], self.centre)), device.put(rows), stages, steps,
            goal[0] - self.centre[0], goal[1] - self.centre[1], found,
        )  # fmt: skip
        return device.host(found).astype(np.float64)
