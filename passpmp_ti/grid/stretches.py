"""A forecast cut into parts so short that the density between two moments is bounded by both.

docs/risk.md derives the bounds that are used here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from passpmp_ti.robots import Robot

SHARPEST = 16.0
"""Greatest ratio of a disc's radius to a standard deviation that windows are made for."""
BLUR = 2.0
"""Sharper ones are blurred by noise; what is farther out in it than this [its standard deviations]
is made up for by a factor."""
LEFT_OUT = 1e-7
"""What an object that is not looked up may add to the risk [1/s]."""
SMALLEST = 1e-6
"""Components of less weight than this are not looked up: their weight is risk."""
BEND = 0.35
"""Greatest half length of a part times the root of how strongly a density is bent along time."""
MOST_PARTS = 8
"""That a stretch between two layers is cut into."""
STEEPEST = 1.0
"""Bend from which on a part is bounded by the window at its end alone."""
LOST = 1e3
"""Leap where there is no such bound either: the risk is 1."""
FARTHEST = 4.5
"""Standard deviations that count where a covariance shrinks."""
ROW = 22


class Forecast(Protocol):
    """What tracked objects will do: mixtures of Gaussians at equally spaced times."""

    times: np.ndarray
    """[L] absolute [s]."""
    weight: np.ndarray
    """[N, C] of each component; rows sum to 1."""
    mean: np.ndarray
    """[N, C, L, 4] (x, y, vx, vy) [m, m/s]."""
    covariance: np.ndarray
    """[N, C, L, 4, 4]."""
    radius: np.ndarray
    """[N] of the disc about the mean that covers the object [m]."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Where the robot can get to."""

    position: tuple[float, float]
    """At `stamp` [m]."""
    stamp: float
    """[s]"""
    top_speed: float
    """Of any of its discs [m/s]."""
    overhang: float
    """[m]"""
    span: float
    """Length of a sample of its motion [s]."""

    @classmethod
    def of(
        cls, robot: Robot, position: tuple[float, float], stamp: float, span: float
    ) -> Reach:
        """Of a robot that is looked at every `span` seconds."""
        top_speed = robot.top_speed + robot.overhang * robot.top_turn_rate
        return cls((position[0], position[1]), stamp, top_speed, robot.overhang, span)


@dataclass(frozen=True, slots=True)
class Parts:
    """Moments of a forecast, a row each: kernels/chances.py says what is in them."""

    rows: np.ndarray
    """[W, 22] float32; node spacings are still missing."""
    slots: np.ndarray
    """[N * C * (L - 1), 2] int32."""
    near: np.ndarray
    """[N * (L - 1), 3] float32."""
    wanted: np.ndarray
    """[W] bool: the robot may get there in time."""
    deviation: np.ndarray
    """[W, 2] standard deviations along the principal axes [m]."""
    radius: np.ndarray
    """[W] within which an object touches a disc [m]."""
    left_out: float
    """Sum of the weights of components that are not looked up."""


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
    def of(cls, covariance: np.ndarray, radius: np.ndarray) -> Shape:
        """Of [..., 4, 4] covariances, about discs of `radius` [...]."""
        xx, yy, xy = covariance[..., 0, 0], covariance[..., 1, 1], covariance[..., 0, 1]
        middle = 0.5 * (xx + yy)
        greater = middle + np.hypot(0.5 * (xx - yy), xy)
        # both make the determinant; their difference would lose the smaller one
        smaller = np.maximum(xx * yy - xy * xy, 0.0) / greater
        square = np.maximum((radius / SHARPEST) ** 2 - smaller, 0.0)
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


def cut(
    forecast: Forecast, radius: np.ndarray, reach: Reach, anchor: tuple[float, float]
) -> Parts:
    """Cut a forecast into parts.

    Args:
        forecast: of the tracked objects.
        radius: [N] within which an object touches a disc [m].
        reach: of the robot.
        anchor: from which places count [m].
    """
    objects, components = forecast.weight.shape
    layers = len(forecast.times)
    length = (forecast.times[-1] - forecast.times[0]) / (layers - 1)
    shape = Shape.of(forecast.covariance, radius[:, None, None])
    bends, _ = _bends(shape, forecast.covariance, length)
    far = _farness(forecast.mean, forecast.covariance, shape, radius[:, None, None], reach)
    wanted = _within_reach(forecast, far * shape.great, radius, reach)
    counts = np.where(wanted, np.clip(np.ceil(bends / BEND), 1, MOST_PARTS), 1).astype(np.int64)

    # a chain of stretches, one for each component of an object, ends with a row of its own
    counts = counts.reshape(objects * components, layers - 1)
    chained = np.pad(counts, ((0, 0), (0, 1)), constant_values=1)
    begins = np.cumsum(chained).reshape(chained.shape) - chained
    cell = np.repeat(np.arange(chained.size), chained.ravel())
    share = (np.arange(len(cell)) - begins.ravel()[cell]) / chained.ravel()[cell]
    chain, layer = np.divmod(cell, layers)
    there = wanted.reshape(counts.shape)
    slots = np.stack([np.where(there, begins[:, :-1], -1), counts], -1).reshape(-1, 2)

    mean, covariance = _between(
        forecast.mean.reshape(-1, layers, 4),
        forecast.covariance.reshape(-1, layers, 4, 4),
        chain, layer, share, length,
    )  # fmt: skip
    size = radius[chain // components]
    shape = Shape.of(covariance, size)
    far = _farness(mean, covariance, shape, size, reach)
    # of the part that begins with a row; the last of a chain begins none
    duration = length / chained.ravel()[cell]
    last = layer == layers - 1
    rows = _rows(mean, covariance, shape, size, anchor)
    bends, monotone = _bends(shape, covariance, duration[:-1])
    _finish(rows, shape, size, far, bends, monotone, duration, last, reach)
    rows[:, 20] *= forecast.weight.ravel()[chain]
    part = np.where(last, False, np.pad(there, ((0, 0), (0, 1))).ravel()[cell])
    near = _near(rows, part, chain // components, layer, objects, layers - 1)
    # a part has a window at its end too
    wanted_rows = part.copy()
    wanted_rows[1:] |= part[:-1]
    return Parts(
        rows.astype(np.float32),
        slots.astype(np.int32),
        near.astype(np.float32),
        wanted_rows,
        np.stack([shape.great, shape.least], -1),
        size + BLUR * shape.noise,
        float(forecast.weight[forecast.weight < SMALLEST].sum()),
    )


def _bends(
    shape: Shape, covariance: np.ndarray, length: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """How strongly densities are bent from each moment to the next, and whether they only widen.

    Along a time in which the covariance goes at a constant rate S and bends as Pvv makes it, a
    Gaussian has f'' >= -k f; k is worked out in the frame in which it is standard normal.

    Args:
        shape: of M moments along the last axis.
        covariance: [..., M, 4, 4] of theirs.
        length: [..., M - 1] from each to the next [s].

    Returns:
        [..., M - 1] half of the length times the root of k; [..., M - 1] bool.
    """
    strongest = np.zeros(1)
    monotone = np.ones(1, dtype=bool)
    ends = slice(None, -1), slice(1, None)
    before, after = (shape.moments(end) for end in ends)
    rate = tuple(
        (getattr(after, name) - getattr(before, name)) / length for name in ("xx", "yy", "xy")
    )
    for at, end in zip((before, after), ends, strict=True):
        xx, yy, xy = at.whitened(*rate)
        middle = 0.5 * (xx + yy)
        gap = np.hypot(0.5 * (xx - yy), xy)
        up, down = np.maximum(middle + gap, 0.0), np.maximum(gap - middle, 0.0)
        own = up**2 + 2 * up * np.maximum(middle, 0.0) - middle**2 - gap**2
        own += 2 * down * (up + down) * FARTHEST**2
        pvv = covariance[..., end, 2:, 2:]
        xx, yy, _ = at.whitened(pvv[..., 0, 0], pvv[..., 1, 1], pvv[..., 0, 1])
        strongest = np.maximum(strongest, own + xx + yy)
        monotone = monotone & (down * length < 1e-3)
    return 0.5 * length * np.sqrt(strongest), monotone


def _farness(
    mean: np.ndarray, covariance: np.ndarray, shape: Shape, radius: np.ndarray, reach: Reach
) -> np.ndarray:
    """[...] standard deviations beyond which an object may be left out."""
    # how fast it may come, as the root of the mean square
    speed = np.hypot(mean[..., 2], mean[..., 3]) + reach.top_speed
    speed += 8 * np.sqrt(covariance[..., 2, 2] + covariance[..., 3, 3])
    rate = (radius + BLUR * shape.noise) * speed / (shape.great * shape.least)
    return np.sqrt(2 * np.log(np.maximum(rate / LEFT_OUT, math.e)))


def _within_reach(
    forecast: Forecast, wide: np.ndarray, radius: np.ndarray, reach: Reach
) -> np.ndarray:
    """[N, C, L - 1] bool: stretches in which the robot may meet the object.

    Args:
        wide: [N, C, L] how far about the mean the object may be [m].
    """
    off = forecast.mean[..., :2] - np.array(reach.position)
    apart = np.hypot(off[..., 0], off[..., 1])
    moved = np.linalg.norm(np.diff(off, axis=2), axis=-1)
    way = reach.top_speed * np.maximum(forecast.times[1:] - reach.stamp, 0.0)
    # what is met in the middle of a stretch is nearer by half of it at most
    near = wide + (1 + BLUR / SHARPEST) * radius[:, None, None]
    least = np.minimum(apart[..., :-1] - near[..., :-1], apart[..., 1:] - near[..., 1:])
    met = least - 0.5 * moved <= reach.overhang + reach.top_speed * reach.span + way
    return met & (forecast.weight >= SMALLEST)[..., None]


def _between(
    means: np.ndarray,
    covariances: np.ndarray,
    chain: np.ndarray,
    layer: np.ndarray,
    share: np.ndarray,
    length: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Means [W, 4] and covariances [W, 4, 4] at a share of the stretch that follows a layer.

    What a constant velocity would not make of the covariance before is put down to noise of the
    acceleration: its parts grow as s^3, s^2 and s. Where that cannot be, the covariances are mixed.
    """
    after = np.minimum(layer + 1, means.shape[1] - 1)
    mean = means[chain, layer]
    mean = mean + share[:, None] * (means[chain, after] - mean)
    first, second = covariances[chain, layer], covariances[chain, after]
    covariance = first + share[:, None, None] * (second - first)
    inner = np.flatnonzero(share > 0)
    if len(inner):
        start, s = first[inner], share[inner]
        move = np.tile(np.eye(4), (len(inner), 1, 1))
        move[:, 0, 2] = move[:, 1, 3] = length
        noise = second[inner] - move @ start @ np.swapaxes(move, 1, 2)
        move[:, 0, 2] = move[:, 1, 3] = s * length
        grown = s[:, None] * np.array([1.0, 1.0, 0.0, 0.0]) + np.array([0.0, 0.0, 1.0, 1.0])
        pushed = s[:, None, None] * noise * grown[:, :, None] * grown[:, None, :]
        fits = np.linalg.eigvalsh(noise)[:, 0] >= -1e-9
        drifted = move @ start @ np.swapaxes(move, 1, 2) + pushed
        covariance[inner[fits]] = drifted[fits]
    return mean, covariance


def _rows(
    mean: np.ndarray,
    covariance: np.ndarray,
    shape: Shape,
    radius: np.ndarray,
    anchor: tuple[float, float],
) -> np.ndarray:
    """[W, 22] what is known of each moment for itself."""
    rows = np.zeros((len(mean), ROW))
    rows[:, :2] = mean[:, :2] - np.array(anchor)
    c, s = shape.c, shape.s
    rows[:, 2], rows[:, 3] = c, s
    rows[:, 8] = c * mean[:, 2] + s * mean[:, 3]
    rows[:, 9] = c * mean[:, 3] - s * mean[:, 2]
    # K = P_vx P_xx^-1 and what it leaves of P_vv, in the frame in which P_xx is diagonal
    x0 = c * covariance[:, 2, 0] + s * covariance[:, 3, 0]
    x1 = c * covariance[:, 2, 1] + s * covariance[:, 3, 1]
    y0 = c * covariance[:, 3, 0] - s * covariance[:, 2, 0]
    y1 = c * covariance[:, 3, 1] - s * covariance[:, 2, 1]
    px, py, qx, qy = c * x0 + s * x1, c * x1 - s * x0, c * y0 + s * y1, c * y1 - s * y0
    k = np.stack([px, py, qx, qy], -1) / np.stack([shape.great, shape.least] * 2, -1) ** 2
    rows[:, 10:14] = k
    size = radius + BLUR * shape.noise
    rows[:, 14] = 0.5 * (k[:, 0] + k[:, 3]) * size
    rows[:, 15] = size * np.hypot(0.5 * (k[:, 0] - k[:, 3]), 0.5 * (k[:, 1] + k[:, 2]))
    xx, yy, xy = shape.along(covariance[:, 2, 2], covariance[:, 3, 3], covariance[:, 2, 3])
    xx, yy, xy = (
        xx - k[:, 0] * px - k[:, 1] * py,
        yy - k[:, 2] * qx - k[:, 3] * qy,
        xy - k[:, 0] * qx - k[:, 1] * qy,
    )
    # E|a| of a normal number is at most the root of mean^2 + (2 / pi) variance
    rows[:, 16] = 2 / math.pi * np.maximum(xx, 0.0)
    rows[:, 17] = 2 / math.pi * xy
    rows[:, 18] = 2 / math.pi * np.maximum(yy, 0.0)
    return rows


def _finish(
    rows: np.ndarray,
    shape: Shape,
    radius: np.ndarray,
    far: np.ndarray,
    bends: np.ndarray,
    monotone: np.ndarray,
    duration: np.ndarray,
    last: np.ndarray,
    reach: Reach,
) -> None:
    """Fill in what rows say of the parts that begin with them."""
    # a sample speaks for places that a disc comes to in half its length
    slack = 0.5 * reach.span * (reach.top_speed + np.hypot(rows[:, 8], rows[:, 9]))
    noise = shape.noise
    rows[:, 6] = radius + BLUR * noise + slack + far * shape.great
    rows[:, 7] = radius + BLUR * noise + slack + far * shape.least
    blurred = noise > 0
    blurred[:-1] |= noise[1:] > 0
    least = shape.least.copy()
    least[:-1] = np.minimum(least[:-1], least[1:])
    rows[:, 19] = 0.5 / least
    # noise that fades as the covariance grows moves what it blurs
    rows[:-1, 15] = np.maximum(rows[:-1, 15], rows[1:, 15])
    rows[:-1, 15] += BLUR * np.abs(np.diff(noise)) / duration[:-1]
    rows[:, 20] = np.where(blurred, 1 / (1 - math.exp(-0.5 * BLUR**2)), 1.0)
    steep = bends > STEEPEST
    rows[:-1, 20] /= np.cos(np.where(steep, 0.0, bends))
    volume = shape.great * shape.least
    leap = np.where(monotone, volume[1:] / volume[:-1], LOST)
    rows[:-1, 21] = np.where(steep & ~last[:-1], leap, 0.0)


def _near(
    rows: np.ndarray,
    part: np.ndarray,
    owner: np.ndarray,
    layer: np.ndarray,
    objects: int,
    stretches: int,
) -> np.ndarray:
    """[N * (L - 1), 3] a disc for each object and stretch, beyond which nothing is of it."""
    begin = np.flatnonzero(part)
    key = owner[begin] * stretches + layer[begin]
    near = np.zeros((objects * stretches, 3))
    near[:, 2] = -1.0
    low = np.full((objects * stretches, 2), np.inf)
    high = -low
    for at in (begin, begin + 1):
        np.minimum.at(low, key, rows[at, :2])
        np.maximum.at(high, key, rows[at, :2])
    some = np.isfinite(low[:, 0])
    near[some, :2] = 0.5 * (low[some] + high[some])
    for at in (begin, begin + 1):
        off = rows[at, :2] - near[key, :2]
        # the disc about a window that lies along its axes
        np.maximum.at(near[:, 2], key, np.hypot(off[:, 0], off[:, 1]) + rows[at, 6])
    return near
