"""The same work in plain NumPy and SciPy: what a reader would write first, and can check by eye.

The check is the textbook one: integrate by the midpoint rule, look at the map at every step.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from scipy import ndimage

from passpmp_ti.bench.states import States
from passpmp_ti.robots import CarLike
from passpmp_ti.scan import Scan

LATEST = 60.0
"""Arrivals are not told beyond this [s]."""
MOST_BEAMS = 24
"""Beams to either side that a cell is compared with."""
CLEAR = 1.0
"""What is nearer to the sensor than this counts as seen [m]."""
CAR = CarLike()
STEERING = (0.0, -CAR.xi_rate, CAR.xi_rate)


@functools.cache
def _polar(size: int, cell: float, beams: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each cell [J, I]: range of its centre [m], beam nearest to it, beams across it."""
    middle = (np.arange(size, dtype=np.float32) + 0.5 - 0.5 * size) * np.float32(cell)
    x, y = middle[None, :], middle[:, None]
    away = np.hypot(x, y)
    apart = 2 * math.pi / beams
    beam = np.floor(np.arctan2(y, x) / np.float32(apart) + 0.5).astype(int) % beams
    across = (cell * math.sqrt(0.5) / (np.maximum(away, 0.1) * apart)).astype(int) + 1
    return away, beam, np.minimum(across, MOST_BEAMS)


def arrival_seconds(
    scan: Scan, size: int, cell: float, clearance: float, speed: float
) -> np.ndarray:
    """When something could first be where, by the look of one full sweep from the grid's middle.

    A cell is seen when all beams across it reach beyond it. What is not seen and lies beside what
    is, and is not the surface of something that stays, may let something out.

    Args:
        scan: told what moves.
        size: cells along each side.
        cell: their side [m].
        clearance: radius of the robot and margins [m]; the cells' own diagonal comes on top.
        speed: of what may come [m/s].

    Returns:
        [J, I] float32 [s]; 0: never free.
    """
    away, beam, across = _polar(size, cell, len(scan.ranges))
    ranges = np.minimum(scan.ranges, scan.range_max).astype(np.float32)
    stays = scan.returned & ~np.asarray(scan.moving)
    widths = [2 * n + 1 for n in range(MOST_BEAMS + 1)]
    least = np.stack([ndimage.minimum_filter1d(ranges, w, mode="wrap") for w in widths])
    most = np.stack([ndimage.maximum_filter1d(ranges, w, mode="wrap") for w in widths])
    all_stay = np.stack([ndimage.minimum_filter1d(stays, w, mode="wrap") for w in widths])
    end = away + np.float32(cell * math.sqrt(0.5))
    seen = (end <= least[across, beam]) | (away < CLEAR)
    lets_out = ~all_stay[across, beam] | (most[across, beam] > end)
    beside = ndimage.maximum_filter(seen.view(np.uint8), 3, mode="constant") > 0
    source = ~seen & lets_out & beside
    taken = cell * math.sqrt(2) + clearance
    free = ndimage.distance_transform_edt(seen) * cell > taken
    to_source = np.full(seen.shape, math.inf)
    if source.any():
        to_source = ndimage.distance_transform_edt(~source) * cell
    seconds = np.clip((to_source - taken) / speed, 0.0, LATEST)
    return np.where(free, seconds, 0.0).astype(np.float32)


def ticks_of(seconds: np.ndarray) -> np.ndarray:
    """Arrival [J, I] in whole milliseconds, uint16, rounded down: earlier is less safe."""
    return np.floor(seconds.astype(np.float64) * 1000).astype(np.uint16)


def passively_safe(arrival: np.ndarray, cell: float, states: States, step: float) -> np.ndarray:
    """[n] uint8: one of three ways to brake is clear at every step, in an arrival map [J, I] of
    ticks about the origin."""
    safe = np.zeros(len(states), dtype=np.uint8)
    for steering in STEERING:
        left = np.flatnonzero(safe == 0)
        columns = [column[left] for column in states.columns]
        safe[left[_braked_clear(arrival, cell, columns, steering, step)]] = 1
    return safe


def _braked_clear(
    arrival: np.ndarray, cell: float, columns: list[np.ndarray], steering: float, step: float
) -> np.ndarray:
    """[m] indices of the states that come to rest untouched."""
    which = np.arange(len(columns[0]))
    clear = [which[:0]]
    while len(which):
        free = ~blocked(arrival, cell, columns[0], columns[1], columns[5])
        resting = columns[3] == 0
        clear.append(which[free & resting])
        moving = free & ~resting
        which = which[moving]
        columns = [column[moving] for column in columns]
        speed = np.abs(columns[3])
        slower = np.copysign(np.maximum(speed - np.float32(CAR.acceleration * step), 0), columns[3])
        columns = moved(columns, slower, np.float32(steering), step)
    return np.concatenate(clear)


def moved(
    columns: list[np.ndarray], speed: np.ndarray, steering: np.ndarray | np.float32, step: float
) -> list[np.ndarray]:
    """x, y, theta, v, xi, t a step later, at `speed` then."""
    x, y, theta, v, xi, t = columns
    way = (v + speed) * np.float32(0.5 * step)
    limit = np.float32(CAR.xi_max)
    middle = np.clip(xi + steering * np.float32(0.5 * step), -limit, limit)
    turn = way * np.tan(middle) * np.float32(0.5 / CAR.wheelbase)
    return [
        x + way * np.cos(theta + turn),
        y + way * np.sin(theta + turn),
        theta + 2 * turn,
        speed,
        np.clip(xi + steering * np.float32(step), -limit, limit),
        t + np.float32(step),
    ]


def blocked(
    arrival: np.ndarray, cell: float, x: np.ndarray, y: np.ndarray, t: np.ndarray
) -> np.ndarray:
    """[n] bool: something could be at (x, y) at t, or the map does not tell."""
    size = len(arrival)
    i = np.floor(x / np.float32(cell)).astype(np.int32) + size // 2
    j = np.floor(y / np.float32(cell)).astype(np.int32) + size // 2
    inside = (i >= 0) & (j >= 0) & (i < size) & (j < size)
    ticks = np.zeros(len(x), dtype=np.uint16)
    ticks[inside] = arrival[j[inside], i[inside]]
    return t * np.float32(1000) >= ticks


def children(
    arrival: np.ndarray, cell: float, parents: np.ndarray, controls: np.ndarray,
    steps: int, step: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Every control from every parent, driven and checked at every step, then braked.

    Args:
        arrival, cell: the map.
        parents: [n, 6] float32 rows x, y, theta, v, xi, t.
        controls: [u, 2] float32 acceleration and steering rate.
        steps: of a primitive.
        step: [s]

    Returns:
        [n u, 6] where they lead, [n u] bool whether that is free all the way and passively safe.
    """
    columns = list(np.repeat(parents, len(controls), axis=0).T)
    pull, steering = np.tile(controls, (len(parents), 1)).T
    which = np.arange(len(pull))
    for _ in range(steps):
        speed = columns[3] + pull * np.float32(step)
        speed = np.clip(speed, -np.float32(CAR.v_reverse), np.float32(CAR.v_max))
        columns = moved(columns, speed, steering, step)
        free = ~blocked(arrival, cell, columns[0], columns[1], columns[5])
        which, pull, steering = which[free], pull[free], steering[free]
        columns = [column[free] for column in columns]
    safe = np.zeros(len(parents) * len(controls), dtype=bool)
    ends = np.zeros((len(safe), 6), dtype=np.float32)
    ends[which] = np.stack(columns, axis=1)
    safe[which] = passively_safe(arrival, cell, States(*columns), step)
    return ends, safe
