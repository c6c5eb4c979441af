"""The eikonal equation solved by a thread for every tile; see kernels/eikonal.py."""

import taichi as ti

from passpmp_ti.kernels.eikonal import Field, Whole, fallen
from passpmp_ti.kernels.launch import kernel

TILE = 8  # cells along a side of what one thread relaxes
TURNS = 16  # in one launch; an even number


@ti.func
def relax_tile(slowness: ti.template(), time: ti.template(), tile_j, tile_i):
    """Sweep one tile in the four diagonal orders; whether a time fell."""
    rows, columns = time.shape[0], time.shape[1]
    changed = False
    for order in range(4):
        for cj, ci in ti.ndrange(TILE, TILE):
            j = tile_j * TILE + cj
            i = tile_i * TILE + ci
            if order % 2 == 1:
                j = tile_j * TILE + TILE - 1 - cj
            if order >= 2:
                i = tile_i * TILE + TILE - 1 - ci
            if j < rows and i < columns:
                old = time[j, i]
                new = fallen(
                    old,
                    ti.min(time[j, ti.max(i - 1, 0)], time[j, ti.min(i + 1, columns - 1)]),
                    ti.min(time[ti.max(j - 1, 0), i], time[ti.min(j + 1, rows - 1), i]),
                    slowness[j, i],
                )
                if new < old:
                    time[j, i] = new
                    changed = True
    return changed


@ti.func
def stirred_about(stirred: ti.template(), tile_j, tile_i):
    """The last turn in which a tile or one beside it changed."""
    rows, columns = stirred.shape[0], stirred.shape[1]
    last = ti.max(
        stirred[tile_j, ti.max(tile_i - 1, 0)], stirred[tile_j, ti.min(tile_i + 1, columns - 1)]
    )
    last = ti.max(last, stirred[ti.max(tile_j - 1, 0), tile_i])
    last = ti.max(last, stirred[ti.min(tile_j + 1, rows - 1), tile_i])
    return ti.max(last, stirred[tile_j, tile_i])


@kernel
def relax(
    # in
    slowness: Field,  # [J, I]
    turn: ti.i32,  # number of the first turn of this launch; 2 as it begins
    # in / out
    time: Field,  # [J, I] as `lay_out` leaves it
    stirred: Whole,  # [tiles] the turn in which each changed last; 1 everywhere as it begins
) -> ti.i32:
    """Relax the tiles, black ones and white ones in turn; returns how many are not settled.

    Tiles of one colour share no edge, and cells read only across edges: the order in which threads
    come to them does not matter.
    """
    for t in ti.static(range(TURNS)):
        for tile_j, tile_i in stirred:
            if (tile_j + tile_i + t) % 2 == 0:
                # a turn ago its neighbours may have changed, two turns ago the tile itself
                if stirred_about(stirred, tile_j, tile_i) >= turn + t - 2:
                    if relax_tile(slowness, time, tile_j, tile_i):
                        stirred[tile_j, tile_i] = turn + t
    unsettled = 0
    for tile_j, tile_i in stirred:
        if stirred[tile_j, tile_i] >= turn + TURNS - 2:
            unsettled += 1
    return unsettled
