"""When a device's milliseconds were, on the host's clock: bounds, not estimates.

Let o be the host's time minus the device's. Whoever asks for the device's time at host time a and
has the answer s (whole milliseconds, rounded down) at b knows that o lies in [a - s - 1 ms, b - s].
Whoever has something at b that the device measured at s knows that o <= b - s. All of these hold at
once, so o lies in their intersection. Between two of them o moves by no more than `drift` times the
time that passed, in either direction.
"""

from __future__ import annotations

from hardware.scip import CLOCK_TURN, ScipError

MILLISECOND = 1e-3
BACK = 1000
"""[ms] by which a reading may be older than the one before: sweeps under way while it was asked."""


class ClockJumped(ScipError):
    """The device's clock was set, or does not keep the time it should."""


class DeviceClock:
    """Bounds on the difference between a host's clock and a device's."""

    def __init__(self, drift: float) -> None:
        """
        Args:
            drift: greatest relative difference of the two clocks' rates.
        """
        self._drift = drift
        self._newest: int | None = None  # [ms], turns counted
        self._low = self._high = self._at = 0.0

    @property
    def width(self) -> float:
        """How well the two clocks' difference was known when they were compared last [s]."""
        return self._high - self._low

    def turned(self, reading: int) -> int:
        """A 24 bit reading with the turns before it counted [ms].

        Raises:
            ClockJumped: a reading that lies back by more than `BACK`.
        """
        if self._newest is None:
            self._newest = reading
            return reading
        ahead = (reading - self._newest) % CLOCK_TURN
        if ahead >= CLOCK_TURN // 2:
            ahead -= CLOCK_TURN
        if ahead < -BACK:
            raise ClockJumped(f"the device's clock went back by {-ahead} ms")
        whole = self._newest + ahead
        self._newest = max(self._newest, whole)
        return whole

    def exchanged(self, reading: int, asked: float, answered: float) -> None:
        """The device was asked at `asked` and its answer `reading` [ms] was there at `answered`.

        Raises:
            ClockJumped: the two clocks disagree with what is known of them.
        """
        fresh = self._newest is None
        device = self.turned(reading) * MILLISECOND
        moved = self._drift * (answered - asked)
        low, high = asked - device - MILLISECOND - moved, answered - device + moved
        if not fresh:
            known_low, known_high = self._bounds(answered)
            low, high = max(low, known_low), min(high, known_high)
        self._keep(low, high, answered)

    def arrived(self, reading: int, after: float, at: float) -> None:
        """What the device measured no earlier than `after` [s] past `reading` was there at `at`.

        Raises:
            ClockJumped: it was there before it can have been measured.
        """
        device = self.turned(reading) * MILLISECOND + after
        low, high = self._bounds(at)
        bound = at - device
        # the bound held when it was measured, which was no longer ago than this
        self._keep(low, min(high, bound + self._drift * max(0.0, bound - low)), at)

    def instants(self, reading: int, first: float, last: float, at: float) -> tuple[float, float]:
        """(no earlier than, no later than) on the host's clock [s].

        Args:
            reading: of the device's clock [ms].
            first: the first moment asked about, after the reading [s].
            last: the last one [s].
            at: when it was there [s].
        """
        low, high = self._bounds(at)
        device = self.turned(reading) * MILLISECOND
        earliest = device + first + low
        moved = self._drift * max(0.0, at - earliest)
        return earliest - moved, min(device + MILLISECOND + last + high + moved, at)

    def _bounds(self, at: float) -> tuple[float, float]:
        moved = self._drift * abs(at - self._at)
        return self._low - moved, self._high + moved

    def _keep(self, low: float, high: float, at: float) -> None:
        if low > high:
            raise ClockJumped(f"the device's clock is off by {low - high:.4f} s")
        self._low, self._high, self._at = low, high, at
