"""What drives: a base with two driven wheels, whoever builds it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from passpmp_ti import door
from passpmp_ti.robots import DifferentialDrive

FARTHEST = 1e9
"""No place is farther away than this [m]; there float64 still tells 0.1 um, and what is reckoned
from rounding stays small."""


class Odometry(NamedTuple):
    """Where a base is, and how fast its wheels turn, at one instant."""

    stamp: float
    """When it was measured, on this machine's monotonic clock [s]."""
    x: float
    y: float
    """Point midway between the driven wheels, in the frame that is planned in [m]."""
    theta: float
    """Heading [rad]; it may jump by whole turns."""
    right: float
    left: float
    """Ground speed of each wheel [m/s]."""

    @property
    def whole(self) -> bool:
        """Whether every number is one, and the place no farther away than any is."""
        near = abs(self.x) <= FARTHEST and abs(self.y) <= FARTHEST
        return near and all(map(math.isfinite, self))


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseLimits:
    """What a base can do, and what it does by itself."""

    wheel_speed: float = 4.16
    """Greatest ground speed of a wheel [m/s]."""
    acceleration: float = 1.6
    """How fast a wheel can change its ground speed, braking too, whatever the load [m/s^2]."""
    track: float = 0.54
    """Distance between the driven wheels [m]."""
    command_timeout: float = 0.25
    """The base brakes by itself when it was told nothing for this long [s]."""

    def __post_init__(self) -> None:
        for field in ("wheel_speed", "acceleration", "track", "command_timeout"):
            door.finite("BaseLimits", field, getattr(self, field), above=0.0)


class Base(Protocol):
    """A base as the executor sees it.

    No call waits for the device, and none raises because of it: a base that is silent is one whose
    odometry grows old.
    """

    @property
    def limits(self) -> BaseLimits:
        """What it can do."""

    def drive(self, right: float, left: float) -> None:
        """Bring the wheels to these ground speeds [m/s] as fast as it can.

        They hold until the next call, or until `limits.command_timeout` is over: it then brakes as
        hard as it can. Numbers that are not finite change nothing, as if nothing had been said.
        """

    def odometry(self) -> Odometry | None:
        """The newest one; None before any came."""

    def stop(self) -> None:
        """Brake as hard as it can, and stay so whatever `drive` says, until `reset`.

        This is the executor's. A button on the base itself is let go by hand, not by `reset`.
        """

    def reset(self) -> None:
        """Obey `drive` again."""

    def close(self) -> None:
        """Brake and let go of the device."""


def wheels_of(speed: float, turn_rate: float, track: float) -> tuple[float, float]:
    """(right, left) ground speeds [m/s] of a speed [m/s] and a turn rate [rad/s]; eq. 23."""
    half = 0.5 * track * turn_rate
    return speed + half, speed - half


def twist_of(right: float, left: float, track: float) -> tuple[float, float]:
    """(speed [m/s], turn rate [rad/s]) of the wheels' ground speeds [m/s]; eq. 23."""
    return 0.5 * (right + left), (right - left) / track


def check_fits(limits: BaseLimits, robot: DifferentialDrive) -> None:
    """The base must do all that is planned for the robot.

    Raises:
        ValueError: it cannot.
    """
    for field, unit in (("wheel_speed", "m/s"), ("acceleration", "m/s^2")):
        can, planned = getattr(limits, field), getattr(robot, field)
        if can < planned:
            raise ValueError(
                f"BaseLimits.{field} = {can:g} {unit} is below the robot's {planned:g} {unit}:"
                " plans would ask for more than the base can do; lower the robot's, by a tenth"
                " more, which is what is left for steering back to the plan"
            )
    if abs(limits.track - robot.track) > 1e-6:
        raise ValueError(
            f"BaseLimits.track = {limits.track:g} m is not the robot's {robot.track:g} m"
        )
