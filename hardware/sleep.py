"""Whether this machine was put to sleep.

The monotonic clock stands still while a machine sleeps, so by it nothing is late and nothing is
old. On Linux CLOCK_BOOTTIME goes on.
"""

from __future__ import annotations

import time
from collections.abc import Callable

NOTICED = 1e-3
"""[s] of sleep that count; no machine sleeps for less."""

Slept = tuple[float, float]
"""For how long a machine has slept since it was started: at least, and at most [s]."""


def asleep() -> Slept:
    """This machine's sleep so far; (0, 0) where no clock tells.

    Clocks are read one after the other, and between two readings a process may have to wait.
    """
    clock = getattr(time, "CLOCK_BOOTTIME", None)
    if clock is None:
        return 0.0, 0.0
    before = time.monotonic()
    total = time.clock_gettime(clock)
    return total - time.monotonic(), total - before


class Sleep:
    """Tells of each sleep once."""

    def __init__(self, slept: Callable[[], Slept] = asleep) -> None:
        """
        Args:
            slept: tells for how long the machine has slept so far.
        """
        self._slept = slept
        _, self._known = slept()

    def woke(self) -> bool:
        """Whether the machine slept since this was asked last."""
        least, most = self._slept()
        woke = least > self._known + NOTICED
        # a reading that had to wait says little: what was known before still bounds what was then
        self._known = most if woke else min(self._known, most)
        return woke
