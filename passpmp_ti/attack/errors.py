"""Errors up to their margins: of ranges, poses, stamps and of the robot's following."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings

RANGES = ("none", "normal", "uniform", "bound", "far", "lost")
START = "start"
POSES = ("none", "shared", "apart", "pull", START)
TRACKING = ("none", "pull", "wander")
STAMPS = ("none", "always", "random")
UNDER = 1 - 1e-9
DRIFT_TIME = 0.4
"""The robot gets from its plan to the margin in no less than this [s]."""


@dataclass(frozen=True, kw_only=True)
class Errors:
    """What errors an episode has; each is as large as its margin in `Settings` lets it be."""

    ranges: str = "none"
    """"normal": cut at the margin, a third of it the deviation; "uniform"; "bound": each beam at
    plus or minus the margin; "far": every beam longer by the margin; "lost": as "uniform", and a
    beam in fifty is lost."""
    poses: str = "none"
    """"shared": scans and state are off together, anew each cycle; "apart": each by its own;
    "pull": the sensors by the margin so that the nearest mover seems farther, the state the other
    way; "start": the state off by the same all the time, so that all that is held is, and the
    sensors as in "pull"."""
    tracking: str = "none"
    """"pull": off its plan towards the nearest mover; "wander": along a slow random way."""
    stamps: str = "none"
    """"always": each scan is older than it says by the margin; "random": by up to it."""


def disturb_ranges(scan: Scan, kind: str, margin: float, generator: np.random.Generator) -> Scan:
    """A scan with errors of at most `margin` [m]; a return may so get beyond the range."""
    if kind == "none" or margin <= 0:
        return scan
    count = len(scan.ranges)
    if kind == "normal":
        error = np.clip(generator.normal(0.0, margin / 3, count), -margin, margin)
    elif kind == "bound":
        error = margin * generator.choice([-1.0, 1.0], count)
    elif kind == "far":
        error = np.full(count, margin)
    else:
        error = generator.uniform(-margin, margin, count)
    ranges = np.where(scan.returned, np.maximum(scan.ranges + UNDER * error, 1e-6), scan.ranges)
    ranges = np.where(ranges >= scan.range_max, np.inf, ranges)
    moving = scan.moving
    if kind == "lost":
        ranges = np.where(generator.uniform(size=count) < 0.02, np.nan, ranges)
    if moving is not None:
        moving = moving & np.isfinite(ranges)
    return replace(scan, ranges=ranges, moving=moving)


def moved(scan: Scan, shift: np.ndarray, stamp: float) -> Scan:
    """A scan whose pose is told wrongly by `shift` [2] [m], and stamped `stamp` [s]."""
    x, y, theta = scan.pose
    return replace(scan, pose=(x + float(shift[0]), y + float(shift[1]), theta), stamp=stamp)


def pose_errors(
    kind: str, count: int, margin: float, pull: np.ndarray, generator: np.random.Generator
) -> tuple[list[np.ndarray], np.ndarray]:
    """(shift of each of `count` scans, shift of the state), each [2] of at most `margin` [m].

    Args:
        kind: of `POSES`.
        count: how many scans.
        margin: `Settings.localisation_error` [m].
        pull: [2] unit vector from the robot to the nearest mover.
        generator: where randomness comes from.
    """
    if kind == "none" or margin <= 0:
        return [np.zeros(2)] * count, np.zeros(2)
    if kind in ("pull", START):
        return [UNDER * margin * pull] * count, -UNDER * margin * pull
    turns = generator.uniform(0, 2 * math.pi, count + 1)
    sizes = margin * UNDER * np.where(generator.uniform(size=count + 1) < 0.7, 1.0, 0.5)
    shifts = sizes[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    if kind == "shared":
        return [shifts[0]] * count, shifts[0]
    return list(shifts[:count]), shifts[count]


def scan_age(kind: str, margin: float, generator: np.random.Generator) -> float:
    """How much older than its stamp a scan is [s]."""
    if kind == "none":
        return 0.0
    return margin * UNDER * (1.0 if kind == "always" else float(generator.uniform()))


SAME_PLACE = 1e-4
"""Two trajectories that meet are one to single precision [m]."""


class Drift:
    """How far the robot is from what it follows: smooth, within its margin, still at rest."""

    def __init__(self, kind: str, settings: Settings, generator: np.random.Generator) -> None:
        self._kind = kind
        self._margin = settings.tracking_error * UNDER
        self._generator = generator
        self._turn = float(generator.uniform(0, 2 * math.pi))
        self.shift = np.zeros(2)
        """[2] from the plan to the robot [m]."""
        self._base = np.zeros(2)

    def advance(self, tick: float, pull: np.ndarray) -> None:
        """Drift for one tick [s] of a robot that moves; pull [2]: towards the nearest mover."""
        if self._kind == "none" or self._margin <= 0:
            return
        wanted = pull
        if self._kind == "wander":
            self._turn += float(self._generator.normal(0.0, 1.5 * math.sqrt(tick)))
            wanted = np.array([math.cos(self._turn), math.sin(self._turn)])
        step = self._base + self._margin * wanted - self.shift
        length = float(np.hypot(*step))
        most = self._margin / DRIFT_TIME * tick
        self.shift = self.shift + step * min(most / max(length, 1e-12), 1.0)

    def carry_over(self, gap: np.ndarray) -> None:
        """What is followed may begin elsewhere: the robot stays at `gap` [2] from it [m]."""
        jump = gap - self.shift
        if np.hypot(*jump) > SAME_PLACE:
            self.shift, self._base = self.shift + jump, self._base + jump


def towards_nearest(place: np.ndarray, others: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """[2] unit vector from a place [2] to the nearest of others [m, 2]; zero where nobody is."""
    if not len(others):
        return np.zeros(2)
    gaps = np.asarray(others) - place
    lengths = np.hypot(*gaps.T)
    n = int(np.argmin(lengths))
    return gaps[n] / max(float(lengths[n]), 1e-9)
