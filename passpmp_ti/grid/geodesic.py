"""When something could first be where if walls bar its way: later, round the corners."""

from __future__ import annotations

import threading

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.distance import distance_between_cells
from passpmp_ti.grid.view import Views
from passpmp_ti.grid.window import Window
from passpmp_ti.kernels.arrival import LANES, SAMPLING
from passpmp_ti.kernels.beams import SLACK
from passpmp_ti.kernels.geodesic import COLUMNS, FAR, ROWS, begin_at, open_cells, walk, walk_apart
from passpmp_ti.kernels.visibility import BLIND_SOURCES, SOURCES
from passpmp_ti.settings import Settings

MOST_SWEEPS = 200
"""A way that turns more often than this is not followed to its end."""


class _Scratch(threading.local):
    """What each thread's kernels work in from cycle to cycle."""

    def __init__(self) -> None:
        self._arrays: dict[tuple[int, bool], tuple[device.Array, device.Array, device.Array]] = {}

    def __call__(self, size: int) -> tuple[device.Array, device.Array, device.Array]:
        """What cells cost, lengths to corners, and what was stirred (elsewhere: other lengths)."""
        key = size, device.resident()
        if key not in self._arrays:
            shape = (size + 2 * ROWS + 1, size + 3 * COLUMNS)
            last = shape if device.resident() else (shape[0], shape[1] // LANES)
            toll = device.full(shape, FAR, np.int32)
            self._arrays = {
                key: (toll, device.empty(shape, np.int32), device.empty(last, np.int32))
            }
        return self._arrays[key]


_scratch = _Scratch()


def ways_from_sources(
    views: Views, seen: device.Array, marks: device.Array, window: Window, settings: Settings
) -> device.Array | None:
    """How far it is to walk from the nearest source, at least.

    Args:
        views: of this instant.
        seen, marks: what they prove, see `rasterised`; all sources, whatever an object's size.
        window: where the cells lie.
        settings: errors of ranges and poses.

    Returns:
        [J + 2 ROWS + 1, I + 3 COLUMNS] int32 [1 / UNIT cells] to corners of cells, padded, see
        kernels/geodesic.py; FAR: nobody gets there. Overwritten by the next call. None: the ways
        turn more often than is followed.
    """
    toll, way, last = _scratch(window.size)
    # Two views of one surface differ by two ranges' noise; an eighth of a cell behind it is
    # forgiven where views meet. Views whose poses err apart differ by two errors.
    behind = 2 * settings.range_noise + SLACK + SAMPLING * window.cell
    open_cells(
        *(
            device.put(array)
            for array in (
                views.view, views.beams, views.ranges, views.met, views.reach, views.far_side
            )
        ),
        seen, marks, *window.corner, window.cell, behind, 2 * settings.localisation_error,
        device.empty(views.reach.shape, np.float32), toll, way,
    )  # fmt: skip
    if settings.unseen_speed < settings.object_speed:
        # Who is fast may come by way of bearings that no sensor covers, but gets there no sooner
        # than straight; what was there before stands still, see `Settings.cones`.
        straight = distance_between_cells(device.host(marks)[SOURCES])
        begin_at(marks, BLIND_SOURCES, device.put(straight), toll, way)
    if not device.resident():
        return way if walk(toll, MOST_SWEEPS, way, last) <= MOST_SWEEPS else None
    last.copy_from(way)
    # as many rounds as moves: a chain that passed every corner would be the longest
    for _ in range(window.size):
        if walk_apart(toll, way, last) == 0:
            return way
    return None
