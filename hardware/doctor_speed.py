"""Whether this machine is fast enough: the executor's loop, the button, the planner's cycle."""

from __future__ import annotations

import contextlib
import io
import math
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hardware.doctor_finding import FAIL, OK, Finding, graded
from hardware.executor_process import ROW, ExecutorConfig, ExecutorProcess
from hardware.executor_settings import ExecutorSettings
from hardware.margins import HASTE
from hardware.stop_button import StopButton
from passpmp_ti import backend
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.planner.rehearsal import rehearse
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings

TICKING = 2.0
"""For how long an executor is watched [s]."""
CYCLES, WARM = 100, 5
"""Cycles that are timed, and those before them."""
ROOM = 5.0
"""Half the width of the room that the planner is shown [m]."""
BEAMS = 1081


def speed(settings: Settings | None, robot: DifferentialDrive | None) -> Iterator[Finding]:
    """All of it, one by one.

    Args:
        settings: of the planner; None: a wheelchair's usual ones.
        robot: who drives; None: a wheelchair.
    """
    robot = DifferentialDrive() if robot is None else robot
    yield from executor()
    yield planner(Settings.for_robot(robot) if settings is None else settings, robot)


def executor() -> Iterator[Finding]:
    """An executor of its own, with wheels that are none: does it keep time, is the button heard?"""
    with tempfile.TemporaryDirectory(prefix="passpmp-") as folder:
        log = Path(folder) / "ticks"
        config = ExecutorConfig(
            directory=Path(folder), base="hardware.simulated_base:build", log=log
        )
        try:
            with ExecutorProcess(config), StopButton(Path(folder)) as button:
                time.sleep(TICKING)
                began = time.monotonic()
                pressed = button.press()
                took = time.monotonic() - began
                released = button.release()
        except RuntimeError as cause:
            yield Finding("executor", FAIL, str(cause))
            return
        data = log.read_bytes()
    rows = [row[0] for row in ROW.iter_unpack(data[: len(data) // ROW.size * ROW.size])]
    # the first ones are of a process that only starts
    yield jitter(np.diff(rows)[10:], ExecutorSettings())
    if not (pressed and released):
        yield Finding(
            "stop button's way", FAIL, "the executor did not obey", "do not drive this machine"
        )
    else:
        yield Finding("stop button's way", OK, f"obeyed within {1e3 * took:.1f} ms, and reset")


def jitter(steps: np.ndarray, settings: ExecutorSettings) -> Finding:
    """How late ticks are.

    Args:
        steps: from each tick to the next [s]; none: there were none.
        settings: of the executor.
    """
    if not len(steps):
        return Finding("executor", FAIL, "it did not tick", "end what else runs, and try again")
    late = steps - settings.period
    share = float(np.quantile(late, 0.99))
    room = settings.feedback_timeout - settings.period
    return graded(
        "executor", share,
        f"ticks at {1.0 / settings.period:.0f} Hz: 99 % no more than {1e3 * share:.1f} ms late,"
        f" the worst {1e3 * float(late.max()):.1f} ms",
        "grant SCHED_FIFO (see above), end what else runs, set the governor to performance",
        warn=0.5 * settings.period, fail=room,
    )  # fmt: skip


def planner(settings: Settings, robot: DifferentialDrive) -> Finding:
    """How long a cycle takes on this machine, without a deadline that would cut it short."""
    with contextlib.redirect_stdout(io.StringIO()):
        name = backend.init()
    free = settings.changed(deadline=None)
    # every kernel is compiled first, as for a drive
    rehearse(Navigator, robot, free)
    corners = [(x * ROOM, y * ROOM) for x, y in ((0.5, 0.1), (-0.5, 0.3))]
    navigator = Navigator(robot, free, goal=corners * 5)
    state, took = np.zeros(5), []
    for k in range(WARM + CYCLES):
        stamp = k * free.cycle
        scans = [_room(state, stamp, turn) for turn in (0.0, math.pi)]
        began = time.perf_counter()
        held = navigator.update(scans, state)
        took.append(time.perf_counter() - began)
        state = held.at(stamp + free.cycle)
    share = float(np.quantile(took[WARM:], 0.99))
    middle = float(np.median(took[WARM:]))
    room = free.cycle - HASTE
    return graded(
        "planner", share,
        f"on {name}: a cycle takes {1e3 * middle:.0f} ms, 99 % within {1e3 * share:.0f} ms, of"
        f" {1e3 * room:.0f} ms that a cycle of {free.cycle:g} s leaves",
        "trees are cut short or answers come late: lengthen planner.cycle, or plan with fewer nodes"
        " (planner.capacity), coarser cells (planner.cell), a GPU",
        warn=0.8 * room, fail=room,
    )  # fmt: skip


def _room(state: np.ndarray, stamp: float, turn: float) -> Scan:
    """A square room as a range finder sees it that looks ahead, or back."""
    increment = math.radians(270.0) / (BEAMS - 1)
    pose = (float(state[0]), float(state[1]), float(state[2]) + turn)
    bearings = pose[2] + increment * (np.arange(BEAMS) - (BEAMS - 1) / 2)
    with np.errstate(divide="ignore"):
        ways = [
            np.where(part > 0, (ROOM - place) / part, (-ROOM - place) / part)
            for place, part in ((pose[0], np.cos(bearings)), (pose[1], np.sin(bearings)))
        ]
    return Scan(
        np.minimum(*ways), angle_min=-math.radians(135.0), angle_increment=increment,
        range_max=10.0, pose=pose, stamp=stamp,
    )  # fmt: skip
