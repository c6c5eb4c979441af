"""The margins that a robot, its executor and its range finders ask of a planner: the one place
where what was measured becomes what is reckoned with."""

from __future__ import annotations

import math
from typing import Any

from hardware.executor_settings import ExecutorSettings
from passpmp_ti import door
from passpmp_ti.settings import Settings

APART = 0.0135
"""Stamps of two range finders that are joined differ by this at the most [s]."""
HASTE = 0.02
"""What a cycle needs beside planning, from the scan's stamp to the executor [s]."""
HALF_SWEEP = 0.015
"""A pose is that of a sweep's middle, as well as that is known; no beam is farther from it than
this [s]: half of `ScipSettings.stamp_error`."""
BRISK = 2.0
"""Wheels change their speed no more than so many times as fast as they were seen to brake."""


def with_margins(
    settings: Settings,
    executor: ExecutorSettings,
    *,
    cycle: float,
    localisation_error: float,
    range_noise: float,
    scan_age: float,
) -> Settings:
    """A planner's settings with the margins that the rest of the chain asks for.

    Lengths are rounded up to whole centimetres: more margin, never less.

    Args:
        settings: for the rest.
        executor: follows what is planned.
        cycle: of the planner [s].
        localisation_error: greatest error of a told pose, and of what a robot rolls in a sweep
            unless that is in its scans (`steady.py`) [m].
        range_noise: greatest error of a range [m].
        scan_age: how much older than its stamp a beam may be [s].

    Raises:
        ValueError: a cycle that leaves no time to plan, or settings that make no sense.
    """
    door.finite("margins", "cycle", cycle, above=HASTE, unit="s")
    return settings.changed(
        cycle=cycle,
        deadline=cycle - HASTE,
        tracking_error=_up(executor.bound + executor.reaction),
        localisation_error=_up(localisation_error),
        range_noise=range_noise,
        stamp_error=scan_age + executor.rest_late,
    )


def longest_guess(executor: ExecutorSettings, odometry_period: float) -> float:
    """How long after the newest odometry the robot's state may be told [s]: less was not known yet
    at times, and what is told for later than that would be in no margin.

    Args:
        executor: looks at the base in each of its periods, and tells.
        odometry_period: from one odometry to the next [s].
    """
    return odometry_period + 2.0 * executor.period


def unforeseen(change: float, duration: float) -> float:
    """How far a wheel gets by then from where it would be if it went on as it did [m].

    Args:
        change: no wheel changes its speed faster than this [m/s^2].
        duration: since it was measured [s].
    """
    return 0.5 * change * duration * duration


def executor_settings(cycle: float, **changes: Any) -> ExecutorSettings:
    """An executor that believes planner and sensor for a cycle [s] and a half, and some.

    Args:
        cycle: of the planner [s].
        changes: fields of `ExecutorSettings` on top.
    """
    silent = 1.5 * cycle + 0.15
    usual = {"planner_timeout": silent, "sensor_timeout": silent, "ahead": max(2.0, 2 * cycle)}
    return ExecutorSettings(**{**usual, **changes})


def deceleration(speed: float, distance: float) -> float:
    """How hard a robot brakes that came to rest so far from where it was told to [m/s^2].

    As if it had braked evenly all the way: what delay and lag cost is in it. So it is less than
    what the robot does once it brakes, and never more.

    Args:
        speed: when it was told [m/s].
        distance: from there to rest [m].
    """
    return speed * speed / (2.0 * distance)


def _up(length: float) -> float:
    """To the next centimetre; a length that is one already stays."""
    hundredths = 100.0 * length - 1e-9
    if not math.isfinite(hundredths):
        raise ValueError(f"margins: {length:g} m is more than can be reckoned with")
    return math.ceil(hundredths) / 100.0
