"""From what the views prove to when something could first be at each cell."""

from __future__ import annotations

import math
import threading

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.geodesic import ways_from_sources
from passpmp_ti.grid.memory import (
    Memory,
    broken_premises,
    remembered_ticks,
    without_intruders,
)
from passpmp_ti.grid.opening import opened_sources
from passpmp_ti.grid.view import Views
from passpmp_ti.grid.window import Window
from passpmp_ti.kernels.arrival import CHUNK, KINDS, LANES, arrival_times
from passpmp_ti.kernels.beams import SLACK
from passpmp_ti.kernels.geodesic import arrival_round_walls
from passpmp_ti.kernels.visibility import BLIND_SOURCES, rasterise
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

BORDER = 1
"""Cells by which two cells are nearer than their centres along each axis: any points of them."""


def rasterised(
    views: Views, window: Window, settings: Settings
) -> tuple[device.Array, device.Array]:
    """(seen [J, I] uint8, 1: all of the cell proven empty; marks [5, J, I] uint8, 0 marks)."""
    seen = device.full((window.size, window.size), 0, np.uint8)
    marks = device.full((5, window.size, window.size), 1, np.uint8)
    arrays = (views.view, views.beams, views.ranges, views.met, views.reach, views.far_side)
    rasterise(
        *(device.put(array) for array in arrays), views.scans, int(_apart(settings)),
        *window.corner, window.cell, 2 * settings.range_noise + SLACK,
        device.empty((*views.reach.shape, 8), np.float32), seen, marks,
    )  # fmt: skip
    return seen, marks


def _apart(settings: Settings) -> bool:
    """Whether what comes out of bearings that are never covered has its own bound of speed."""
    return settings.unseen_speed < settings.object_speed


class _Scratch(threading.local):
    """What each thread's kernels work in from cycle to cycle: fresh memory is slow to come by."""

    def __init__(self) -> None:
        self._arrays: dict[tuple[int, bool], tuple[device.Array, device.Array]] = {}

    def __call__(self, size: int) -> tuple[device.Array, device.Array]:
        """Squared distances, and the least of each chunk's blocks, of a window of `size` cells."""
        key = size, device.resident()
        if key not in self._arrays:
            blocks = size // LANES
            self._arrays = {
                key: (
                    device.empty((KINDS * size * blocks,), np.int32, LANES),
                    device.empty((KINDS, size // CHUNK, blocks), np.int32),
                )
            }
        return self._arrays[key]


_scratch = _Scratch()


def _unseen_square(cell: float, clearance: float) -> int:
    """The greatest squared distance [cells] to what is unseen at which a cell is not free.

    In single precision, as the kernels compute.
    """
    side, rounding = np.float32(cell), np.float32(1e-3) * np.float32(cell) + np.float32(SLACK)

    def free(square: int) -> bool:
        return bool(np.sqrt(np.float32(square)) * side - rounding > np.float32(clearance))

    square = math.floor((clearance / cell) ** 2)
    while not free(square + 1):
        square += 1
    while free(square):
        square -= 1
    return square


def arrival(
    views: Views,
    seen: device.Array,
    marks: device.Array,
    window: Window,
    base: int,
    robot: Robot,
    settings: Settings,
    memory: Memory | None,
) -> tuple[device.Array, device.Array, np.ndarray]:
    """When something could first be where.

    Args:
        views: of this instant.
        seen, marks: what they prove, see `rasterised`.
        window: where the cells lie.
        base: whole milliseconds from which ticks count.
        robot: whose discs.
        settings: bounds and margins.
        memory: of the cycle before; arrivals are never earlier than it knows.

    Returns:
        Ticks [J, I] uint16; the marks, with the sources that are left of them where objects have a
        size; places [n, 2] of broken premises [m].
    """
    # Views whose poses err apart leave less of a disc hidden, by no more than one error; how far
    # the rest of it reaches is inside the clearance, as the scan's error.
    size = settings.object_radius - settings.localisation_error
    left = marks
    if size > 0:
        hidden, sources = device.host(seen), device.host(marks)
        left = device.put(opened_sources(hidden, sources, window.cell, size))

    clearance = settings.clearance(robot)
    broken = np.zeros((0, 2))
    remembered, shift, age = remembered_ticks(memory), (0, 0), -1
    if memory is not None:
        age = base - memory.base_ticks
        shift = memory.window.cells_to(window)
        broken = broken_premises(memory, views, window, age, robot, settings)
        if len(broken):
            remembered = without_intruders(memory, broken, age, clearance, settings)
    ticks = device.empty((window.size, window.size), np.uint16)
    blind_speed = 0.0  # nothing is asked about where nothing is marked
    if _apart(settings) and (device.resident() or not marks[BLIND_SOURCES].all()):
        blind_speed = settings.unseen_speed
    way = None
    if settings.cones == "geodesic":
        way = ways_from_sources(views, seen, marks, window, settings)
    arrival_times(
        seen, marks, left, remembered, *shift, age if way is None else -1, BORDER,
        _unseen_square(window.cell, clearance), int(size > 0), window.cell, clearance,
        settings.object_speed, blind_speed, settings.stamp_error, device.share(),
        *_scratch(window.size), ticks,
    )  # fmt: skip
    if way is not None:
        arrival_round_walls(
            way, remembered, *shift, age, window.cell, clearance, settings.object_speed,
            settings.stamp_error, ticks,
        )  # fmt: skip
    return ticks, left, broken
