"""The parts of a robot's file: range finders, base, what was measured, a world that is none."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from hardware.base_kinds import KINDS, BaseKind
from hardware.margins import deceleration
from hardware.scip_settings import ScipSettings
from passpmp_ti import door


@dataclass(frozen=True, slots=True, kw_only=True)
class Lidar:
    """A range finder on the robot."""

    name: str
    """For people: "front", "rear"."""
    scip: ScipSettings | None
    """How it is reached; None: it is emulated."""
    mount: tuple[float, float, float]
    """(x, y, theta) on the robot, from midway between its driven wheels [m, m, rad]."""
    range_max: float = 10.0
    """How far it is believed [m]."""
    range_noise: float = 0.04
    """Greatest error of a range [m]; a UST-10LX's data sheet has 40 mm."""

    def __post_init__(self) -> None:
        door.array(f"lidar {self.name}", "mount", self.mount, (3,))
        door.finite(f"lidar {self.name}", "range_max", self.range_max, above=0.0, unit="m")
        door.finite(f"lidar {self.name}", "range_noise", self.range_noise, least=0.0, unit="m")

    def pose(self, robot: Any) -> tuple[float, float, float]:
        """(x, y, theta) in the world of the sensor on a robot at (x, y, theta, ...)."""
        x, y, theta = (float(v) for v in robot[:3])
        mx, my, turn = self.mount
        c, s = math.cos(theta), math.sin(theta)
        return x + c * mx - s * my, y + s * mx + c * my, theta + turn


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What somebody measured of the robot; docs/on-your-robot.md tells how. Each is the worst that
    was seen on the worst floor, with the heaviest load, never a mean."""

    braking_speed: float
    """Speed at which it was told to stop [m/s]."""
    braking_distance: float
    """From where it was told to where it came to rest [m]."""
    order_delay: float
    """From an order to its effect [s]."""
    wheel_lag: float = 0.05
    """Time constant of the wheels' answer [s]."""
    tracking_error: float
    """Farthest off its path that it was [m]."""
    rest_late: float = 0.1
    """Longest that it rested after its path did [s]."""
    localisation_error: float
    """Greatest error of the told place [m]."""
    heading_error: float
    """Greatest error of the told heading [rad]."""

    def __post_init__(self) -> None:
        for above_0 in ("braking_speed", "braking_distance", "tracking_error", "rest_late"):
            door.finite("measured", above_0, getattr(self, above_0), above=0.0)
        for least_0 in ("order_delay", "wheel_lag", "localisation_error", "heading_error"):
            door.finite("measured", least_0, getattr(self, least_0), least=0.0)

    @property
    def deceleration(self) -> float:
        """How hard it brakes [m/s^2]."""
        return deceleration(self.braking_speed, self.braking_distance)


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseConfig:
    """What drives the robot."""

    kind: str
    """A name in `base_kinds.KINDS`."""
    fields: Mapping[str, Any] = field(default_factory=dict)
    """What that kind asks for."""
    wheel_speed: float
    """Greatest ground speed of a wheel [m/s]."""
    command_timeout: float
    """It brakes by itself when it was told nothing for this long [s]."""
    runs_on: float
    """The longest way on its last order that is put up with if the executor dies [m]."""
    odometry_period: float = 0.01
    """Time from one odometry to the next [s]."""

    def __post_init__(self) -> None:
        door.choice("base", "kind", self.kind, KINDS)
        for above_0 in ("wheel_speed", "command_timeout", "runs_on", "odometry_period"):
            door.finite("base", above_0, getattr(self, above_0), above=0.0)

    @property
    def made_by(self) -> BaseKind:
        """Its kind."""
        return KINDS[self.kind]


@dataclass(frozen=True, slots=True, kw_only=True)
class Emulated:
    """A world that is none, for range finders without an address and a simulated base."""

    scenario: str
    """Its walls and movers: a shipped name, or a file."""
    seed: int = 0
    walls_known: bool = False
    """The planner gets what stands there as a map; False: all that is seen may move."""
