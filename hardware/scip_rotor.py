"""An emulated device's clock and its turning mirror: which sweep is ready when, with what stamp."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hardware.scip import CLOCK_TURN
from hardware.scip_sweep import UST_10LX, UST_CODES, Codes, Parameters
from passpmp_ti import door


@dataclass(frozen=True, slots=True, kw_only=True)
class Nature:
    """How an emulated device is made."""

    parameters: Parameters = UST_10LX
    codes: Codes = UST_CODES
    clock_start: int = 0
    """Its clock when it is switched on [ms]; after 2^24 - 1 it wraps."""
    clock_rate: float = 1.0
    """Seconds of its clock in a second of the host's."""
    unevenness: float = 0.0
    """By how much longer than its parameters say a turn takes, as a share."""
    tick: float = 1e-3
    """A sweep is sent at a whole multiple of this on its clock [s]; some firmware has 5 ms."""
    boot_time: float = 2.0
    """For how long it takes no connection once it was rebooted [s]."""

    def __post_init__(self) -> None:
        name = "Nature"
        door.whole(name, "clock_start", self.clock_start, least=0, most=CLOCK_TURN - 1)
        door.finite(name, "clock_rate", self.clock_rate, least=0.5, most=2.0)
        door.finite(name, "unevenness", self.unevenness, least=-0.5, most=0.5)
        door.finite(name, "boot_time", self.boot_time, least=0.0, unit="s")
        door.finite(name, "tick", self.tick, least=1e-6, most=1.0, unit="s")


class Rotor:
    """Turn k begins with step 0 at `begin(k)`, host's time."""

    def __init__(self, nature: Nature, now: float) -> None:
        p = nature.parameters
        self._nature = nature
        self._on = now
        self._zero = now - 1e-3 * nature.clock_start / nature.clock_rate
        self._turn = p.period * (1 + nature.unevenness) / nature.clock_rate
        self._swept = self._turn * (p.last + 1) / p.steps_per_turn

    def reset_clock(self, now: float) -> None:
        """From now on the clock counts from 0."""
        self._zero = now

    def reading(self, when: float) -> int:
        """24 bit clock [ms]."""
        return math.floor(self._time(when) * 1000) % CLOCK_TURN

    def begin(self, turn: int) -> float:
        """When step 0 is measured [s], host's time."""
        return self._on + turn * self._turn

    def ready(self, turn: int) -> float:
        """When the sweep can be sent [s], host's time."""
        ticks = math.ceil(self._time(self.begin(turn) + self._swept) / self._nature.tick)
        return self._zero + ticks * self._nature.tick / self._nature.clock_rate

    def first_after(self, when: float) -> int:
        """The first turn that begins no earlier than this."""
        return max(0, math.ceil((when - self._on) / self._turn))

    def _time(self, when: float) -> float:
        """The clock without its wrap [s]."""
        return (when - self._zero) * self._nature.clock_rate
