"""Discs whose next step is decided as the episode runs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from passpmp_ti.sim import geometry
from passpmp_ti.sim.movers import Movers
from passpmp_ti.sim.world import World


class SteppedMovers:
    """Discs that are told, step by step, where to be next; straight lines in between."""

    def __init__(
        self, places: np.ndarray, radius: np.ndarray, top_speed: float, time: float
    ) -> None:
        """Discs [m] at places [m, 2] [m] at `time` [s], with radii [m] [m]."""
        self.radius = np.asarray(radius, dtype=np.float64)
        self.top_speed = top_speed
        self.born = np.full(len(self.radius), -np.inf)
        """[m] time from which each is in the world [s]."""
        self._times = [time]
        self._places = [np.array(places, dtype=np.float64).reshape(-1, 2)]

    @property
    def now(self) -> np.ndarray:
        """[m, 2] the last places [m]."""
        return self._places[-1]

    def step(self, time: float, places: np.ndarray) -> None:
        """Be at `places` [m, 2] [m] at `time` [s]."""
        self._times.append(time)
        self._places.append(np.array(places, dtype=np.float64))

    def put(self, places: np.ndarray) -> None:
        """Have stood at `places` [m, 2] [m] all the time; for those that are not yet born."""
        self._times, self._places = self._times[-1:], [np.array(places, dtype=np.float64)]

    def positions(self, times: np.ndarray) -> np.ndarray:
        times = np.atleast_1d(np.asarray(times, dtype=np.float64))
        low = max(int(np.searchsorted(self._times, times.min(), side="right")) - 1, 0)
        known, path = self._times[low:], np.array(self._places[low:])
        found = np.empty((len(times), len(self.radius), 2))
        for n in range(len(self.radius)):
            for axis in range(2):
                found[:, n, axis] = np.interp(times, known, path[:, n, axis])
        return found

    def at(self, time: float) -> np.ndarray:
        return self.positions(np.array([time]))[0]

    def present(self, time: float) -> np.ndarray:
        return self.born <= time


class Together:
    """Several kinds of movers as one."""

    def __init__(self, parts: Sequence[Movers]) -> None:
        self._parts = parts
        self.radius = np.concatenate([p.radius for p in parts])
        self.top_speed = max(p.top_speed for p in parts)

    def positions(self, times: np.ndarray) -> np.ndarray:
        return np.concatenate([p.positions(times) for p in self._parts], axis=1)

    def at(self, time: float) -> np.ndarray:
        return np.concatenate([p.at(time) for p in self._parts])

    def present(self, time: float) -> np.ndarray:
        return np.concatenate([p.present(time) for p in self._parts])


HUNT, LEAVE = 3.0, 5.0
"""For how long a hunter goes for the robot, and for how long it leaves it alone [s]: a robot that
is mobbed for good never moves, and nothing is shown."""


def places_for(
    still: World, count: int, gap: float, away: tuple[np.ndarray, float], rng: np.random.Generator
) -> np.ndarray:
    """[count, 2] places at least `gap` [m] from what stands and far from a point [m].

    Args:
        still: what stands.
        count: how many places.
        gap: [m].
        away: (point [2], least distance to it) [m].
        rng: draws them.
    """
    low, high = np.array(still.bounds[:2]), np.array(still.bounds[2:])
    drawn = rng.uniform(low, high, (4000, 2))
    apart = np.hypot(*(drawn - away[0]).T)
    drawn = drawn[(still.clearance(drawn) > gap) & (apart > away[1])]
    if len(drawn) < count:
        raise ValueError(f"places_for: no room for {count} discs")
    return drawn[:count]


LEAN = 1e-3
"""How deep a hunter leans on the robot, so that a touch is judged as one [m]."""


def hunt(
    movers: SteppedMovers,
    still: World,
    time: float,
    cycle: float,
    robot: np.ndarray,
    robot_radius: float,
) -> None:
    """One step at top speed, towards the robot or away from it by turns; walls hold it back.

    Args:
        movers: who hunt.
        still: what stands.
        time: end of the step [s].
        cycle: length of the step [s].
        robot: [2] where the robot is then [m].
        robot_radius: nobody is inside its body [m].
    """
    here = movers.now
    longest = movers.top_speed * cycle * (1 - 1e-9)
    phase = (time + 2.7 * np.arange(len(here))) % (HUNT + LEAVE)
    towards = robot - here
    away = np.hypot(*towards.T)
    step = towards / np.maximum(away, 1e-9)[:, None]
    room = np.maximum(away - robot_radius - movers.radius + LEAN, 0.0)
    leaves = np.clip(HUNT * movers.top_speed - away, 0.0, longest)  # to where it can come back from
    step *= np.where(phase < HUNT, np.minimum(longest, room), -leaves)[:, None]
    # who is stopped slides along
    for turn in (0.0, 0.7, -0.7, math.pi / 2, -math.pi / 2):
        c, s = math.cos(turn), math.sin(turn)
        there = here + step @ np.array([[c, s], [-s, c]])
        free = _free(here, there, movers.radius, still)
        here = np.where(free[:, None], there, here)
        step[free] = 0.0
    movers.step(time, here)


def _free(begin: np.ndarray, end: np.ndarray, radius: np.ndarray, still: World) -> np.ndarray:
    """[m] bool: whether discs can go straight from `begin` to `end`."""
    if not len(still.outline):
        return np.ones(len(begin), dtype=bool)
    a, b = still.outline[:, :2], still.outline[:, 2:]
    apart = geometry.segment_to_segment(begin[:, None], end[:, None], a, b).min(axis=1)
    return apart > radius + 1e-3
