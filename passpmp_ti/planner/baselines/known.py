"""A world whose future is known: what viability is computed for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from passpmp_ti import door


class Discs(Protocol):
    """Moving discs whose places are known at all times."""

    radius: np.ndarray
    """[m] radii [m]."""
    top_speed: float
    """No disc is ever faster [m/s]."""

    def positions(self, times: np.ndarray) -> np.ndarray:
        """[n, m, 2] centres at times [n] [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownWorld:
    """Everything that is there, for all time. One of `period` and `freezes_at` says how it goes on
    for ever (Sec. 6.1: the periodic case and the freezing case)."""

    bounds: tuple[float, float, float, float]
    """(x low, y low, x high, y high): the robot has to stay inside [m]."""
    clearance: Callable[[np.ndarray], np.ndarray]
    """Distance of points [n, 2] to the nearest fixed thing [n] [m]; 0 inside one."""
    movers: Discs
    period: float | None = None
    """After this time everything is where it was [s]."""
    freezes_at: float | None = None
    """From this time on nothing moves any more [s]."""

    def __post_init__(self) -> None:
        door.array("KnownWorld", "bounds", self.bounds, (4,))
        if (self.period is None) == (self.freezes_at is None):
            raise ValueError(
                "KnownWorld takes one of period and freezes_at: what is known for a while only has"
                " no viability kernel"
            )
        if self.period is not None:
            door.finite("KnownWorld", "period", self.period, above=0.0, unit="s")
        if self.freezes_at is not None and not math.isfinite(self.freezes_at):
            raise ValueError(f"KnownWorld.freezes_at must be finite; got {self.freezes_at!r}")
