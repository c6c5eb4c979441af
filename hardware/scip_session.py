"""The host's side of one connection: bytes and the time in, bytes and scans out. No sockets."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator

from hardware.scip import (
    END,
    LONGEST_REPLY,
    BadSum,
    Garbled,
    Refused,
    Reply,
    ScipError,
    Splitter,
    checked,
    decode_info,
    decode_numbers,
    decode_reply,
)
from hardware.scip_clock import DeviceClock
from hardware.scip_commands import Measure, Plain
from hardware.scip_receiver import Counters, Pose, Receiver
from hardware.scip_settings import ScipSettings
from hardware.scip_sweep import Parameters, Sweep, decode_sweep
from passpmp_ti.scan import Scan

SETTLED = 1.0
"""[s] before clocks are compared again because scans could not be promised their stamp error."""

Heard = tuple[Reply, float]
"""A reply, and when it was there [s]."""


class Silent(ScipError):
    """Nothing came for too long."""


class Unfit(ScipError, ValueError):
    """The device cannot do what its settings ask of it: no new connection would help."""


class Session:
    """Opens a device, compares clocks, and turns its sweeps into scans.

    Whoever owns the connection gives each piece of bytes to `receive`, calls `check` from time to
    time, and sends what `take` returns. Any `ScipError` means that the connection is to be closed.
    """

    def __init__(
        self,
        settings: ScipSettings,
        now: float,
        *,
        counters: Counters | None = None,
        pose_at: Callable[[float], Pose] | None = None,
    ) -> None:
        """
        Args:
            settings: of the device.
            now: the host's time [s]; no later call may have an earlier one.
            counters: are counted on.
            pose_at: the sensor's pose in the world at a time; None: scans have the pose (0, 0, 0).
        """
        self.counters = Counters() if counters is None else counters
        self.version: dict[str, str] = {}
        self.state: dict[str, str] = {}
        self.parameters: Parameters | None = None
        self.clock: DeviceClock | None = None
        """The device's, once it is compared."""
        self.sweep: Sweep | None = None
        """The newest one, as it came."""
        self.since = math.inf
        """When the first sweep came [s]; inf before."""
        self._settings = settings
        self._pose_at = pose_at
        self._splitter = Splitter(END, LONGEST_REPLY)
        self._now = now
        self._deadline = now + settings.answer_within
        self._out = bytearray()
        self._scans: list[Scan] = []
        self._garbled_in_row = 0
        self._script = self._conversation()
        next(self._script)

    @property
    def deadline(self) -> float:
        """When `check` has something to say if nothing comes [s]."""
        return self._deadline

    def take(self) -> bytes:
        """What is to be sent; each byte is returned once."""
        out = bytes(self._out)
        self._out.clear()
        return out

    def check(self, now: float) -> None:
        """Nothing may have come for too long.

        Raises:
            Silent: it has.
        """
        if now > self._deadline:
            raise Silent(f"nothing usable came for {now - self._deadline:.3f} s too long")

    def receive(self, data: bytes, now: float) -> list[Scan]:
        """Scans in what came.

        Raises:
            ScipError: the connection cannot be used any more.
        """
        self._now = now
        overflows = self._splitter.overflows
        frames = self._splitter.feed(data)
        for _ in range(self._splitter.overflows - overflows):
            self._count_garbled(Garbled("a reply without an end"))
        for frame in frames:
            try:
                # an empty line too many is left over from before
                reply = decode_reply(frame.lstrip(b"\n"))
            except Garbled as error:
                self._count_garbled(error)
            else:
                self._script.send((reply, now))
        scans, self._scans = self._scans, []
        return scans

    def _count_garbled(self, error: Garbled) -> None:
        if isinstance(error, BadSum):
            self.counters.bad_sums += 1
        else:
            self.counters.garbled += 1
        self._garbled_in_row += 1
        if self._garbled_in_row >= self._settings.garbled_most:
            raise ScipError(f"{self._garbled_in_row} replies in a row could not be read; {error}")

    def _conversation(self) -> Generator[None, Heard, None]:
        """All that is said, in order; each `yield` waits for a reply."""
        # a device may still stream, or adjust its clock, for whoever was connected before
        yield from self._ask(Plain("TM", "2"))
        yield from self._ask(Plain("QT"))
        self.version = yield from self._ask_info("VV")
        parameters = Parameters.from_info((yield from self._ask_info("PP")))
        self.state = yield from self._ask_info("II")
        self.parameters = parameters
        command = self._fitting(parameters)
        clock = self.clock = DeviceClock(self._settings.drift)
        receiver = Receiver(
            self._settings, parameters, command, clock, self.counters, self._pose_at
        )
        sweeps = self._stream if command.streams else self._ask_for_each
        while True:
            yield from self._compare_clocks(clock)
            receiver.clocks_compared()
            yield from sweeps(command, receiver)
            yield from self._ask(Plain("QT"), "00")

    def _ask(self, command: Plain | Measure, *accepted: str) -> Generator[None, Heard, Heard]:
        """The answer to a command; where statuses are named it must have one of them."""
        text = command.encode()
        self._out += text + b"\n"
        self._deadline = self._now + self._settings.answer_within
        reply, at = yield
        while reply.echo != text:
            self.counters.strays += 1
            reply, at = yield
        if accepted and reply.status not in accepted:
            raise Refused(reply.status, text.decode("ascii"))
        return reply, at

    def _ask_info(self, name: str) -> Generator[None, Heard, dict[str, str]]:
        reply, _ = yield from self._ask(Plain(name), "00")
        return decode_info(reply.lines)

    def _compare_clocks(self, clock: DeviceClock) -> Generator[None, Heard, None]:
        yield from self._ask(Plain("TM", "0"), "00", "02")
        for _ in range(self._settings.clock_samples):
            asked = self._now
            reply, answered = yield from self._ask(Plain("TM", "1"), "00")
            if len(reply.lines) != 1:
                raise Garbled("a clock without a time")
            reading = decode_numbers(checked(reply.lines[0]), 4)
            if len(reading) != 1:
                raise Garbled("a clock without a time")
            clock.exchanged(int(reading[0]), asked, answered)
        yield from self._ask(Plain("TM", "2"), "00", "03")

    def _stream(self, command: Measure, receiver: Receiver) -> Generator[None, Heard, None]:
        yield from self._ask(command, "00")
        self._deadline = self._now + self._settings.silent_after
        compared = self._now
        while not self._doubtful(receiver, compared):
            reply, at = yield
            self._hear_sweep(command, receiver, reply, at, good="99")
            # what is not new is no sign of life
            self._deadline = max(self._deadline, receiver.newest_at + self._settings.silent_after)

    def _ask_for_each(self, command: Measure, receiver: Receiver) -> Generator[None, Heard, None]:
        yield from self._ask(Plain("BM"), "00", "02")
        compared = self._now
        while not self._doubtful(receiver, compared):
            reply, at = yield from self._ask(command)
            self._hear_sweep(command, receiver, reply, at, good="00")

    def _doubtful(self, receiver: Receiver, compared: float) -> bool:
        """Whether the clocks have to be compared again."""
        due = SETTLED if receiver.doubts else self._settings.clock_every
        return self._now - compared >= min(due, self._settings.clock_every)

    def _fitting(self, parameters: Parameters) -> Measure:
        """The command for what the settings ask, or a refusal."""
        s = self._settings
        start = parameters.first if s.start is None else s.start
        end = parameters.last if s.end is None else s.end
        if not parameters.first <= start < end <= parameters.last:
            raise Unfit(
                f"ScipSettings.start and .end must lie within the {parameters.model}'s steps"
                f" {parameters.first} to {parameters.last}; got {start} and {end}"
            )
        steps = end - start + 1
        # the last group's bearing would be another than its place says
        if steps % s.cluster or steps < 2 * s.cluster:
            raise Unfit(
                f"ScipSettings.cluster must divide the {steps} steps from {start} to {end} and"
                f" leave two beams or more; got {s.cluster}"
            )
        if s.range_max * 1000 > parameters.farthest:
            raise Unfit(
                f"ScipSettings.range_max must be at most the {parameters.model}'s"
                f" {parameters.farthest / 1000:g} m; got {s.range_max:g}"
            )
        kind = ("M" if s.streams else "G") + ("E" if s.intensities else "D")
        return Measure(kind, start, end, s.cluster, s.skip if s.streams else 0)

    def _hear_sweep(
        self, command: Measure, receiver: Receiver, reply: Reply, at: float, *, good: str
    ) -> None:
        if reply.status == good:
            try:
                sweep = decode_sweep(command, reply)
            except Garbled as error:
                self._count_garbled(error)
                return
            self._garbled_in_row = 0
            self.sweep = sweep
            scan = receiver.take(sweep, at)
            self.since = min(self.since, at)
            if scan is not None:
                self._scans.append(scan)
        elif reply.status == "0M":
            self.counters.unstable += 1
        elif reply.status in ("00", "98"):
            self.counters.strays += 1
        else:
            raise Refused(reply.status, command.encode().decode("ascii"))
