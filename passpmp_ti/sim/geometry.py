"""Distances in the plane, exact and over whole arrays."""

from __future__ import annotations

import numpy as np


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[...] z component of the product of plane vectors [..., 2]."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def point_to_segment(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[...] distance of points [..., 2] to the segments a b [..., 2], broadcast [m]."""
    along = b - a
    length2 = np.maximum((along * along).sum(axis=-1), 1e-300)
    share = np.clip(((points - a) * along).sum(axis=-1) / length2, 0.0, 1.0)
    gap = points - a - share[..., None] * along
    return np.sqrt((gap * gap).sum(axis=-1))


def segment_to_segment(p0: np.ndarray, p1: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[...] distance between the segments p0 p1 and a b, each [..., 2], broadcast [m]."""
    apart = np.minimum(
        np.minimum(point_to_segment(p0, a, b), point_to_segment(p1, a, b)),
        np.minimum(point_to_segment(a, p0, p1), point_to_segment(b, p0, p1)),
    )
    return np.where(_cross_each_other(p0, p1, a, b), 0.0, apart)


def _cross_each_other(p0: np.ndarray, p1: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    d1, d2 = cross(b - a, p0 - a), cross(b - a, p1 - a)
    d3, d4 = cross(p1 - p0, a - p0), cross(p1 - p0, b - p0)
    return (d1 * d2 < 0) & (d3 * d4 < 0)


def inside_polygon(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """[n] bool: points [n, 2] strictly within a simple polygon [m, 2] (even-odd rule)."""
    x, y = points[:, 0, None], points[:, 1, None]
    a, b = polygon, np.roll(polygon, -1, axis=0)
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    met = a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return ((spans & (x < met)).sum(axis=1) % 2).astype(bool)


def edges(polygon: np.ndarray) -> np.ndarray:
    """[m, 4] the closed outline x1, y1, x2, y2 of a polygon [m, 2]."""
    return np.concatenate([polygon, np.roll(polygon, -1, axis=0)], axis=1)
