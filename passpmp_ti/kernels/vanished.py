"""Surfaces that were met, and whether all of the square about them is proven empty now."""

import taichi as ti

from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.visibility import MOVABLE_CELLS, STATIC_CELLS

STRETCH = 64
"""Cells of a row that are passed over together where they hold no surface."""

Cells = ti.types.ndarray(dtype=ti.u8, ndim=2)  # [J, I] 1: proven empty
Marks = ti.types.ndarray(dtype=ti.u8, ndim=3)  # [5, J, I] 0 marks


@ti.func
def bare(marks: ti.template(), j, begin, end):
    """Whether a stretch of a row holds no surface: most hold none, and this is quickly told."""
    unmarked = ti.u8(1)
    for i in range(begin, end):
        unmarked &= marks[STATIC_CELLS, j, i] & marks[MOVABLE_CELLS, j, i]
    return unmarked != 0


@ti.func
def square_empty(seen: ti.template(), row, column, reach):
    """Whether all of a square is seen, `reach` cells to each side; it lies in the grid."""
    all_seen = seen[row, column] != 0
    j = row - reach
    while all_seen and j <= row + reach:
        i = column - reach
        while all_seen and i <= column + reach:
            all_seen = seen[j, i] != 0
            i += 1
        j += 1
    return all_seen


@ti.func
def asked_and_gone(marks: ti.template(), seen: ti.template(), kind, j, i, row, column, reach):
    """(1, 0) for a surface that is asked about, now at [row, column]; (1, 1) where it is gone."""
    inside = (
        ti.min(row, column) >= reach
        and row < seen.shape[0] - reach
        and column < seen.shape[1] - reach
    )
    asked = 0
    gone = 0
    if marks[kind, j, i] == 0 and reach >= 0 and inside:
        asked = 1
        gone = ti.cast(square_empty(seen, row, column, reach), ti.i32)
    return ti.math.ivec2(asked, gone)


@kernel
def surfaces_gone(
    # in
    marks: Marks,  # of the model before
    seen: Cells,  # now, in a window of the same size
    shift_i: ti.i32,  # what was cell [j, i] before is [j + shift_j, i + shift_i] now
    shift_j: ti.i32,
    static_reach: ti.i32,  # cells that a surface that stays may be off; < 0: it is not asked about
    movable_reach: ti.i32,  # cells that one that may move has gone at most; the same
    # out
    found: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [2] of 0: surfaces asked about, those gone
):
    for j in range(marks.shape[1]):
        here = ti.math.ivec2(0, 0)
        row = j + shift_j
        begin = 0
        while begin < marks.shape[2]:
            end = ti.min(begin + STRETCH, marks.shape[2])
            if not bare(marks, j, begin, end):
                for i in range(begin, end):
                    at = i + shift_i
                    here += asked_and_gone(
                        marks, seen, STATIC_CELLS, j, i, row, at, static_reach
                    ) + asked_and_gone(marks, seen, MOVABLE_CELLS, j, i, row, at, movable_reach)
            begin = end
        # whole numbers: the order in which rows are added does not matter
        if here[0] > 0:
            found[0] += here[0]
            found[1] += here[1]


@kernel
def count_surfaces(
    # in
    marks: Marks,
) -> ti.i32:
    """How many cells hold a surface that stays, and how many one that may move, together."""
    count = 0
    for j in range(marks.shape[1]):
        for i in range(marks.shape[2]):
            count += 2 - ti.cast(marks[STATIC_CELLS, j, i] + marks[MOVABLE_CELLS, j, i], ti.i32)
    return count
