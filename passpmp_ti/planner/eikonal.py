"""The guide's equation, solved the way that suits the machine: by one thread, or by many."""

from __future__ import annotations

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.distance import distance_to_zeros
from passpmp_ti.kernels.distance import column_distance, row_distance
from passpmp_ti.kernels.relax import TILE, TURNS, relax
from passpmp_ti.kernels.sweep import sweep

MOST_SWEEPS = 24
MOST_LAUNCHES = 40
"""Of the parallel solver, `TURNS` turns each."""


def solve(slowness: device.Array, goal: tuple[int, int], time: device.Array) -> None:
    """Work out the time to the goal, by one thread on the CPU and by many elsewhere.

    Args:
        slowness: [J, I] float32 [s] to cross a cell.
        goal: its cell (j, i).
        time: [J, I] float32 [s]; 0 at the goal and UNREACHED elsewhere, solved in place.
    """
    rows, columns = time.shape
    if not device.resident():
        sweep(slowness, *goal, MOST_SWEEPS, time, np.empty((rows, 2), dtype=np.int32))
        return
    tiles = (-(-rows // TILE), -(-columns // TILE))
    stirred = device.put(np.ones(tiles, dtype=np.int32))
    for launch in range(MOST_LAUNCHES):
        if relax(slowness, 2 + TURNS * launch, time, stirred) == 0:
            return


def distances_to_zeros(mask: device.Array) -> device.Array:
    """[J, I] float32 [cells] to the nearest cell that is 0 of a uint8 mask."""
    if not device.resident():
        return distance_to_zeros(mask)
    column = device.empty(mask.shape, np.int32)
    distance = device.empty(mask.shape, np.float32)
    column_distance(mask, column)
    row_distance(column, distance)
    return distance
