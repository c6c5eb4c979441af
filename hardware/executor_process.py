"""The executor as a process of its own: small, without Taichi, and alive when all else is not.

    python -m hardware.executor_process '{"directory": "/run/passpmp", "base": ...}'

Taichi's kernels hold Python's lock while they run, so no thread of the planner's process could keep
time. The process is started afresh, not forked: it holds nothing of the planner's.
"""

from __future__ import annotations

import contextlib
import dataclasses
import fcntl
import gc
import importlib
import json
import os
import signal
import stat
import struct
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from hardware.base import Base
from hardware.child import ended, main_of, started
from hardware.executor import Executor, Tick
from hardware.executor_settings import ExecutorSettings
from hardware.follower import FollowerSettings
from hardware.priority import put_forward
from passpmp_ti import door
from passpmp_ti.robots import DifferentialDrive

PATIENCE = 10.0
"""[s] for an executor whose planner died to come to rest, before the next one starts."""
READY = b"ready\n"
"""What the process says once it listens."""
ROW = struct.Struct(f"<{len(Tick._fields)}d")
"""A tick in the log."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExecutorConfig:
    """All that an executor's process needs to know."""

    directory: Path
    """Of its sockets; made if need be, for this user only."""
    base: str
    """What makes the base, "module:function", as "hardware.base_link:build"."""
    base_options: dict[str, Any] = field(default_factory=dict)
    """What that is called with."""
    robot: DifferentialDrive = field(default_factory=DifferentialDrive)
    """As it is planned for."""
    settings: ExecutorSettings = field(default_factory=ExecutorSettings)
    log: Path | None = None
    """Ticks are written to it, `ROW` each; None: they are not."""
    priority: int = 10
    """Of SCHED_FIFO, 1 to 99, where the system grants it: on a busy machine nothing else keeps
    time. 0: none, as all others."""

    def __post_init__(self) -> None:
        if self.base.count(":") != 1:
            raise ValueError(
                f"ExecutorConfig.base must be 'module:function'; got {self.base!r}, and"
                " 'hardware.base_link:build' drives a base that another process serves"
            )
        door.whole("ExecutorConfig", "priority", self.priority, least=0, most=99)

    def to_json(self) -> str:
        """As the process is told it."""
        robot = self.robot
        return json.dumps(
            {
                "directory": str(self.directory),
                "base": self.base,
                "base_options": self.base_options,
                "robot": {
                    "discs": robot.discs,
                    "wheel_speed": robot.wheel_speed,
                    "acceleration": robot.acceleration,
                    "track": robot.track,
                },
                "settings": dataclasses.asdict(self.settings),
                "log": None if self.log is None else str(self.log),
                "priority": self.priority,
            }
        )

    @classmethod
    def from_json(cls, text: str) -> ExecutorConfig:
        """As `to_json` wrote it.

        Raises:
            ValueError: a field is missing, unknown, or out of its range.
        """
        try:
            given = json.loads(text)
            robot, settings = given.pop("robot"), given.pop("settings")
            robot["discs"] = tuple(tuple(disc) for disc in robot["discs"])
            follower = FollowerSettings(**settings.pop("follower"))
            log = given.pop("log")
            return cls(
                directory=Path(given.pop("directory")),
                robot=DifferentialDrive(**robot),
                settings=ExecutorSettings(follower=follower, **settings),
                log=None if log is None else Path(log),
                **given,
            )
        except (KeyError, TypeError, AttributeError) as cause:
            raise ValueError(f"no configuration of an executor: {cause!r}") from cause

    def build_base(self) -> Base:
        """The base.

        Raises:
            ValueError: nothing makes one.
        """
        module, name = self.base.split(":")
        try:
            build = getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError) as cause:
            raise ValueError(f"ExecutorConfig.base = {self.base!r}: {cause}") from cause
        base: Base = build(**self.base_options)
        return base


class ExecutorProcess:
    """Starts an executor's process and looks after it.

    It outlives a planner that dies: it carries on to rest first. It ends, at rest, once whoever
    started it is gone.
    """

    def __init__(self, config: ExecutorConfig, *, within: float = 20.0) -> None:
        """
        Args:
            config: what it is told.
            within: time to start [s].

        Raises:
            RuntimeError: it did not start; says why.
        """
        self.process, told = started("hardware.executor_process", config.to_json(), within)
        if told != READY:
            raise RuntimeError(f"the executor did not start: {ended(self.process, 1.0)}")

    def __enter__(self) -> ExecutorProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self.process.poll() is None

    def close(self, within: float = 20.0) -> str:
        """Let it come to rest and end. Returns what it complained of."""
        return ended(self.process, within)


def run(config: ExecutorConfig, parent: int) -> None:
    """Be an executor, until a signal or the death of whoever started this process ends it.

    Args:
        config: all else.
        parent: process number of whoever started this one.

    Raises:
        ValueError: the configuration makes no sense.
    """
    config.directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    check_private(config.directory)
    asked: list[int] = []

    def leave(number: int, frame: FrameType | None) -> None:
        asked.append(number)

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, leave)
    alone = _alone(config.directory)
    if config.priority:
        put_forward("the executor", config.priority)
    log = None if config.log is None else os.open(config.log, os.O_WRONLY | os.O_CREAT, 0o600)
    executor = Executor(
        config.build_base(), config.robot, config.settings, config.directory, log=_writer(log)
    )
    # what is there now stays; what comes is small, and goes by its count of references
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        os.write(sys.stdout.fileno(), READY)
        executor.run(lambda: bool(asked) or os.getppid() != parent)
    finally:
        executor.close()
        os.close(alone)


def check_private(directory: Path) -> None:
    """Who may enter the directory of the sockets may drive the robot.

    Raises:
        ValueError: somebody but this user may.
    """
    there = directory.stat()
    if there.st_uid != os.geteuid() or there.st_mode & 0o077:
        raise ValueError(
            f"ExecutorConfig.directory = {directory} must be this user's and closed to all others,"
            f" since who may enter it can drive the robot; its mode is"
            f" {stat.S_IMODE(there.st_mode):o}, its owner {there.st_uid}; chmod 700 it, or name"
            " one that does not exist yet"
        )


def busy(directory: Path) -> bool:
    """Whether an executor works in a directory."""
    try:
        descriptor = os.open(directory, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


def _alone(directory: Path) -> int:
    """A descriptor that keeps all other executors out of a directory while it is open: two would
    take each other's sockets away, and the button would reach only one.

    Raises:
        ValueError: one that is there does not end.
    """
    descriptor, until = os.open(directory, os.O_RDONLY), time.monotonic() + PATIENCE
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > until:
                os.close(descriptor)
                raise ValueError(
                    f"ExecutorConfig.directory = {directory}: another executor works there; end"
                    " it, or give this one a directory of its own"
                ) from None
            time.sleep(0.05)
        else:
            return descriptor


def _writer(log: int | None) -> Callable[[Tick], None] | None:
    if log is None:
        return None

    def write(tick: Tick) -> None:
        # a disk that is full is no reason to stop holding the robot's way to rest
        with contextlib.suppress(OSError):
            os.write(log, ROW.pack(*tick))

    return write


def main() -> int:
    return main_of("hardware.executor_process", ExecutorConfig.from_json, run)


if __name__ == "__main__":
    sys.exit(main())
