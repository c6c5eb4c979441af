"""Discs that are steered while the episode runs: bounded, stopped by walls and by the robot."""

from __future__ import annotations

import numpy as np

from passpmp_ti import door
from passpmp_ti.sim import geometry

TOUCH = 1e-6
"""How deep a disc that leans on the robot is in contact, so that a touch is judged as one [m]."""
WALL_GAP = 1e-3
"""From here to a wall a disc slides along it [m]."""
UNDER = 1 - 1e-9
"""Share of the bound that is used: rounding must not exceed it."""


class SteeredMovers:
    """Discs whose ways are decided tick by tick.

    Between two ticks each goes along a straight line at one speed. `advance` cuts every step to the
    bound, slides it along walls, and ends it at the robot's skin. Asked for times to come, they
    stand where they are.
    """

    def __init__(
        self,
        places: np.ndarray,
        radius: np.ndarray,
        top_speed: float,
        tick: float,
        start_time: float,
        outline: np.ndarray,
    ) -> None:
        """Put discs into the world.

        Args:
            places: [m, 2] centres at the start [m].
            radius: [m] [m].
            top_speed: the bound of every disc [m/s].
            tick: time between two decisions [s].
            start_time: of the first tick [s].
            outline: [s, 4] surfaces that stay [m].

        Raises:
            ValueError: a disc that begins in a wall, or a number out of its range.
        """
        owner = "SteeredMovers"
        self.radius = door.array(owner, "radius", radius, (None,))
        count = len(self.radius)
        places = door.array(owner, "places", places, (count, 2))
        self.top_speed = door.finite(owner, "top_speed", top_speed, least=0.0, unit="m/s")
        self.tick = door.finite(owner, "tick", tick, above=0.0, unit="s")
        self._start = start_time
        self._outline = outline
        self._way = np.empty((256, count, 2))
        self._way[0] = places
        self._ticks = 0
        self._pairs = (np.zeros(0, dtype=int), np.zeros((0, 4)))
        self.survey(0.0)
        owners, walls = self._pairs
        if len(owners):
            gaps = geometry.point_to_segment(places[owners], walls[:, :2], walls[:, 2:])
            inside = np.flatnonzero(gaps < self.radius[owners])
            if len(inside):
                n = int(owners[inside[0]])
                raise ValueError(f"{owner}.places[{n}] = {places[n]!r} is inside a wall")

    @property
    def now(self) -> np.ndarray:
        """[m, 2] centres at the last tick [m]."""
        return self._way[self._ticks]

    @property
    def history(self) -> np.ndarray:
        """[ticks + 1, m, 2] every place so far [m]."""
        return self._way[: self._ticks + 1]

    def positions(self, times: np.ndarray) -> np.ndarray:
        ticks = (np.atleast_1d(np.asarray(times, dtype=np.float64)) - self._start) / self.tick
        ticks = np.clip(ticks, 0.0, self._ticks)
        below = np.minimum(ticks.astype(int), max(self._ticks - 1, 0))
        share = (ticks - below)[:, None, None]
        above = np.minimum(below + 1, self._ticks)
        return (1 - share) * self._way[below] + share * self._way[above]

    def at(self, time: float) -> np.ndarray:
        return self.positions(np.array([time]))[0]

    def present(self, time: float) -> np.ndarray:
        return np.ones(len(self.radius), dtype=bool)

    def survey(self, duration: float) -> None:
        """Note the walls that each disc could meet within `duration` [s]."""
        places = self.now
        if not len(places) or not len(self._outline):
            return
        gaps = geometry.point_to_segment(
            places[:, None], self._outline[None, :, :2], self._outline[None, :, 2:]
        )
        near = self.radius[:, None] + 2 * WALL_GAP + self.top_speed * duration
        owners, walls = np.nonzero(gaps <= near)
        self._pairs = (owners, self._outline[walls])

    def advance(
        self, velocity: np.ndarray, limit: np.ndarray, discs: np.ndarray, disc_radius: float
    ) -> None:
        """Go on by one tick; `survey` must have looked this far.

        Args:
            velocity: [m, 2] where each wants to go [m/s]; cut to its limit.
            limit: [m] greatest speed [m/s]; cut to the bound.
            discs: [d, 2] centres of the robot's discs as the tick ends [m].
            disc_radius: of each [m].
        """
        place = self.now
        step = velocity * self.tick
        length = np.hypot(step[:, 0], step[:, 1])
        longest = np.minimum(limit, self.top_speed) * self.tick * UNDER
        share = np.minimum(longest / np.maximum(length, 1e-12), 1.0)
        step = self._past_walls(place, step * share[:, None])
        step = _to_skin(place, step, discs, disc_radius + self.radius - TOUCH)
        if self._ticks + 1 == len(self._way):
            self._way = np.concatenate([self._way, np.empty_like(self._way)])
        self._ticks += 1
        self._way[self._ticks] = place + step

    def _past_walls(self, place: np.ndarray, step: np.ndarray) -> np.ndarray:
        owners, walls = self._pairs
        if not len(owners):
            return step
        a, b = walls[:, :2], walls[:, 2:]
        here = place[owners]
        gap = geometry.segment_to_segment(here, here + step[owners], a, b) - self.radius[owners]
        close = np.flatnonzero(gap < WALL_GAP)
        if not len(close):
            return step
        step = step.copy()
        for pair in close:
            n = owners[pair]
            along = b[pair] - a[pair]
            share = np.clip((here[pair] - a[pair]) @ along / max(along @ along, 1e-300), 0.0, 1.0)
            away = here[pair] - a[pair] - share * along
            away /= max(float(np.hypot(*away)), 1e-12)
            step[n] -= min(float(step[n] @ away), 0.0) * away
        gap = geometry.segment_to_segment(here, here + step[owners], a, b) - self.radius[owners]
        step[owners[gap < 0]] = 0.0
        return step


def _to_skin(
    place: np.ndarray, step: np.ndarray, discs: np.ndarray, apart: np.ndarray
) -> np.ndarray:
    """Steps [m, 2] cut where a disc would come nearer than `apart` [m] to a disc of the robot."""
    for disc in discs:
        rel = place - disc
        end = rel + step
        inside = (end * end).sum(axis=1) < apart * apart
        if not inside.any():
            continue
        aa = (step * step).sum(axis=1)
        bb = (rel * step).sum(axis=1)
        cc = (rel * rel).sum(axis=1) - apart * apart
        root = np.sqrt(np.maximum(bb * bb - aa * cc, 0.0))
        share = np.clip((-bb - root) / np.maximum(aa, 1e-300), 0.0, 1.0)
        # who is in it already does not go deeper, but may go away
        share = np.where(cc <= 0, np.where(bb > 0, 1.0, 0.0), share)
        step = np.where(inside[:, None], step * share[:, None], step)
    return step
