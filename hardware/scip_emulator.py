"""An emulated range finder on a TCP port, for whatever reads a real one."""

from __future__ import annotations

import select
import socket
import threading
import time
from collections.abc import Callable

from hardware.scip_device import MOST_UNSENT, Device
from passpmp_ti import door

LOOPBACK = "127.0.0.1"
READ = 4096
"""[bytes] taken from a host at once."""
SHORTEST_SEND = 1 << 14
"""[bytes] of the system's own buffer: a host that does not read loses sweeps, as with a device."""
LONGEST_WAIT = 0.05
"""[s] between two looks at what another thread may have changed."""


class Emulator:
    """Serves one host at a time, from a thread of its own.

    with Emulator(lambda now: Device(source, now)) as emulator:
        host, port = emulator.address
    """

    def __init__(
        self,
        make: Callable[[float], Device],
        *,
        host: str = LOOPBACK,
        port: int = 0,
        second: str = "refuse",
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """
        Args:
            make: makes the device, given the time.
            host: the address to listen at. The protocol knows no secret: whoever reaches it can
                read it, so it is loopback unless another is named.
            port: 0: any that is free.
            second: what becomes of a second host, "refuse": it is turned away; "steal": it takes
                the first one's place.
            clock: seconds that never go back.
        """
        door.choice("Emulator", "second", second, ("refuse", "steal"))
        door.whole("Emulator", "port", port, least=0, most=65535)
        self._clock = clock
        self._device = make(clock())
        self._steals = second == "steal"
        self._host: socket.socket | None = None
        self._unsent = b""
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._listener = socket.create_server((host, port), backlog=4)
        self._listener.setblocking(False)
        self._address = self._listener.getsockname()[:2]
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._serve, name="scip-emulator", daemon=True)
        self._thread.start()

    def __enter__(self) -> Emulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def address(self) -> tuple[str, int]:
        """(host, port) that it listens at."""
        return self._address

    def inject(self, fault: str, sweeps: int = 1) -> None:
        """As `Device.inject`."""
        with self._lock:
            self._device.inject(fault, sweeps)

    def reboot(self) -> None:
        """As if its power had failed for a moment."""
        with self._lock:
            self._device.reboot(self._clock())

    def hang_up(self) -> None:
        """The connection ends, and nothing else changes: a cable that was pulled and put back."""
        with self._lock:
            self._drop()

    def close(self) -> None:
        """Stop serving.

        Raises:
            RuntimeError: the thread had ended by itself, as where a source raises; says why.
        """
        self._closed.set()
        self._thread.join()
        if self._failure is not None:
            raise RuntimeError(f"Emulator: {self._failure}") from self._failure

    def _serve(self) -> None:
        try:
            while not self._closed.is_set():
                self._wait()
                with self._lock:
                    self._step(self._clock())
        except Exception as failure:
            self._failure = failure
        finally:
            self._listener.close()
            self._drop()

    def _wait(self) -> None:
        with self._lock:
            left = max(0.0, min(self._device.next_event() - self._clock(), LONGEST_WAIT))
            hosts = [] if self._host is None else [self._host]
            sending = hosts if self._unsent else []
            hearing = hosts if self._may_hear() else []
        try:
            select.select([self._listener, *hearing], sending, [], left)
        except (OSError, ValueError):
            # another thread hung up meanwhile
            return

    def _step(self, now: float) -> None:
        self._accept(now)
        try:
            if self._host is not None:
                self._hear(self._host, now)
            # the device's time goes on without a host
            self._unsent += self._device.advance(self._clock())
            if self._host is None or not self._device.is_up(now):
                self._drop()
            elif self._unsent:
                self._unsent = self._unsent[self._host.send(self._unsent) :]
        except BlockingIOError:
            return
        except OSError:
            self._drop()

    def _accept(self, now: float) -> None:
        try:
            host, _ = self._listener.accept()
        except BlockingIOError:
            return
        if not self._device.is_up(now) or (self._host is not None and not self._steals):
            host.close()
            return
        self._drop()
        host.setblocking(False)
        host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        host.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SHORTEST_SEND)
        self._host = host
        self._device.connect(now)

    def _hear(self, host: socket.socket, now: float) -> None:
        if not self._may_hear():
            return
        try:
            data = host.recv(READ)
        except BlockingIOError:
            return
        if not data:
            raise ConnectionResetError("the host is gone")
        self._device.receive(data, now)

    def _may_hear(self) -> bool:
        """A host that does not read its answers is not listened to."""
        return len(self._unsent) <= MOST_UNSENT

    def _drop(self) -> None:
        if self._host is not None:
            self._host.close()
            self._device.disconnect()
        self._host = None
        self._unsent = b""
