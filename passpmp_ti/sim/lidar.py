"""A planar range finder in the simulated world."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from passpmp_ti import door
from passpmp_ti.kernels.raycast import MOVING, cast_rays
from passpmp_ti.scan import Scan
from passpmp_ti.sim.world import World

LABELS = ("sensor", "none")
FAR = 1e6  # stands in where there is nothing to hit, beyond any range [m]


@dataclass(frozen=True, kw_only=True)
class Lidar:
    """Where a range finder sits and what it can see."""

    range_max: float
    """[m]."""
    beams: int
    """Beams of a sweep."""
    field_of_view: float = 2 * math.pi
    """[rad]; a full turn has beams / 2 pi apart, less has one beam at either end."""
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """(x, y, theta) of the sensor on the robot [m, m, rad]."""
    noise: float = 0.0
    """Standard deviation of a range [m]; errors are cut at three of them."""
    labels: str = "none"
    """"sensor": a return tells whether its surface may move; "none": every surface may."""

    def __post_init__(self) -> None:
        name = "Lidar"
        door.finite(name, "range_max", self.range_max, above=0.0, unit="m")
        door.whole(name, "beams", self.beams, least=2)
        door.finite(
            name,
            "field_of_view",
            self.field_of_view,
            above=0.0,
            most=2 * math.pi + 1e-9,
            unit="rad",
        )
        door.array(name, "mount", self.mount, (3,))
        door.finite(name, "noise", self.noise, least=0.0, unit="m")
        door.choice(name, "labels", self.labels, LABELS)

    @property
    def greatest_error(self) -> float:
        """Bound on the error of a range [m]: what `Settings.range_noise` must be at least."""
        return 3.0 * self.noise

    @property
    def bearings(self) -> np.ndarray:
        """[beams] bearings in the sensor's frame [rad]."""
        return self._first + self._increment * np.arange(self.beams)

    @property
    def _increment(self) -> float:
        closed = self.field_of_view >= 2 * math.pi - 1e-9
        return self.field_of_view / (self.beams if closed else self.beams - 1)

    @property
    def _first(self) -> float:
        return -0.5 * self._increment * (self.beams - 1)

    def pose(self, robot_pose: np.ndarray) -> tuple[float, float, float]:
        """(x, y, theta) in the world of the sensor on a robot at (x, y, theta, ...)."""
        x, y, theta = (float(v) for v in np.asarray(robot_pose)[:3])
        mx, my, turn = self.mount
        c, s = math.cos(theta), math.sin(theta)
        return (x + c * mx - s * my, y + s * mx + c * my, theta + turn)

    def scan(
        self,
        world: World,
        robot_pose: np.ndarray,
        stamp: float,
        generator: np.random.Generator | None = None,
    ) -> Scan:
        """One sweep, all of it at the instant `stamp`.

        A sensor inside an object sees nothing: all its beams are lost.

        Args:
            world: what is there.
            robot_pose: (x, y, theta, ...) of the robot [m, m, rad].
            stamp: absolute time [s].
            generator: draws the errors of the ranges; needed where `noise` > 0.

        Raises:
            ValueError: noise without a generator.
        """
        if self.noise > 0 and generator is None:
            raise ValueError("Lidar.scan: noise > 0 needs a numpy Generator; pass generator=")
        pose = self.pose(robot_pose)
        labelled = self.labels == "sensor"
        if world.holds(np.array(pose[:2]), stamp):
            ranges = np.full(self.beams, np.nan)
            moving = np.ones(self.beams, dtype=bool)
        else:
            ranges, moving = self._cast(world, pose, stamp)
            if self.noise > 0 and generator is not None:
                error = generator.normal(0.0, self.noise, self.beams)
                limit = self.greatest_error
                # a return stays a return: an error neither loses a beam nor adds one
                ranges = np.where(
                    np.isfinite(ranges),
                    np.clip(
                        ranges + np.clip(error, -limit, limit),
                        1e-6,
                        np.nextafter(self.range_max, 0.0),
                    ),
                    ranges,
                )
        return Scan(
            ranges,
            angle_min=self._first,
            angle_increment=self._increment,
            range_max=self.range_max,
            pose=pose,
            stamp=stamp,
            moving=moving if labelled else None,
        )

    def _cast(
        self, world: World, pose: tuple[float, float, float], stamp: float
    ) -> tuple[np.ndarray, np.ndarray]:
        bearings = pose[2] + self.bearings
        rays = np.stack([np.cos(bearings), np.sin(bearings)], axis=1).astype(np.float32)
        place = np.array(pose[:2])
        ranges = np.empty(self.beams, dtype=np.float32)
        met = np.empty(self.beams, dtype=np.uint8)
        cast_rays(rays, self._segments(world, place), self._discs(world, place, stamp), ranges, met)
        found = ranges.astype(np.float64)
        # a surface at the very sensor is still a return
        found = np.where(found < self.range_max, np.maximum(found, 1e-6), np.inf)
        return found, (met == MOVING) & np.isfinite(found)

    def _segments(self, world: World, place: np.ndarray) -> np.ndarray:
        own = world.outline - np.tile(place, 2)
        low = np.minimum(own[:, :2], own[:, 2:])
        high = np.maximum(own[:, :2], own[:, 2:])
        near = ((low < self.range_max) & (high > -self.range_max)).all(axis=1)
        if not near.any():
            return np.array([[FAR, FAR, FAR, FAR]], dtype=np.float32)
        return np.ascontiguousarray(own[near], dtype=np.float32)

    def _discs(self, world: World, place: np.ndarray, stamp: float) -> np.ndarray:
        own = world.movers.at(stamp) - place
        radius = world.movers.radius
        near = world.movers.present(stamp) & (np.hypot(*own.T) < self.range_max + radius)
        if not near.any():
            return np.array([[FAR, FAR, 1e-3]], dtype=np.float32)
        return np.ascontiguousarray(
            np.concatenate([own[near], radius[near, None]], axis=1), dtype=np.float32
        )
