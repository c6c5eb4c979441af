"""A range finder that exists in memory only: commands and the time in, replies out. No sockets."""

from __future__ import annotations

import math

import numpy as np

from hardware.scip import (
    LONGEST_COMMAND,
    Refused,
    Reply,
    Splitter,
    encode_info,
    encode_numbers,
    encode_reply,
    summed,
)
from hardware.scip_commands import Command, Measure, decode_command
from hardware.scip_rotor import Nature, Rotor
from hardware.scip_sweeper import Source, Sweeper

Answer = tuple[str, tuple[bytes, ...]]
"""Status and lines."""
STANDBY, ADJUSTING, SINGLE, MULTI, ASLEEP = "000", "002", "003", "004", "005"
STATES = {
    STANDBY: "Idle", ADJUSTING: "Adjusting", SINGLE: "Single", MULTI: "Measuring", ASLEEP: "Sleep",
}  # fmt: skip
REBOOT_DELAY = 1.0
"""[s] from the second RB to the reboot, and the longest from the first to the second."""
MOST_ASKED = 16
"""Single sweeps under way; more are denied."""
MOST_UNSENT = 1 << 17
"""[bytes]; what finds no room is not answered."""


class Device:
    """Answers the commands of SCIP 2.2 as a UST does, and tells what a source shows it.

    Give it what the host sends with `receive`, and send the host what `advance` returns. While
    `is_up` is false there is no connection.
    """

    def __init__(self, source: Source, now: float, nature: Nature | None = None) -> None:
        """
        Args:
            source: what there is to see.
            now: the host's time [s]; no later call may have an earlier one.
            nature: how it is made; None: a UST-10LX.
        """
        self.nature = Nature() if nature is None else nature
        self.state = STANDBY
        self._sweeper = Sweeper(source, self.nature, now)
        self._up_at = -math.inf
        self._reboot_at = math.inf
        self._asked_to_reboot = -math.inf
        self._forget_host()

    def inject(self, fault: str, sweeps: int = 1) -> None:
        """Make something go wrong, as `Sweeper.inject` says."""
        self._sweeper.inject(fault, sweeps)

    @property
    def rotor(self) -> Rotor:
        """Its clock and its mirror."""
        return self._sweeper.rotor

    def is_up(self, now: float) -> bool:
        """Whether a host may connect, and stay."""
        return now >= self._up_at

    def connect(self, now: float) -> None:
        """A host is there."""
        self._forget_host()
        self._sweeper.skip_to(now)

    def disconnect(self) -> None:
        """The host is gone; nothing of it is remembered but the state that it left."""
        self._forget_host()

    def reboot(self, now: float) -> None:
        """The connection ends, nothing answers for a while, and the clock begins at 0."""
        self._forget_host()
        self.state = STANDBY
        self._up_at = now + self.nature.boot_time
        self._reboot_at = math.inf
        self.rotor.reset_clock(now)

    def receive(self, data: bytes, now: float) -> None:
        """Answer what the host sends."""
        for line in self._lines.feed(data.replace(b"\r", b"\n")):
            if len(self._out) > MOST_UNSENT:
                return
            try:
                reply = self._answer(decode_command(line), line, now)
            except Refused as refusal:
                reply = Reply(line, refusal.status)
            if reply is not None:
                self._out += encode_reply(reply)

    def advance(self, now: float) -> bytes:
        """What is to be sent by now; each byte is returned once."""
        if now >= self._reboot_at:
            self.reboot(now)
        self._out += self._sweeper.advance(now)
        if self.state == MULTI and not self._sweeper.streams:
            self.state = STANDBY
        out = bytes(self._out)
        self._out.clear()
        return out

    def next_event(self) -> float:
        """When `advance` may have something new, without anything received [s]."""
        return min(self._reboot_at, self._sweeper.next_event())

    def _forget_host(self) -> None:
        self._lines = Splitter(b"\n", 4 * LONGEST_COMMAND)
        self._out = bytearray()
        self._sweeper.end()
        if self.state == MULTI:
            self.state = STANDBY

    def _answer(self, command: Command, echo: bytes, now: float) -> Reply | None:
        if isinstance(command, Measure):
            return self._measure(command, echo, now)
        answer = {
            "BM": self._light, "II": self._tell_state, "PP": self._tell_parameters,
            "QT": self._stop, "RB": self._ask_to_reboot, "RS": self._reset, "RT": self._reset,
            "TM": self._adjust, "VV": self._tell_version, "%SL": self._sleep,
            "%ST": self._tell_state_number,
        }.get(command.name)  # fmt: skip
        if answer is None:
            raise Refused("0F", f"{command.name}: not with this device")
        status, lines = answer(command.argument, now)
        return Reply(echo, status, lines)

    def _measure(self, command: Measure, echo: bytes, now: float) -> Reply | None:
        p = self.nature.parameters
        if command.end > p.last or command.start < p.first:
            raise Refused("04", f"steps are {p.first} to {p.last}")
        if command.start > command.end:
            raise Refused("05", "the last step is before the first")
        if not command.streams:
            if self.state != SINGLE or len(self._sweeper.asked) >= MOST_ASKED:
                raise Refused("10", "the laser is off, or a stream is under way")
            self._sweeper.asked.append(command)
            return None
        if self.state not in (STANDBY, SINGLE):
            raise Refused("10", "another stream is under way, or the device is not awake")
        self.state = MULTI
        self._sweeper.stream(command, now)
        return Reply(echo, "00")

    def _light(self, _: str, now: float) -> Answer:
        if self.state == ADJUSTING:
            return "10", ()
        if self.state in (SINGLE, MULTI):
            return "02", ()
        self.state = SINGLE
        return "00", ()

    def _stop(self, _: str, now: float) -> Answer:
        if self.state == ADJUSTING:
            return "10", ()
        self._end_sweeps()
        return "00", ()

    def _reset(self, _: str, now: float) -> Answer:
        self._end_sweeps()
        self.rotor.reset_clock(now)
        return "00", ()

    def _ask_to_reboot(self, _: str, now: float) -> Answer:
        if now - self._asked_to_reboot <= REBOOT_DELAY:
            self._reboot_at = now + REBOOT_DELAY
            return "00", ()
        self._asked_to_reboot = now
        return "01", ()

    def _adjust(self, control: str, now: float) -> Answer:
        if control == "0":
            if self.state in (MULTI, ASLEEP):
                return "10", ()
            already = self.state == ADJUSTING
            self._end_sweeps()
            self.state = ADJUSTING
            return ("02" if already else "00"), ()
        if control == "1":
            if self.state != ADJUSTING:
                return "04", ()
            return "00", (summed(encode_numbers(np.array([self.rotor.reading(now)]), 4)),)
        if control == "2":
            if self.state != ADJUSTING:
                return "03", ()
            self.state = STANDBY
            return "00", ()
        return "01", ()

    def _sleep(self, _: str, now: float) -> Answer:
        if self.state not in (STANDBY, SINGLE):
            return "10", ()
        self._end_sweeps()
        self.state = ASLEEP
        return "00", ()

    def _tell_version(self, _: str, now: float) -> Answer:
        return "00", encode_info(
            {
                "VEND": "emulated", "PROD": self.nature.parameters.model, "FIRM": "4.0.2-A",
                "PROT": "SCIP 2.2", "SERI": "E0000001",
            }
        )  # fmt: skip

    def _tell_parameters(self, _: str, now: float) -> Answer:
        if self.state == ADJUSTING:
            return "10", ()
        return "00", encode_info(self.nature.parameters.to_info())

    def _tell_state(self, _: str, now: float) -> Answer:
        lit = self.state in (SINGLE, MULTI)
        return "00", encode_info(
            {
                "MODL": self.nature.parameters.model, "LASR": "ON" if lit else "OFF",
                "SCSP": str(self.nature.parameters.speed), "MESM": STATES[self.state],
                "SBPS": "Ethernet 100 [Mbps]", "TIME": f"{self.rotor.reading(now):06X}",
                "STAT": "sensor is working normally",
            }
        )  # fmt: skip

    def _tell_state_number(self, _: str, now: float) -> Answer:
        return "00", (summed(self.state.encode("ascii")),)

    def _end_sweeps(self) -> None:
        self.state = STANDBY
        self._sweeper.end()
