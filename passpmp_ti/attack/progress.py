"""A line that says how a campaign goes."""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Sequence
from typing import IO

from passpmp_ti.attack.campaign import Campaign, Result, failed

SPARSE = 30.0
"""Seconds between lines where the output is not a terminal."""


class CampaignProgress:
    """Tells cycles a second, what is left, and failures: in one line, or now and then."""

    def __init__(
        self, campaign: Campaign, before: Sequence[Result], stream: IO[str] | None = None
    ) -> None:
        self._campaign = campaign
        self._stream = sys.stderr if stream is None else stream
        self._terminal = self._stream.isatty()
        self._began = clock.monotonic()
        self._before = sum(r["cycles"] for r in before)
        self._share_before = self._share(before)
        self._last = -SPARSE
        self._length = 0

    def see(self, results: Sequence[Result]) -> None:
        """Tell of all results so far."""
        elapsed = clock.monotonic() - self._began
        if not self._terminal and elapsed - self._last < SPARSE:
            return
        self._last = elapsed
        line = self.line(results, max(elapsed, 1e-9))
        if self._terminal:
            self._stream.write("\r" + line.ljust(self._length))
            self._length = len(line)
        else:
            self._stream.write(line + "\n")
        self._stream.flush()

    def line(self, results: Sequence[Result], elapsed: float) -> str:
        """How it goes after `elapsed` seconds of this run."""
        cycles = sum(r["cycles"] for r in results)
        share = self._share(results)
        gained = share - self._share_before
        left = "-" if gained <= 0 else _time((1 - share) / gained * elapsed)
        return (
            f"{len(results)} episodes   {cycles} cycles"
            f"   {(cycles - self._before) / elapsed:.0f} cycles/s"
            f"   {100 * share:.0f} %, {left} left"
            f"   {sum(r['metres'] for r in results) / 1000:.2f} km"
            f"   contacts moving {sum(r['contacts_moving'] for r in results)},"
            f" at rest {sum(r['contacts_at_rest'] for r in results)}"
            f"   failed {sum(failed(r) for r in results)}"
        )

    def end(self) -> None:
        """Leave the line."""
        if self._terminal and self._length:
            self._stream.write("\n")
            self._stream.flush()

    def _share(self, results: Sequence[Result]) -> float:
        """What of the campaign is done."""
        shares = []
        for robot in self._campaign.robots:
            own = [r for r in results if r["robot"] == robot]
            if self._campaign.cycles is not None:
                shares.append(min(sum(r["cycles"] for r in own) / self._campaign.cycles, 1.0))
            elif self._campaign.episodes is not None:
                shares.append(min(len(own) / self._campaign.episodes, 1.0))
        return sum(shares) / max(len(shares), 1)


def _time(seconds: float) -> str:
    minutes = round(seconds / 60)
    return f"{minutes // 60}:{minutes % 60:02d} h" if minutes >= 60 else f"{minutes} min"
