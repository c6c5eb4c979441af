"""A trajectory of a robot with two driven wheels, as quick to ask as a control loop needs it."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from passpmp_ti.trajectory import Trajectory


class Place(NamedTuple):
    """Where a path is at one time, how fast, and how its wheels change."""

    x: float
    y: float
    theta: float
    right: float
    left: float
    """Ground speed of each wheel [m/s]."""
    right_rate: float = 0.0
    left_rate: float = 0.0
    """How fast those change [m/s^2]."""


class Path:
    """The states of a trajectory, straight lines between them, and rest after its end."""

    __slots__ = ("_states", "_times", "end", "start")

    def __init__(self, trajectory: Trajectory) -> None:
        self._times: list[float] = trajectory.times.tolist()
        self._states: list[list[float]] = trajectory.states.tolist()
        self.start = self._times[0]
        self.end = self._times[-1]
        """From here on it is at rest [s]."""

    @classmethod
    def resting(cls, x: float, y: float, theta: float, time: float) -> Path:
        """Rest at a pose from `time` [s] on."""
        return cls(Trajectory.resting(np.array([x, y, theta, 0.0, 0.0]), time))

    @property
    def last(self) -> Place:
        """Where it rests."""
        return Place(*self._states[-1])

    def at(self, time: float) -> Place:
        """The place at `time` [s]: the first one before the start, rest after the end."""
        after = bisect_right(self._times, time)
        if after == 0 or after == len(self._times):
            return Place(*self._states[0 if after == 0 else -1])
        t, u = self._times[after - 1], self._times[after]
        a, b = self._states[after - 1], self._states[after]
        share = (time - t) / (u - t)
        x, y, theta, right, left = (p + share * (q - p) for p, q in zip(a, b, strict=True))
        rates = (b[3] - a[3]) / (u - t), (b[4] - a[4]) / (u - t)
        return Place(x, y, theta, right, left, *rates)


def gap(a: Place, b: Place) -> tuple[float, float, float]:
    """How far two places are apart: [m], [rad], and of the faster changed wheel [m/s]."""
    return (
        math.hypot(a.x - b.x, a.y - b.y),
        abs(math.remainder(a.theta - b.theta, math.tau)),
        max(abs(a.right - b.right), abs(a.left - b.left)),
    )
