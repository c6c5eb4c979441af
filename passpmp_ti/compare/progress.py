"""A line that says how a comparison goes."""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Mapping, Sequence
from typing import IO, Any, Protocol

from passpmp_ti.compare.job import Key, Result

SPARSE = 30.0
"""Seconds between lines where the output is not a terminal."""


class Planned(Protocol):
    """Episodes that are to be driven: a comparison, or a benchmark."""

    @property
    def variants(self) -> Sequence[Any]:
        """What is told apart; each has a `name`."""

    def jobs(self) -> Sequence[Any]:
        """Every episode; each has a `key`."""


class ComparisonProgress:
    """Tells what is done, what is left, and the counts of each variant."""

    def __init__(self, comparison: Planned, stream: IO[str] | None = None) -> None:
        self._wanted = [job.key for job in comparison.jobs()]
        self._variants = [v.name for v in comparison.variants]
        self._stream = sys.stderr if stream is None else stream
        self._terminal = self._stream.isatty()
        self._began = clock.monotonic()
        self._last = -SPARSE
        self._new = 0
        self._length = 0

    def see(self, results: Mapping[Key, Result]) -> None:
        """Tell of all results so far; called after each episode."""
        self._new += 1
        elapsed = clock.monotonic() - self._began
        if not self._terminal and elapsed - self._last < SPARSE:
            return
        self._last = elapsed
        line = self.line(results, elapsed)
        if self._terminal:
            self._stream.write("\r" + line.ljust(self._length))
            self._length = len(line)
        else:
            self._stream.write(line + "\n")
        self._stream.flush()

    def line(self, results: Mapping[Key, Result], elapsed: float) -> str:
        """How it goes after `elapsed` seconds and the episodes of this run."""
        own = [results[key] for key in self._wanted if key in results]
        left = len(self._wanted) - len(own)
        eta = _time(left * elapsed / self._new) if self._new else "-"
        parts = [f"{len(own)} of {len(self._wanted)} episodes, {eta} left"]
        for variant in self._variants:
            done = [r for r in own if r["variant"] == variant and r["error"] is None]
            reached = sum(r["outcome"]["reached_goal"] for r in done)
            contacts = sum(r["outcome"]["collisions_moving"] for r in done)
            parts.append(f"{variant}: {reached}/{len(done)} at the goal, {contacts} contacts")
        raised = sum(r["error"] is not None for r in own)
        return "   ".join(parts + ([f"{raised} raised"] if raised else []))

    def end(self) -> None:
        """Leave the line."""
        if self._terminal and self._length:
            self._stream.write("\n")
            self._stream.flush()


def _time(seconds: float) -> str:
    if seconds < 100:
        return f"{round(seconds)} s"
    minutes = round(seconds / 60)
    return f"{minutes // 60}:{minutes % 60:02d} h" if minutes >= 60 else f"{minutes} min"
