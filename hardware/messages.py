"""What planner, sensors, executor and base say to each other: messages to bytes and back.

    magic "PMPX" | version u8 | kind u8 | zero u16 | length of the body u32 | session u64
    | sequence u32 | zero u32 | sent at f64 [s] | body | CRC-32 of all before

All little endian. A message is one datagram. Decoding tells whether it is whole and well formed;
whether what it says makes sense is for who hears it.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from hardware.base import Odometry
from hardware.status import Reason, State, Status, Verdict
from passpmp_ti.trajectory import Trajectory

MAGIC, VERSION = b"PMPX", 1
HEADER = struct.Struct("<4sBBHIQIId")
SUM = struct.Struct("<I")
MOST_STATES = 4000
"""Longest trajectory; its message fits into the buffer that Linux gives a socket unless told
otherwise."""
MOST_ODOMETRY = 64
COUNTS = struct.Struct("<II")
WHEELS = struct.Struct("<dd")
ODOMETRY = struct.Struct("<6d")
STATUS = struct.Struct("<3BxI QI QI QI 9d 4I")
LONGEST = HEADER.size + COUNTS.size + 6 * 8 * MOST_STATES + SUM.size
"""[bytes]; nothing longer is a message."""


class MessageError(Exception):
    """Bytes that are no message."""


class Torn(MessageError):
    """It is not whole: its length or its sum is wrong."""


class Foreign(MessageError):
    """Whole, but nobody here talks like that."""


class Source(IntEnum):
    """Whose heart beats."""

    PLANNER = 1
    SENSOR = 2


@dataclass(frozen=True, slots=True)
class Offer:
    """A trajectory to follow from its start on."""

    trajectory: Trajectory


@dataclass(frozen=True, slots=True)
class Beat:
    """A sign of life."""

    source: Source
    of: float
    """When there was life: of a sensor, the stamp of its newest scan [s]."""


@dataclass(frozen=True, slots=True)
class Ask:
    """Tell me your status."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop for good."""


@dataclass(frozen=True, slots=True)
class Reset:
    """Forget that you were told to stop."""


@dataclass(frozen=True, slots=True)
class Drive:
    """Wheel speeds for a base [m/s]."""

    right: float
    left: float


Body = Offer | Beat | Ask | Stop | Reset | Drive | Odometry | Status
KINDS: tuple[type, ...] = (Offer, Beat, Ask, Stop, Reset, Drive, Odometry, Status)


@dataclass(frozen=True, slots=True)
class Message:
    """A body, and whom it is from."""

    session: int
    """Which run of its sender; a later run has a greater number."""
    sequence: int
    """Grows with every message that its sender sends."""
    sent_at: float
    """[s], monotonic."""
    body: Body

    def encode(self) -> bytes:
        """Its bytes."""
        body = _encode(self.body)
        kind = KINDS.index(type(self.body))
        head = HEADER.pack(
            MAGIC, VERSION, kind, 0, len(body), self.session, self.sequence, 0, self.sent_at
        )
        return head + body + SUM.pack(zlib.crc32(head + body))


def decode(data: bytes) -> Message:
    """The message in a datagram.

    Raises:
        MessageError: there is none.
    """
    if not HEADER.size + SUM.size <= len(data) <= LONGEST:
        raise Torn(f"{len(data)} bytes are no message")
    magic, version, kind, zero, length, session, sequence, null, sent_at = HEADER.unpack_from(data)
    if magic != MAGIC:
        raise Foreign(f"it begins with {magic!r}")
    if length != len(data) - HEADER.size - SUM.size:
        raise Torn(f"{len(data)} bytes hold no body of {length}")
    whole = memoryview(data)
    if zlib.crc32(whole[: -SUM.size]) != SUM.unpack(whole[-SUM.size :])[0]:
        raise Torn("its sum is wrong")
    if version != VERSION or kind >= len(KINDS) or zero or null:
        raise Foreign(f"version {version}, kind {kind}")
    try:
        body = _decode(KINDS[kind], data[HEADER.size : -SUM.size])
    except (struct.error, ValueError) as cause:
        raise Foreign(f"no {KINDS[kind].__name__}: {cause}") from cause
    return Message(session, sequence, sent_at, body)


def _encode(body: Body) -> bytes:
    if isinstance(body, Offer):
        t = body.trajectory
        if len(t.times) > MOST_STATES:
            raise ValueError(f"a trajectory may have {MOST_STATES} states; got {len(t.times)}")
        numbers = np.column_stack([t.times, t.states]).astype("<f8")
        return COUNTS.pack(len(t.times), t.brakes_from) + numbers.tobytes()
    if isinstance(body, Beat):
        return struct.pack("<Bd", body.source, body.of)
    if isinstance(body, Drive):
        return WHEELS.pack(body.right, body.left)
    if isinstance(body, Odometry):
        return ODOMETRY.pack(*body)
    if isinstance(body, Status):
        return _encode_status(body)
    return b""


def _decode(kind: type, data: bytes) -> Body:
    if kind is Offer:
        count, brakes_from = COUNTS.unpack_from(data)
        numbers = np.frombuffer(data, "<f8", offset=COUNTS.size)
        if count < 1 or brakes_from >= count or numbers.size != 6 * count:
            raise ValueError(f"{count} states, braking from {brakes_from}, in {len(data)} bytes")
        rows = numbers.reshape(count, 6).astype(np.float64)
        return Offer(Trajectory(rows[:, 0].copy(), rows[:, 1:].copy(), brakes_from))
    if kind is Beat:
        source, of = struct.unpack("<Bd", data)
        return Beat(Source(source), of)
    if kind is Drive:
        return Drive(*WHEELS.unpack(data))
    if kind is Odometry:
        return Odometry(*ODOMETRY.unpack(data))
    if kind is Status:
        return _decode_status(data)
    if data:
        raise ValueError(f"{len(data)} bytes where there are none")
    body: Body = kind()
    return body


def _encode_status(s: Status) -> bytes:
    recent = s.odometry[-MOST_ODOMETRY:]
    head = STATUS.pack(
        s.state, s.reason, s.verdict, len(recent), *s.held, *s.newest, *s.judged,
        s.stamp, *s.rests, s.rests_from, s.error, s.worst_error, s.right, s.left,
        s.taken, s.refused, s.garbled, s.overruns,
    )  # fmt: skip
    return head + b"".join(ODOMETRY.pack(*o) for o in recent)


def _decode_status(data: bytes) -> Status:
    (
        state, reason, verdict, count, held, held_n, newest, newest_n, judged, judged_n,
        stamp, x, y, theta, rests_from, error, worst_error, right, left,
        taken, refused, garbled, overruns,
    ) = STATUS.unpack_from(data)  # fmt: skip
    rest = data[STATUS.size :]
    if count > MOST_ODOMETRY or len(rest) != count * ODOMETRY.size:
        raise ValueError(f"{count} odometries in {len(rest)} bytes")
    return Status(
        stamp=stamp, state=State(state), reason=Reason(reason), held=(held, held_n),
        newest=(newest, newest_n), rests=(x, y, theta), rests_from=rests_from,
        judged=(judged, judged_n), verdict=Verdict(verdict), error=error,
        worst_error=worst_error, right=right, left=left, taken=taken, refused=refused,
        garbled=garbled, overruns=overruns,
        odometry=tuple(Odometry(*row) for row in ODOMETRY.iter_unpack(rest)),
    )  # fmt: skip
