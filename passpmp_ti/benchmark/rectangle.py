"""Gaps between a robot's true rectangle and round things, for the judge of a benchmark."""

from __future__ import annotations

import numpy as np

from passpmp_ti.sim import geometry


def gaps_to_discs(
    size: tuple[float, float], states: np.ndarray, positions: np.ndarray, radius: np.ndarray
) -> np.ndarray:
    """[n - 1, m] least gap between a rectangle and each disc in each step [m]; <= 0: they touch.

    Seen from the rectangle a disc's centre goes from where it is as a step begins to where it is
    as it ends. That way is taken for straight: exact at the ends, and in a step of 5 ms off by
    less than 0.2 mm between them.

    Args:
        size: length along the robot's axis and width; the reference point is the middle [m].
        states: [n, 5] of the robot at the steps' ends.
        positions: [n, m, 2] the discs' centres then [m].
        radius: [m] [m].
    """
    apart = positions - states[:, None, :2]
    c, s = np.cos(states[:, 2])[:, None], np.sin(states[:, 2])[:, None]
    own = np.stack(
        [c * apart[..., 0] + s * apart[..., 1], -s * apart[..., 0] + c * apart[..., 1]], axis=-1
    )
    corners = 0.5 * np.array(size) * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    begin, end = own[:-1, :, None], own[1:, :, None]
    edges = geometry.segment_to_segment(begin, end, corners, np.roll(corners, -1, axis=0))
    inside = (np.abs(own[:-1]) <= 0.5 * np.array(size)).all(axis=-1)
    return np.where(inside, 0.0, edges.min(axis=-1)) - radius


def gaps_to_walls(size: tuple[float, float], states: np.ndarray, walls: np.ndarray) -> np.ndarray:
    """[n] least gap between a rectangle and fixed segments [s, 4] at each state [m].

    Args:
        size: length along the robot's axis and width; the reference point is the middle [m].
        states: [n, 5].
        walls: x1, y1, x2, y2 [m].
    """
    if not len(walls):
        return np.full(len(states), np.inf)
    half = 0.5 * np.array(size) * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    c, s = np.cos(states[:, 2])[:, None], np.sin(states[:, 2])[:, None]
    corners = states[:, None, :2] + np.stack(
        [c * half[:, 0] - s * half[:, 1], s * half[:, 0] + c * half[:, 1]], axis=-1
    )
    first, second = corners[:, :, None], np.roll(corners, -1, axis=1)[:, :, None]
    return geometry.segment_to_segment(first, second, walls[:, :2], walls[:, 2:]).min(axis=(1, 2))
