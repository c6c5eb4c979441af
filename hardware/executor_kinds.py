"""What can break around an executor, and by when the robot has to be at rest."""

from __future__ import annotations

import signal
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hardware.executor_rig import NATURE, Rig
from hardware.executor_trials import CYCLE


@dataclass(frozen=True, slots=True)
class Kind:
    """A fault, and by when the robot has to be at rest."""

    name: str
    begin: Callable[[Any], object]
    """Breaks it; is given the rig."""
    end: Callable[[Any], object]
    """Mends it."""
    detection: float
    """From the fault until nothing that comes is taken any more, or the robot brakes [s]."""
    brakes: bool
    """At once, off what it holds; else it carries on to the end of what it holds."""
    stays: bool = True
    """It stays at rest while the fault lasts: after a jump it knows where it is, and drives on."""
    ticks: bool = True
    """The executor goes on: its ticks tell whether the machine stood still."""
    obeys: bool = True
    """The base goes on to obey. Else it takes as long as it takes until the robot is off its path,
    and then the base's own stop, which comes when orders would have stopped it."""


def _kill_planner(rig: Rig) -> None:
    rig.planner.send_signal(signal.SIGKILL)
    rig.planner.wait()


def _start_planner(rig: Rig) -> None:
    rig.planner = rig.start_planner()


def _kill_executor(rig: Rig) -> None:
    rig.executor.process.send_signal(signal.SIGKILL)
    rig.executor.process.wait()


def _start_executor(rig: Rig) -> None:
    rig.executor.close()
    rig.executor = rig.start_executor()


def _signalled(what: str, number: int) -> Callable[[Rig], object]:
    def send(rig: Rig) -> None:
        process = rig.planner if what == "planner" else rig.executor.process
        process.send_signal(number)

    return send


def kinds(rig: Rig) -> list[Kind]:
    """All faults, with the times that the rig's settings promise."""
    s, limits = rig.settings, NATURE.limits
    # from the base's measurement to the executor's tick to the base's next look
    hop = NATURE.period + 2 * s.period
    # the planner hears that it is to go wrong in its next cycle
    told = 2 * CYCLE

    def wrong(how: str) -> Callable[[Rig], object]:
        return lambda rig: rig.order(how)

    def broken(how: str) -> Callable[[Rig], object]:
        return lambda rig: rig.inject(how)

    def cut(is_cut: bool) -> Callable[[Rig], object]:
        return lambda rig: rig.cut(cut=is_cut)

    return [
        Kind("planner killed", _kill_planner, _start_planner, hop, False),
        Kind(
            "planner stopped", _signalled("planner", signal.SIGSTOP),
            _signalled("planner", signal.SIGCONT), hop, False,
        ),
        Kind("link cut", cut(True), cut(False), hop, False),
        Kind(
            "scans frozen", wrong("frozen"), wrong(""), told + s.sensor_timeout, False
        ),
        Kind("numbers that are none", wrong("nan"), wrong(""), told, False),
        Kind("planner's clock stepped", wrong("clock"), wrong(""), told, False),
        Kind("feedback silent", broken("silent"), broken(""), s.feedback_timeout + hop, True),
        Kind("feedback nan", broken("nan"), broken(""), hop, True),
        Kind("feedback jumps 1 m", broken("jump"), broken(""), hop, True, stays=False),
        Kind("base deaf", broken("deaf"), broken(""), hop, True, obeys=False),
        Kind(
"executor killed", _kill_executor, _start_executor, limits.command_timeout, True,
ticks=False,
),
        Kind(
            "executor stopped", _signalled("executor", signal.SIGSTOP),
            _signalled("executor", signal.SIGCONT), limits.command_timeout, True, ticks=False,
        ),
        Kind("emergency stop", Rig.press, Rig.release, hop, True),
    ]  # fmt: skip
