"""Discs that move, each no faster than it declares."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from passpmp_ti import door


class Movers(Protocol):
    """Moving discs of the simulated world."""

    radius: np.ndarray
    """[m] radii [m]."""
    top_speed: float
    """No disc is ever faster [m/s]."""

    def positions(self, times: np.ndarray) -> np.ndarray:
        """[n, m, 2] centres at times [n] [s]; of those absent: where they were or will be seen."""

    def at(self, time: float) -> np.ndarray:
        """[m, 2] centres at `time` [s]."""

    def present(self, time: float) -> np.ndarray:
        """[m] bool: which are in the world at `time` [s]."""


class PathMovers:
    """Discs along polylines that are given by their times; they stand before and after.

    Straight lines at constant speed between the points: the top speed is known exactly.
    """

    def __init__(
        self,
        paths: Sequence[np.ndarray],
        radius: np.ndarray,
        born: np.ndarray | None = None,
        gone: np.ndarray | None = None,
    ) -> None:
        """Take over paths.

        Args:
            paths: per disc [n, 3] rows t, x, y [s, m, m], t increasing, n >= 1.
            radius: [m] [m].
            born: [m] time from which each is in the world [s]; None: always.
            gone: [m] time after which each is not [s]; None: never.

        Raises:
            ValueError: a path's shape or times, a radius that is not > 0.
        """
        count = len(paths)
        self.radius = door.array("PathMovers", "radius", radius, (count,))
        if (self.radius <= 0).any():
            raise ValueError(f"PathMovers.radius must be > 0 m; got {self.radius.min():g} m")
        self.paths = []
        speeds = [0.0]
        for n, path in enumerate(paths):
            rows = door.array("PathMovers", f"paths[{n}]", path, (None, 3))
            steps = np.diff(rows[:, 0])
            if not len(rows) or (steps <= 0).any():
                raise ValueError(f"PathMovers.paths[{n}]: times must increase, one row at least")
            lengths = np.hypot(*np.diff(rows[:, 1:], axis=0).T)
            speeds.extend((lengths / steps).tolist())
            self.paths.append(rows)
        self.top_speed = max(speeds)
        self.born = np.full(count, -np.inf) if born is None else np.asarray(born, dtype=float)
        self.gone = np.full(count, np.inf) if gone is None else np.asarray(gone, dtype=float)
        self._first = np.array([p[0, 0] for p in self.paths])
        self._last = np.array([p[-1, 0] for p in self.paths])
        self._start = np.array([p[0, 1:] for p in self.paths]).reshape(-1, 2)
        self._end = np.array([p[-1, 1:] for p in self.paths]).reshape(-1, 2)

    def positions(self, times: np.ndarray) -> np.ndarray:
        times = np.atleast_1d(np.asarray(times, dtype=np.float64))
        early = times.max() <= self._first
        still = np.where(early[:, None], self._start, self._end)
        found = np.repeat(still[None], len(times), axis=0)
        for n in np.flatnonzero(~early & (times.min() < self._last)):
            path = self.paths[n]
            for column in (1, 2):
                found[:, n, column - 1] = np.interp(times, path[:, 0], path[:, column])
        return found

    def at(self, time: float) -> np.ndarray:
        return self.positions(np.array([time]))[0]

    def present(self, time: float) -> np.ndarray:
        return (self.born <= time) & (time <= self.gone)


class NoMovers(PathMovers):
    """Nothing moves."""

    def __init__(self) -> None:
        super().__init__((), np.zeros(0))


def stretched(
    paths: tuple[tuple[tuple[float, float, float], ...], ...], factor: float
) -> tuple[tuple[tuple[float, float, float], ...], ...]:
    """Rows (t, x, y) of paths [s, m, m], gone along in `factor` times the time."""
    return tuple(tuple((t * factor, x, y) for t, x, y in path) for path in paths)
