"""SCIP 2, the protocol of Hokuyo's range finders: bytes to numbers, lines and replies, and back.

A host sends a command and a line feed. The device answers with the command's echo, a line with a
status of two characters, lines of data or information, and an empty line. Every line after the
echo ends with a check sum of one character.

Source: Hokuyo, *Communication Protocol Specification for SCIP 2.0*, C-42-03320B, secs. 6, 7, 9.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PORT = 10940
END = b"\n\n"
"""Ends a reply."""
BLOCK = 64
"""Characters of a full line of data, its check sum not counted."""
LONGEST_REPLY = 1 << 16
"""[bytes]; distances and intensities of 10,000 steps would be 61 kB."""
LONGEST_COMMAND = 64
"""[bytes]; the longest that a device knows has 15, a semicolon and 16 more."""
CLOCK_BITS = 24
"""A device counts milliseconds, and begins again after 2^24 of them: 4 h 39 min 37.216 s."""
CLOCK_TURN = 1 << CLOCK_BITS
"""[ms]."""

_LOW, _HIGH = 0x30, 0x6F  # the first and last of the 64 characters that stand for six bits


class ScipError(Exception):
    """Whatever this protocol can raise about what came over the wire."""


class Garbled(ScipError):
    """These bytes are no reply."""


class BadSum(Garbled):
    """A line's check sum is not that of its bytes."""


class Refused(ScipError):
    """A reply, or an answer due, whose status is not that of success."""

    def __init__(self, status: str, about: str = "") -> None:
        super().__init__(f"status {status}{': ' if about else ''}{about}")
        self.status = status


@dataclass(frozen=True, slots=True)
class Reply:
    """One answer of a device."""

    echo: bytes
    """The command as it was sent, text after a semicolon included."""
    status: str
    lines: tuple[bytes, ...] = ()
    """As they came, each with its check sum."""


def check_sum(line: bytes) -> int:
    """The character that ends `line`: the low six bits of the sum of its bytes, made printable."""
    return (sum(line) & 0x3F) + _LOW


def summed(line: bytes) -> bytes:
    """`line` and its check sum."""
    return line + bytes([check_sum(line)])


def checked(line: bytes) -> bytes:
    """`line` without its check sum.

    Raises:
        BadSum: it is another line's.
    """
    if len(line) < 2 or line[-1] != check_sum(line[:-1]):
        raise BadSum(f"check sum of {_shown(line)}")
    return line[:-1]


def encode_numbers(values: np.ndarray, width: int) -> bytes:
    """Numbers as characters of six bits each, the most significant first (sec. 6).

    Args:
        values: [n] integers, from 0 to less than 64^width.
        width: characters a number.

    Raises:
        ValueError: a number that does not fit.
    """
    numbers = np.asarray(values, dtype=np.int64)
    bad = np.flatnonzero((numbers < 0) | (numbers >= 64**width))
    if len(bad):
        raise ValueError(
            f"values[{bad[0]}] = {numbers[bad[0]]}: {width} characters hold 0 to {64**width - 1}"
        )
    shifts = 6 * np.arange(width - 1, -1, -1)
    return (((numbers[:, None] >> shifts) & 0x3F) + _LOW).astype(np.uint8).tobytes()


def decode_numbers(text: bytes, width: int) -> np.ndarray:
    """[n] int64, what `encode_numbers` was given.

    Raises:
        Garbled: another character, or a number cut short.
    """
    if len(text) % width:
        raise Garbled(f"{len(text)} characters are no numbers of {width}")
    digits = np.frombuffer(text, dtype=np.uint8).astype(np.int64)
    if len(digits) and (digits.min() < _LOW or digits.max() > _HIGH):
        raise Garbled(f"no number: {_shown(text)}")
    shifts = 6 * np.arange(width - 1, -1, -1)
    return ((digits.reshape(-1, width) - _LOW) << shifts).sum(axis=1)


def encode_block(text: bytes) -> list[bytes]:
    """Lines of 64 characters, each with its check sum."""
    return [summed(text[i : i + BLOCK]) for i in range(0, len(text), BLOCK)]


def decode_block(lines: tuple[bytes, ...]) -> bytes:
    """What `encode_block` was given. Numbers straddle lines, so lines are joined first.

    Raises:
        BadSum: of a line.
        Garbled: a line that is longer than any, or short before the last.
    """
    for i, line in enumerate(lines):
        if len(line) > BLOCK + 1 or (len(line) <= BLOCK and i + 1 < len(lines)):
            raise Garbled(f"line {i} of {len(lines)} has {len(line)} characters")
    return b"".join(checked(line) for line in lines)


def encode_info(info: dict[str, str]) -> tuple[bytes, ...]:
    """Lines `KEY:value;` and a sum that covers what stands before the semicolon (sec. 8.11-13)."""
    texts = (f"{key}:{value}".encode("ascii") for key, value in info.items())
    return tuple(text + b";" + bytes([check_sum(text)]) for text in texts)


def decode_info(lines: tuple[bytes, ...]) -> dict[str, str]:
    """What `encode_info` was given; the sum may cover the semicolon too, as some firmware has it.

    Raises:
        BadSum: of a line.
        Garbled: a line of another form.
    """
    info = {}
    for line in lines:
        text, semicolon, total = line[:-2], line[-2:-1], line[-1:]
        key, colon, value = text.partition(b":")
        if semicolon != b";" or not colon:
            raise Garbled(f"no information: {_shown(line)}")
        if total[0] not in (check_sum(text), check_sum(text + b";")):
            raise BadSum(f"check sum of {_shown(line)}")
        info[_ascii(key)] = _ascii(value)
    return info


def encode_reply(reply: Reply) -> bytes:
    """What a device sends, the empty line included."""
    status = summed(reply.status.encode("ascii"))
    return b"\n".join((reply.echo, status, *reply.lines)) + END


def decode_reply(frame: bytes) -> Reply:
    """A reply from its bytes, the empty line taken off; its lines are not checked yet.

    Raises:
        Garbled: too short, or a status that is none.
        BadSum: of the status.
    """
    echo, *lines = frame.split(b"\n")
    if not lines or len(lines[0]) != 3:
        raise Garbled(f"no reply: {_shown(frame)}")
    return Reply(echo, _ascii(checked(lines[0])), tuple(lines[1:]))


class Splitter:
    """Cuts a stream of bytes at a separator, and keeps no more than `most` bytes of it."""

    def __init__(self, separator: bytes, most: int) -> None:
        self._separator = separator
        self._most = most
        self._rest = b""
        self.overflows = 0
        """How often more than `most` bytes came without a separator; they were thrown away."""

    def feed(self, data: bytes) -> list[bytes]:
        """The pieces that `data` completes, empty ones left out."""
        *pieces, rest = (self._rest + data).split(self._separator)
        kept = [piece for piece in pieces if len(piece) <= self._most]
        self.overflows += len(pieces) - len(kept)
        if len(rest) > self._most:
            self.overflows += 1
            rest = rest[-len(self._separator) + 1 :] if len(self._separator) > 1 else b""
        self._rest = rest
        return [piece for piece in kept if piece]


def _ascii(text: bytes) -> str:
    try:
        return text.decode("ascii")
    except UnicodeDecodeError as cause:
        raise Garbled(f"no ASCII: {_shown(text)}") from cause


def _shown(text: bytes) -> str:
    return repr(text[:40]) + ("..." if len(text) > 40 else "")
