"""People of the crowd benchmark: walkers, and those who step out when the robot comes near."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from passpmp_ti.sim.movers import PathMovers


@dataclass(frozen=True, kw_only=True, eq=False)
class Ambush:
    """Somebody who waits at the first place of a way, and goes along it once the robot is near."""

    way: np.ndarray
    """[n, 2] places, n >= 2 [m]."""
    radius: float
    """[m]"""
    near: float
    """Distance of the robot's centre at which he steps out [m]."""
    speed: float
    """[m/s], all along."""


class CrowdMovers:
    """Walkers whose ways are given, and people whose ways begin when the robot comes near.

    The order is: walkers, then those who wait. Who waits stands still until `notice` tells of a
    robot near enough; up to that time nothing that was told of him changes.
    """

    def __init__(self, walkers: PathMovers, ambushes: Sequence[Ambush]) -> None:
        self.radius = np.concatenate([walkers.radius, [a.radius for a in ambushes]])
        self.stepped: list[float | None] = [None] * len(ambushes)
        """When each of those who wait stepped out [s]; None: not yet."""
        self._walkers = walkers
        self._ambushes = tuple(ambushes)
        self._people = self._laid()
        self.top_speed = max([walkers.top_speed, *(a.speed for a in ambushes)])

    def notice(self, time: float, place: np.ndarray) -> None:
        """The robot's centre is at `place` [2] at `time` [s]; who finds it near sets out."""
        changed = False
        for n, ambush in enumerate(self._ambushes):
            near = float(np.hypot(*(ambush.way[0] - place))) <= ambush.near
            if near and self.stepped[n] is None:
                self.stepped[n] = time
                changed = True
        if changed:
            self._people = self._laid()

    def positions(self, times: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [self._walkers.positions(times), self._people.positions(times)], axis=1
        )

    def at(self, time: float) -> np.ndarray:
        return self.positions(np.array([time]))[0]

    def present(self, time: float) -> np.ndarray:
        return np.ones(len(self.radius), dtype=bool)

    def _laid(self) -> PathMovers:
        paths = [
            np.array([[0.0, *a.way[0]]]) if start is None else timed(a.way, a.speed, start)
            for a, start in zip(self._ambushes, self.stepped, strict=True)
        ]
        return PathMovers(paths, np.array([a.radius for a in self._ambushes]))


def timed(way: np.ndarray, speed: float, start: float) -> np.ndarray:
    """[n, 3] rows t, x, y of places [n, 2] [m], gone along at `speed` [m/s] from `start` [s] on."""
    lengths = np.hypot(*np.diff(way, axis=0).T)
    times = start + np.concatenate([[0.0], np.cumsum(lengths)]) / speed
    return np.concatenate([times[:, None], way], axis=1)
