"""Right messages of every kind that is heard; and their readers, as a fuzzer feeds them."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np

from hardware.base import Odometry
from hardware.broken_trees import as_message, broken_tree
from hardware.ros_frames import MOST_FRAMES, Frames
from hardware.ros_messages import (
    Tree,
    Untrusted,
    laser_scan,
    map_message,
    motion_of,
    odometry_message,
    place_of,
    pose_stamped,
    static_map_of,
    stop_of,
    sweep_of,
    transforms,
    transforms_of,
    twist,
    wheels_from,
)
from hardware.ros_port import BOOL, GRID, ODOMETRY, POSE, SCAN, TRANSFORMS, TWIST
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.scan import Scan

RANGE_MAX = 10.0
"""[m]"""
TRACK = 0.54
"""[m]"""
BEAMS = 90
NOW = 1.7e9
"""A wall clock [s]."""
FRAMES = ("odom", "base_link", "laser", "map")


def _scan() -> Scan:
    ranges = np.where(np.arange(BEAMS) % 7 == 0, math.inf, 3.0)
    ranges[5], ranges[-1] = math.nan, 0.01
    return Scan(ranges, -math.pi, math.tau / BEAMS, 8.0, pose=(0, 0, 0), stamp=0.0)


SEEN = _scan()
KNOWN = StaticMap.from_segments(
    np.array([[-1.0, 0.0, 4.0, 0.0], [4.0, 0.0, 4.0, 3.0]]), resolution=0.05
)
MOVED = Odometry(0.0, 1.0, 2.0, 0.3, 0.1, 0.2)
LINKS = [("base_link", "laser", (0.2, 0.0, 0.0)), ("map", "odom", (1.0, 0.5, 0.2))]
RIGHT: dict[str, Callable[[float], Tree]] = {
    SCAN: lambda now: laser_scan(SEEN, now, "laser"),
    ODOMETRY: lambda now: odometry_message(MOVED, now, "odom", "base_link", TRACK),
    TRANSFORMS: lambda now: transforms(LINKS, now),
    POSE: lambda now: pose_stamped((4.0, 2.0, 0.0), now, "map"),
    GRID: lambda now: map_message(KNOWN, now, "odom"),
    TWIST: lambda now: twist(0.3, -0.2),
    BOOL: lambda now: {"data": False},
}
"""A message of each kind that is heard; its stamp is given, wall clock [s]."""


class Readers:
    """What makes the planner's things of messages."""

    refusal: type[Exception] = Untrusted

    def __init__(self, draw: random.Random) -> None:
        self._right = {kind: right(NOW) for kind, right in RIGHT.items()}
        self._kinds = list(self._right)
        self._frames = Frames()
        self._readers = {
            SCAN: self._scan, ODOMETRY: self._odometry, TRANSFORMS: self._transforms,
            POSE: self._place, GRID: self._map, TWIST: self._twist, BOOL: stop_of,
        }  # fmt: skip

    def made(self, draw: random.Random) -> tuple[str, Any]:
        kind = draw.choice(self._kinds)
        return kind, as_message(broken_tree(self._right[kind], draw))

    def eat(self, data: tuple[str, Any]) -> None:
        kind, message = data
        self._readers[kind](message)

    def close(self) -> None:
        pass

    def _scan(self, message: Any) -> None:
        sweep = sweep_of(message, range_max=RANGE_MAX)
        scan = sweep.at((0.0, 0.0, 0.0), 0.0)
        given = np.asarray(message.ranges, dtype=np.float64)
        empty = (scan.ranges >= scan.range_max).sum()
        if empty > (given > message.range_min).sum():
            raise AssertionError("a beam that tells of nothing, and is taken for empty space")
        if not scan.range_max <= RANGE_MAX or not sweep.lasts >= 0.0:
            raise AssertionError(f"{scan.range_max} m, {sweep.lasts} s")

    def _odometry(self, message: Any) -> None:
        motion = motion_of(message)
        # the executor has a rule for numbers that are none
        tuple(map(float, motion.odometry(0.0, TRACK)))
        self._frames.pose(motion.frame, motion.child)

    def _transforms(self, message: Any) -> None:
        self._frames.hear(transforms_of(message))
        if len(self._frames) > MOST_FRAMES:
            raise AssertionError(f"{len(self._frames)} frames are remembered")
        for frame in FRAMES[1:]:
            self._frames.pose(FRAMES[0], frame)

    def _place(self, message: Any) -> None:
        _, *place = place_of(message)
        if not all(map(math.isfinite, place)):
            raise AssertionError(f"a goal at {place}")

    def _map(self, message: Any) -> None:
        _, known = static_map_of(message)
        if known.occupied.sum() > (np.asarray(message.data) == 100).sum():
            raise AssertionError("what nobody told of is taken for what stays")

    def _twist(self, message: Any) -> None:
        tuple(map(float, wheels_from(message, TRACK)))
