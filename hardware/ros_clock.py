"""Stamps of ROS, which are wall clock, as stamps of the monotonic clock, which all here go by.

How far the wall clock is ahead is read as a message arrives, and its stamp is put on our clock by
that. It is right as long as nobody has set the wall clock since the stamp was made, so:

- a stamp of the future, or older than `oldest`, is not believed;
- after the wall clock jumped by more than `JUMP` nothing is believed for `oldest`: what comes then
  may carry a stamp of before;
- nor is a stamp from before this clock first looked.

What is left is an error of at most `JUMP`, and `skew`, which is how far the wall clock of the
machine that stamps may be off this one's: `error` in all. It belongs into the planner's
`Settings.stamp_error`. Not noticed: a clock that is set and set back between two looks.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from hardware.ros_messages import Untrusted
from passpmp_ti import door

JUMP = 0.002
"""The clocks may part by this from one look to the next [s]; slewed by 500 ppm they need 4 s."""


class RosClock:
    """Tells what a stamp is on the monotonic clock."""

    def __init__(
        self,
        *,
        oldest: float = 0.5,
        skew: float = 0.0,
        wall: Callable[[], float] = time.time,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """
        Args:
            oldest: stamps older than this on arrival are not believed [s].
            skew: how far the clock that stamps may be off this machine's [s]; 0: it is the same.
            wall: seconds of the wall clock.
            clock: seconds that never go back.
        """
        self.oldest = door.finite("RosClock", "oldest", oldest, above=0.0, unit="s")
        self.skew = door.finite("RosClock", "skew", skew, least=0.0, unit="s")
        self._wall, self._clock = wall, clock
        self._ahead = self._read()
        self._since = clock()
        self.jumps = 0
        """Times that the wall clock was set."""

    @property
    def error(self) -> float:
        """A stamp that is believed may really be this much older [s]."""
        return JUMP + self.skew

    def look(self) -> None:
        """See whether the wall clock was set; to be called often, and at each arrival."""
        ahead = self._read()
        if abs(ahead - self._ahead) > JUMP:
            self.jumps += 1
            # first: another thread must not put a stamp by the new reading and believe it
            self._since = self._clock() + self.oldest
        self._ahead = ahead

    def ours(self, stamp: float) -> float:
        """A stamp that came just now, wall clock [s], on the monotonic clock [s].

        Raises:
            Untrusted: it is not to be believed.
        """
        self.look()
        now = self._clock()
        age = now - (stamp - self._ahead)
        # written so that a stamp that is no number is refused too
        if not age >= -self.skew - JUMP:
            raise Untrusted("a stamp of the future")
        if not age <= self.oldest:
            raise Untrusted("a stamp that is too old")
        ours = now - max(age, 0.0)
        if ours < self._since:
            raise Untrusted("a stamp of before the wall clock was set, or first looked at")
        return ours

    def theirs(self, stamp: float) -> float:
        """A time of the monotonic clock as the wall clock shows it [s]."""
        return stamp + self._ahead

    def _read(self) -> float:
        """How far the wall clock is ahead [s]: the closest of a few readings, since this process
        may sleep between the two clocks."""
        best = None
        for _ in range(3):
            before, wall, after = self._clock(), self._wall(), self._clock()
            if best is None or after - before < best[0]:
                best = after - before, wall - 0.5 * (before + after)
        assert best is not None
        return best[1]
