"""What a certificate says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_verify.robot import Robot
from passpmp_verify.view import Scan


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """One scan of a range finder; see wedges.Scan."""

    ranges: np.ndarray
    angle_min: float
    angle_increment: float
    range_max: float
    pose: tuple[float, float, float]
    stamp: float
    moving: np.ndarray | None


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What was seen at one instant."""

    scans: tuple[Scan, ...]
    position: tuple[float, float, float]
    """The robot's (x, y, theta) then [m, m, rad]: nobody else is where its body was."""
    clear_radius: float
    """A disc about the robot that was declared empty then [m]; 0: none."""
    on_map: bool
    """The poses are good enough for the static map to say what the beams met."""

    @property
    def stamp(self) -> float:
        """[s]"""
        return self.scans[0].stamp


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Surfaces that stay; see static_map.StaticMap."""

    occupied: np.ndarray
    resolution: float
    origin: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Assumptions:
    """What is assumed of the world and of the robot's senses; SI units."""

    object_speed: float
    object_width: float
    object_radius: float
    blind_speed: float | None
    range_noise: float
    localisation_error: float
    tracking_error: float
    stamp_error: float
    map_tolerance: float

    @property
    def margin(self) -> float:
        """What a disc must be clear of beyond its radius [m]: the robot may be off its trajectory,
        and both the scans' poses and its own may be wrong."""
        return self.tracking_error + 2 * self.localisation_error


@dataclass(frozen=True, slots=True, eq=False)
class Certificate:
    """A trajectory, and all that is needed to prove that nothing can touch it."""

    robot: Robot
    assumptions: Assumptions
    moments: tuple[Moment, ...]
    """Newest first."""
    static_map: Cells | None
    times: np.ndarray
    """[n] [s]"""
    states: np.ndarray
    """[n, 5]"""
    brakes_from: int

    @property
    def begin(self) -> float:
        """From when on the path is to be proven: all scans are older [s]."""
        return max(float(self.times[0]), self.moments[0].stamp)
