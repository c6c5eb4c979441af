"""What a user says of the executor."""

from __future__ import annotations

from dataclasses import dataclass, field

from hardware.base import BaseLimits
from hardware.follower import FollowerSettings
from passpmp_ti import door
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.settings import Settings


@dataclass(frozen=True, slots=True, kw_only=True)
class ExecutorSettings:
    """How the executor follows, whom it believes, and when it stops."""

    period: float = 0.01
    """Time from one order to the wheels to the next [s]."""
    follower: FollowerSettings = field(default_factory=FollowerSettings)

    # when it stops at once
    bound: float = 0.08
    """The robot may be off its path beyond this [m], by the newest odometry and what it may have
    moved away since."""
    leaving_speed: float = 0.4
    """No part of the robot leaves its path faster than this [m/s]: what its wheels slip, and what
    feedback has them differ from the plan."""
    feedback_timeout: float = 0.06
    """The newest odometry is older than this [s]."""

    # when it takes no new trajectory, and carries on to rest
    planner_timeout: float = 0.3
    """Nothing came from the planner for this long [s]: more than one cycle."""
    sensor_timeout: float = 0.3
    """The sensor's newest scan is older than this [s]: more than a cycle and a scan's age."""

    # what it takes
    join: tuple[float, float, float] = (5e-3, 0.01, 0.02)
    """How far a trajectory may start from where the robot will be [m, rad, m/s of a wheel]."""
    ahead: float = 2.0
    """A trajectory may start this long after it comes [s]."""

    # rest
    rest_speed: float = 0.03
    """Wheels that are told to turn no faster than this are at rest [m/s]: odometry has noise."""
    settled_after: float = 0.2
    """The robot is taken to stand where it is once its wheels rest for this long [s]."""
    rest_late: float = 0.1
    """The robot is at rest this long after its path is, at the latest [s]."""

    # when the executor itself is gone
    runs_on: float = 1.1
    """The longest way on its last order that is put up with until the base brakes by itself [m]: no
    plan holds it, so it is no part of what is proven."""

    def __post_init__(self) -> None:
        name = "ExecutorSettings"
        if not isinstance(self.follower, FollowerSettings):
            raise ValueError(f"{name}.follower must be FollowerSettings; got {self.follower!r}")
        door.finite(name, "period", self.period, least=0.005, most=0.02, unit="s")
        for above_0 in (
            "bound", "feedback_timeout", "planner_timeout", "sensor_timeout", "ahead",
            "rest_speed", "settled_after", "rest_late", "leaving_speed", "runs_on",
        ):  # fmt: skip
            door.finite(name, above_0, getattr(self, above_0), above=0.0)
        if not isinstance(self.join, (tuple, list)) or len(self.join) != 3:
            raise ValueError(f"{name}.join must be three tolerances; got {self.join!r}")
        object.__setattr__(self, "join", tuple(self.join))
        for i, value in enumerate(self.join):
            door.finite(name, f"join[{i}]", value, least=0.0)
        if self.join[0] >= self.bound:
            raise ValueError(
                f"{name}.join[0] = {self.join[0]:g} m must be below the bound of {self.bound:g} m:"
                " a robot that joins a path is off it by as much"
            )
        if self.feedback_timeout <= self.period:
            raise ValueError(
                f"{name}.feedback_timeout = {self.feedback_timeout:g} s must be above the period"
                f" of {self.period:g} s"
            )

    @property
    def reaction(self) -> float:
        """What the robot moves away from its path from a tick that found it within `bound` to the
        effect of the next order [m]."""
        return self.leaving_speed * (self.period + self.follower.delay)

    def check_watchdog(self, limits: BaseLimits, robot: DifferentialDrive) -> None:
        """A base that hears no more goes on as it was told last until its time-out is over.

        Raises:
            ValueError: it gets too far by then.
        """
        # an order is what is planned and what feedback adds
        fastest = min(limits.wheel_speed, robot.wheel_speed + self.follower.most)
        way = fastest * limits.command_timeout
        if way > self.runs_on:
            raise ValueError(
                f"ExecutorSettings.runs_on = {self.runs_on:g} m: if the executor dies, the robot"
                f" runs on for {way:g} m, at {fastest:g} m/s for BaseLimits.command_timeout ="
                f" {limits.command_timeout:g} s, before its base brakes; shorten the base's"
                " time-out, lower the robot's wheel_speed, or put up with a longer way"
            )

    def check_margins(self, settings: Settings, *, scan_age: float) -> None:
        """What the executor allows must lie within what the planner reckons with.

        Args:
            settings: of the planner.
            scan_age: how much older than its stamp a scan may be, by the sensor itself [s].

        Raises:
            ValueError: it does not.
        """
        # to the bound by what is known, and on until the next order has an effect
        most = self.bound + self.reaction
        if most > settings.tracking_error:
            raise ValueError(
                f"ExecutorSettings.bound = {self.bound:g} m and the {self.reaction:g} m that the"
                " robot moves away before it brakes are above the planner's"
                f" Settings.tracking_error = {settings.tracking_error:g} m: the robot could leave"
                f" what was verified; raise tracking_error to {most:g} m, or lower the bound"
            )
        # who rests later than planned is hit where who comes had that much longer to come: the
        # same as if the scan were older
        late = scan_age + self.rest_late
        if late > settings.stamp_error:
            raise ValueError(
                f"Settings.stamp_error = {settings.stamp_error:g} s must hold a scan's own"
                f" {scan_age:g} s and ExecutorSettings.rest_late = {self.rest_late:g} s;"
                f" raise it to {late:g} s"
            )
        if self.planner_timeout <= settings.cycle or self.sensor_timeout <= settings.cycle:
            raise ValueError(
                "ExecutorSettings.planner_timeout and .sensor_timeout must be above the planner's"
                f" cycle of {settings.cycle:g} s; got {self.planner_timeout:g} s and"
                f" {self.sensor_timeout:g} s"
            )
