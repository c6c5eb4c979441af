"""Distances from points to border pieces, exactly, and quickly where points lie together."""

from __future__ import annotations

import numpy as np

from passpmp_verify.pieces import Pieces

CHUNK = 48
"""Points that are asked together."""
SMALL = 40_000
"""Pairs of points and pieces that are not worth sorting."""


def distance_to(points: np.ndarray, pieces: Pieces) -> np.ndarray:
    """[n] distance from each point [n, 2] to the nearest piece [m]; inf where there is none."""
    result = np.full(len(points), np.inf)
    if not len(points) or not len(pieces):
        return result
    table = _Table(pieces)
    if len(points) * len(pieces) <= SMALL:
        return table.nearest(points, np.arange(len(pieces)))
    middle, half = pieces.middle, pieces.half
    for index in _together(points):
        some = points[index]
        centre = 0.5 * (some.min(axis=0) + some.max(axis=0))
        spread = np.hypot(*(some - centre).T).max()
        apart = np.hypot(*(middle - centre).T)
        # no point is farther from its nearest piece than this
        most = (apart + half).min() + spread
        result[index] = table.nearest(some, np.flatnonzero(apart - half - spread <= most))
    return result


def _together(points: np.ndarray) -> list[np.ndarray]:
    """Indices of points in chunks that lie close together."""
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float((high - low).max())
    cells = max(int(np.sqrt(len(points) / CHUNK)), 1)
    ij = np.minimum((points - low) / max(extent, 1e-9) * cells, cells - 1).astype(int)
    order = np.lexsort((points[:, 1], ij[:, 0]))
    return np.array_split(order, max(len(points) // CHUNK, 1))


class _Table:
    """Pieces as numbers that distances are made of."""

    def __init__(self, pieces: Pieces) -> None:
        middle, half = 0.5 * (pieces.low + pieces.high), 0.5 * (pieces.high - pieces.low)
        self._numbers = np.stack(
            [
                pieces.x, pieces.y, np.cos(middle), np.sin(middle), np.cos(half), np.sin(half),
                pieces.from_, pieces.to,
            ]
        )  # fmt: skip

    def nearest(self, points: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """[n] distance from each point to the nearest of the chosen pieces."""
        x, y, c, s, cos_half, sin_half, low, high = self._numbers[:, chosen]
        dx, dy = points[:, 0, None] - x, points[:, 1, None] - y
        along, across = c * dx + s * dy, np.abs(c * dy - s * dx)
        # an arc is symmetric about its middle: the point is beside it, or nearest to its end. A
        # step is an arc of no width, from `low` to `high` along its bearing.
        r = np.hypot(along, across)
        beside = along * sin_half >= across * cos_half
        to_arc = np.where(
            beside & (sin_half > 0), np.abs(r - low),
            np.hypot(along - low * cos_half, across - low * sin_half),
        )  # fmt: skip
        to_step = np.hypot(along - np.clip(along, low, high), across)
        return np.where(sin_half > 0, to_arc, to_step).min(axis=1)
