"""Ctrl-C as something to be heard."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupts:
    """Counts Ctrl-C (and SIGTERM) instead of dying of it."""

    def __init__(self) -> None:
        self.count = 0

    def hear(self, number: int, frame: FrameType | None) -> None:
        """One more."""
        self.count += 1


@contextmanager
def interrupts() -> Iterator[Interrupts]:
    """While this is open, Ctrl-C ends nothing by itself."""
    heard = Interrupts()
    before = {n: signal.signal(n, heard.hear) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield heard
    finally:
        for number, old in before.items():
            signal.signal(number, old)
