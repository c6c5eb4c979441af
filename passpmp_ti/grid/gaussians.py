"""Gaussians of places and velocities: their shapes, what lies between two of them, and how bent."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

FARTHEST = 4.5
"""Standard deviations that count where a covariance shrinks."""


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
        middle = 0.5 * (xx + yy)
        greater = middle + np.hypot(0.5 * (xx - yy), xy)
        # both make the determinant; their difference would lose the smaller one
        smaller = np.maximum(xx * yy - xy * xy, 0.0) / greater
        square = np.maximum(floor**2 - smaller, 0.0)
        angle = 0.5 * np.arctan2(2 * xy, xx - yy)
        return cls(
            xx + square, yy + square, xy, np.cos(angle), np.sin(angle),
            np.sqrt(greater + square), np.sqrt(smaller + square), np.sqrt(square),
        )  # fmt: skip

    def moments(self, some: slice) -> Shape:
        """Those of some of the last axis."""
        return Shape(*(getattr(self, f.name)[..., some] for f in fields(self)))

    def along(self, xx: np.ndarray, yy: np.ndarray, xy: np.ndarray) -> tuple[np.ndarray, ...]:
        """(xx, yy, xy) of symmetric matrices in the frames of the principal axes."""
        cc, ss, cs = self.c * self.c, self.s * self.s, self.c * self.s
        return (
            cc * xx + ss * yy + 2 * cs * xy,
            ss * xx + cc * yy - 2 * cs * xy,
            cs * (yy - xx) + (cc - ss) * xy,
        )

    def whitened(self, xx: np.ndarray, yy: np.ndarray, xy: np.ndarray) -> tuple[np.ndarray, ...]:
        """The same as seen from where these Gaussians are standard normal ones."""
        xx, yy, xy = self.along(xx, yy, xy)
        return xx / self.great**2, yy / self.least**2, xy / (self.great * self.least)


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
        start, s = first[:, :, inner], share[inner]
        move = np.tile(np.eye(4), (len(inner), 1, 1))
        move[:, 0, 2] = move[:, 1, 3] = length
        noise = second[:, :, inner] - move @ start @ np.swapaxes(move, -1, -2)
        move[:, 0, 2] = move[:, 1, 3] = s * length
        grown = s[:, None] * np.array([1.0, 1.0, 0.0, 0.0]) + np.array([0.0, 0.0, 1.0, 1.0])
        pushed = s[:, None, None] * noise * grown[:, :, None] * grown[:, None, :]
        fits = np.linalg.eigvalsh(noise)[..., 0] >= -1e-9
        drifted = move @ start @ np.swapaxes(move, -1, -2) + pushed
        covariance[:, :, inner] = np.where(fits[..., None, None], drifted, covariance[:, :, inner])
    return mean, covariance


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
    ends = slice(None, -1), slice(1, None)
    rate = tuple(np.diff(getattr(shape, name), axis=-1) / length for name in ("xx", "yy", "xy"))
    step = np.diff(mean[..., :2], axis=-2)
    for end in ends:
        at = shape.moments(end)
        xx, yy, xy = at.whitened(*rate)
        middle = 0.5 * (xx + yy)
        gap = np.hypot(0.5 * (xx - yy), xy)
        up, down = np.maximum(middle + gap, 0.0), np.maximum(gap - middle, 0.0)
        own = up**2 + 2 * up * np.maximum(middle, 0.0) - middle**2 - gap**2
        own += 2 * down * (up + down) * FARTHEST**2
        pvv = covariance[..., end, 2:, 2:]
        xx, yy, _ = at.whitened(pvv[..., 0, 0], pvv[..., 1, 1], pvv[..., 0, 1])
        along = (at.c * step[..., 0] + at.s * step[..., 1]) / at.great
        across = (at.c * step[..., 1] - at.s * step[..., 0]) / at.least
        moved = np.hypot(along, across) / length
        strongest = np.maximum(strongest, moved + np.sqrt(np.maximum(own, 0.0) + xx + yy))
    return 0.5 * length * strongest
