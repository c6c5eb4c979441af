"""The moments of a forecast once more, in NumPy: what kernels/moments.py must make of it.

Whole arrays [N, C, J] at a time, and matrices by their parts: another way to the same numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from passpmp_ti.grid.moments import Forecast, Moments
from passpmp_ti.grid.reach import Reach
from passpmp_ti.kernels.cuts import BEND, MOST_PARTS, STRAIGHT
from passpmp_ti.kernels.forecasts import BLUR, COARSEST, LEFT_OUT, MOST_SIDE, SHARPEST, SMALLEST
from passpmp_ti.kernels.gaussians import FARTHEST, TINY
from passpmp_ti.kernels.moments import LOST, NODE, ROUNDING, ROW, STEEPEST


@dataclass(frozen=True, slots=True)
class Shape:
    """Gaussians of places, blurred where they are too sharp; all arrays are of one shape."""

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
    means, covariances = forecast.mean, forecast.covariance
    # what the nodes of a layer that wide will blur anyway needs no moments of its own
    coarse = 2 * reach.way(forecast.times) / (MOST_SIDE - 2) / COARSEST
    shape = Shape.of(covariances, np.maximum(size / SHARPEST, coarse))
    wanted = _within_reach(means, covariances, shape, size, reach, forecast.times)
    wanted &= (forecast.weight >= SMALLEST)[..., None]
    bends = bends_of(shape, means, covariances, length)
    met = wanted[..., 1:] | wanted[..., :-1]
    steepest = np.where(met, bends, 0.0).max(axis=(0, 1), initial=0.0)
    # how many moments begin with each layer: none where it can be done without
    counts = np.append(np.clip(np.ceil(steepest / BEND), 1, MOST_PARTS).astype(np.int64), 1)
    counts[_needless(means, shape, steepest)] = 0
    ends = np.cumsum(counts)
    layer = np.repeat(np.arange(layers), counts)
    share = (np.arange(len(layer)) - (ends - counts)[layer]) / counts[layer]
    starts = np.where(counts > 0, ends - counts, ends - 1)
    times = forecast.times[layer] + share * length
    mean, covariance = between(means, covariances, layer, share, length)
    duration = np.diff(times)

    plain = Shape.of(covariance, 0.0)
    wanted = _within_reach(mean, covariance, plain, size, reach, times)
    wanted &= (forecast.weight >= SMALLEST)[..., None]
    # a layer is asked until the next moment
    way = reach.way(np.append(times[1:], times[-1]))
    low, high = _box(mean, covariance, plain, size, wanted, reach, way)
    fine = _sharpest_tenth(np.where(wanted, plain.least, np.inf).reshape(-1, len(times)))
    extent = high - low
    side = np.maximum(NODE * fine, extent.max(axis=0) / (MOST_SIDE - 2))
    side = np.where(np.isfinite(side), side, 1.0)
    sides = np.ceil(extent / side).astype(np.int64) + 2
    floor = np.maximum(size / SHARPEST, side / COARSEST)
    shape = Shape.of(covariance, floor)
    bends = bends_of(shape, mean, covariance, duration)
    floor = np.maximum(floor, _floor(mean, covariance, bends, duration))
    shape = Shape.of(covariance, floor)
    bends = bends_of(shape, mean, covariance, duration)
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


def _sharpest_tenth(least: np.ndarray) -> np.ndarray:
    """[J] what a tenth of the deviations [M, J] is below; infinite ones do not count."""
    ordered = np.sort(np.pad(least, ((0, 1), (0, 0)), constant_values=np.inf), axis=0)
    return ordered[np.isfinite(ordered).sum(axis=0) // 10, np.arange(least.shape[1])]


def _moments_first(array: np.ndarray) -> np.ndarray:
    """[J, N, C, ...] of [N, C, J, ...]: what is looked up together lies together."""
    return np.moveaxis(array, 2, 0)


def _needless(mean: np.ndarray, shape: Shape, steepest: np.ndarray) -> list[int]:
    """Layers between others, where means go straight on and densities hardly change."""
    needless: list[int] = []
    begin, last = 0, len(steepest)
    while begin < last:
        end = begin + 1
        while (
            end < last
            and steepest[begin : end + 1].sum() < BEND
            and _straight(mean, shape, begin, end + 1)
        ):
            end += 1
        needless += range(begin + 1, end)
        begin = end
    return needless


def _straight(mean: np.ndarray, shape: Shape, begin: int, end: int) -> bool:
    """Whether means between two layers lie evenly on the way from the one to the other."""
    share = np.linspace(0.0, 1.0, end - begin + 1)[1:-1, None]
    first, last = mean[:, :, begin, None, :2], mean[:, :, end, None, :2]
    off = mean[:, :, begin + 1 : end, :2] - (first + share * (last - first))
    far = np.hypot(off[..., 0], off[..., 1]) / shape.least[..., begin + 1 : end]
    return bool(far.max(initial=0.0) < STRAIGHT)


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
