"""Whether a place belongs to a surface that a map declares to stay."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np


class StaticMap(Protocol):
    """What is read of a map."""

    @property
    def occupied(self) -> np.ndarray:
        """[J, I] bool; row 0 is the lowest y of the map's own frame."""

    @property
    def resolution(self) -> float:
        """Side of a cell [m]."""

    @property
    def origin(self) -> tuple[float, float, float]:
        """World (x, y, yaw) of the outer corner of cell [0, 0] [m, m, rad]."""


class Surfaces:
    """Places all within `tolerance` [m] of an occupied cell of a map; nowhere without a map.

    Poses err by up to `error` [m].
    """

    def __init__(
        self, static_map: StaticMap | None, tolerance: float, error: float = 0.0
    ) -> None:
        self.known = static_map is not None
        self.slack = 0.0
        """How far from a surface's true place a return may be that is taken for it [m]."""
        if static_map is None:
            return
        self.slack = tolerance + math.sqrt(2) * static_map.resolution + error
        self._origin = static_map.origin
        self._resolution = static_map.resolution
        occupied = np.asarray(static_map.occupied, dtype=bool)
        self._grown = _grown(occupied, tolerance / self._resolution)

    def hold(self, points: np.ndarray) -> np.ndarray:
        """[n] bool for world points [n, 2] [m]."""
        if not self.known:
            return np.zeros(len(points), dtype=bool)
        x, y, yaw = self._origin
        dx, dy = points[:, 0] - x, points[:, 1] - y
        c, s = math.cos(yaw), math.sin(yaw)
        i = np.floor((c * dx + s * dy) / self._resolution).astype(np.int64)
        j = np.floor((c * dy - s * dx) / self._resolution).astype(np.int64)
        rows, columns = self._grown.shape
        inside = (i >= 0) & (j >= 0) & (i < columns) & (j < rows)
        found = np.zeros(len(points), dtype=bool)
        found[inside] = self._grown[j[inside], i[inside]]
        return found

    def hold_line(self, start: np.ndarray, end: np.ndarray) -> bool:
        """Whether the map knows a surface all the way from `start` to `end` [2] [m]."""
        if not self.known:
            return False
        pieces = math.ceil(4 * math.dist(start, end) / self._resolution) + 1
        share = (np.arange(pieces) + 0.5) / pieces
        return bool(self.hold(start + share[:, None] * (end - start)).all())


def _grown(occupied: np.ndarray, cells: float) -> np.ndarray:
    """Cells whose centre is at most `cells` cells from that of an occupied one."""
    reach = int(cells + 1e-9)
    rows, columns = occupied.shape
    padded = np.pad(occupied, reach)
    grown = np.zeros_like(occupied)
    for dj in range(-reach, reach + 1):
        for di in range(-reach, reach + 1):
            if math.hypot(dj, di) <= cells + 1e-9:
                grown |= padded[reach + dj : reach + dj + rows, reach + di : reach + di + columns]
    return grown
