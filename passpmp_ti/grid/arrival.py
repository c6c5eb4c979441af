"""From what the views prove to when something could first be at each cell."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from passpmp_ti.grid.distance import NO_SEED, distance_between_cells
from passpmp_ti.grid.memory import broken_premises, remembered_ticks, without_intruders
from passpmp_ti.grid.opening import opened_sources
from passpmp_ti.grid.view import Views
from passpmp_ti.grid.window import Window
from passpmp_ti.kernels.arrival import arrival_times
from passpmp_ti.kernels.beams import SLACK
from passpmp_ti.kernels.visibility import BLIND_SOURCES, SOURCES, mark_sources, see_cells
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

if TYPE_CHECKING:
    from passpmp_ti.grid.model import FutureModel


def rasterised(views: Views, window: Window, settings: Settings) -> tuple[np.ndarray, np.ndarray]:
    """(seen [J, I] uint8, 1: all of the cell proven empty; marks [5, J, I] uint8, 0 marks)."""
    seen = np.empty((window.size, window.size), dtype=np.uint8)
    marks = np.ones((5, window.size, window.size), dtype=np.uint8)
    i0, j0 = window.corner
    see_cells(views.view, views.beams, views.reach, i0, j0, window.cell, seen)
    apart = settings.unseen_speed < settings.object_speed
    mark_sources(
        views.view, views.beams, views.ranges, views.met, views.reach, views.far_side,
        views.scans, int(apart), i0, j0, window.cell, 2 * settings.range_noise + SLACK, marks,
    )  # fmt: skip
    return seen, marks


@functools.cache
def _nothing_near(size: int) -> np.ndarray:
    """[size, size] distances where nothing is marked anywhere; only ever read."""
    return np.full((size, size), NO_SEED, dtype=np.float32)


def _to_sources(marks: np.ndarray, blind_speed: float) -> tuple[np.ndarray, np.ndarray]:
    """[J, I] distances to the nearest source, and to the nearest blind one [cells]."""
    to_source = distance_between_cells(marks[SOURCES])
    if blind_speed > 0 and not marks[BLIND_SOURCES].all():
        return to_source, distance_between_cells(marks[BLIND_SOURCES])
    return to_source, _nothing_near(len(to_source))


def arrival(
    views: Views,
    seen: np.ndarray,
    marks: np.ndarray,
    window: Window,
    base: int,
    robot: Robot,
    settings: Settings,
    previous: FutureModel | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """When something could first be where.

    Args:
        views: of this instant.
        seen, marks: what they prove, see `rasterised`.
        window: where the cells lie.
        base: whole milliseconds from which ticks count.
        robot: whose discs.
        settings: bounds and margins.
        previous: the model of the cycle before; arrivals are never earlier than it knows.

    Returns:
        Ticks [J, I] uint16; the marks, with the sources that are left of them where objects have a
        size; places [n, 2] of broken premises [m].
    """
    blind_speed = settings.unseen_speed
    to_source, to_blind = _to_sources(marks, blind_speed)
    # Views whose poses err apart leave less of a disc hidden, by no more than one error; how far
    # the rest of it reaches is inside the clearance, as the scan's error.
    size = settings.object_radius - settings.localisation_error
    if size > 0:
        marks = opened_sources(seen, marks, window.cell, size)
        farther, blind_farther = _to_sources(marks, blind_speed)
        to_source = np.maximum(to_source, farther)
        to_blind = np.maximum(to_blind, blind_farther)
    to_unseen = distance_between_cells(seen)

    clearance = settings.clearance(robot)
    broken = np.zeros((0, 2))
    memory, shift, age = remembered_ticks(previous), (0, 0), -1
    if previous is not None:
        age = base - previous.base_ticks
        shift = previous.window.cells_to(window)
        broken = broken_premises(previous, views, window, age, robot, settings)
        if len(broken):
            memory = without_intruders(previous, broken, age, clearance, settings)
    ticks = np.empty(seen.shape, dtype=np.uint16)
    arrival_times(
        to_source, to_blind, to_unseen, memory, shift[0], shift[1], age, window.cell, clearance,
        settings.object_speed, blind_speed, settings.stamp_error, ticks,
    )  # fmt: skip
    return ticks, marks, broken
