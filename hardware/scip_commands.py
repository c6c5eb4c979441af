"""The commands of SCIP 2, to bytes and back.

Source: Hokuyo, *Communication Protocol Specification for SCIP 2.0*, C-42-03320B, secs. 8 and 9;
%ST, %SL, RT and RB are of SCIP 2.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from hardware.scip import LONGEST_COMMAND, Refused

DISTANCES = ("GD", "GE", "GS", "MD", "ME", "MS")
"""G: one sweep; M: a stream. D: 18 bits a distance, S: 12, E: distance and intensity."""
ARGUMENTS = {
    "BM": 0, "CR": 2, "DB": 3, "HS": 1, "II": 0, "PP": 0, "QT": 0, "RB": 0, "RS": 0, "RT": 0,
    "SS": 6, "TM": 1, "VV": 0, "%SL": 0, "%ST": 0,
}  # fmt: skip
"""Characters after the name of every command but the measuring ones."""
MULTI_ECHO = ("HD", "HE", "ND", "NE")
"""Of devices that tell several echoes a step."""
LONGEST_TEXT = 16
MOST_STEPS = 9999
MOST_CLUSTER = 99


@dataclass(frozen=True, slots=True)
class Plain:
    """A command without numbers, as `TM0` or `VV`."""

    name: str
    argument: str = ""
    text: str = ""
    """Up to 16 characters that the device gives back."""

    def encode(self) -> bytes:
        """Without the line feed; the echo of a reply is the same."""
        return _with_text(self.name + self.argument, self.text)


@dataclass(frozen=True, slots=True)
class Measure:
    """A command for one sweep or a stream of them."""

    kind: str
    """One of `DISTANCES`."""
    start: int
    """First step."""
    end: int
    """Last step, included."""
    cluster: int = 1
    """Steps that share a value; 0 counts as 1."""
    skip: int = 0
    """Sweeps left out after each one sent; a stream only."""
    count: int = 0
    """Sweeps to send, 0 for no end; in an echo, how many are still to come. A stream only."""
    text: str = ""

    @property
    def streams(self) -> bool:
        return self.kind[0] == "M"

    @property
    def intensities(self) -> bool:
        return self.kind[1] == "E"

    @property
    def width(self) -> int:
        """Characters a value."""
        return 2 if self.kind[1] == "S" else 3

    @property
    def groups(self) -> int:
        """Distances of a sweep; the last group may hold fewer steps."""
        return -(-(self.end - self.start + 1) // max(self.cluster, 1))

    def encode(self) -> bytes:
        """Without the line feed; the echo of a reply is the same but for `count`."""
        head = f"{self.kind}{self.start:04d}{self.end:04d}{self.cluster:02d}"
        tail = f"{self.skip:01d}{self.count:02d}" if self.streams else ""
        return _with_text(head + tail, self.text)

    def asks_for(self, other: Measure) -> bool:
        """Whether the two are one command but for `count`."""
        return replace(self, count=0) == replace(other, count=0)


Command = Plain | Measure


def decode_command(line: bytes) -> Command:
    """The command in a line, its end taken off.

    Raises:
        Refused: no command, or not whole; with the status that a device answers.
    """
    if len(line) > LONGEST_COMMAND:
        raise Refused("0D", "the command is too long")
    body, _, text = _ascii(line).partition(";")
    if len(text) > LONGEST_TEXT:
        raise Refused("0G", f"more than {LONGEST_TEXT} characters of text")
    name = body[:3] if body.startswith("%") else body[:2]
    argument = body[len(name) :]
    if name in DISTANCES:
        return _measure(name, argument, text)
    if name in MULTI_ECHO:
        raise Refused("0F", f"{name}: one echo a step is all there is")
    if name not in ARGUMENTS:
        raise Refused("0E", f"no command {name!r}")
    _check_length(argument, ARGUMENTS[name])
    return Plain(name, argument, text)


def _measure(kind: str, argument: str, text: str) -> Measure:
    fields = [("01", 4), ("02", 4), ("03", 2)]
    if kind[0] == "M":
        fields += [("06", 1), ("07", 2)]
    _check_length(argument, sum(width for _, width in fields))
    numbers = []
    for status, width in fields:
        digits, argument = argument[:width], argument[width:]
        if not (digits.isascii() and digits.isdigit()):
            raise Refused(status, f"no number: {digits!r}")
        numbers.append(int(digits))
    start, end, cluster, skip, count = (*numbers, 0, 0)[:5]
    return Measure(kind, start, end, cluster, skip, count, text)


def _check_length(argument: str, wanted: int) -> None:
    if len(argument) < wanted:
        raise Refused("0H", "the command is too short")
    if len(argument) > wanted:
        raise Refused("0D", "the command is too long")


def _ascii(line: bytes) -> str:
    if any(not 0x20 <= byte < 0x7F for byte in line):
        raise Refused("0E", "characters that no command has")
    return line.decode("ascii")


def _with_text(command: str, text: str) -> bytes:
    return (f"{command};{text}" if text else command).encode("ascii")
