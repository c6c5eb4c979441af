"""DynaBARN's worlds: an arena that cylinders cross, each over and over on its own way."""

from __future__ import annotations

import gzip
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from passpmp_ti.sim.data_files import DATA, find_data
from passpmp_ti.sim.movers import Movers, PathMovers
from passpmp_ti.sim.world import World

START = (11.0, 0.0, math.pi)
"""(x, y, theta) [m, m, rad]."""
GOAL = (-9.0, 0.0)
"""[m]"""
LONGEST = 100.0
"""Timeout of a trial [s]."""
BORDER = 10.0
"""Cylinders enter and leave where |x| or |y| is this [m]."""
WALL = 0.5
"""Thickness of the walls on three sides, whose middles lie on the border [m]."""
BOUNDS = {"easy": 0.95, "medium": 1.45, "hard": 1.95}
"""By class: no cylinder is ever faster [m/s]."""
PER_CLASS = 20
"""Worlds of a class, by their numbers."""
OUTSIDE = 12.0
"""From so far outside a cylinder comes in, and so far it goes out [m]: farther than the planner
looks."""
KEEP_OUT, QUIET = 1.0, 5.0
"""No cylinder comes nearer to the robot's start [m] in the first seconds of an episode [s]: as
published, none ever does, since the start lies outside the border."""
GOLDEN = 0.6180339887498949


@dataclass(frozen=True, kw_only=True, eq=False)
class Crossing:
    """One cylinder's way from border to border, gone again and again."""

    radius: float
    """[m]"""
    period: float
    """[s]"""
    way: np.ndarray
    """[n, 3] rows t, x, y [s, m, m], straight lines between them."""


def class_of(world: int) -> str:
    """The class of a world: easy, medium or hard."""
    return list(BOUNDS)[min(world // PER_CLASS, len(BOUNDS) - 1)]


def read_worlds() -> dict[int, tuple[Crossing, ...]]:
    """Every world there is, by its number.

    Raises:
        ValueError: the data is absent (and where it was looked for), or is not what it should be.
    """
    path = find_data(f"${{{DATA}}}/dynabarn/dynabarn_keyframes.json.gz", Path.cwd() / "dynabarn")
    try:
        with gzip.open(path, "rt", encoding="utf-8") as file:
            worlds: Mapping[str, Sequence[Mapping[str, object]]] = json.load(file)
    except (OSError, EOFError, ValueError) as cause:
        raise ValueError(f"{path}: not compressed JSON: {cause}") from cause
    return {
        int(number): tuple(
            Crossing(
                radius=float(one["radius"]),  # type: ignore[arg-type]
                period=float(one["duration"]),  # type: ignore[arg-type]
                way=np.array(one["keyframes_t_x_y"], dtype=np.float64),
            )
            for one in crossings
        )
        for number, crossings in sorted(worlds.items(), key=lambda item: int(item[0]))
    }


def outwards(place: np.ndarray) -> np.ndarray:
    """[2] unit vector that leads from a place [2] on the border straight out of the arena."""
    side = np.abs(place) >= np.abs(place).max() - 1e-6
    normal = np.where(side, np.sign(place), 0.0)
    return normal / np.hypot(*normal)


def passed(crossing: Crossing) -> np.ndarray:
    """[n + 2, 3] rows t, x, y of one pass [s, m, m], from outside the arena to outside.

    In the recordings a cylinder that has reached its exit stands at its entry the next moment, half
    of it inside the arena. Here it comes in, straight through the border, at the speed at which it
    then goes on, and goes out like that: nobody is born, or is gone, in sight.
    """
    way = crossing.way
    ends = []
    for end, beside, sign in ((way[0], way[1], -1.0), (way[-1], way[-2], 1.0)):
        speed = math.dist(end[1:], beside[1:]) / abs(end[0] - beside[0])
        place = end[1:] + OUTSIDE * outwards(end[1:])
        ends.append([end[0] + sign * OUTSIDE / speed, *place])
    return np.concatenate([ends[:1], way, ends[1:]])


def movers_of(crossings: Sequence[Crossing], begin: float, end: float) -> PathMovers:
    """Every pass of every cylinder that is there at any time from `begin` to `end` [s]."""
    paths, radius = [], []
    for crossing in crossings:
        rows, period = passed(crossing), crossing.period
        first = math.floor((begin - rows[-1, 0]) / period)
        last = math.ceil((end - rows[0, 0]) / period)
        for lap in range(first, last + 1):
            moved = rows + np.array([lap * period, 0.0, 0.0])
            if moved[-1, 0] >= begin and moved[0, 0] <= end:
                paths.append(moved)
                radius.append(crossing.radius)
    born, gone = (np.array([path[row, 0] for path in paths]) for row in (0, -1))
    return PathMovers(paths, np.array(radius), born=born, gone=gone)


@dataclass(frozen=True, kw_only=True, eq=False)
class CrossingSource:
    """The cylinders of one world; the seed chooses when the robot sets out."""

    crossings: tuple[Crossing, ...]
    top_speed: float
    """No cylinder is ever faster [m/s]."""

    def draw(
        self,
        still: World,
        start: tuple[float, float, float],
        duration: float,
        seed: int,
        generator: np.random.Generator,
    ) -> tuple[Movers, float]:
        longest = max(crossing.period for crossing in self.crossings)
        # seed 0 begins as the recordings do, the others are spread over the longest period
        time = math.floor(1000 * longest * (seed * GOLDEN % 1.0)) / 1000
        movers = movers_of(self.crossings, time, time + 10 * longest + QUIET)
        for _ in range(math.ceil(100 * longest)):
            if self._quiet(movers, np.array(start[:2]), time):
                return movers_of(self.crossings, time, time + duration), time
            time = round(time + 0.1, 3)
        raise ValueError(
            f"DynaBARN: somebody always comes within {KEEP_OUT:g} m of the robot's start"
        )

    def _quiet(self, movers: Movers, start: np.ndarray, time: float) -> bool:
        """Whether nobody comes near the start [2] for a while after `time` [s]."""
        times = time + np.arange(0.0, QUIET, 0.1)
        apart = np.hypot(*np.moveaxis(movers.positions(times) - start, -1, 0)) - movers.radius
        here = np.array([movers.present(float(t)) for t in times])
        return not bool((here & (apart < KEEP_OUT)).any())

    def paced(self, top_speed: float) -> CrossingSource:
        raise ValueError("DynaBARN's cylinders move as they were recorded; no other speed is known")


def walls() -> tuple[np.ndarray, ...]:
    """Each [4, 2]: the walls behind the goal and on both sides; the robot's side is open [m]."""
    long, thick = BORDER, 0.5 * WALL
    return (
        _box(-BORDER, 0.0, thick, long), _box(0.0, BORDER, long, thick),
        _box(0.0, -BORDER, long, thick),
    )  # fmt: skip


def _box(x: float, y: float, half_length: float, half_width: float) -> np.ndarray:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=np.float64)
    return np.array([x, y]) + corners * np.array([half_length, half_width])
