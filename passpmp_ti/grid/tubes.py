"""Where tracked movers can be at a chosen confidence, and what it makes of arrival times."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.distance import distance_between_cells
from passpmp_ti.grid.window import Window
from passpmp_ti.kernels.arrival import LATEST, cap_memory
from passpmp_ti.kernels.tubes import overlay
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

if TYPE_CHECKING:
    from passpmp_ti.tracking.forecast import Forecast
    from passpmp_ti.tracking.tracks import Tracks

MOST_LAYERS = {"hybrid": 32, "probabilistic": 20}
"""Of a forecast. Tubes are known at their layers only, and give away what lies between; chances get
moments of their own where they need them."""
TICK = 1e-3
"""[s]"""
SLACK = 1e-3
"""[m] by which f32 places and forms may be short."""
NO_TUBES = np.zeros((1, 12), dtype=np.float32)


def last_braking_ends(settings: Settings, robot: Robot) -> float:
    """[s] after the scan, until when a model has to speak of movers (Property 3)."""
    return settings.horizon + robot.longest_braking + 4 * settings.time_step


def layer_times(settings: Settings, robot: Robot, stamp: float) -> np.ndarray:
    """[L] absolute [s]: when tracked movers are forecast, evenly over the model's horizon.

    As far apart as `Settings.layer_length` tells, or as `MOST_LAYERS` of them ask for.
    """
    whole = last_braking_ends(settings, robot)
    apart = settings.layer_length
    apart *= math.ceil(whole / apart / (MOST_LAYERS[settings.mode] - 1) - 1e-9)
    return stamp + apart * np.arange(math.ceil(whole / apart - 1e-9) + 1)


def asked_speed(settings: Settings) -> float:
    """Share of the bound of speed up to which hidden movers are excluded [0, 1].

    The chance that one comes out and is faster is what a plan may have anyway; eq. 9 does the rest.
    """
    if settings.mode != "probabilistic":
        return 1.0
    shares = np.sort(np.array(settings.hidden_speeds))
    # chance that a hidden mover is at least as fast as each of them
    chance = settings.emergence * np.arange(len(shares), 0, -1) / len(shares)
    likely = shares[chance > settings.allowed_risk]
    return float(likely[-1]) if len(likely) else 0.0


def away_from_tube(robot: Robot, settings: Settings, cell: float) -> float:
    """What a cell's middle keeps from where a mover can be [m]: any point of the cell is meant."""
    return settings.clearance(robot) + math.sqrt(0.5) * cell + SLACK


def strayed(settings: Settings, half: float) -> float:
    """How far a mover gets from where a layer knows it to be, half a layer before or after [m]; the
    scan may be older than its stamp tells."""
    return settings.object_speed * (half + settings.stamp_error)


def tubes_of(
    tracks: Tracks,
    forecast: Forecast,
    robot: Robot,
    settings: Settings,
    window: Window,
    base: float,
) -> np.ndarray:
    """Where tracked movers can be at `Settings.confidence`, for kernels/tubes.py.

    Each ellipse holds its mover at its moment but for an equal share of what the confidence leaves
    open, so that none of them fails with that confidence (Boole). Until half way to the next moment
    the mover goes no farther than the bound of speed lets it, nor beyond what it can have reached
    from where it was seen last.

    Args:
        tracks: movers.
        forecast: of them, evenly in time from the scan on.
        robot: whose disc is kept away from them.
        settings: confidence, bound of speed, margins.
        window: where the cells lie.
        base: from which ticks count [s].

    Returns:
        [K, 12] float32.
    """
    count, parts, layers = forecast.weight.shape[0], *forecast.mean.shape[1:3]
    if not count:
        return NO_TUBES[:0]
    half = 0.5 * (forecast.times[1] - forecast.times[0])
    v_b = settings.object_speed
    allowed = (1 - settings.confidence) / layers
    # components that are left out cost their weight
    weight = np.array(forecast.weight)
    order = np.argsort(weight, axis=1, kind="stable")
    below = np.cumsum(np.take_along_axis(weight, order, axis=1), axis=1) <= 0.1 * allowed
    dropped = np.zeros_like(below)
    np.put_along_axis(dropped, order, below, axis=1)
    # chi square of two degrees of freedom
    q2 = -2 * math.log(0.9 * allowed)

    kept = away_from_tube(robot, settings, window.cell)
    radius = kept + forecast.radius + strayed(settings, half)
    cov = q2 * forecast.covariance[..., :2, :2]
    # E(A) + disc(r) lies in E((1 + 1/s) A + (1 + s) r^2 I) for any s > 0; this s is the tightest
    s = np.sqrt(0.5 * np.trace(cov, axis1=-2, axis2=-1)) / radius[:, None, None]
    s = np.maximum(s, 1e-6)
    outer = (1 + 1 / s)[..., None, None] * cov
    outer += ((1 + s) * radius[:, None, None] ** 2)[..., None, None] * np.eye(2)
    form = np.linalg.inv(outer)
    age = forecast.times - base
    first = np.floor((age - half) / TICK).clip(0, LATEST)
    reached = forecast.times + half - np.array(tracks.last_seen)[:, None] + settings.stamp_error
    disc = np.maximum(np.array(tracks.last_radius), forecast.radius)[:, None] + v_b * reached
    # where it was seen is an estimate as well, no worse than the track's
    great = np.linalg.eigvalsh(forecast.covariance[:, :, 0, :2, :2])[..., -1].max(axis=1)
    disc += kept + np.sqrt(q2 * great)[:, None]

    anchor = np.array(window.anchor)
    rows = np.zeros((count, parts, layers, 12))
    rows[..., 0] = first
    rows[..., 1:3] = forecast.mean[..., :2] - anchor
    rows[..., 3], rows[..., 4], rows[..., 5] = form[..., 0, 0], form[..., 0, 1], form[..., 1, 1]
    rows[..., 6:8] = (np.array(tracks.last_centre) - anchor)[:, None, None]
    rows[..., 8] = disc[:, None]
    rows[:, :, 0, 9] = 1
    up = np.sqrt(outer[..., 1, 1])
    rows[..., 10] = np.maximum(rows[..., 2] - up, rows[..., 7] - rows[..., 8]) - SLACK
    rows[..., 11] = np.minimum(rows[..., 2] + up, rows[..., 7] + rows[..., 8]) + SLACK
    return rows[~dropped].reshape(-1, 12).astype(np.float32)


@dataclass(frozen=True, slots=True)
class Laid:
    """Lays what is asked about over the arrival times of hidden movers."""

    window: Window
    base: float
    """From which ticks count [s]."""
    stamp: float
    """Of the scan [s]."""
    robot: Robot
    settings: Settings

    def tubes_over(
        self, hidden: device.Array, tubes: np.ndarray, strict: device.Array
    ) -> device.Array:
        """[J, I] uint16: until when a place is free of hidden movers and of those in their tubes,
        or of any whatever.

        Args:
            hidden: [J, I] uint16 arrival times of hidden movers at the bound of speed.
            tubes: [K, 12] of tracked ones.
            strict: [J, I] uint16 arrival times of any mover at the bound of speed.
        """
        return self._over(hidden, 1.0, tubes, strict)

    def slowed(self, hidden: device.Array, unexplained: np.ndarray) -> device.Array:
        """[J, I] uint16: until when a place is free of hidden movers that are no faster than is
        asked about, and of what is seen and not tracked.

        Args:
            hidden: as above.
            unexplained: [n, 2] returns that may move and belong to no track [m].
        """
        share = asked_speed(self.settings)
        asked = self._over(hidden, 1e9 if share == 0 else 1 / share, NO_TUBES[:0], hidden)
        if share < 1 and len(unexplained):
            # they are there for sure, and nothing tells how fast
            return capped(asked, unexplained, self.window, self.robot, self.settings)
        return asked

    def _over(
        self, hidden: device.Array, stretch: float, tubes: np.ndarray, strict: device.Array
    ) -> device.Array:
        settings, window = self.settings, self.window
        # what comes later is nobody's forecast
        end = math.floor(
            (self.stamp + last_braking_ends(settings, self.robot) - self.base) / TICK
        )
        asked = device.empty((window.size, window.size), np.uint16)
        overlay(
            device.share(), hidden, stretch, min(end, LATEST),
            device.put(tubes if len(tubes) else NO_TUBES), len(tubes), strict, *window.corner,
            window.cell, asked,
        )  # fmt: skip
        return asked


def capped(
    ticks: device.Array, places: np.ndarray, window: Window, robot: Robot, settings: Settings
) -> device.Array:
    """[J, I] uint16: arrival times, capped by cones at the bound of speed from places [n, 2]."""
    mask = np.ones((window.size, window.size), dtype=np.uint8)
    cells = np.floor((places - np.array(window.origin)) / window.cell).astype(int)
    inside = ((cells >= 0) & (cells < window.size)).all(axis=1)
    mask[cells[inside, 1], cells[inside, 0]] = 0
    result = device.empty((window.size, window.size), np.uint16)
    cap_memory(
        device.put(distance_between_cells(mask)), ticks, window.cell, settings.clearance(robot),
        settings.object_speed, settings.stamp_error, 0, result,
    )  # fmt: skip
    return result
