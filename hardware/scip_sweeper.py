"""What an emulated device sweeps and sends, with faults where they are wanted."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hardware.scip import Reply, encode_reply
from hardware.scip_commands import Measure
from hardware.scip_rotor import Nature, Rotor
from hardware.scip_sweep import FIRST_CODE, Sweep, distances_of, encode_sweep
from passpmp_ti import door

Source = Callable[[float], np.ndarray]
"""From when a sweep begins on the host's clock [s] to what each step, from the device's first to
its last, measures then: floats are ranges as a `Scan` means them [m], whole numbers are sent as
they are [mm]."""

FAULTS = ("checksum", "drop", "freeze", "stall", "truncate", "unstable")
MOST_BEHIND = 4
"""Sweeps that are made up for after a pause."""
MOST_HELD = 1 << 17
"""[bytes] of sweeps; what finds no room is not sent."""
STRENGTH = 1000
"""The intensity of every return."""


class Sweeper:
    """Turns all the time, and sends what was asked for."""

    def __init__(self, source: Source, nature: Nature, now: float) -> None:
        """
        Args:
            source: what there is to see.
            nature: of the device.
            now: when it is switched on, host's time [s].
        """
        self.rotor = Rotor(nature, now)
        self.asked: list[Measure] = []
        """Single sweeps that were asked for and are not sent yet."""
        self._source = source
        self._nature = nature
        self._faults = dict.fromkeys(FAULTS, 0)
        self._seen: np.ndarray | None = None
        self._next = 0  # the first turn that is not looked at yet
        self._stream: Measure | None = None
        self._from = 0  # the turn with which the stream begins
        self._held = bytearray()  # by the fault "stall"

    def inject(self, fault: str, sweeps: int = 1) -> None:
        """Make something go wrong with the next sweeps that are sent.

        Args:
            fault: "checksum": a byte is changed; "drop": not sent; "freeze": the distances of the
                sweep before, with a new stamp; "stall": held back, and sent all at once when the
                last of them is ready; "truncate": its second half is missing; "unstable": the
                device says that it is, and sends no distances.
            sweeps: how many; 0 ends the fault.

        Raises:
            ValueError: no such fault.
        """
        door.choice("Device.inject", "fault", fault, FAULTS)
        self._faults[fault] = door.whole("Device.inject", "sweeps", sweeps, least=0)

    @property
    def streams(self) -> bool:
        """Whether a stream is under way."""
        return self._stream is not None

    def stream(self, command: Measure, now: float) -> None:
        """Begin a stream with the next turn."""
        self._stream = command
        self._from = self._next = max(self._next, self.rotor.first_after(now))

    def end(self) -> None:
        """Nothing is asked for any more."""
        self._stream = None
        self.asked.clear()
        self._held.clear()

    def skip_to(self, now: float) -> None:
        """Turns that began before are not told of."""
        self._next = max(self._next, self.rotor.first_after(now))

    def advance(self, now: float) -> bytes:
        """Replies that are ready by now; each byte is returned once."""
        self._next = max(self._next, self.rotor.first_after(now) - MOST_BEHIND)
        told = b""
        while self.rotor.ready(self._next) <= now:
            told += self._turn(self._next)
            self._next += 1
        return told

    def next_event(self) -> float:
        """When `advance` may have something new [s]."""
        return self.rotor.ready(self._next) if self.streams or self.asked else math.inf

    def _turn(self, turn: int) -> bytes:
        """What is sent of one turn."""
        asked, self.asked = self.asked, []
        stream = self._stream
        if stream is not None and (turn - self._from) % (stream.skip + 1):
            stream = None
        if not asked and stream is None:
            return b""
        distances = self._look(turn)
        stamp = self.rotor.reading(self.rotor.begin(turn))
        told = b""
        for command in asked:
            told += self._deliver(command, _part(command, distances, stamp, self._nature))
        if stream is not None:
            if stream.count:
                stream = replace(stream, count=stream.count - 1)
                self._stream = stream if stream.count else None
            told += self._deliver(stream, _part(stream, distances, stamp, self._nature))
        return told

    def _look(self, turn: int) -> np.ndarray:
        """[steps] mm or codes."""
        if self._seen is not None and self._spend("freeze"):
            return self._seen
        seen = np.asarray(self._source(self.rotor.begin(turn)))
        p = self._nature.parameters
        if seen.shape != (p.steps,):
            raise ValueError(
                f"Device.source must return {p.steps} values, one for each step from {p.first} to"
                f" {p.last}; got shape {seen.shape}"
            )
        if not np.issubdtype(seen.dtype, np.integer):
            seen = distances_of(seen, p, self._nature.codes)
        self._seen = seen.astype(np.int64)
        return self._seen

    def _deliver(self, command: Measure, sweep: Sweep) -> bytes:
        """The bytes of one reply, and of those that were held back before it, faults included."""
        frame = encode_reply(encode_sweep(command, sweep))
        if self._spend("unstable"):
            frame = encode_reply(Reply(command.encode(), "0M"))
        if self._spend("checksum"):
            middle = len(frame) // 2
            frame = frame[:middle] + bytes([frame[middle] ^ 1]) + frame[middle + 1 :]
        if self._spend("truncate"):
            frame = frame[: len(frame) // 2]
        if self._spend("drop"):
            frame = b""
        stalled = self._spend("stall")
        if len(self._held) < MOST_HELD:
            self._held += frame
        if stalled and self._faults["stall"]:
            return b""
        told = bytes(self._held)
        self._held.clear()
        return told

    def _spend(self, fault: str) -> bool:
        """Whether this sweep has the fault."""
        left = self._faults[fault]
        self._faults[fault] = max(0, left - 1)
        return left > 0


def _part(command: Measure, distances: np.ndarray, stamp: int, nature: Nature) -> Sweep:
    """The steps that a command asks for; of each cluster the least distance, else a code."""
    p = nature.parameters
    asked = distances[command.start - p.first : command.end - p.first + 1]
    if command.cluster > 1:
        # a code stands only where no step of the cluster has a distance
        measured = (asked >= p.nearest) & (asked < FIRST_CODE)
        order = np.where(measured, asked, asked + FIRST_CODE + 4)
        starts = np.arange(0, len(asked), command.cluster)
        least = np.minimum.reduceat(order, starts)
        asked = np.where(least > FIRST_CODE + 3, least - FIRST_CODE - 4, least)
    strength = np.where((asked >= p.nearest) & (asked < FIRST_CODE), STRENGTH, 0)
    return Sweep(stamp, asked, strength)
