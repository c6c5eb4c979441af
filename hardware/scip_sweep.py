"""What a device measures: its parameters, a sweep as it comes, and ranges as they are meant."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hardware.scip import (
    Garbled,
    Refused,
    Reply,
    checked,
    decode_block,
    decode_numbers,
    encode_block,
    encode_numbers,
    summed,
)
from hardware.scip_commands import MOST_STEPS, Measure, decode_command

FIRST_CODE = 65533
"""From here on a number is no distance but a code, as one below the device's least distance is."""
AT_THE_SENSOR = 1e-3
"""[m] Where something stands that is nearer than the device can measure."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """What PP tells of a device. Step k looks along (k - front) 2 pi / steps_per_turn."""

    model: str
    nearest: int
    """Least distance [mm]; below are codes."""
    farthest: int
    """Greatest distance [mm]."""
    steps_per_turn: int
    first: int
    """First step that is measured."""
    last: int
    """Last step that is measured."""
    front: int
    """The step that looks ahead."""
    speed: int
    """Turns a minute."""

    @property
    def period(self) -> float:
        """From one sweep to the next by the device's own clock [s]."""
        return 60.0 / self.speed

    @property
    def steps(self) -> int:
        return self.last - self.first + 1

    def angle(self, step: float) -> float:
        """Bearing in the sensor's frame, counter-clockwise [rad]."""
        return (step - self.front) * 2 * math.pi / self.steps_per_turn

    def after(self, step: float) -> float:
        """From the sweep's time stamp to this step [s]."""
        return self.period * step / self.steps_per_turn

    def to_info(self) -> dict[str, str]:
        return {key: str(getattr(self, name)) for key, name in _KEYS.items()}

    @classmethod
    def from_info(cls, info: dict[str, str]) -> Parameters:
        """What a device says of itself.

        Raises:
            Garbled: something is not said, or cannot be.
        """
        given: dict[str, int] = {}
        for key, name in _KEYS.items():
            text = info.get(key, "")
            if name == "model":
                continue
            if not (text.isascii() and text.isdigit() and len(text) <= 9):
                raise Garbled(f"PP: {key} must be a whole number; got {text!r}")
            given[name] = int(text)
        found = cls(model=info.get("MODL", ""), **given)
        if not (
            0 < found.nearest < found.farthest < FIRST_CODE
            and found.first < found.last <= MOST_STEPS
            and found.steps <= found.steps_per_turn
            and found.last < 2 * found.steps_per_turn
            and found.front <= MOST_STEPS
            and found.speed > 0
        ):
            raise Garbled(f"PP: these numbers belong to no range finder: {found}")
        return found


_KEYS = {
    "MODL": "model", "DMIN": "nearest", "DMAX": "farthest", "ARES": "steps_per_turn",
    "AMIN": "first", "AMAX": "last", "AFRT": "front", "SCAN": "speed",
}  # fmt: skip

UST_10LX = Parameters(
    model="UST-10LX", nearest=20, farthest=30000, steps_per_turn=1440, first=0, last=1080,
    front=540, speed=2400,
)  # fmt: skip
URG_04LX = Parameters(
    model="URG-04LX", nearest=20, farthest=5600, steps_per_turn=1024, first=44, last=725,
    front=384, speed=600,
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Codes:
    """Numbers that are no distances, by what they mean; any that is not named is a lost beam."""

    no_return: tuple[int, ...]
    """Nothing within the device's range. Only numbers that cannot mean anything else belong here:
    they make space free."""
    too_near: tuple[int, ...]
    """Something is nearer than the device can measure."""
    lost: tuple[int, ...]
    """Whatever else; the first one is what the emulator sends."""


UST_CODES = Codes(no_return=(65533,), too_near=(2, 4), lost=(65534, 65535, 1, 3, 5))
"""No table of a UST was at hand. 65533 is what devices were seen to send for nothing; the two
above it, and the small numbers that a UTM gives a meaning, are not trusted to mean that."""
UTM_CODES = Codes(no_return=(1,), too_near=(2, 4), lost=(5, 3))
"""Source: C-42-03320B, table 4."""
URG_CODES = Codes(no_return=(0,), too_near=(), lost=(6, 1, 2, 7, 8, 9, *range(10, 20)))
"""Source: C-42-03320B, table 3, where 0 is "possibly at 22 m"."""


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """One sweep as a device tells it."""

    stamp: int
    """Milliseconds of the device's clock at step 0; they wrap after 2^24."""
    distances: np.ndarray
    """[n] int64 [mm], or codes."""
    intensities: np.ndarray | None = None
    """[n] int64, or None where they were not asked for."""


def encode_sweep(command: Measure, sweep: Sweep) -> Reply:
    """The reply that carries a sweep.

    Args:
        command: what was asked; of a stream that ends, its count are the sweeps still to come.
        sweep: its answer; numbers too great for the command's width become the greatest there is.
    """
    values = sweep.distances
    if command.intensities:
        strength = np.zeros_like(values) if sweep.intensities is None else sweep.intensities
        values = np.stack([values, strength], axis=1).ravel()
    text = encode_numbers(np.minimum(values, 64**command.width - 1), command.width)
    stamp = summed(encode_numbers(np.array([sweep.stamp]), 4))
    status = "99" if command.streams else "00"
    return Reply(command.encode(), status, (stamp, *encode_block(text)))


def decode_sweep(command: Measure, reply: Reply) -> Sweep:
    """The sweep in a reply to `command`.

    Raises:
        Garbled: not whole, or of another command.
        BadSum: of a line.
    """
    try:
        echo = decode_command(reply.echo)
    except Refused as cause:
        raise Garbled(f"the echo of nothing that was asked: {reply.echo[:40]!r}") from cause
    if not isinstance(echo, Measure) or not echo.asks_for(command):
        raise Garbled(f"the answer to {reply.echo!r}, not to {command.encode()!r}")
    if not reply.lines:
        raise Garbled("a sweep without a time stamp")
    stamp = decode_numbers(checked(reply.lines[0]), 4)
    if len(stamp) != 1:
        raise Garbled(f"{len(stamp)} time stamps")
    values = decode_numbers(decode_block(reply.lines[1:]), command.width)
    wanted = command.groups * (2 if command.intensities else 1)
    if len(values) != wanted:
        raise Garbled(f"{len(values)} values where {wanted} were asked for")
    if command.intensities:
        return Sweep(int(stamp[0]), values[0::2], values[1::2])
    return Sweep(int(stamp[0]), values)


def ranges_of(
    distances: np.ndarray, parameters: Parameters, codes: Codes, range_max: float
) -> np.ndarray:
    """Ranges as a `Scan` means them (REP 117, leaning to the unsafe side).

    Something too near to be measured is a return at the sensor itself: at the least distance it
    would vouch for the space before it. What is no distance and no known code is lost.

    Args:
        distances: [n] [mm] or codes.
        parameters: of the device.
        codes: what its codes mean.
        range_max: how far "no return" makes free, and beyond which returns do not count [m].

    Returns:
        [n] float64 [m]: a return, `inf` for none within `range_max`, `nan` for a lost beam.
    """
    ranges = distances / 1000.0
    ranges[ranges >= range_max] = np.inf
    coded = (distances < parameters.nearest) | (distances >= FIRST_CODE)
    told = distances[coded]
    meant = np.full(len(told), np.nan)
    meant[np.isin(told, codes.no_return)] = np.inf
    meant[np.isin(told, codes.too_near)] = AT_THE_SENSOR
    ranges[coded] = meant
    return ranges


def distances_of(ranges: np.ndarray, parameters: Parameters, codes: Codes) -> np.ndarray:
    """What a device would tell of ranges [m] as a `Scan` means them: [n] int64 [mm] or codes."""
    mm = np.rint(np.where(np.isfinite(ranges), ranges, 0.0) * 1000.0).astype(np.int64)
    mm[mm < parameters.nearest] = (codes.too_near or codes.lost)[0]
    mm[ranges * 1000.0 > parameters.farthest] = codes.no_return[0]
    mm[~(ranges > 0)] = codes.lost[0]
    return mm
