"""Who is where no sensor looks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from passpmp_ti.sim.lidar import Lidar

ROOM, TURN = 0.05, 0.03
"""A disc counts as out of sight this much too early [m, rad]: it moves on until the tick ends."""


def uncovered(
    lidars: Sequence[Lidar], state: np.ndarray, places: np.ndarray, radius: np.ndarray
) -> np.ndarray:
    """[m] bool: some of a disc lies in bearings that none of the range finders covers.

    What was assumed of it there is assumed for good where it was within their range: the robot
    remembers what it saw before, and that nobody came out of there.

    Args:
        lidars: of a robot that carries one, or whose sectors leave no gap.
        state: [5] of the robot.
        places: [m, 2] [m].
        radius: [m] [m].
    """
    blind = np.ones(len(places), dtype=bool)
    for lidar in lidars:
        if lidar.field_of_view >= 2 * math.pi - 1e-9:
            return np.zeros(len(places), dtype=bool)
        x, y, theta = lidar.pose(state)
        gap = places - np.array([x, y])
        apart = np.hypot(*gap.T)
        bearing = np.arctan2(gap[:, 1], gap[:, 0]) - theta
        bearing = np.abs((bearing + math.pi) % (2 * math.pi) - math.pi)
        half = np.arcsin(np.clip((radius + ROOM) / np.maximum(apart, 1e-9), 0.0, 1.0))
        blind &= bearing + half + TURN > 0.5 * lidar.field_of_view
    return blind


def within_range(
    lidars: Sequence[Lidar], state: np.ndarray, places: np.ndarray, radius: np.ndarray
) -> np.ndarray:
    """[m] bool: some of a disc is within the range of a range finder, whatever its bearing."""
    near = np.zeros(len(places), dtype=bool)
    for lidar in lidars:
        apart = np.hypot(*(places - np.array(lidar.pose(state)[:2])).T)
        near |= apart - radius - ROOM < lidar.range_max
    return near
