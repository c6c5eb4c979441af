"""What a range finder sees of a simulated world, from a base that is simulated too."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from hardware.base import Odometry
from hardware.scip_sweep import UST_10LX, Parameters
from passpmp_ti import door
from passpmp_ti.sim.world import World

REMEMBERED = 200
"""Places of the base that are known still: 2 s of them, every 10 ms."""


class Track:
    """Where a base was of late."""

    def __init__(self) -> None:
        self._known: deque[Odometry] = deque(maxlen=REMEMBERED)

    def note(self, truth: Odometry) -> None:
        """Where it is now."""
        self._known.append(truth)

    def at(self, times: np.ndarray) -> np.ndarray | None:
        """[3, n] x, y, theta at some times [n]; the nearest that is known; None before any is."""
        known = np.array(self._known)
        if not len(known):
            return None
        return np.stack([np.interp(times, known[:, 0], known[:, i]) for i in (1, 2, 3)])


class EmulatedLidar:
    """What an emulated device is shown: call it with the time at which a sweep begins.

    Each beam is cast from where the base is at its own time; movers are where they are in the
    sweep's middle.
    """

    def __init__(
        self,
        world: World,
        track: Track,
        mount: tuple[float, float, float],
        rng: np.random.Generator,
        *,
        ahead: float,
        noise: float,
        parameters: Parameters = UST_10LX,
    ) -> None:
        """
        Args:
            world: what is there.
            track: where the base was.
            mount: (x, y, theta) on it [m, m, rad].
            rng: draws the errors.
            ahead: the world's time is this much ahead of the clock's [s].
            noise: standard deviation of a range; cut at three of them [m].
            parameters: of the device.
        """
        self._world, self._track, self._rng = world, track, rng
        self._noise = door.finite("EmulatedLidar", "noise", noise, least=0.0, unit="m")
        self._ahead, self._parameters = ahead, parameters
        self._mount = mount
        steps = np.arange(parameters.first, parameters.last + 1)
        self._bearings = (steps - parameters.front) * (2 * math.pi / parameters.steps_per_turn)
        self._after = np.array([parameters.after(step) for step in steps.tolist()])

    def __call__(self, begin: float) -> np.ndarray:
        """[steps] ranges [m]; `inf`: nothing; `nan`, all of them: it is not known from where."""
        times = begin + self._after
        robot = self._track.at(times)
        if robot is None:
            return np.full(len(times), np.nan)
        x, y, theta = robot
        mx, my, turn = self._mount
        c, s = np.cos(theta), np.sin(theta)
        places = np.stack([x + c * mx - s * my, y + s * mx + c * my], axis=1)
        bearings = theta + turn + self._bearings
        rays = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        ranges = cast(places, rays, self._world.outline, self._discs(float(times.mean())))
        errors = self._rng.normal(0.0, self._noise, len(ranges))
        errors = np.clip(errors, -3 * self._noise, 3 * self._noise)
        hit = ranges <= self._parameters.farthest / 1000.0
        # nothing is nearer than 0, and 0 would be a lost beam
        return np.where(hit, np.maximum(ranges + errors, 0.0) + 1e-9, np.inf)

    def _discs(self, when: float) -> np.ndarray:
        movers, time = self._world.movers, when + self._ahead
        there = movers.present(time)
        return np.column_stack([movers.at(time)[there], movers.radius[there]])


def cast(
    places: np.ndarray, rays: np.ndarray, segments: np.ndarray, discs: np.ndarray
) -> np.ndarray:
    """[n] how far each ray goes to the first surface [m]; inf: for ever.

    Args:
        places: [n, 2] where they begin [m].
        rays: [n, 2] unit vectors.
        segments: [m, 4] x1, y1, x2, y2 [m].
        discs: [k, 3] x, y, radius [m]; none holds a place.
    """
    nearest = np.full(len(rays), np.inf)
    rx, ry = rays.T
    with np.errstate(divide="ignore", invalid="ignore"):
        for x1, y1, x2, y2 in segments:
            dx, dy = x2 - x1, y2 - y1
            px, py = x1 - places[:, 0], y1 - places[:, 1]
            across = rx * dy - ry * dx
            along = (px * dy - py * dx) / across
            share = (px * ry - py * rx) / across
            met = (share >= 0.0) & (share <= 1.0) & (along >= 0.0)
            nearest = np.minimum(nearest, np.where(met, along, np.inf))
        for x, y, radius in discs:
            px, py = x - places[:, 0], y - places[:, 1]
            middle = rx * px + ry * py
            half = np.sqrt(radius**2 - (px * px + py * py - middle**2))
            met = (middle >= 0.0) & np.isfinite(half)
            nearest = np.minimum(nearest, np.where(met, middle - half, np.inf))
    return nearest
