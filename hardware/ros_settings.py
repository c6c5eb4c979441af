"""All there is to set on a robot with ROS, and the margins that follow from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from hardware.base import BaseLimits, check_fits
from hardware.config import usual_directory
from hardware.executor_settings import ExecutorSettings
from hardware.follower import FollowerSettings
from hardware.margins import (
    APART,
    BRISK,
    HASTE,
    executor_settings,
    longest_guess,
    unforeseen,
    with_margins,
)
from hardware.ros_clock import JUMP
from hardware.ros_messages import Pose, Untrusted
from hardware.steady import bounds, steadied_or_lost
from passpmp_ti import door
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings

STAMPED = ("any", "first")


@dataclass(frozen=True, slots=True, kw_only=True)
class RosSettings:
    """A robot, its topics and frames, and what may be relied on about them."""

    # the robot
    robot: DifferentialDrive = field(default_factory=DifferentialDrive)
    """As it is planned for."""
    limits: BaseLimits = field(default_factory=BaseLimits)
    """What the base that hears cmd_vel can do, and does by itself."""

    # topics and frames
    scans: tuple[str, ...] = ("scan",)
    """Topics of the range finders."""
    base_frame: str = "base_link"
    """Midway between the driven wheels; the odometry's child frame."""

    frame: str = ""
    """Frame that is planned in. Empty: the odometry's own, which moves without jumps. Another, as
    "map": tf joins it with the odometry's, and where a localisation jumps by more than the
    executor's bound, the robot brakes."""
    map: str = ""
    """Topic of a map, in that frame, of what stays; it is waited for. Empty: there is none."""

    # what may be relied on
    range_max: float = 10.0
    """How far +inf is taken for empty space [m], and beyond which returns do not count."""
    beyond_is_free: bool = False
    """Whether the driver says a number above its `range_max` for +inf."""
    sweep: float = 0.02
    """Longest time from a sweep's first beam to its last [s]."""
    stamped: str = "any"
    """Which beam's time a scan's stamp is: "first", as the message is defined, or "any" of the
    sweep, for drivers of which that is not known; the robot's place is then less sure."""
    skew: float = 0.0
    """How far the clocks of the machines that stamp may be off this one's [s]."""
    oldest: float = 0.5
    """Messages older than this are not believed [s]."""
    apart: float = APART
    """Stamps of several scans that are taken for one instant differ by this at the most [s]."""
    pose_error: float = 0.01
    """Greatest error of the robot's pose in the frame that is planned in [m]: with a map that of
    the localisation, else what the odometry errs by within the seconds that a plan lasts."""
    heading_error: float = 0.01
    """Likewise of its heading, and of how a range finder is mounted [rad]."""
    range_error: float = 0.04
    """Greatest error of a range [m]."""
    odometry_period: float = 0.02
    """From one odometry to the next [s]. Longer after one than that, and what the executor takes to
    hand it on, no pose is told: scans that would need one are not believed."""

    # planning
    mode: str = "conservative"
    cycle: float = 0.1
    """[s]"""
    object_speed: float = 1.0
    """Bound on everybody's speed [m/s]."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Other fields of the planner's `Settings`."""
    executor: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `ExecutorSettings` that differ from what the cycle asks for."""
    seed: int = 0

    # this machine
    directory: Path = field(default_factory=lambda: usual_directory("passpmp-ros"))
    """Of the sockets between planner, executor and base; who may enter it may drive. Not that of
    `passpmp drive`: there is one executor to a directory."""
    backend: str = "cpu"
    threads: int | None = None
    """Of the planner's kernels; None: all cores."""
    show_every: float = 0.5
    """Time between two pictures of hidden and unsafe regions [s]."""
    show_cell: float = 0.1
    """Side of their cells, at least [m]."""
    show_reach: float = 5.0
    """Half the side of the picture of the ICS^b region [m]."""

    def __post_init__(self) -> None:
        name = "RosSettings"
        if not isinstance(self.scans, (list, tuple)) or not self.scans:
            raise ValueError(f"{name}.scans must be topics, as ['scan']; got {self.scans!r}")
        for n, topic in enumerate(self.scans):
            door.text(name, f"scans[{n}]", topic)
        for text in ("base_frame", "frame", "map", "backend"):
            door.text(name, text, getattr(self, text))
        if not isinstance(self.beyond_is_free, bool):
            raise ValueError(
                f"{name}.beyond_is_free must be true or false; got {self.beyond_is_free!r}"
            )
        object.__setattr__(self, "scans", tuple(self.scans))
        for above_0 in (
            "range_max", "sweep", "oldest", "cycle", "odometry_period", "show_every", "show_cell",
            "show_reach",
        ):  # fmt: skip
            door.finite(name, above_0, getattr(self, above_0), above=0.0)
        for least_0 in (
            "skew", "apart", "pose_error", "heading_error", "range_error", "object_speed",
        ):  # fmt: skip
            door.finite(name, least_0, getattr(self, least_0), least=0.0)
        for own in ("mode", "cycle", "object_speed"):
            if own in self.settings:
                raise ValueError(
                    f"{name}.settings: {own} has a field of its own, by which margins are reckoned;"
                    f" set {name}.{own}"
                )
        door.choice(name, "stamped", self.stamped, STAMPED)
        door.finite(name, "cycle", self.cycle, above=2 * HASTE, unit="s")
        door.whole(name, "seed", self.seed, least=0)
        if self.threads is not None:
            door.whole(name, "threads", self.threads, least=1)
        check_fits(self.limits, self.robot)

    @classmethod
    def from_parameters(cls, given: Mapping[str, Any]) -> RosSettings:
        """From plain values, as a parameter server or a file has them.

        Raises:
            ValueError: an unknown name (the nearest is suggested), or a value out of its range.
        """
        values = dict(_mapping("parameters", given))
        _check_names("", values, [f.name for f in fields(cls)])
        for name, kind in (("robot", DifferentialDrive), ("limits", BaseLimits)):
            if name in values:
                own = dict(_mapping(name, values[name]))
                known = [f.name for f in fields(kind) if f.init]
                _check_names(f"{name}.", own, known)
                if "discs" in own:
                    rows = door.array("RosSettings.robot", "discs", own["discs"], (None, 2))
                    own["discs"] = tuple((float(offset), float(radius)) for offset, radius in rows)
                values[name] = kind(**own)
        for name in ("settings", "executor"):
            if name in values:
                values[name] = dict(_mapping(name, values[name]))
        if values.get("directory"):
            values["directory"] = Path(door.text("RosSettings", "directory", values["directory"]))
        else:
            values.pop("directory", None)
        return cls(**values)

    @property
    def scan_age(self) -> float:
        """A beam may have been measured this long before its scan's stamp [s]."""
        pairs = self.apart if len(self.scans) > 1 else 0.0
        return self.sweep + self.skew + JUMP + pairs

    def moments(self, stamp: float, lasts: float) -> tuple[float, float]:
        """(a scan's stamp as the planner takes it, when to ask for the sensor's place) [s].

        Args:
            stamp: as the message has it.
            lasts: from its first beam to its last, as the message tells; 0 where it does not.

        Raises:
            Untrusted: a sweep longer than `sweep`.
        """
        if lasts > self.sweep:
            raise Untrusted(f"a sweep longer than sweep = {self.sweep:g} s")
        if self.stamped == "any":
            # no beam is a sweep older than that; those that are younger promise more than is taken
            return stamp, stamp
        # one that does not tell how long it lasts may last as long as any
        lasts = lasts or self.sweep
        return stamp + lasts, stamp + 0.5 * lasts

    def steadied(self, scan: Scan, state: np.ndarray, mount: Pose) -> Scan:
        """What a sweep proves although the robot turned meanwhile, and nobody knows its heading
        better than `heading_error`. What it rolled is in `Settings.localisation_error`.

        Args:
            scan: placed by `state`.
            state: [5] the robot's when the sensor's place was asked for.
            mount: of the range finder on the robot.
        """
        _, turning = bounds(float(state[3]), float(state[4]), self.robot.track)
        turn = turning * self._astray + self.heading_error
        turn += 2.0 * self._unforeseen / self.robot.track
        return steadied_or_lost(scan, turn * math.hypot(*mount[:2]), turn)

    @property
    def guess(self) -> float:
        """How long after the newest odometry the robot's state may be told [s]."""
        return longest_guess(self.executor_settings(), self.odometry_period)

    @property
    def _unforeseen(self) -> float:
        """What a wheel does otherwise than it did at the newest odometry, until a beam is measured
        [m]."""
        return unforeseen(BRISK * self.limits.acceleration, self.guess + self._astray)

    @property
    def _astray(self) -> float:
        """From a beam to the time at which its sensor's place is asked for, the middle of the sweep
        where that is known, and what both stamps are off, at the most [s]."""
        return self.sweep * (0.5 if self.stamped == "first" else 1.0) + self.skew + JUMP

    def executor_settings(self) -> ExecutorSettings:
        """The executor's: what suits the cycle, and `executor` on top."""
        own = dict(self.executor)
        _check_names("executor.", own, [f.name for f in fields(ExecutorSettings)])
        if isinstance(own.get("follower"), Mapping):
            follower = dict(own["follower"])
            known = [f.name for f in fields(FollowerSettings)]
            _check_names("executor.follower.", follower, known)
            own["follower"] = FollowerSettings(**follower)
        return executor_settings(self.cycle, **own)

    def planner_settings(self) -> Settings:
        """The planner's, with the margins that range finders, clocks and executor ask for.

        Raises:
            ValueError: `settings` has less of a margin than they need.
        """
        executor = self.executor_settings()
        needed = with_margins(
            Settings.for_robot(self.robot, mode=self.mode, object_speed=self.object_speed),
            executor,
            cycle=self.cycle,
            localisation_error=self.pose_error
            + self.robot.top_speed * self._astray
            + self._unforeseen,
            range_noise=self.range_error,
            scan_age=self.scan_age,
        )
        made = needed.changed(**self.settings)
        for name in ("localisation_error", "range_noise"):
            told, least = getattr(made, name), getattr(needed, name)
            if told < least:
                raise ValueError(
                    f"RosSettings.settings: {name} = {told:g} m is less than the {least:g} m that"
                    " pose_error, range_error and sweep ask for; leave it out, or lower those if"
                    " they may be"
                )
        if made.object_speed * self.scan_age >= made.object_width:
            raise ValueError(
                f"RosSettings.object_speed = {made.object_speed:g} m/s: in the {self.scan_age:g} s"
                " that a beam may be old, an object could move by its own width of"
                f" {made.object_width:g} m and be met by none; lower it, sweep or apart"
            )
        executor.check_margins(made, scan_age=self.scan_age)
        return made


def read_parameters(path: str | Path) -> dict[str, Any]:
    """Names and values from a YAML file.

    Raises:
        ValueError: it cannot be read, or holds something else.
    """
    try:
        told = yaml.safe_load(Path(path).read_text())
    except Exception as cause:
        # values within each other by the hundred, and tags as `!!bool maybe`, have PyYAML raise
        # whatever comes
        raise ValueError(f"{path}: cannot be read; {cause}") from cause
    if told is not None and not isinstance(told, dict):
        raise ValueError(f"{path}: must hold names and values; got {told!r}")
    return told or {}


def _mapping(name: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise ValueError(f"RosSettings.{name} must be names and values; got {value!r}")
    return value


def _check_names(where: str, given: Mapping[str, Any], known: list[str]) -> None:
    for name in given:
        if name not in known:
            raise ValueError(
                f"RosSettings has no field {where}{name}{door.nearest(name, known)}; it has"
                f" {', '.join(known)}"
            )
