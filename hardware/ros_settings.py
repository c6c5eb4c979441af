"""All there is to set on a robot with ROS, and the margins that follow from it."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from hardware.base import BaseLimits, check_fits
from hardware.executor_settings import ExecutorSettings
from hardware.follower import FollowerSettings
from hardware.ros_clock import JUMP
from passpmp_ti import door
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.settings import Settings

STAMPED = ("any", "first")
HASTE = 0.02
"""What a cycle needs beside planning, from the scan's stamp to the executor [s]."""


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
    apart: float = 0.0135
    """Stamps of several scans that are taken for one instant differ by this at the most [s]."""
    pose_error: float = 0.01
    """Greatest error of the robot's pose in the frame that is planned in [m]: with a map that of
    the localisation, else what the odometry errs by within the seconds that a plan lasts."""
    range_error: float = 0.04
    """Greatest error of a range [m]."""

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
    directory: Path = field(
        default_factory=lambda: Path(
            os.environ.get("XDG_RUNTIME_DIR", tempfile.gettempdir()), f"passpmp-{os.getuid()}"
        )
    )
    """Of the sockets between planner, executor and base; who may enter it may drive."""
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
        if not self.scans or isinstance(self.scans, str):
            raise ValueError(f"{name}.scans must be topics, as ['scan']; got {self.scans!r}")
        object.__setattr__(self, "scans", tuple(self.scans))
        for above_0 in (
            "range_max", "sweep", "oldest", "cycle", "show_every", "show_cell", "show_reach",
        ):  # fmt: skip
            door.finite(name, above_0, getattr(self, above_0), above=0.0)
        for least_0 in ("skew", "apart", "pose_error", "range_error", "object_speed"):
            door.finite(name, least_0, getattr(self, least_0), least=0.0)
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
        values = dict(given)
        _check_names("", values, [f.name for f in fields(cls)])
        for name, kind in (("robot", DifferentialDrive), ("limits", BaseLimits)):
            if name in values:
                own = dict(_mapping(name, values[name]))
                known = [f.name for f in fields(kind) if f.init]
                _check_names(f"{name}.", own, known)
                if "discs" in own:
                    own["discs"] = tuple(tuple(disc) for disc in own["discs"])
                values[name] = kind(**own)
        for name in ("settings", "executor"):
            if name in values:
                values[name] = dict(_mapping(name, values[name]))
        if values.get("directory"):
            values["directory"] = Path(values["directory"])
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
        """
        if self.stamped == "any":
            # no beam is a sweep older than that; those that are younger promise more than is taken
            return stamp, stamp
        # one that does not tell how long it lasts may last as long as any
        lasts = lasts or self.sweep
        return stamp + lasts, stamp + 0.5 * lasts

    def executor_settings(self) -> ExecutorSettings:
        """Whom the executor believes for how long: a cycle and a half, and some."""
        patience = 1.5 * self.cycle + 0.15
        own: dict[str, Any] = {
            "planner_timeout": patience, "sensor_timeout": patience,
            "ahead": max(2.0, 2 * self.cycle),
        }  # fmt: skip
        own |= self.executor
        _check_names("executor.", own, [f.name for f in fields(ExecutorSettings)])
        if isinstance(own.get("follower"), Mapping):
            own["follower"] = FollowerSettings(**own["follower"])
        return ExecutorSettings(**own)

    def planner_settings(self) -> Settings:
        """The planner's, with the margins that range finders, clocks and executor ask for.

        Raises:
            ValueError: `settings` has less of a margin than they need.
        """
        executor = self.executor_settings()
        # what the robot moves between a beam and the time at which the sensor's place is asked for,
        # the middle of the sweep where that is known, and what both stamps are off
        astray = self.sweep * (0.5 if self.stamped == "first" else 1.0) + self.skew + JUMP
        shift = self.pose_error + self.robot.top_speed * astray
        margins: dict[str, Any] = {
            # what it moves away between two odometries is not seen
            "tracking_error": executor.bound + 0.01,
            "localisation_error": math.ceil(1000 * shift) / 1000,
            "range_noise": self.range_error,
            "stamp_error": self.scan_age + executor.rest_late,
            "deadline": self.cycle - HASTE,
        }
        made = Settings.for_robot(
            self.robot, mode=self.mode, cycle=self.cycle, object_speed=self.object_speed,
            **(margins | dict(self.settings)),
        )  # fmt: skip
        for name in ("localisation_error", "range_noise"):
            if getattr(made, name) < margins[name] - 1e-9:
                raise ValueError(
                    f"RosSettings.settings: {name} = {getattr(made, name):g} m is less than the"
                    f" {margins[name]:g} m that pose_error, range_error and sweep ask for; leave"
                    " it out, or lower those if they may be"
                )
        if made.object_speed * self.scan_age >= made.object_width:
            raise ValueError(
                f"RosSettings.object_speed = {made.object_speed:g} m/s: in the {self.scan_age:g} s"
                " that a beam may be old, an object could move by its own width of"
                f" {made.object_width:g} m and be met by none; lower it, sweep or apart"
            )
        executor.check_margins(made, scan_age=self.scan_age)
        return made


def _mapping(name: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f"RosSettings.{name} must be names and values; got {value!r}")
    return value


def _check_names(where: str, given: Mapping[str, Any], known: list[str]) -> None:
    for name in given:
        if name not in known:
            raise ValueError(
                f"RosSettings has no field {where}{name}{door.nearest(name, known)}; it has"
                f" {', '.join(known)}"
            )
