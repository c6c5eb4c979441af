"""A range finder on the network: keeps a connection to it and hands out its scans."""

from __future__ import annotations

import errno
import os
import select
import socket
import time
from collections.abc import Callable, Sequence

from hardware.scip import ScipError
from hardware.scip_receiver import Counters, Pose
from hardware.scip_session import Session, Unfit
from hardware.scip_settings import ScipSettings
from passpmp_ti.scan import Scan

READ = 1 << 16
"""[bytes] taken from a socket at once."""
MOST_READS = 100
"""Pieces of that size taken in one step; no system keeps as much for a slow reader."""
LONGEST_WAIT = 0.05
"""[s] between two looks at deadlines."""


class ScipClient:
    """Reads one range finder. Connects by itself, and again whenever the connection is lost.

    Use it from one thread. Nothing that a device or a network does raises; `trouble` says what was
    wrong last, and `counters` how often what happened.

        with ScipClient(ScipSettings(host="192.168.0.10")) as client:
            scan = client.read(timeout=0.1)  # None where nothing came
    """

    def __init__(
        self,
        settings: ScipSettings,
        *,
        clock: Callable[[], float] = time.monotonic,
        pose_at: Callable[[float], Pose] | None = None,
    ) -> None:
        """
        Args:
            settings: of the device.
            clock: seconds that never go back; scans are stamped by it.
            pose_at: the sensor's pose (x, y, theta) in the world [m, m, rad] at a time of that
                clock, a moment ago; None: scans have the pose (0, 0, 0).
        """
        self.settings = settings
        self.counters = Counters()
        self.trouble = ""
        """Why the last connection, or attempt, ended; empty before any did."""
        self._clock = clock
        self._pose_at = pose_at
        self._newest: Scan | None = None  # that was not read yet
        self._socket: socket.socket | None = None
        self._connecting = False
        self._session: Session | None = None
        self._unsent = b""
        self._give_up_at = 0.0
        self._pause = settings.retry_first
        self._retry_at = clock()

    def __enter__(self) -> ScipClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def session(self) -> Session | None:
        """The connection as it is now, or None."""
        return self._session

    @property
    def streaming(self) -> bool:
        """Whether sweeps come."""
        return self._session is not None and self._session.since <= self._clock()

    @property
    def link(self) -> tuple[socket.socket, bool] | None:
        """The socket, and whether it is still connecting; None where there is none."""
        return None if self._socket is None else (self._socket, self._connecting)

    def read(self, timeout: float) -> Scan | None:
        """The newest scan, if it was not read yet; waits for one up to `timeout` [s].

        Scans that came before it and were not read are passed over: who plans every tenth of a
        second wants what is there now, not what was there in the order in which it came.

        Raises:
            ValueError: the device cannot do what the settings ask.
        """
        until = self._clock() + timeout
        while True:
            self.step()
            if self._newest is not None:
                scan, self._newest = self._newest, None
                return scan
            left = until - self._clock()
            if left <= 0:
                return None
            wait([self], left)

    def step(self) -> None:
        """Do what can be done without waiting.

        Raises:
            ValueError: the device cannot do what the settings ask.
        """
        now = self._clock()
        try:
            if self._socket is None:
                if now >= self._retry_at:
                    self._connect(now)
            elif self._connecting:
                self._finish_connecting(now)
            elif self._session is not None:
                self._exchange(self._socket, self._session, now)
        except Unfit:
            self.close()
            raise
        except (ScipError, OSError) as cause:
            self._lose(str(cause) or type(cause).__name__, now)

    def close(self) -> None:
        """Close the connection. Reading again opens a new one."""
        if self._socket is not None:
            self._socket.close()
        self._socket = self._session = None
        self._connecting = False
        self._unsent = b""

    def _connect(self, now: float) -> None:
        family = socket.AF_INET6 if ":" in self.settings.host else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        # commands are few and short; waiting to join them would spoil the clocks' comparison
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connecting = True
        self._give_up_at = now + self.settings.answer_within
        failure = self._socket.connect_ex((self.settings.host, self.settings.port))
        if failure not in (0, errno.EINPROGRESS, errno.EWOULDBLOCK):
            raise OSError(failure, os.strerror(failure))

    def _finish_connecting(self, now: float) -> None:
        assert self._socket is not None
        if not select.select([], [self._socket], [], 0)[1]:
            if now > self._give_up_at:
                raise ScipError("no connection within the time allowed")
            return
        failure = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if failure:
            raise OSError(failure, os.strerror(failure))
        self._connecting = False
        self._session = Session(self.settings, now, counters=self.counters, pose_at=self._pose_at)
        self._send(self._socket, self._session)

    def _exchange(self, link: socket.socket, session: Session, now: float) -> None:
        before = session.since
        for _ in range(MOST_READS):
            try:
                data = link.recv(READ)
            except BlockingIOError:
                break
            if not data:
                raise ScipError("the device closed the connection")
            # read again: an answer must not seem to have come earlier than it did
            now = self._clock()
            for scan in session.receive(data, now):
                self.counters.passed += self._newest is not None
                self._newest = scan
        session.check(now)
        self.counters.connections += session.since < before
        if now - session.since > self.settings.retry_most:
            self._pause = self.settings.retry_first
        self._send(link, session)

    def _send(self, link: socket.socket, session: Session) -> None:
        self._unsent += session.take()
        if self._unsent:
            try:
                sent = link.send(self._unsent)
            except BlockingIOError:
                return
            self._unsent = self._unsent[sent:]

    def _lose(self, why: str, now: float) -> None:
        self.close()
        self.trouble = why
        self.counters.lost += 1
        self._retry_at = now + self._pause
        self._pause = min(2 * self._pause, self.settings.retry_most)


def wait(clients: Sequence[ScipClient], timeout: float) -> None:
    """Wait until one of the clients may have something to do, `timeout` [s] at the most."""
    timeout = min(timeout, LONGEST_WAIT)
    links = [link for client in clients if (link := client.link) is not None]
    if not links:
        time.sleep(timeout)
        return
    reading = [link for link, connecting in links if not connecting]
    writing = [link for link, connecting in links if connecting]
    select.select(reading, writing, [], timeout)
