"""A robot in full: its range finders, its base, what was measured of it, and where it shall go."""

from __future__ import annotations

import math
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hardware.base import BaseLimits, check_fits
from hardware.config_parts import BaseConfig, Emulated, Lidar, Measured
from hardware.executor_settings import ExecutorSettings
from hardware.follower import FollowerSettings
from hardware.margins import (
    APART,
    BRISK,
    HALF_SWEEP,
    executor_settings,
    longest_guess,
    unforeseen,
    with_margins,
)
from hardware.merge import check_stamp_error, needed_stamp_error
from hardware.scip_settings import ScipSettings
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.settings import Settings

FOR_STEERING = 0.9
"""Share of the measured braking that may be planned with; the rest steers back to the plan."""
RESERVE = 1.5
"""The executor lets the robot off its path by so much more than was ever measured."""
LEAST_BOUND = 0.02
"""[m]; odometry itself has noise."""
LOST_ODOMETRY = 3
"""Odometries that may be missing before the executor calls the base silent."""
FIELD_OF_VIEW = math.radians(270.0)
"""Of a UST-10LX; `HALF_SWEEP` is of such a device too."""
MARGINS = ("tracking_error", "localisation_error", "range_noise", "stamp_error", "deadline")
"""Fields of `Settings` that come of what was measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveConfig:
    """All that `passpmp drive CONFIG` needs to know, checked as a whole."""

    name: str
    robot: DifferentialDrive
    lidars: tuple[Lidar, ...]
    base: BaseConfig
    measured: Measured
    planner: Settings
    """As the file has them, without margins."""
    goals: tuple[tuple[float, float], ...]
    """[m], one after another."""
    map: Path | None = None
    """A map_server file of what stays."""
    directory: Path
    """Of the executor's sockets."""
    button: Path | None = None
    """An input device any key of which stops the robot; None: only `hardware.stop_button` does."""
    emulated: Emulated | None = None

    def __post_init__(self) -> None:
        if not 1 <= len(self.lidars) <= 2:
            raise ValueError(
                f"lidars must list one range finder or two; got {len(self.lidars)}: stamps of more"
                " are not known to lie near enough to each other"
            )
        if not self.goals:
            raise ValueError("goals must hold at least one point [x, y]")
        self._check_devices()
        self._check_braking()
        self._check_view()
        executor, planner = self.executor_settings, self.planner_settings
        executor.check_margins(planner, scan_age=self.scan_age)
        check_fits(self.limits, self.robot)
        executor.check_watchdog(self.limits, self.robot)
        check_stamp_error(planner, self._scips, self.apart)
        self.base_options()

    @property
    def limits(self) -> BaseLimits:
        """Of the base, with the braking that was measured."""
        return BaseLimits(
            wheel_speed=self.base.wheel_speed,
            acceleration=self.measured.deceleration,
            track=self.robot.track,
            command_timeout=self.base.command_timeout,
        )

    @property
    def apart(self) -> float:
        """Stamps of scans of one instant differ by this at the most [s]."""
        return APART if len(self.lidars) > 1 else 0.0

    @property
    def scan_age(self) -> float:
        """How much older than its stamp a beam may be [s]."""
        return needed_stamp_error(self._scips, self.apart)

    @property
    def executor_settings(self) -> ExecutorSettings:
        """The executor's, with what was measured."""
        m = self.measured
        usual = executor_settings(self.planner.cycle)
        return executor_settings(
            self.planner.cycle,
            # an order is kept for a period, half of it on average
            follower=FollowerSettings(
                wheel_lag=m.wheel_lag, delay=m.order_delay + 0.5 * usual.period
            ),
            bound=max(RESERVE * m.tracking_error, LEAST_BOUND),
            feedback_timeout=max(usual.feedback_timeout, LOST_ODOMETRY * self.base.odometry_period),
            rest_late=m.rest_late,
            runs_on=self.base.runs_on,
        )

    @property
    def guess(self) -> float:
        """How long after the newest odometry the robot's state may be told [s]."""
        return longest_guess(self.executor_settings, self.base.odometry_period)

    @property
    def heading_error(self) -> float:
        """Greatest error of a range finder's heading [rad]: that of what is told, and what the
        robot turned otherwise than its wheels said since."""
        return self.measured.heading_error + 2.0 * self._unforeseen / self.robot.track

    @property
    def _unforeseen(self) -> float:
        """What a wheel does otherwise than it did at the newest odometry, until a sweep's first or
        last beam is measured [m]."""
        # wheels may change faster than they surely brake: a measured distance has delays in it
        return unforeseen(BRISK * self.limits.acceleration, self.guess + HALF_SWEEP)

    @property
    def planner_settings(self) -> Settings:
        """The planner's, with the margins of what was measured. What the robot moves and turns in a
        sweep, and the error of its heading, is taken from the scans themselves (`steady.py`); what
        that error moves of the body, the centres of its discs, is of the place."""
        m = self.measured
        swung = self.robot.overhang * self.heading_error
        return with_margins(
            self.planner,
            self.executor_settings,
            cycle=self.planner.cycle,
            localisation_error=m.localisation_error + self._unforeseen + swung,
            range_noise=max(lidar.range_noise for lidar in self.lidars),
            scan_age=self.scan_age,
        )

    def base_options(self) -> dict[str, Any]:
        """What the base is made with."""
        return self.base.made_by.options(self.base.fields, self.limits)

    @property
    def _scips(self) -> list[ScipSettings]:
        """Of an emulated one only what any device has."""
        return [lidar.scip or ScipSettings(host="127.0.0.1") for lidar in self.lidars]

    def _check_devices(self) -> None:
        if self.emulated is not None and self.base.kind != "simulated":
            raise ValueError(
                f"base.kind must be simulated where `emulated` has a world, since what range"
                f" finders see there must move with the base; got {self.base.kind!r}; leave"
                " `emulated` out for real devices"
            )
        for n, lidar in enumerate(self.lidars):
            if lidar.scip is None and self.emulated is None:
                raise ValueError(
                    f"lidars[{n}].host is missing: give the device's address, 192.168.0.10 as it is"
                    " delivered, or a world with `emulated: {scenario: corridor_person}`"
                )
            if lidar.scip is not None and self.emulated is not None:
                raise ValueError(
                    f"lidars[{n}].host = {lidar.scip.host!r} with `emulated`: a real range finder"
                    " does not see a world that is none; leave one of the two out"
                )
        if self.emulated is not None and self.emulated.walls_known and self.map is not None:
            raise ValueError(
                "map with emulated.walls_known: there is one map of what stays; leave one of the"
                " two out"
            )
        if len({lidar.name for lidar in self.lidars}) < len(self.lidars):
            raise ValueError("lidars[1].name is that of the other; give each its own")

    def _check_braking(self) -> None:
        m, most = self.measured, FOR_STEERING * self.measured.deceleration
        if self.robot.acceleration > most:
            raise ValueError(
                f"robot.acceleration = {self.robot.acceleration:g} m/s^2 must be <= {most:.3g}:"
                f" measured.braking_distance = {m.braking_distance:g} m from"
                f" measured.braking_speed = {m.braking_speed:g} m/s is {m.deceleration:.3g} m/s^2,"
                " and a tenth of it is for steering back to the plan; lower robot.acceleration"
            )
        if self.robot.wheel_speed > m.braking_speed:
            raise ValueError(
                f"robot.wheel_speed = {self.robot.wheel_speed:g} m/s is above"
                f" measured.braking_speed = {m.braking_speed:g} m/s: nobody saw it brake from"
                " there; measure at the speed that is planned with, or lower robot.wheel_speed"
            )

    @property
    def looks_all_round(self) -> bool:
        """Whether every bearing is covered by a range finder."""
        headings = [lidar.mount[2] for lidar in self.lidars]
        # the middle between two of them, on the wide side, is where neither may look
        apart = abs(math.remainder(headings[-1] - headings[0], math.tau))
        return len(headings) > 1 and math.pi - 0.5 * apart < 0.5 * FIELD_OF_VIEW

    def _check_view(self) -> None:
        blind = self.planner.blind_speed
        if self.looks_all_round or (blind is not None and blind < self.planner.object_speed):
            return
        raise ValueError(
            "planner.blind_speed is missing: the range finders do not look all round, and out"
            " of bearings that none covers anything may come, so the robot would never move;"
            " add a second one behind, or bound what is there with planner.blind_speed and"
            " planner.clear_radius (docs/add-a-sensor.md, blind sectors)"
        )


def usual_directory(name: str = "passpmp") -> Path:
    """Where the executor's sockets are unless the file says so.

    Args:
        name: of those who share it; there is one executor to a directory.
    """
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    if runtime:
        return Path(runtime) / name
    return Path(tempfile.gettempdir()) / f"{name}-{os.geteuid()}"
