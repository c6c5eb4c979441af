"""How a robot with two driven wheels keeps to its path."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from hardware.base import BaseLimits, Odometry, twist_of, wheels_of
from hardware.path import Place
from passpmp_ti import door


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerSettings:
    """Feed-forward by the plan and a wheel's answer, feedback by where the robot is."""

    wheel_lag: float = 0.05
    """Time constant of the wheels' first-order answer to a command [s]."""
    delay: float = 0.01
    """From an order to its effect [s]: half a period that it is kept, and the way there."""
    along: float = 2.5
    """Speed for each metre that the robot lags behind [1/s]."""
    across: float = 12.0
    """Turn for each metre beside the path and metre of way, at low speed [1/m^2]."""
    swing: float = 3.5
    """Fastest that it swings back to the path [rad/s]; `across` is less where that asks for it."""
    turning: float = 5.0
    """Turn rate for each radian that the heading is off [1/s]."""
    most: float = 0.4
    """Greatest change to a wheel's planned speed by feedback [m/s]."""

    def __post_init__(self) -> None:
        name = "FollowerSettings"
        for field in ("along", "across", "turning", "most", "wheel_lag", "delay"):
            door.finite(name, field, getattr(self, field), least=0.0)
        door.finite(name, "swing", self.swing, above=0.0)


def moved_on(odometry: Odometry, time: float, track: float) -> Odometry:
    """Where the base will be at `time` [s] if its wheels go on as they do."""
    ahead = time - odometry.stamp
    speed, turn_rate = twist_of(odometry.right, odometry.left, track)
    middle = odometry.theta + 0.5 * turn_rate * ahead
    if not math.isfinite(middle):
        middle = math.nan  # a broken odometry's; infinity has no cosine, and would raise
    c, sine = math.cos(middle), math.sin(middle)
    return odometry._replace(
        stamp=time,
        x=odometry.x + speed * ahead * c,
        y=odometry.y + speed * ahead * sine,
        theta=odometry.theta + turn_rate * ahead,
    )


def error_of(odometry: Odometry, place: Place, overhang: float) -> float:
    """How far any disc's centre of the body is from where the path has it [m], at the most.

    Args:
        odometry: where the robot is.
        place: where the path is at `odometry.stamp`.
        overhang: greatest distance of a disc's centre from the reference point [m].
    """
    apart = math.hypot(odometry.x - place.x, odometry.y - place.y)
    turned = abs(math.remainder(odometry.theta - place.theta, math.tau))
    # a centre swings by a chord, and no chord is longer than its arc
    return apart + overhang * turned


def wheel_speeds(
    odometry: Odometry,
    at: Callable[[float], Place],
    time: float,
    limits: BaseLimits,
    settings: FollowerSettings,
) -> tuple[float, float]:
    """Wheel speeds that keep the robot on its path.

    Feed-forward inverts the wheels' lag: v + lag dv/dt. Feedback is that of Samson for a unicycle:
    along the path in proportion, across it in proportion to the way, and by the heading.

    Args:
        odometry: the newest.
        at: the path, by time.
        time: now [s].
        limits: of the base.
        settings: gains.

    Returns:
        (right, left) [m/s], within the limits; NaN where the odometry's numbers are too great to
        reckon with. Zeros where the path is at rest, so that the robot
        rests when it was proven to, not when it is where it should be.

    Source: C. Samson, "Control of chained systems: application to path following and time-varying
    point-stabilization of mobile robots", IEEE Trans. Automatic Control 40(1), 1995.
    """
    s = settings
    ahead = at(time + s.delay)
    if ahead[3:] == (0.0, 0.0, 0.0, 0.0):
        return 0.0, 0.0
    here, wanted = moved_on(odometry, time, limits.track), at(time)
    if not math.isfinite(here.theta):
        return math.nan, math.nan  # no angle has a cosine that is as great
    c, sine = math.cos(here.theta), math.sin(here.theta)
    dx, dy = wanted.x - here.x, wanted.y - here.y
    along, across = c * dx + sine * dy, c * dy - sine * dx
    off = math.remainder(wanted.theta - here.theta, math.tau)
    speed, _ = twist_of(wanted.right, wanted.left, limits.track)
    # a quotient by next to nothing has no square
    stiffness = min(math.sqrt(s.across), s.swing / abs(speed)) ** 2 if speed else 0.0
    straight = math.sin(off) / off if off else 1.0
    correction = wheels_of(
        s.along * along, stiffness * speed * straight * across + s.turning * off, limits.track
    )
    if not all(map(math.isfinite, correction)):
        return math.nan, math.nan  # a limit would make a number of it
    planned = (
        _leading(s.wheel_lag, ahead.right, ahead.right_rate),
        _leading(s.wheel_lag, ahead.left, ahead.left_rate),
    )
    right, left = (
        _within(limits.wheel_speed, p + _within(s.most, e))
        for p, e in zip(planned, correction, strict=True)
    )
    return right, left


def _leading(lag: float, speed: float, rate: float) -> float:
    """The order by which a wheel with this lag has this speed now; never one against the way it
    turns: if the next order came late, the end of braking would become a way back."""
    order = speed + lag * rate
    return 0.0 if order * speed < 0.0 else order


def _within(most: float, value: float) -> float:
    return max(-most, min(most, value))
