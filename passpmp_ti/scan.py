"""One sweep of a range finder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti import door


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """What a planar range finder saw at one instant.

    A range is the distance [m] to the first surface along its bearing. `inf`, or anything at or
    beyond `range_max`, means that nothing returned within `range_max`. `nan`, zero and negative
    values mean that the beam was lost: its bearing is unseen.
    """

    ranges: np.ndarray
    """[n] float64 [m]."""
    angle_min: float
    """Bearing of beam 0 in the sensor's frame [rad]; beam i looks along angle_min + i increment."""
    angle_increment: float
    """Bearing between neighbouring beams [rad], > 0 (counter-clockwise)."""
    range_max: float
    """[m]."""
    pose: tuple[float, float, float]
    """(x, y, theta) of the sensor in the world [m, m, rad]."""
    stamp: float
    """Absolute time of the sweep [s]."""
    moving: np.ndarray | None = None
    """[n] bool: True where the surface hit may move. None: every surface may."""

    def __post_init__(self) -> None:
        ranges = np.array(self.ranges, dtype=np.float64)
        if ranges.ndim != 1 or len(ranges) < 2:
            raise ValueError(f"Scan.ranges must have shape (n,), n >= 2; got {ranges.shape}")
        ranges.setflags(write=False)
        object.__setattr__(self, "ranges", ranges)
        set_ = object.__setattr__
        set_(self, "angle_min", door.finite("Scan", "angle_min", self.angle_min, unit="rad"))
        set_(
            self,
            "angle_increment",
            door.finite("Scan", "angle_increment", self.angle_increment, above=0.0, unit="rad"),
        )
        set_(self, "range_max", door.finite("Scan", "range_max", self.range_max, above=0, unit="m"))
        set_(self, "stamp", door.finite("Scan", "stamp", self.stamp, unit="s"))
        x, y, theta = door.array("Scan", "pose", self.pose, (3,))
        set_(self, "pose", (float(x), float(y), float(theta)))
        span = (len(ranges) - 1) * self.angle_increment
        if span > 2 * np.pi + 1e-6:
            raise ValueError(
                f"Scan: {len(ranges)} beams of {self.angle_increment:g} rad span {span:.4f} rad;"
                " a sweep covers at most 2 pi"
            )
        if self.moving is not None:
            moving = np.array(self.moving)
            if moving.shape != ranges.shape or moving.dtype != np.bool_:
                raise ValueError(
                    f"Scan.moving must be bool of shape {ranges.shape};"
                    f" got {moving.dtype} {moving.shape}"
                )
            moving.setflags(write=False)
            set_(self, "moving", moving)

    @property
    def bearings(self) -> np.ndarray:
        """[n] bearings in the world's frame [rad]."""
        n = len(self.ranges)
        return self.pose[2] + self.angle_min + self.angle_increment * np.arange(n)

    @property
    def returned(self) -> np.ndarray:
        """[n] bool: a surface was hit within `range_max`."""
        with np.errstate(invalid="ignore"):
            return (self.ranges > 0) & (self.ranges < self.range_max)

    @property
    def lost(self) -> np.ndarray:
        """[n] bool: the beam says nothing."""
        with np.errstate(invalid="ignore"):
            return ~(self.ranges > 0)

    def points(self) -> np.ndarray:
        """[m, 2] world positions of the returns [m]."""
        hit = self.returned
        r, a = self.ranges[hit], self.bearings[hit]
        return np.stack([self.pose[0] + r * np.cos(a), self.pose[1] + r * np.sin(a)], axis=1)
