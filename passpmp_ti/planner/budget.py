"""The wall clock time of a cycle: what it is spent on, and what is kept back for its end."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager

FIRST = 0.25
"""Share of the deadline that is kept back before any cycle has told how much its end takes."""
DECAY = 0.98
"""What is kept back falls by this factor a cycle, to what the ends really take."""
FACTOR = 2.0
"""How many times the longest end of late is kept back: the next may be longer."""
LEAST = 0.002
"""[s] kept back whatever was measured: a launch, or a page of memory, may come late by as much."""
MOST = 0.5
"""Share of the deadline that is kept back at most: one long pause must not end planning."""


class Reserve:
    """How much of a cycle is kept back for its end: choice, second check and bookkeeping.

    It follows the longest end of late, a maximum that decays: it grows at once and falls slowly.
    """

    def __init__(self) -> None:
        self._longest: float | None = None

    def seconds(self, deadline: float) -> float:
        """What is kept back of a cycle that has to answer within `deadline` [s]."""
        wanted = FIRST * deadline if self._longest is None else FACTOR * self._longest
        return min(max(wanted, LEAST), MOST * deadline)

    def learn(self, spent: float, deadline: float) -> None:
        """An end took `spent` [s], from when the tree should have stopped, or did so earlier."""
        before = FIRST * deadline / FACTOR if self._longest is None else self._longest
        self._longest = max(spent, DECAY * before)


class Budget:
    """One cycle's time, from its beginning on.

    Without a deadline it only takes times, and nothing is decided by them.
    """

    def __init__(self, deadline: float | None, reserve: Reserve) -> None:
        self._began = self._lap = time.perf_counter()
        self._deadline = deadline
        self._reserve = reserve
        self._grown: float | None = None
        self.until: float | None = None
        """When exploration has to end, on `time.perf_counter`'s clock [s]; None: no deadline."""
        if deadline is not None:
            self.until = self._began + deadline - reserve.seconds(deadline)
        self.timings: dict[str, float] = {}
        """Seconds spent on each part so far."""

    def lap(self, part: str) -> None:
        """What was done since the last lap was `part`."""
        now = time.perf_counter()
        self.timings[part] = self.timings.get(part, 0.0) + now - self._lap
        self._lap = now

    def explored(self) -> bool:
        """Whether the time for exploration is over."""
        return self.until is not None and time.perf_counter() >= self.until

    def grown(self) -> None:
        """The tree is grown: what comes now is the end that time was kept back for."""
        self._grown = time.perf_counter()

    def late(self) -> bool:
        """Whether the deadline has passed."""
        return self._deadline is not None and self.left() < 0

    def left(self) -> float:
        """Time until the deadline [s]; negative: late; inf: there is none."""
        if self._deadline is None:
            return float("inf")
        return self._began + self._deadline - time.perf_counter()

    def close(self) -> None:
        """The cycle has its answer: take the whole time, and learn from it."""
        now = time.perf_counter()
        self.timings["total"] = now - self._began
        if self._deadline is None or self.until is None:
            return
        # a cycle without a tree teaches nothing, but what was once slow must not be held for ever
        spent = 0.0 if self._grown is None else now - min(self._grown, self.until)
        self._reserve.learn(spent, self._deadline)


@contextmanager
def without_collector(wanted: bool) -> Iterator[None]:
    """Keep Python's garbage collector from pausing the cycle, where that is `wanted`.

    A full collection looks at all that Taichi keeps: tens of milliseconds, whenever it pleases.
    """
    if not (wanted and gc.isenabled()):
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
