"""A host's session and an emulated device joined in memory, by a clock that only they have."""

from __future__ import annotations

from collections.abc import Callable

from hardware.scip_device import Device
from hardware.scip_session import Session
from passpmp_ti.scan import Scan


class Wire:
    """Hours pass in seconds, and the same happens every time."""

    def __init__(
        self,
        session: Session,
        device: Device,
        now: float,
        delay: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """
        Args:
            session: of the host, just made.
            device: just made, or left by another host.
            now: the time of both [s].
            delay: how long the next piece of bytes is under way [s].
        """
        self.now = now
        self._session = session
        self._device = device
        self._delay = delay
        device.connect(now)

    def run(self, duration: float) -> list[Scan]:
        """The scans of the next `duration` [s].

        Raises:
            ScipError: the session gave the connection up.
        """
        scans: list[Scan] = []
        end = self.now + duration
        while self.now < end:
            asked = self._session.take()
            if asked:
                self.now += self._delay()
                self._device.receive(asked, self.now)
            told = self._device.advance(self.now)
            if told:
                self.now += self._delay()
                scans += self._session.receive(told, self.now)
                continue
            self._session.check(self.now)
            # a moment later, so that it has passed by any rounding
            event = min(self._device.next_event(), self._session.deadline) + 1e-6
            self.now = max(self.now, min(event, end))
        return scans
