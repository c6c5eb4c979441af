"""Gaussians of places and velocities: their shapes, what lies between two of them, and how bent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FARTHEST = 4.5
"""Standard deviations that count where a covariance shrinks."""
TINY = 1e-300
"""Instead of nothing, to divide by."""


@dataclass(frozen=True, slots=True)
class Shape:
    """Gaussians of places, blurred where they are too sharp; all arrays are of one shape.

    Written out for two dimensions: NumPy takes ten times as long for stacks of small matrices.
    """

    xx: np.ndarray
    """Covariance, noise included, as `yy` and `xy` [m^2]."""
    yy: np.ndarray
    xy: np.ndarray
    c: np.ndarray
    """Cosine and sine (`s`) of the principal axis of the greater deviation."""
    s: np.ndarray
    great: np.ndarray
    """Standard deviations along the principal axes [m]."""
    least: np.ndarray
    noise: np.ndarray
    """Standard deviation of what they are blurred by [m]."""

    @classmethod
    def of(cls, covariance: np.ndarray, floor: np.ndarray | float) -> Shape:
        """Of [..., 4, 4] covariances, none of whose deviations is to be below `floor` [m]."""
        xx, yy, xy = covariance[..., 0, 0], covariance[..., 1, 1], covariance[..., 0, 1]
        half = 0.5 * (xx - yy)
        gap = np.sqrt(half * half + xy * xy)
        greater = 0.5 * (xx + yy) + gap
        # both make the determinant; their difference would lose the smaller one
        smaller = np.maximum(xx * yy - xy * xy, 0.0) / greater
        square = np.maximum(floor**2 - smaller, 0.0)
        # half of an angle from its cosine; a round one's axes are any
        cosine = half / np.maximum(gap, TINY)
        return cls(
            xx + square, yy + square, xy, np.sqrt(0.5 + 0.5 * cosine),
            np.copysign(np.sqrt(0.5 - 0.5 * cosine), xy), np.sqrt(greater + square),
            np.sqrt(smaller + square), np.sqrt(square),
        )  # fmt: skip

    def along(self, xx: np.ndarray, yy: np.ndarray, xy: np.ndarray) -> tuple[np.ndarray, ...]:
        """(xx, yy, xy) of symmetric matrices in the frames of the principal axes."""
        cc, ss, cs = self.c * self.c, self.s * self.s, self.c * self.s
        return (
            cc * xx + ss * yy + 2 * cs * xy,
            ss * xx + cc * yy - 2 * cs * xy,
            cs * (yy - xx) + (cc - ss) * xy,
        )


def by_component(array: np.ndarray, axes: int) -> np.ndarray:
    """The same array, but in memory each component, along its last `axes`, lies together."""
    last = tuple(range(-axes, 0))
    first = tuple(range(axes))
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(array, last, first)), first, last)


def between(
    means: np.ndarray,
    covariances: np.ndarray,
    layer: np.ndarray,
    share: np.ndarray,
    length: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Means [N, C, J, 4] and covariances [N, C, J, 4, 4] at a share of the stretch after a layer.

    What a constant velocity would not make of the covariance before is put down to noise of the
    acceleration: its parts grow as s^3, s^2 and s. Where that cannot be, the covariances are mixed.
    """
    after = np.minimum(layer + 1, means.shape[2] - 1)
    mean = means[:, :, layer]
    mean = mean + share[:, None] * (means[:, :, after] - mean)
    first, second = covariances[:, :, layer], covariances[:, :, after]
    covariance = first + share[:, None, None] * (second - first)
    inner = np.flatnonzero(share > 0)
    if len(inner):
        start, s = first[:, :, inner], share[inner, None, None]
        noise = second[:, :, inner] - _drifted(start, length)
        grown = np.array([1.0, 1.0, 0.0, 0.0]) * s[..., 0] + np.array([0.0, 0.0, 1.0, 1.0])
        pushed = s * noise * grown[:, :, None] * grown[:, None, :]
        fits = _positive(noise + 1e-9 * np.eye(4))
        pushed += _drifted(start, s * length)
        covariance[:, :, inner] = np.where(fits[..., None, None], pushed, covariance[:, :, inner])
    return mean, covariance


def _drifted(covariance: np.ndarray, time: np.ndarray | float) -> np.ndarray:
    """[..., 4, 4] covariances after a time at constant velocity [s]."""
    after = covariance.copy()
    after[..., :2, :] += time * covariance[..., 2:, :]
    after[..., :, :2] += time * after[..., :, 2:]
    return after


def _positive(matrix: np.ndarray) -> np.ndarray:
    """[...] bool: symmetric matrices [..., 4, 4] that are positive definite: all pivots are
    positive. Several times as fast as eigenvalues."""
    rest = np.moveaxis(matrix, (-2, -1), (0, 1)).copy()
    positive = np.ones(rest.shape[2:], dtype=bool)
    for k in range(4):
        pivot = rest[k, k]
        positive &= pivot > 0
        column = rest[k + 1 :, k] / np.where(pivot > 0, pivot, 1.0)
        rest[k + 1 :, k + 1 :] -= column[:, None] * rest[None, k, k + 1 :]
    return positive


def bends_of(
    shape: Shape, mean: np.ndarray, covariance: np.ndarray, length: np.ndarray | float
) -> np.ndarray:
    """[..., J - 1] how strongly densities are bent, as seen from one place, between moments.

    Along a time in which the mean moves evenly and the covariance goes at a constant rate and bends
    as Pvv makes it, a Gaussian has f'' >= -k f: half of the time times the root of k.

    Args:
        shape: [..., J].
        mean: [..., J, 4].
        covariance: [..., J, 4, 4].
        length: [J - 1] from each moment to the next [s].
    """
    strongest = np.zeros(1)
    determinant = (shape.great * shape.least) ** 2
    inverse = shape.yy / determinant, shape.xx / determinant, -shape.xy / determinant
    xx, yy, xy = (np.diff(part, axis=-1) / length for part in (shape.xx, shape.yy, shape.xy))
    product = xx * yy - xy * xy
    x, y = (np.diff(mean[..., axis], axis=-1) / length for axis in range(2))
    speed = x * x, y * y, x * y
    for end in (slice(None, -1), slice(1, None)):
        # the inverse makes of the rate what it is as seen from where the Gaussian is a standard one
        at = tuple(part[..., end] for part in inverse)
        middle = 0.5 * _trace(at, (xx, yy, xy))
        square = np.maximum(middle * middle - product / determinant[..., end], 0.0)
        gap = np.sqrt(square)
        up, down = np.maximum(middle + gap, 0.0), np.maximum(gap - middle, 0.0)
        own = up * (up + 2 * np.maximum(middle, 0.0)) - middle * middle - square
        own += 2 * FARTHEST**2 * down * (up + down)
        pvv = covariance[..., end, 2:, 2:]
        spread = _trace(at, (pvv[..., 0, 0], pvv[..., 1, 1], pvv[..., 0, 1]))
        bend = np.sqrt(np.maximum(_trace(at, speed), 0.0))
        bend += np.sqrt(np.maximum(np.maximum(own, 0.0) + spread, 0.0))
        strongest = np.maximum(strongest, bend)
    return 0.5 * length * strongest


def _trace(first: tuple[np.ndarray, ...], second: tuple[np.ndarray, ...]) -> np.ndarray:
    """Of the products of symmetric matrices (xx, yy, xy)."""
    return first[0] * second[0] + first[1] * second[1] + 2 * first[2] * second[2]
