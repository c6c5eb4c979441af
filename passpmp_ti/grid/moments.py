"""The moments at which a forecast is rasterised, and its Gaussians then.

docs/risk.md derives the bounds that are used here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.reach import Reach
from passpmp_ti.kernels.cuts import MOST_PARTS, choose_moments
from passpmp_ti.kernels.forecasts import SMALLEST
from passpmp_ti.kernels.moments import GRID, KNOWN, MOMENT, ROW, lay_moments


class Forecast(Protocol):
    """What tracked objects will do: mixtures of Gaussians at equally spaced times."""

    @property
    def times(self) -> np.ndarray:
        """[L] absolute [s]."""

    @property
    def weight(self) -> np.ndarray:
        """[N, C] of each component; rows sum to 1."""

    @property
    def mean(self) -> np.ndarray:
        """[N, C, L, 4] (x, y, vx, vy) [m, m/s]."""

    @property
    def covariance(self) -> np.ndarray:
        """[N, C, L, 4, 4]."""

    @property
    def radius(self) -> np.ndarray:
        """[N] of the disc about the mean that covers the object [m]."""


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
    weight, times = forecast.weight, forecast.times
    objects, components = weight.shape
    each, last = objects * components, len(times) - 1
    given = (
        *(_put(array) for array in (forecast.mean, forecast.covariance, weight, radius)),
        device.put(np.array([
            *reach.position, reach.disc_speed, *anchor, (times[-1] - times[0]) / last,
        ])),
    )  # fmt: skip
    tally = device.put(np.array([objects, components], np.int32))
    layers = device.put(np.stack([times, reach.way(times)], axis=1))
    moments = device.empty((last * MOST_PARTS + 1, MOMENT), np.float64)
    starts = device.empty((last + 1,), np.int32)
    some = max(each, 1)
    count = choose_moments(
        *given, layers, tally, device.empty((some, last + 1), np.float64),
        device.empty((some, last), np.float64), device.empty((last,), np.float64), moments, starts,
    )  # fmt: skip
    moments = device.host(moments)[:count]
    times = moments[:, 2].copy()
    # a layer is asked until the next moment
    moments[:, 3] = reach.way(np.append(times[1:], times[-1]))
    rows = count * each
    some = max(rows, 1)
    out = (
        device.empty((some, ROW), np.float32),
        device.empty((max(count * objects, 1), 3), np.float32),
        device.empty((some,), np.uint8),
        device.empty((some, 3), np.float64),
        device.empty((count, GRID), np.float32),
        device.empty((2, count), np.int32),
    )
    lay_moments(*given, tally, device.put(moments), device.empty((some, KNOWN), np.float64), *out)
    laid, near, wanted, sizes, grids, sides = map(device.host, out)
    return Moments(
        times,
        device.host(starts),
        laid[:rows],
        near[: count * objects],
        wanted[:rows].view(bool),
        sizes[:rows, :2],
        sizes[:rows, 2],
        grids,
        sides,
        float(weight[weight < SMALLEST].sum()),
    )


def _put(array: np.ndarray) -> device.Array:
    """`array` where the kernels read it; zeros, which nobody asks for, instead of nothing: a device
    has no empty arrays."""
    if not array.size:
        array = np.zeros([max(count, 1) for count in array.shape])
    return device.put(np.ascontiguousarray(array, dtype=np.float64))
