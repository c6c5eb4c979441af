"""Processes that this one starts, and how they are asked to end."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from pathlib import Path


def started(module: str, told: str, within: float) -> tuple[subprocess.Popen[bytes], bytes]:
    """Start a module as a process, and wait for its first line.

    A Ctrl-C is not for it. It is told this process's number, to end when that is gone.

    Args:
        module: is run.
        told: its first argument.
        within: time to say something [s].

    Returns:
        The process, and its line.

    Raises:
        RuntimeError: it said nothing; tells what it complained of.
    """
    home = str(Path(__file__).parents[1])
    paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
    process = subprocess.Popen(
        [sys.executable, "-m", module, told, str(os.getpid())],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join(paths),
            "ENABLE_TAICHI_HEADER_PRINT": "0",
        },
        start_new_session=True,
    )
    assert process.stdout is not None
    ready, _, _ = select.select([process.stdout], [], [], within)
    line = process.stdout.readline() if ready else b""
    if not line.endswith(b"\n"):
        process.kill()
        _, why = process.communicate()
        raise RuntimeError(f"{module} did not start: {why.decode(errors='replace')}")
    return process, line


def ended(process: subprocess.Popen[bytes], within: float) -> str:
    """Ask a child to end, and see that it does. Returns what it complained of.

    Args:
        process: its errors are piped.
        within: time that it has before it is killed [s].
    """
    if process.poll() is None:
        # one that is stopped hears nothing
        process.send_signal(signal.SIGCONT)
        process.terminate()
    try:
        _, told = process.communicate(timeout=within)
    except subprocess.TimeoutExpired:
        process.kill()
        _, told = process.communicate()
    return told.decode(errors="replace")
