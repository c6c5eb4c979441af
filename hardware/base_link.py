"""A base in another process: its owner serves it, the executor drives it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from hardware.base import Base, BaseLimits, Odometry
from hardware.letterbox import Letterbox
from hardware.messages import Body, Drive, Message, MessageError, Reset, Stop, decode


class BaseServer:
    """Lets one executor at a time drive a base. Its owner calls `step` often.

    A command holds from when it was sent: one that lay about is not obeyed for the whole of the
    base's time-out once more. When the newest is that old, the base is told to stop, and nothing
    but a fresh command lets it go.
    """

    def __init__(
        self, base: Base, address: Path, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """
        Args:
            base: is driven.
            address: socket to listen at; who may enter its directory may drive.
            clock: seconds that never go back, the same for all processes.
        """
        self._base = base
        self._clock = clock
        self._box = Letterbox(address)
        self._session = 0
        self._driver = ""
        self._sent = 0
        self._told: Odometry | None = None
        self._obeyed: float | None = None  # when what is obeyed was sent
        self._held_up = False  # stopped because nothing fresh came, not because somebody said so
        self._told_to_stop = False
        self.garbled = 0
        """Messages that could not be read."""

    def fileno(self) -> int:
        """For `select`."""
        return self._box.fileno()

    def step(self) -> None:
        """Hear the driver, and tell it where the base is."""
        for data, sender in self._box.collect():
            try:
                message = decode(data)
            except MessageError:
                self.garbled += 1
                continue
            self._hear(message, sender)
        if self._obeyed is not None and self._old(self._obeyed):
            self._base.stop()
            # orders that a stopped base did not obey end too: that lets nothing go
            self._obeyed, self._held_up = None, not self._told_to_stop
        odometry = self._base.odometry()
        if odometry is not None and odometry is not self._told and self._driver:
            self._told = odometry
            self._sent += 1
            told = Message(self._session, self._sent, self._clock(), odometry)
            self._box.post(self._driver, told.encode())

    def close(self) -> None:
        """The base stops, and nobody drives it any more."""
        self._base.stop()
        self._box.close()

    def _hear(self, message: Message, sender: str) -> None:
        body = message.body
        if isinstance(body, Stop):
            # whoever says so
            self._base.stop()
            self._obeyed, self._held_up, self._told_to_stop = None, False, True
            return
        if not isinstance(body, (Drive, Reset)) or message.session < self._session:
            return
        self._session, self._driver = message.session, sender
        if self._old(message.sent_at):
            return
        if isinstance(body, Drive):
            if self._held_up:
                self._base.reset()
                self._held_up = False
            # of another clock's future it is no fresher than now
            self._obeyed = min(message.sent_at, self._clock())
            self._base.drive(body.right, body.left)
        elif isinstance(body, Reset):
            self._base.reset()
            self._held_up = self._told_to_stop = False

    def _old(self, sent_at: float) -> bool:
        # a number that is none is no fresh one
        return not self._clock() - self._base.limits.command_timeout <= sent_at


class RemoteBase:
    """A `Base` that another process serves."""

    def __init__(
        self,
        address: Path,
        limits: BaseLimits,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """
        Args:
            address: the server's socket.
            limits: of the base.
            clock: seconds that never go back, the same for all processes.
        """
        self._limits = limits
        self._clock = clock
        self._server = address
        self._session = time.monotonic_ns()
        self._sent = 0
        self._box = Letterbox(address.with_name(f"{address.name}-{self._session:x}"))
        self._told: Odometry | None = None

    @property
    def limits(self) -> BaseLimits:
        return self._limits

    def drive(self, right: float, left: float) -> None:
        self._say(Drive(right, left))

    def odometry(self) -> Odometry | None:
        for data, _ in self._box.collect():
            try:
                message = decode(data)
            except MessageError:
                continue
            if isinstance(message.body, Odometry) and message.session == self._session:
                self._told = message.body
        return self._told

    def stop(self) -> None:
        self._say(Stop())

    def reset(self) -> None:
        self._say(Reset())

    def close(self) -> None:
        self.stop()
        self._box.close()

    def _say(self, body: Body) -> None:
        self._sent += 1
        message = Message(self._session, self._sent, self._clock(), body)
        self._box.post(self._server, message.encode())


def build(*, address: str, **limits: float) -> RemoteBase:
    """A remote base from plain values, as a configuration has them.

    Raises:
        ValueError: a number out of its range, or no directory where the server's socket should be.
    """
    here = Path(address)
    if not here.parent.is_dir():
        raise ValueError(
            f"base.address = {address}: there is no {here.parent}; start what serves the base"
            " first, as hardware/examples/serve_base.py does"
        )
    return RemoteBase(here, BaseLimits(**limits))
