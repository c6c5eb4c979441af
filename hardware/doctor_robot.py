"""What a robot's file names: does it answer, and as it should?"""

from __future__ import annotations

import importlib
import math
import os
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hardware.base import Base
from hardware.complaints import advice
from hardware.config import DriveConfig
from hardware.config_parts import Lidar
from hardware.devices import devices
from hardware.doctor_finding import FAIL, OK, WARN, Finding
from hardware.executor import LATCH
from hardware.executor_process import busy, check_private
from hardware.letterbox import LONGEST_NAME
from hardware.scip_client import ScipClient
from hardware.scip_settings import ScipSettings

LISTEN = 2.5
"""To a range finder [s]."""
ASK = 1.0
"""A base, for its odometry [s]."""
TICK = 0.01
"""[s]"""
SLOW = 0.9
"""Share of the scans that a device promises, below which something is wrong."""
OFTEN = 0.05
"""Share of sweeps, above which a fault is worth a word."""
LOST = 0.2
"""Share of lost beams, above which the robot sees little."""
LONGEST_SOCKET = 30
"""[bytes] of the longest name of a socket in the directory."""


def robot(config: DriveConfig) -> Iterator[Finding]:
    """All of it, one by one. Nothing moves: a base is told to stand."""
    yield directory(config.directory)
    yield button(config)
    if config.map is not None:
        yield map_of(config)
    if busy(config.directory):
        yield Finding(
            "devices", WARN, f"an executor works in {config.directory}",
            "they are not asked while somebody drives; end that drive first",
        )  # fmt: skip
        return
    with tempfile.TemporaryDirectory(prefix="passpmp-") as folder:
        elsewhere = replace(config, directory=Path(folder))
        try:
            with devices(elsewhere) as (settings, build, options):
                for lidar, one in zip(config.lidars, settings, strict=True):
                    yield range_finder(lidar, one)
                yield driven(config, build, options)
        except RuntimeError as cause:
            yield Finding("devices", FAIL, str(cause))


def driven(config: DriveConfig, build: str, options: Mapping[str, Any]) -> Finding:
    """A base that is made as the executor makes it, and asked."""
    module, name = build.split(":")
    try:
        one: Base = getattr(importlib.import_module(module), name)(**options)
    except (ValueError, OSError) as cause:
        return Finding(f"base {config.base.kind}", FAIL, str(cause))
    except (ImportError, AttributeError) as cause:
        return Finding(
            f"base {config.base.kind}", FAIL, str(cause), "install what this kind of base needs"
        )
    return base(config, one)


def directory(path: Path) -> Finding:
    """Of the executor's sockets."""
    longest = len(os.fsencode(path)) + LONGEST_SOCKET
    if longest > LONGEST_NAME:
        return Finding(
            "directory", FAIL, f"{path} is too long a name for sockets",
            "take a directory nearer to the root",
        )  # fmt: skip
    if not path.exists():
        parent = next((p for p in path.parents if p.exists()), Path("/"))
        if not os.access(parent, os.W_OK):
            return Finding(
                "directory", FAIL, f"{path} cannot be made", "name one that this user may make"
            )
        return Finding("directory", OK, f"{path} will be made")
    try:
        check_private(path)
    except ValueError as problem:
        return Finding("directory", FAIL, str(problem))
    return Finding("directory", OK, f"{path}, for this user only")


def button(config: DriveConfig) -> Finding:
    """The device of the stop button, if there is one."""
    by_hand = f"python -m hardware.stop_button {config.directory}"
    if (config.directory / LATCH).exists():
        return Finding(
            "stop button", FAIL, "it was pressed, and still is", f"let go of it: {by_hand} --reset"
        )
    if config.button is None:
        return Finding("stop button", OK, f"no device; {by_hand} stops it")
    if not os.access(config.button, os.R_OK):
        return Finding(
            "stop button", FAIL, f"{config.button} cannot be read",
            "is it plugged in, and this user in the group `input`?",
        )  # fmt: skip
    return Finding("stop button", OK, f"{config.button} can be read; {by_hand} stops it too")


def map_of(config: DriveConfig) -> Finding:
    """What is known to stay."""
    from passpmp_ti.grid.static_map import StaticMap

    assert config.map is not None
    try:
        known = StaticMap.load(config.map)
    except ValueError as problem:
        return Finding("map", FAIL, str(problem), "docs/add-a-sensor.md tells what it may be")
    rows, columns = known.occupied.shape
    size = f"{columns * known.resolution:.1f} x {rows * known.resolution:.1f} m"
    return Finding("map", OK, f"{config.map}: {size}, {int(known.occupied.sum())} cells that stay")


def range_finder(lidar: Lidar, settings: ScipSettings) -> Finding:
    """Whether it connects, what it is, how often it comes, and how old."""
    what = f"lidar {lidar.name}"
    where = f"{settings.host}:{settings.port}"
    ages, lost, returns = [], 0, 0
    with ScipClient(settings) as client:
        until, began = time.monotonic() + LISTEN, math.inf
        while (left := until - time.monotonic()) > 0:
            try:
                scan = client.read(min(left, 0.1))
            except ValueError as problem:
                return Finding(what, FAIL, f"{where}: {problem}", "change what its section asks")
            if scan is not None:
                now = time.monotonic()
                began = min(began, now)
                ages.append(now - scan.stamp)
                lost += int(scan.lost.sum())
                returns += int(scan.returned.sum())
        session, counters = client.session, client.counters
        if not ages or session is None or session.parameters is None or session.clock is None:
            trouble = client.trouble or "it is connected, and no sweep came"
            return Finding(what, FAIL, f"{where}: {trouble}", advice(settings, trouble))
        parameters, clock = session.parameters, session.clock
    # those that this loop was too slow for count too: they came
    rate = (counters.scans - 1) / max(until - began, 1e-3)
    promised = 1.0 / (parameters.period * (settings.skip + 1))
    beams = parameters.steps * len(ages)
    told = (
        f"{where}: {parameters.model}, {rate:.1f} of {promised:.1f} scans/s, clocks compared to"
        f" {1e3 * clock.width:.1f} ms, scans {1e3 * float(np.median(ages)):.0f} ms old when they"
        f" are there, {100 * returns / beams:.0f} % of beams return"
    )
    swept = max(counters.sweeps, 1)
    if rate < SLOW * promised:
        return Finding(
            what, WARN, told,
            "fewer scans than it promises: is the network shared, does another program poll it?",
        )  # fmt: skip
    if counters.unsure > OFTEN * swept or counters.late > OFTEN * swept:
        return Finding(
            what, WARN, told + f"; {counters.unsure} without a sure stamp, {counters.late} late",
            "this machine or the network is too busy for it: give the planner a priority",
        )  # fmt: skip
    if counters.bad_sums or counters.garbled:
        return Finding(
            what, WARN, told + f"; {counters.bad_sums + counters.garbled} replies broken",
            "look at cable and plugs",
        )  # fmt: skip
    if lost > LOST * beams:
        return Finding(
            what, WARN, told + f"; {100 * lost / beams:.0f} % of beams are lost",
            "clean the window, and see with python -m hardware.scip_look which codes come",
        )  # fmt: skip
    return Finding(what, OK, told)


def base(config: DriveConfig, one: Base) -> Finding:
    """Whether it says where it stands, and how often; it is told to stand."""
    what = f"base {config.base.kind}"
    where = config.base.made_by.reach(config.base.fields)
    stamps: list[float] = []
    wrong = ""
    newest = None
    try:
        until = time.monotonic() + ASK
        while time.monotonic() < until:
            one.drive(0.0, 0.0)
            newest = one.odometry() or newest
            if newest is not None and (not stamps or newest.stamp > stamps[-1]):
                stamps.append(newest.stamp)
                if not newest.whole:
                    wrong = "its odometry has numbers that are none"
            time.sleep(TICK)
        if not stamps or newest is None:
            return Finding(
                what, FAIL, f"{where}: no odometry within {ASK:g} s",
                "is what serves it running, by this user, at that address?",
            )  # fmt: skip
        late = time.monotonic() - newest.stamp
    finally:
        one.close()
    if wrong:
        return Finding(what, FAIL, f"{where}: {wrong}", "mend its driver")
    if late < -TICK or late > ASK:
        return Finding(
            what, FAIL, f"{where}: its stamps are {late:.3f} s old",
            "they must be of this machine's monotonic clock (time.monotonic)",
        )  # fmt: skip
    fastest = max(abs(newest.right), abs(newest.left))
    if fastest > config.executor_settings.rest_speed:
        return Finding(
            what, FAIL, f"{where}: its wheels turn by {fastest:.3f} m/s while it is told to stand",
            "stop whoever drives it, or see whether its odometry is right",
        )  # fmt: skip
    period = (stamps[-1] - stamps[0]) / max(len(stamps) - 1, 1)
    place = f"at ({newest.x:.2f}, {newest.y:.2f}) m, {math.degrees(newest.theta):.0f} deg"
    told = f"{where}: stands {place}; odometry every {1e3 * period:.0f} ms"
    if len(stamps) < 3 or period > 1.5 * config.base.odometry_period:
        return Finding(
            what, WARN, told,
            f"base.odometry_period says {1e3 * config.base.odometry_period:.0f} ms: the executor"
            " would take the base for silent; correct it",
        )  # fmt: skip
    return Finding(what, OK, told)
