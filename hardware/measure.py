"""Drives a base straight ahead and stops it, and tells what a robot's file asks for.

    python -m hardware.measure CONFIG --clear 6             # told to stop
    python -m hardware.measure CONFIG --clear 6 --silent    # told nothing any more

No planner, no range finder, nobody who looks: keep the way clear, and a hand on the base's own
emergency stop.
"""

from __future__ import annotations

import argparse
import importlib
import math
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hardware.base import Base, Odometry
from hardware.config import DriveConfig
from hardware.config_file import read_config
from hardware.devices import devices
from hardware.executor import LATCH
from hardware.executor_process import busy
from hardware.margins import deceleration

TICK = 0.01
"""From one order to the next [s]."""
STEADY = 1.0
"""At the speed that it is stopped from [s]."""
LOST = 0.5
"""Without odometry for so long it is not driven on [s]."""
AT_REST = 0.02
"""Wheels that turn no faster stand [m/s]."""
RESTS = 0.5
"""It has come to rest once it stands for this long [s]."""
LONGEST = 10.0
"""[s] for it to come to rest."""
HIGH, LOW = 0.8, 0.2
"""Shares of the speed between which braking is taken for even."""
CAREFUL = 2.0
"""The way that is asked for is so many times what the file's numbers make of it."""


@dataclass(frozen=True, slots=True)
class Stopped:
    """How a base came to rest."""

    speed: float
    """From which [m/s]."""
    distance: float
    """From where it was told, or told nothing any more, to where it rests [m]."""
    delay: float
    """Until it slows down, as if it braked evenly from then on [s]: lag and all."""
    took: float
    """To rest [s]."""

    @property
    def deceleration(self) -> float:
        """What braking counts for [m/s^2]."""
        return deceleration(self.speed, self.distance)


def way(config: DriveConfig, speed: float) -> float:
    """How much must be clear ahead [m]."""
    gathers = speed**2 / (2.0 * config.robot.acceleration) + speed * STEADY
    stops = speed * config.base.command_timeout + speed**2 / (2.0 * config.limits.acceleration)
    return CAREFUL * (gathers + stops)


def drive_and_stop(
    base: Base,
    speed: float,
    acceleration: float,
    *,
    silent: bool = False,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> tuple[list[Odometry], float]:
    """Gather speed, keep it, stop.

    Args:
        base: is driven, straight ahead.
        speed: that it is stopped from [m/s].
        acceleration: with which it gathers speed [m/s^2].
        silent: it is told nothing any more, instead of to stop.
        clock: seconds that never go back.
        sleep: waits for some of them.

    Returns:
        All odometry, and when it was told [s].

    Raises:
        ValueError: no odometry came, before it drove or while it did, or it did not come to rest.
    """
    known: list[Odometry] = []

    def look() -> None:
        here = base.odometry()
        if here is not None and (not known or here.stamp > known[-1].stamp):
            known.append(here)

    base.reset()
    began = clock()
    while not known:
        base.drive(0.0, 0.0)
        look()
        sleep(TICK)
        if clock() - began > STEADY:
            raise ValueError("measure: no odometry comes; is what serves the base running?")
    began = said = heard = clock()
    while (since := clock() - began) < speed / acceleration + STEADY:
        wanted = min(acceleration * since, speed)
        said = clock()
        base.drive(wanted, wanted)
        before = known[-1]
        look()
        heard = said if known[-1] is not before else heard
        sleep(TICK)
        if clock() - heard > LOST:
            raise ValueError("measure: odometry ended while it drove; it is stopped")
    # a silence begins with the last thing that was said
    told = said if silent else clock()
    while not _rests(known, told):
        if not silent:
            base.drive(0.0, 0.0)
        look()
        sleep(TICK)
        if clock() - told > LONGEST:
            raise ValueError(
                f"measure: it did not come to rest within {LONGEST:g} s"
                + ("; base.command_timeout is not what it does" if silent else "")
            )
    return known, told


def stopped(known: list[Odometry], told: float) -> Stopped:
    """What odometry says of a stop.

    Args:
        known: from before it was told until it rests.
        told: when [s].

    Raises:
        ValueError: it did not drive, or there is too little odometry.
    """
    rows = np.array(known)
    times, speeds = rows[:, 0], rows[:, 4:].mean(axis=1)
    steady = speeds[(times > told - 0.5 * STEADY) & (times <= told)]
    after = times > told
    if len(steady) < 3 or not after.any() or steady.mean() <= 2 * AT_REST:
        raise ValueError("measure: it did not drive, or too little odometry came to tell")
    speed = float(steady.mean())
    falls = np.flatnonzero(after & (speeds <= HIGH * speed))
    low = np.flatnonzero(after & (speeds <= LOW * speed))
    high_at, low_at = times[falls[0]], times[low[0]]
    # back along the line to where it had all of its speed
    begins = high_at - (low_at - high_at) * (1.0 - HIGH) / (HIGH - LOW)
    moving = np.flatnonzero(after & (np.abs(speeds) > AT_REST))
    rest = times[moving[-1]] if len(moving) else told
    x, y = (float(np.interp(told, times, rows[:, i])) for i in (1, 2))
    # stamps tell no better than to one odometry where it was then: it may have been as far back
    unsure = speed * float(np.median(np.diff(times)))
    return Stopped(
        speed=speed,
        distance=math.hypot(rows[-1, 1] - x, rows[-1, 2] - y) + unsure,
        delay=max(float(begins - told), 0.0),
        took=float(rest - told),
    )


def report(found: Stopped, *, silent: bool) -> str:
    """As lines of a robot's file."""
    if silent:
        return (
            f"from {found.speed:.2f} m/s, told nothing any more: slows down after"
            f" {found.delay:.3f} s, rests after {found.took:.2f} s and {found.distance:.3f} m\n"
            f"base:\n  command_timeout: {math.ceil(100 * found.delay) / 100:g}"
        )
    return (
        f"from {found.speed:.2f} m/s, told to stop: rests after {found.took:.2f} s and"
        f" {found.distance:.3f} m, {found.deceleration:.2f} m/s^2 all in all\n"
        f"measured:\n  braking_speed: {math.floor(100 * found.speed) / 100:g}\n"
        f"  braking_distance: {math.ceil(100 * found.distance) / 100:g}\n"
        f"  order_delay: {found.delay:.3f}   # with the wheels' lag\n  wheel_lag: 0.0"
    )


def _rests(known: list[Odometry], told: float) -> bool:
    """Whether it stands since it was told, for long enough."""
    if not known or known[-1].stamp < told + RESTS:
        return False
    late = [o for o in known if o.stamp > known[-1].stamp - RESTS]
    return all(max(abs(o.right), abs(o.left)) <= AT_REST for o in late)


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Drive a base straight ahead, stop it, and tell how it stopped.",
        epilog="example: python -m hardware.measure hardware/examples/emulated.yaml --clear 8",
    )
    parser.add_argument("config", type=Path, help="of the robot")
    parser.add_argument(
        "--clear", type=float, required=True, metavar="M", help="of clear way ahead [m]"
    )
    parser.add_argument("--speed", type=float, help="[m/s] (default: robot.wheel_speed)")
    parser.add_argument("--silent", action="store_true", help="tell it nothing, not to stop")
    given = parser.parse_args()
    try:
        config = read_config(given.config)
        speed = config.robot.wheel_speed if given.speed is None else given.speed
        if not 0.0 < speed <= config.base.wheel_speed:
            raise ValueError(
                f"measure --speed must be > 0 and <= base.wheel_speed ="
                f" {config.base.wheel_speed:g} m/s; got {speed:g}"
            )
        if not given.clear >= way(config, speed):
            raise ValueError(
                f"measure --clear = {given.clear:g} m: from {speed:g} m/s it may take"
                f" {way(config, speed):.1f} m; clear more of the way, or take a lower --speed"
            )
        if busy(config.directory):
            raise ValueError(f"an executor works in {config.directory}; end that drive first")
        if (config.directory / LATCH).exists():
            raise ValueError(
                "the emergency stop is pressed; let go of it with"
                f" python -m hardware.stop_button {config.directory} --reset"
            )
        found = _measured(config, speed, silent=given.silent)
    except (ValueError, RuntimeError) as error:
        print(error, file=sys.stderr)
        return 2
    print(report(found, silent=given.silent))
    return 0


def _measured(config: DriveConfig, speed: float, *, silent: bool) -> Stopped:
    with tempfile.TemporaryDirectory(prefix="passpmp-") as folder:
        elsewhere = replace(config, directory=Path(folder))
        with devices(elsewhere) as (_, build, options):
            module, name = build.split(":")
            base: Base = getattr(importlib.import_module(module), name)(**options)
            try:
                known, told = drive_and_stop(base, speed, config.robot.acceleration, silent=silent)
            finally:  # a Ctrl-C too
                base.close()
    return stopped(known, told)


if __name__ == "__main__":
    sys.exit(main())
