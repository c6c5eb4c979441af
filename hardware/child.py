"""Processes that this one has started, and how they are asked to end."""

from __future__ import annotations

import signal
import subprocess


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
