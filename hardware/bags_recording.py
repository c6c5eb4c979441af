"""A recorded robot: where it was, and what was seen at each instant."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hardware.bags import messages
from hardware.merge import Pairing
from hardware.ros_frames import Frames, compose
from hardware.ros_messages import (
    Pose,
    Untrusted,
    motion_of,
    stamp_of,
    static_map_of,
    sweep_of,
    transforms_of,
)
from hardware.ros_port import GRID, ODOMETRY, SCAN, TRANSFORMS
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.scan import Scan

LONGEST_GAP = 1.0
"""Where the robot was is not known between two poses that are farther apart than this [s]."""
FASTEST = 100.0
"""Odometry of wheels that turn faster than this is of no robot [m/s]."""
SPEEDS_FROM_POSES = 0.2
"""Time over which speeds are taken from poses where the odometry tells none [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """Where a recorded robot was."""

    times: np.ndarray
    """[n] increasing [s]."""
    states: np.ndarray
    """[n, 5] x, y, theta (continuous), right, left [m, m, rad, m/s, m/s]."""

    def at(self, time: float) -> np.ndarray | None:
        """[5] the state at a time [s], straight between two; None where nothing is known."""
        n = int(np.searchsorted(self.times, time))
        if n < len(self.times) and self.times[n] == time:
            return self.states[n].copy()
        if not 0 < n < len(self.times) or self.times[n] - self.times[n - 1] > LONGEST_GAP:
            return None
        return np.array([np.interp(time, self.times[n - 1 : n + 1], column)
                         for column in self.states[n - 1 : n + 1].T])  # fmt: skip

    @property
    def fastest(self) -> float:
        """Greatest speed of a wheel [m/s]."""
        return float(np.abs(self.states[:, 3:]).max())


@dataclass(frozen=True, slots=True, eq=False)
class Instant:
    """What was seen at one time, and by whom."""

    stamp: float
    """Since the recording's first pose [s]."""
    scans: tuple[Scan, ...]
    state: np.ndarray
    """[5]."""


class Recording:
    """A recording of a robot's scans and odometry."""

    def __init__(
        self,
        path: str | Path,
        *,
        track: float,
        scans: Sequence[str] = (),
        odometry: str = "",
        base_frame: str = "base_link",
        mount: Pose | None = None,
    ) -> None:
        """Reads all but the scans.

        Args:
            path: as for `messages`.
            track: distance between the driven wheels [m].
            scans: topics of the range finders; none: all there are.
            odometry: its topic; empty: the first there is, or tf where there is none.
            base_frame: of the robot; the odometry's child frame where that is told.
            mount: of all range finders on the robot; None: as tf says, and where it says nothing
                the robot's middle.

        Raises:
            ValueError: nothing tells where the robot was, or there are no such scans.
        """
        self.path, self.track = Path(path), track
        self.trouble: Counter[str] = Counter()
        """What was left out, or taken for granted, by reason."""
        self.topics: tuple[str, ...] = tuple(scans)
        self._mount, self._frames = mount, Frames()
        topics, motions, moved = self._read(odometry)
        if motions:
            base_frame = motions[-1].child or base_frame
        self.base_frame = base_frame.lstrip("/")
        way = [(m.stamp, *m.pose, m.speed, m.turn_rate) for m in motions] or [
            (when, *pose, 0.0, 0.0) for when, child, pose in moved if child == self.base_frame
        ]
        # what is no number is no place
        rows = np.array(way).reshape(-1, 6)
        rows = rows[np.isfinite(rows).all(axis=1)]
        if len(np.unique(rows[:, 0])) < 2:
            raise ValueError(
                f"{path}: nothing tells where the robot was: there is no odometry"
                f"{f' on {odometry}' if odometry else ''}, and tf does not move {base_frame}"
            )
        self.begin = float(rows[0, 0])
        """Wall clock time of the first pose [s]; all else is told since then."""
        self.way = _way(rows, self.begin, track)
        if not self.way.fastest <= FASTEST:
            raise ValueError(
                f"{path}: nothing tells where the robot was: its odometry has wheels at up to"
                f" {self.way.fastest:g} m/s, and none turns faster than {FASTEST:g} m/s"
            )
        if not self.topics:
            self.topics = tuple(sorted(topics))
        self.frame = motions[-1].frame.lstrip("/") if motions else ""
        """That its poses are in; empty where it is not told."""
        missing = sorted(set(_slashed(self.topics)) - set(_slashed(topics)))
        if missing or not self.topics:
            raise ValueError(
                f"{path}: no scans on {', '.join(missing) or 'any topic'};"
                f" there are {', '.join(sorted(topics)) or 'none'}"
            )

    def instants(
        self,
        *,
        range_max: float = 10.0,
        beyond_is_free: bool = False,
        apart: float = 0.0135,
        moments: Callable[[float, float], tuple[float, float]] = lambda stamp, _: (stamp, stamp),
        steadied: Callable[[Scan, np.ndarray, Pose], Scan] = lambda scan, state, mount: scan,
    ) -> Iterator[Instant]:
        """What was seen, in order.

        Args:
            range_max: as for `sweep_of`.
            beyond_is_free: as for `sweep_of`.
            apart: stamps within an instant differ by this at the most [s].
            moments: as `RosSettings.moments`.
            steadied: as `RosSettings.steadied`.
        """
        streams = {topic: n for n, topic in enumerate(_slashed(self.topics))}
        pairing = Pairing(len(streams), apart=apart)
        newest = [-math.inf] * len(streams)
        for one in messages(self.path, [SCAN]):
            stream = streams.get(_slash(one.topic))
            if stream is None:
                continue
            try:
                sweep = sweep_of(one.message, range_max=range_max, beyond_is_free=beyond_is_free)
                stamp, middle = moments(sweep.stamp - self.begin, sweep.lasts)
                if not stamp > newest[stream]:
                    raise Untrusted("a scan no newer than the one before")
                state = self.way.at(middle)
                if state is None or self.way.at(stamp) is None:
                    raise Untrusted("no pose of a scan's time")
                x, y, theta = (float(v) for v in state[:3])
                mount = self._mounted(sweep.frame)
                scan = steadied(sweep.at(compose((x, y, theta), mount), stamp), state, mount)
            except ValueError as why:
                self.trouble[str(why)] += 1
                continue
            newest[stream] = stamp
            pair = pairing.add(stream, scan)
            if pair is not None:
                state = self.way.at(pair[0].stamp)
                assert state is not None  # one of them has this stamp
                yield Instant(pair[0].stamp, pair, state)
        if pairing.alone:
            self.trouble["scans without a partner"] += pairing.alone

    def static_map(self, topic: str) -> StaticMap:
        """The last map on a topic.

        Raises:
            ValueError: there is none, or it is in another frame than the poses.
        """
        found = None
        for one in messages(self.path, [GRID]):
            if _slash(one.topic) == _slash(topic):
                try:
                    found = static_map_of(one.message)
                except Untrusted as why:
                    raise ValueError(f"{self.path}: on {topic}: {why}") from why
        if found is None:
            raise ValueError(f"{self.path}: no map on {topic}; give the topic of one, or a file")
        if self.frame and found[0].lstrip("/") != self.frame:
            raise ValueError(
                f"{self.path}: the map on {topic} is in {found[0]}, the poses in {self.frame};"
                " give a file with a map in the frame of the poses"
            )
        return found[1]

    def _read(self, odometry: str) -> tuple[set[str], list[Any], list[tuple[float, str, Pose]]]:
        """Topics of scans; motions; (time, child, pose) of what tf moves."""
        topics: set[str] = set()
        motions: list[Any] = []
        moved: list[tuple[float, str, Pose]] = []
        chosen = _slash(odometry) if odometry else ""
        for one in messages(self.path, [SCAN, ODOMETRY, TRANSFORMS]):
            if one.kind == SCAN:
                topics.add(one.topic)
            elif one.kind == ODOMETRY:
                chosen = chosen or _slash(one.topic)
                if _slash(one.topic) == chosen:
                    try:
                        motions.append(motion_of(one.message))
                    except Untrusted as why:
                        self.trouble[str(why)] += 1
            else:
                links = transforms_of(one.message)
                self._frames.hear(links)
                if not links or one.topic.endswith("static"):
                    continue
                try:
                    stamps = [stamp_of(t) for t in one.message.transforms]
                except Untrusted as why:
                    self.trouble[str(why)] += 1
                    continue
                if len(stamps) == len(links):
                    moved += [
                        (t, child.lstrip("/"), pose)
                        for t, (_, child, pose) in zip(stamps, links, strict=True)
                    ]
        return topics, motions, moved

    def _mounted(self, frame: str) -> Pose:
        if self._mount is not None:
            return self._mount
        found = self._frames.pose(self.base_frame, frame)
        if found is None:
            self.trouble[f"{frame} is taken to be in the robot's middle: tf does not say"] += 1
            return (0.0, 0.0, 0.0)
        return found


def _way(rows: np.ndarray, begin: float, track: float) -> Way:
    """From rows stamp, x, y, theta, speed, turn rate, which may be out of order."""
    _, first = np.unique(rows[:, 0], return_index=True)
    rows = rows[first]
    times, poses = rows[:, 0] - begin, rows[:, 1:4].copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    speed, turn = rows[:, 4], rows[:, 5]
    if not speed.any() and not turn.any():
        # odometry that tells no speeds: over a while, since poses have noise
        before = np.searchsorted(times, times - 0.5 * SPEEDS_FROM_POSES)
        after = np.minimum(
            np.searchsorted(times, times + 0.5 * SPEEDS_FROM_POSES), len(times) - 1
        )
        before, after = np.maximum(before - (before == after), 0), np.maximum(after, 1)
        lapse = np.maximum(times[after] - times[before], 1e-6)
        step = poses[after] - poses[before]
        speed = (step[:, 0] * np.cos(poses[:, 2]) + step[:, 1] * np.sin(poses[:, 2])) / lapse
        turn = step[:, 2] / lapse
    half = 0.5 * track * turn  # eq. 23
    return Way(times, np.column_stack([poses, speed + half, speed - half]))


def _slash(topic: str) -> str:
    return "/" + topic.lstrip("/")


def _slashed(topics: Iterable[str]) -> list[str]:
    return [_slash(topic) for topic in topics]
