"""The moments at which a forecast is rasterised, and its Gaussians then.

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
LEFT_OUT = 1e-6
"""What an object that is not looked up may add to the risk [1/s]."""
SMALLEST = 1e-6
"""Components of less weight than this are not looked up: their weight is risk."""
BEND = 0.5
"""Greatest half length of a part times the root of how strongly a density is bent along time, that
stretches between layers are cut into parts for."""
STRAIGHT = 0.05
"""Greatest way of a mean off the middle of those before and after, for the layer to be left out
[standard deviations]."""
MOST_PARTS = 8
"""That a stretch is cut into."""
STEEPEST = 1.0
"""Bend from which on Gaussians are blurred."""
ROUNDING = 1e-3
"""[m] of places in single precision."""
LOST = 1e3
"""Margin where they are bent more than any bound allows for: the risk is 1."""
FARTHEST = 4.5
"""Standard deviations that count where a covariance shrinks."""
NODE = 0.8
"""Side of a cell of the layers [standard deviations of the sharper objects]."""
COARSEST = 1.2
"""The same of the sharpest object; what is sharper is blurred."""
MOST_SIDE = 64
"""Nodes along a side of a layer."""
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
    """Where the robot's discs can get to."""

    position: tuple[float, float]
    """At `stamp` [m]."""
    stamp: float
    """[s]"""
    speed: float
    """At `stamp` [m/s]."""
    acceleration: float
    """[m/s^2]"""
    top_speed: float
    """[m/s]"""
    overhang: float
    """[m]"""
    disc_speed: float
    """Greatest speed of any disc [m/s]."""

    @classmethod
    def of(
        cls,
        robot: Robot,
        position: tuple[float, float],
        stamp: float,
        speed: float | None,
        within: float = 0.0,
    ) -> Reach:
        """Of a robot anywhere `within` metres of `position` that drives at `speed`; None: at its
        top speed."""
        return cls(
            (position[0], position[1]),
            stamp,
            robot.top_speed if speed is None else abs(speed),
            robot.deceleration,
            robot.top_speed,
            robot.overhang + within,
            robot.top_speed + robot.overhang * robot.top_turn_rate,
        )

    def way(self, times: np.ndarray) -> np.ndarray:
        """How far from `position` a disc may be by then [m]; times absolute [s]."""
        after = np.maximum(times - self.stamp, 0.0)
        way = self.speed * after + 0.5 * self.acceleration * after**2
        return self.overhang + np.minimum(way, self.top_speed * after)


@dataclass(frozen=True, slots=True)
class Moments:
    """J moments: kernels/chances.py and kernels/hazard.py say what is in their rows."""

    times: np.ndarray
    """[J] absolute [s]."""
    starts: np.ndarray
    """[L] int32: the last moment that is no later than each layer of the forecast."""
    rows: np.ndarray
    """[J * N * C, 22] float32; node spacings of windows are still missing."""
    near: np.ndarray
    """[J * N, 3] float32."""
    wanted: np.ndarray
    """[J * N * C] bool: the robot may meet it."""
    deviation: np.ndarray
    """[J * N * C, 2] standard deviations along the principal axes [m]."""
    radius: np.ndarray
    """[J * N * C] within which an object touches a disc [m]."""
    grids: np.ndarray
    """[J, 9] float32."""
    sides: np.ndarray
    """[2, J] nodes along the sides of a layer."""
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


def moments_of(
    forecast: Forecast, radius: np.ndarray, reach: Reach, anchor: tuple[float, float]
) -> Moments:
    """Choose moments and layers, and work out the Gaussians there.

    Args:
        forecast: of the tracked objects.
        radius: [N] within which an object touches a disc [m].
        reach: of the robot.
        anchor: from which places count [m].
    """
    layers = len(forecast.times)
    length = (forecast.times[-1] - forecast.times[0]) / (layers - 1)
    size = radius[:, None, None]
    shape = Shape.of(forecast.covariance, size / SHARPEST)
    wanted = _within_reach(forecast.mean, forecast.covariance, shape, size, reach, forecast.times)
    wanted &= (forecast.weight >= SMALLEST)[..., None]
    bends = _bends(shape, forecast.mean, forecast.covariance, length)
    met = wanted[..., 1:] | wanted[..., :-1]
    steepest = np.where(met, bends, 0.0).max(axis=(0, 1), initial=0.0)
    # how many moments begin with each layer: none where it can be done without
    counts = np.append(np.clip(np.ceil(steepest / BEND), 1, MOST_PARTS).astype(np.int64), 1)
    counts[_needless(forecast.mean, shape, steepest)] = 0
    ends = np.cumsum(counts)
    layer = np.repeat(np.arange(layers), counts)
    share = (np.arange(len(layer)) - (ends - counts)[layer]) / counts[layer]
    starts = np.where(counts > 0, ends - counts, ends - 1)
    times = forecast.times[layer] + share * length
    mean, covariance = _between(forecast.mean, forecast.covariance, layer, share, length)
    duration = np.diff(times)

    plain = Shape.of(covariance, 0.0)
    wanted = _within_reach(mean, covariance, plain, size, reach, times)
    wanted &= (forecast.weight >= SMALLEST)[..., None]
    # a layer is asked until the next moment
    way = reach.way(np.append(times[1:], times[-1]))
    low, high = _box(mean, covariance, plain, size, wanted, reach, way)
    sharp = np.sort(np.where(wanted, plain.least, np.inf).reshape(-1, len(times)), axis=0)
    fine = sharp[wanted.reshape(sharp.shape).sum(axis=0) // 10, np.arange(len(times))]
    extent = high - low
    side = np.maximum(NODE * fine, extent.max(axis=0) / (MOST_SIDE - 2))
    side = np.where(np.isfinite(side), side, 1.0)
    sides = np.ceil(extent / side).astype(np.int64) + 2
    floor = np.maximum(size / SHARPEST, side / COARSEST)
    shape = Shape.of(covariance, floor)
    bends = _bends(shape, mean, covariance, duration)
    floor = np.maximum(floor, _floor(mean, covariance, bends, duration))
    shape = Shape.of(covariance, floor)
    bends = _bends(shape, mean, covariance, duration)
    # what lies between two moments is bounded by both, and each has two neighbours
    short = np.where(bends < 1.3, 1 / np.cos(np.minimum(bends, 1.3)), LOST)
    margin = np.ones(shape.xx.shape)
    margin[..., :-1] = short
    margin[..., 1:] = np.maximum(margin[..., 1:], short)

    far = _farness(mean, covariance, shape, size, reach)
    rows = _rows(mean, covariance, shape, size, anchor, duration)
    rows[..., 6] = size + BLUR * shape.noise + far * shape.great
    rows[..., 7] = size + BLUR * shape.noise + far * shape.least
    rows[..., 20] = forecast.weight[..., None] * margin
    rows[..., 20] *= np.where(shape.noise > 0, 1 / (1 - math.exp(-0.5 * BLUR**2)), 1.0)
    rows[..., 21] = _layer_margin(shape, side)
    grids = _grids(rows, shape, wanted, reach, anchor, way, low, side)
    return Moments(
        times,
        starts.astype(np.int32),
        _moments_first(rows).reshape(-1, ROW).astype(np.float32),
        _moments_first(_near(rows, wanted)[:, None]).reshape(-1, 3).astype(np.float32),
        _moments_first(wanted).ravel(),
        _moments_first(np.stack([shape.great, shape.least], -1)).reshape(-1, 2),
        _moments_first(size + BLUR * shape.noise).ravel(),
        grids.astype(np.float32),
        sides,
        float(forecast.weight[forecast.weight < SMALLEST].sum()),
    )


def _moments_first(array: np.ndarray) -> np.ndarray:
    """[J, N, C, ...] of [N, C, J, ...]: what is looked up together lies together."""
    return np.moveaxis(array, 2, 0)


def _needless(mean: np.ndarray, shape: Shape, steepest: np.ndarray) -> list[int]:
    """Every other layer, where means go straight on and densities hardly change."""
    chord = mean[:, :, 1:-1, :2] - 0.5 * (mean[:, :, :-2, :2] + mean[:, :, 2:, :2])
    off = np.hypot(chord[..., 0], chord[..., 1]) / shape.least[..., 1:-1]
    smooth = off.max(axis=(0, 1), initial=0.0) < STRAIGHT
    needless: list[int] = []
    for k in range(1, len(steepest)):
        if smooth[k - 1] and steepest[k - 1] + steepest[k] < BEND and k - 1 not in needless:
            needless.append(k)
    return needless


def _rates(shape: Shape, length: np.ndarray | float) -> tuple[np.ndarray, ...]:
    """(xx, yy, xy) at which covariances go from each moment to the next [m^2/s]."""
    return tuple(np.diff(getattr(shape, name), axis=-1) / length for name in ("xx", "yy", "xy"))


def _bends(
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
    rate = _rates(shape, length)
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


def _floor(
    mean: np.ndarray, covariance: np.ndarray, bends: np.ndarray, duration: np.ndarray
) -> np.ndarray:
    """[..., J] deviations down to which Gaussians are blurred so that none is bent too steeply [m].

    Half of `STEEPEST` each for what the mean's way and the covariance's growth make of it.
    """
    step = np.diff(mean[..., :2], axis=-2)
    rate = np.abs(np.diff(covariance[..., 0, 0] + covariance[..., 1, 1], axis=-1))
    rate += 2 * np.abs(np.diff(covariance[..., 0, 1], axis=-1))
    speed = np.sqrt(covariance[..., 2, 2] + covariance[..., 3, 3])
    speed = np.maximum(speed[..., :-1], speed[..., 1:]) * duration
    need = np.hypot(step[..., 0], step[..., 1])
    need = np.maximum(need, np.sqrt(2 * math.sqrt(2) * rate))
    need = np.maximum(need, 2 * math.sqrt(2) * speed)
    need = np.where(bends > STEEPEST, need / STEEPEST, 0.0)
    floor = np.zeros((*need.shape[:-1], need.shape[-1] + 1))
    floor[..., :-1] = need
    floor[..., 1:] = np.maximum(floor[..., 1:], need)
    return floor


def _farness(
    mean: np.ndarray, covariance: np.ndarray, shape: Shape, radius: np.ndarray, reach: Reach
) -> np.ndarray:
    """[...] standard deviations beyond which an object may be left out."""
    # how fast it may come, as the root of the mean square
    speed = np.hypot(mean[..., 2], mean[..., 3]) + reach.disc_speed
    speed += 8 * np.sqrt(covariance[..., 2, 2] + covariance[..., 3, 3])
    rate = (radius + BLUR * shape.noise) * speed / (shape.great * shape.least)
    return np.sqrt(2 * np.log(np.maximum(rate / LEFT_OUT, math.e)))


def _width(
    mean: np.ndarray, covariance: np.ndarray, shape: Shape, radius: np.ndarray, reach: Reach
) -> np.ndarray:
    """[...] how far about its mean an object is looked up, with room for what blurring adds [m]."""
    sharp = Shape.of(covariance, np.maximum(shape.least, radius / SHARPEST))
    far = _farness(mean, covariance, sharp, radius, reach)
    return (1 + BLUR / SHARPEST) * radius + far * sharp.great


def _within_reach(
    mean: np.ndarray,
    covariance: np.ndarray,
    shape: Shape,
    radius: np.ndarray,
    reach: Reach,
    times: np.ndarray,
) -> np.ndarray:
    """[N, C, J] bool: moments about which the robot may meet the object."""
    wide = _width(mean, covariance, shape, radius, reach)
    off = mean[..., :2] - np.array(reach.position)
    way = reach.way(np.append(times[1:], times[-1]))
    return np.hypot(off[..., 0], off[..., 1]) - wide <= way


def _between(
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
        covariance[:, :, inner] = np.where(
            fits[..., None, None], drifted, covariance[:, :, inner]
        )
    return mean, covariance


def _rows(
    mean: np.ndarray,
    covariance: np.ndarray,
    shape: Shape,
    radius: np.ndarray,
    anchor: tuple[float, float],
    duration: np.ndarray,
) -> np.ndarray:
    """[N, C, J, 22] what is known of each moment for itself."""
    rows = np.zeros((*shape.xx.shape, ROW))
    rows[..., :2] = mean[..., :2] - np.array(anchor)
    c, s = shape.c, shape.s
    rows[..., 2], rows[..., 3] = c, s
    rows[..., 8] = c * mean[..., 2] + s * mean[..., 3]
    rows[..., 9] = c * mean[..., 3] - s * mean[..., 2]
    # K = P_vx P_xx^-1 and what it leaves of P_vv, in the frame in which P_xx is diagonal
    x0 = c * covariance[..., 2, 0] + s * covariance[..., 3, 0]
    x1 = c * covariance[..., 2, 1] + s * covariance[..., 3, 1]
    y0 = c * covariance[..., 3, 0] - s * covariance[..., 2, 0]
    y1 = c * covariance[..., 3, 1] - s * covariance[..., 2, 1]
    px, py, qx, qy = c * x0 + s * x1, c * x1 - s * x0, c * y0 + s * y1, c * y1 - s * y0
    great, least = shape.great**2, shape.least**2
    kxx, kxy, kyx, kyy = px / great, py / least, qx / great, qy / least
    rows[..., 10], rows[..., 11], rows[..., 12], rows[..., 13] = kxx, kxy, kyx, kyy
    size = radius + BLUR * shape.noise
    rows[..., 14] = 0.5 * (kxx + kyy) * size
    rows[..., 15] = size * np.hypot(0.5 * (kxx - kyy), 0.5 * (kxy + kyx))
    # noise that fades as the covariance grows moves what it blurs
    fading = BLUR * np.abs(np.diff(shape.noise, axis=-1)) / duration
    rows[..., :-1, 15] += fading
    rows[..., 1:, 15] += fading
    xx, yy, xy = shape.along(covariance[..., 2, 2], covariance[..., 3, 3], covariance[..., 2, 3])
    # E|a| of a normal number is at most the root of mean^2 + (2 / pi) variance
    rows[..., 16] = 2 / math.pi * np.maximum(xx - kxx * px - kxy * py, 0.0)
    rows[..., 17] = 2 / math.pi * (xy - kxx * qx - kxy * qy)
    rows[..., 18] = 2 / math.pi * np.maximum(yy - kyx * qx - kyy * qy, 0.0)
    rows[..., 19] = 0.5 / shape.least
    return rows


def _layer_margin(shape: Shape, side: np.ndarray) -> np.ndarray:
    """[..., J] by how much bilinear values between a layer's nodes may fall short, as a factor."""
    determinant = (shape.great * shape.least) ** 2
    x = 0.5 * side * np.sqrt(shape.yy / determinant)
    y = 0.5 * side * np.sqrt(shape.xx / determinant)
    return 1 / (np.cos(x) * np.cos(y))


def _grids(
    rows: np.ndarray,
    shape: Shape,
    wanted: np.ndarray,
    reach: Reach,
    anchor: tuple[float, float],
    way: np.ndarray,
    low: np.ndarray,
    side: np.ndarray,
) -> np.ndarray:
    """[J, 9] where the layers lie, and how fast and how sharp what is in them is."""
    grids = np.zeros((len(way), 9))
    for axis in range(2):
        # rounding must not take the last cell away
        grids[:, axis] = low[axis] - anchor[axis] - 0.5 * side
        grids[:, 6 + axis] = reach.position[axis] - anchor[axis]
    grids[:, 2], grids[:, 3] = 1 / side, side
    grids[:, 8] = (way + ROUNDING) ** 2
    speed = np.hypot(rows[..., 8], rows[..., 9])
    grids[:, 4] = np.where(wanted, 0.5 / shape.least, 0.0).max(axis=(0, 1), initial=0.0)
    grids[:, 5] = np.where(wanted, speed, 0.0).max(axis=(0, 1), initial=0.0)
    return grids


def _box(
    mean: np.ndarray,
    covariance: np.ndarray,
    shape: Shape,
    radius: np.ndarray,
    wanted: np.ndarray,
    reach: Reach,
    way: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Corners ([2, J], [2, J]) of a box about all that the robot may meet, where it may be [m]."""
    wide = _width(mean, covariance, shape, radius, reach)
    corners = []
    for sign in (-1.0, 1.0):
        bounds = []
        for axis in range(2):
            edge = np.where(wanted, sign * mean[..., axis] + wide, -np.inf)
            most = edge.max(axis=(0, 1), initial=-np.inf)
            bounds.append(sign * np.minimum(most, sign * reach.position[axis] + way))
        corners.append(np.array(bounds))
    low, high = corners
    met = np.all(low < high, axis=0)
    return np.where(met, low, 0.0), np.where(met, high, 0.0)


def _near(rows: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """[N, J, 3] a disc for each object and moment, beyond which nothing is of it."""
    low = np.where(wanted[..., None], rows[..., :2], np.inf).min(axis=1)
    high = np.where(wanted[..., None], rows[..., :2], -np.inf).max(axis=1)
    some = np.isfinite(low)
    middle = 0.5 * (np.where(some, low, 0.0) + np.where(some, high, 0.0))
    off = np.hypot(*np.moveaxis(rows[..., :2] - middle[:, None], -1, 0))
    # the greater deviation reaches farthest
    radius = np.where(wanted, off + rows[..., 6], -1.0).max(axis=1)
    return np.concatenate([middle, radius[..., None]], axis=-1)
