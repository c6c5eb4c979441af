"""How far a robot can get."""

from __future__ import annotations

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

    @classmethod
    def of(
        cls,
        robot: Robot,
        position: tuple[float, float],
        stamp: float,
        speed: float | None,
        within: float = 0.0,
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
        )

    def way(self, times: np.ndarray) -> np.ndarray:
        """How far from `position` a disc may be by then [m]; times absolute [s]."""
        after = np.maximum(times - self.stamp, 0.0)
        way = self.speed * after + 0.5 * self.acceleration * after**2
        return self.overhang + np.minimum(way, self.top_speed * after)
