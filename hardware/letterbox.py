"""A socket of the file system that takes datagrams, and sends them."""

from __future__ import annotations

import contextlib
import os
import socket
from pathlib import Path

from hardware.messages import LONGEST

LONGEST_NAME = 100
"""[bytes] of an address; systems allow little more."""
MOST_AT_ONCE = 64
"""Datagrams taken in one go: who floods one box does not keep its owner from its work."""
BUFFER = 1 << 20
"""[bytes] asked of the system for what was sent and not read yet."""


class Letterbox:
    """Takes what is put into it; who may enter its directory may do that.

    Nothing waits: what a full box cannot take is lost, as datagrams are.
    """

    def __init__(self, address: Path) -> None:
        """
        Raises:
            ValueError: the address is too long for a socket.
        """
        if len(os.fsencode(address)) > LONGEST_NAME:
            raise ValueError(
                f"Letterbox.address must have at most {LONGEST_NAME} bytes; got {address}; take a"
                " directory nearer to the root"
            )
        self.address = address
        # what a process that was killed has left behind
        address.unlink(missing_ok=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        for option in (socket.SO_RCVBUF, socket.SO_SNDBUF):
            self._socket.setsockopt(socket.SOL_SOCKET, option, BUFFER)
        self._socket.bind(os.fsencode(address))
        self._own = _identity(address)

    def fileno(self) -> int:
        """For `select`."""
        return self._socket.fileno()

    def post(self, to: str | Path, data: bytes) -> bool:
        """Whether it could be sent: nobody there, or a box that is full, is no error here."""
        try:
            self._socket.sendto(data, os.fsencode(to))
        except OSError:
            return False
        return True

    def collect(self, most: int = MOST_AT_ONCE) -> list[tuple[bytes, str]]:
        """What came, in order, each with its sender's address ("" where it has none).

        Args:
            most: letters that are taken.
        """
        letters: list[tuple[bytes, str]] = []
        while len(letters) < most:
            try:
                # one byte more tells what is too long from what just fits
                data, sender = self._socket.recvfrom(LONGEST + 1)
            except OSError:
                break
            letters.append((data, os.fsdecode(sender) if sender else ""))
        return letters

    def close(self) -> None:
        """Nothing comes any more. What another has put at the address since is left to it."""
        self._socket.close()
        with contextlib.suppress(OSError):
            if _identity(self.address) == self._own:
                self.address.unlink()


def _identity(address: Path) -> tuple[int, int]:
    there = address.lstat()
    return there.st_dev, there.st_ino
