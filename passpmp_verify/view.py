"""Polar regions that are proven empty: views of scans, and discs that are known to be empty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

LOST, NOTHING, MOVABLE, STATIC, STATIC_BY_MAP = -1, 0, 1, 2, 3
"""What a beam met."""
SHUT, OPEN, UNCOVERED = 0, 1, 2
"""What a far side lets through: nothing; anything; what comes out of bearings never covered."""
TAU = 2 * math.pi


class Scan(Protocol):
    """What is read of a scan; see the fields of the certificate's scans."""

    @property
    def ranges(self) -> np.ndarray:
        """[n] [m]; inf or >= range_max: nothing met; nan or <= 0: lost."""

    @property
    def angle_min(self) -> float:
        """Bearing of beam 0 in the sensor's frame [rad]."""

    @property
    def angle_increment(self) -> float:
        """[rad], > 0."""

    @property
    def range_max(self) -> float:
        """[m]."""

    @property
    def pose(self) -> tuple[float, float, float]:
        """(x, y, theta) of the sensor [m, m, rad]."""

    @property
    def stamp(self) -> float:
        """Absolute time [s]."""

    @property
    def moving(self) -> np.ndarray | None:
        """[n] bool, or None: every surface may move."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A polar region: wedge i lies between `bearing` + i `increment` and the next; the last one
    closes the circle. All bearings are the world's."""

    x: float
    y: float
    bearing: float
    increment: float
    ranges: np.ndarray
    """[n] where each beam ends [m]; 0 where it was lost."""
    met: np.ndarray
    """[n] what each beam met."""
    reach: np.ndarray
    """[n] each wedge is proven empty up to here [m]."""
    side: np.ndarray
    """[n] what each wedge's far side lets through."""
    chord: np.ndarray
    """[n, 2, 2] the two returns of each wedge that is shut [m]."""
    closed: bool
    """The beams go all the way round."""
    is_scan: bool
    """False: a disc that is known to be empty."""

    @property
    def angles(self) -> np.ndarray:
        """[n] angle of each wedge [rad]."""
        n = len(self.reach)
        angles = np.full(n, self.increment)
        angles[-1] = TAU - (n - 1) * self.increment
        return angles

    @property
    def bearings(self) -> np.ndarray:
        """[n] of the beams [rad]."""
        return self.bearing + self.increment * np.arange(len(self.reach))

    def polar(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(range [m], bearing counted from beam 0 in [0, 2 pi) [rad]) of points [n, 2]."""
        dx, dy = points[:, 0] - self.x, points[:, 1] - self.y
        return np.hypot(dx, dy), np.mod(np.arctan2(dy, dx) - self.bearing, TAU)

    def wedge(self, turn: np.ndarray) -> np.ndarray:
        """[n] the wedge that holds each bearing counted from beam 0 [rad]."""
        turn = np.mod(turn, TAU)
        return np.minimum((turn / self.increment).astype(np.int64), len(self.reach) - 1)

    def proves(self, points: np.ndarray) -> np.ndarray:
        """[n] bool: proven empty."""
        r, turn = self.polar(points)
        return r <= self.reach[self.wedge(turn)]


def ends_of(scan: Scan) -> np.ndarray:
    """[m, 2] where the beams met something [m]."""
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        met = (ranges > 0) & (ranges < scan.range_max)
    bearings = scan.pose[2] + scan.angle_min + scan.angle_increment * np.flatnonzero(met)
    r = ranges[met]
    return np.stack(
        [scan.pose[0] + r * np.cos(bearings), scan.pose[1] + r * np.sin(bearings)], axis=1
    )


def view_of_disc(x: float, y: float, radius: float) -> View:
    """A disc that is known to be empty."""
    n = 16
    full = np.full(n, float(radius))
    return View(
        x, y, 0.0, TAU / n, full, np.zeros(n, int), full, np.full(n, OPEN), np.zeros((n, 2, 2)),
        True, False,
    )  # fmt: skip
