"""How far a robot can get."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from passpmp_ti.robots import Robot


@dataclass(frozen=True, slots=True)
class Reach:
    """Where the robot's discs can get to."""

    position: tuple[float, float]
    """At `stamp` [m]."""
    stamp: float
    """[s]"""
    speed: float
    """At `stamp` [m/s]."""
    acceleration: float
    """[m/s^2]"""
    top_speed: float
    """[m/s]"""
    overhang: float
    """[m]"""
    disc_speed: float
    """Greatest speed of any disc [m/s]."""
    plans_end: float
    """When the robot brakes at the latest [s]; inf: it need not."""
    longest_braking: float
    """From the top speed to rest [s]."""

    @classmethod
    def of(
        cls,
        robot: Robot,
        position: tuple[float, float],
        stamp: float,
        speed: float | None,
        within: float = 0.0,
        plans_end: float = math.inf,
    ) -> Reach:
        """Of a robot anywhere `within` metres of `position` that drives at `speed`; None: at its
        top speed."""
        return cls(
            (position[0], position[1]),
            stamp,
            robot.top_speed if speed is None else abs(speed),
            robot.deceleration,
            robot.top_speed,
            robot.overhang + within,
            robot.top_speed + robot.overhang * robot.top_turn_rate,
            plans_end,
            robot.longest_braking,
        )

    def way(self, times: np.ndarray) -> np.ndarray:
        """How far from `position` a disc may be by then [m]; times absolute [s]."""
        after = np.maximum(np.minimum(times, self.plans_end) - self.stamp, 0.0)
        way = self.speed * after + 0.5 * self.acceleration * after**2
        way = np.minimum(way, self.top_speed * after)
        # the weakest braking takes the longest from the top speed, and loses it evenly at the least
        braking = np.clip(times - self.plans_end, 0.0, self.longest_braking)
        way += self.top_speed * braking * (1 - 0.5 * braking / self.longest_braking)
        return self.overhang + way
