"""Processes that this one starts, and how they are asked to end."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

Config = TypeVar("Config")


class Child(subprocess.Popen[bytes]):
    """A module that runs as a process of its own. A Ctrl-C is not for it.

    What it complains of goes to a file: a pipe that nobody reads would hold it up once full, and
    break under it when this process is gone before it.
    """

    def __init__(self, module: str, told: str) -> None:
        """
        Args:
            module: is run.
            told: its first argument; the second is this process's number.
        """
        home = str(Path(__file__).parents[1])
        paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
        # each complaint goes to the file's end, wherever it was read last
        self._complaints = tempfile.TemporaryFile("a+b")  # noqa: SIM115 - as long as the process
        super().__init__(
            [sys.executable, "-m", module, told, str(os.getpid())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(paths),
                "ENABLE_TAICHI_HEADER_PRINT": "0",
            },
            start_new_session=True,
        )

    def complaints(self) -> str:
        """What it complained of so far."""
        self._complaints.seek(0)
        return self._complaints.read().decode(errors="replace")


def started(module: str, told: str, within: float) -> tuple[Child, bytes]:
    """Start a module as a process, and wait for its first line.

    It is told this process's number, to end when that is gone.

    Args:
        module: is run.
        told: its first argument.
        within: time to say something [s].

    Returns:
        The process, and its line.

    Raises:
        RuntimeError: it said nothing; tells what it complained of.
    """
    process = Child(module, told)
    assert process.stdout is not None
    ready, _, _ = select.select([process.stdout], [], [], within)
    line = process.stdout.readline() if ready else b""
    if not line.endswith(b"\n"):
        process.kill()
        process.wait()
        raise RuntimeError(f"{module} did not start: {process.complaints()}")
    return process, line


def ended(process: Child, within: float) -> str:
    """Ask a child to end, and see that it does. Returns what it complained of.

    Args:
        process: from `started`.
        within: time that it has before it is killed [s].
    """
    if process.poll() is None:
        # one that is stopped hears nothing
        process.send_signal(signal.SIGCONT)
        process.terminate()
    try:
        process.wait(timeout=within)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    assert process.stdout is not None
    process.stdout.close()
    return process.complaints()


def main_of(module: str, read: Callable[[str], Config], run: Callable[[Config, int], None]) -> int:
    """The `main` of a module that `started` starts. Returns its exit status.

    Args:
        module: its name.
        read: the configuration, from the first argument.
        run: is told it, and the number of the process whose end ends this one. By hand that is the
            shell that it was started from.
    """
    if len(sys.argv) not in (2, 3):
        print(f"example: python -m {module} CONFIGURATION", file=sys.stderr)
        return 2
    try:
        parent = int(sys.argv[2]) if len(sys.argv) == 3 else os.getppid()
        run(read(sys.argv[1]), parent)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    return 0
