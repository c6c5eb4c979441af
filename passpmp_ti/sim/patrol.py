"""Discs on patrol: each goes its round again and again, all with one period."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from passpmp_ti.sim.movers import Movers, PathMovers, stretched
from passpmp_ti.sim.world import World


class PatrolMovers:
    """Discs that repeat their paths for ever, before time 0 as well."""

    def __init__(self, round_: PathMovers, period: float) -> None:
        self.period = period
        """[s]."""
        self.radius = round_.radius
        self.top_speed = round_.top_speed
        self._round = round_

    def positions(self, times: np.ndarray) -> np.ndarray:
        return self._round.positions(np.mod(np.asarray(times, dtype=np.float64), self.period))

    def at(self, time: float) -> np.ndarray:
        return self.positions(np.array([time]))[0]

    def present(self, time: float) -> np.ndarray:
        return np.ones(len(self.radius), dtype=bool)


@dataclass(frozen=True, kw_only=True)
class PatrolSource:
    """Closed rounds along waypoints that the scenario gives with their times."""

    paths: tuple[tuple[tuple[float, float, float], ...], ...]
    """Per disc rows (t, x, y) [s, m, m], from t = 0 to the period, and back where it began."""
    radius: tuple[float, ...]
    """Per disc [m]."""

    def __post_init__(self) -> None:
        for n, path in enumerate(self.paths):
            if path[0][0] != 0 or path[-1][0] != self.period or path[-1][0] <= 0:
                raise ValueError(
                    f"patrol.discs[{n}].waypoints are from t = {path[0][0]:g} to"
                    f" {path[-1][0]:g} s; every disc's must be from 0 to one period, here"
                    f" {self.period:g} s"
                )
            if path[0][1:] != path[-1][1:]:
                raise ValueError(
                    f"patrol.discs[{n}].waypoints end at {path[-1][1:]} and begin at {path[0][1:]};"
                    " a round must end where it begins"
                )

    @property
    def period(self) -> float:
        """[s]."""
        return self.paths[0][-1][0]

    @property
    def top_speed(self) -> float:
        return self._round.top_speed

    @property
    def _round(self) -> PathMovers:
        return PathMovers([np.array(p) for p in self.paths], np.array(self.radius))

    def draw(
        self,
        still: World,
        start: tuple[float, float, float],
        duration: float,
        seed: int,
        generator: np.random.Generator,
    ) -> tuple[Movers, float]:
        return PatrolMovers(self._round, self.period), 0.0

    def paced(self, top_speed: float) -> PatrolSource:
        """The same rounds with all speeds in proportion: the period changes with them.

        Raises:
            ValueError: a speed of 0, at which no round ends.
        """
        if top_speed <= 0:
            raise ValueError("movers on patrol cannot be stopped; write them as type: scripted")
        return replace(self, paths=stretched(self.paths, self.top_speed / top_speed))
