"""From when to when places come to be reached: least and greatest arrival over blocks of cells.

Level k holds, for each block of (2 << k) x (2 << k) cells, the least and the greatest arrival time
of the block and its eight neighbours. Every cell that a disc of the block's side about any point of
the block touches is among them. So one look-up speaks for a disc: until its least time all of it is
free, from its greatest on none of it is. Both may say less than is true, never more.

    counts i32: 0 i0, 1 j0 (cell of the map's corner), 2 columns, 3 rows, 8- where each level begins
    spans u32 [F]: least time in the lower half of the bits, greatest in the upper half
"""

import taichi as ti

from passpmp_ti.kernels.launch import kernel

LEVELS = 7
BEGIN = 8
"""Where the levels' offsets begin in `counts`."""
LINES = 64
"""Rows of blocks that one thread is handed at a time."""
TILE = 2 << (LEVELS - 1)
ROUNDING = 3e-3
"""[m] by which sums of f32 ways may be short."""

Spans = ti.types.ndarray(dtype=ti.u32, ndim=1)
Counts = ti.types.ndarray(dtype=ti.i32, ndim=1)


@ti.func
def blocks_along(cells, level):
    """How many blocks of a level a row of cells takes."""
    return (cells + (2 << level) - 1) >> (level + 1)


@ti.func
def level_for(radius, scale):
    """The finest level whose look-ups speak for a disc of `radius`; LEVELS and more: none does.

    A block's side must be no less than the radius: its exponent as a float gives the power of two.
    """
    blocks = ti.max((radius + ROUNDING) * scale * 0.5, 0.5)
    return (ti.bit_cast(ti.cast(blocks, ti.f32), ti.i32) >> 23) - 126


@ti.func
def span_about(spans: ti.template(), counts: ti.template(), scale, x, y, level):
    """(ticks until which all of a level's disc about (x, y) is free, ticks from which none of it
    is). Beyond the map nothing is ever free; what of a disc lies on the map lies as near to the
    map's nearest point."""
    i = ti.cast(ti.floor(x * scale), ti.i32) - counts[0]
    j = ti.cast(ti.floor(y * scale), ti.i32) - counts[1]
    on_i = ti.min(ti.max(i, 0), counts[2] - 1)
    on_j = ti.min(ti.max(j, 0), counts[3] - 1)
    at = counts[BEGIN + level]
    at += (on_j >> (level + 1)) * blocks_along(counts[2], level) + (on_i >> (level + 1))
    both = spans[at]
    least = ti.cast(both & ti.u32(65535), ti.i32)
    if i != on_i or j != on_j:
        least = 0
    return least, ti.cast(both >> ti.u32(16), ti.i32)


@ti.func
def packed(least, greatest):
    return ti.cast(least, ti.u32) | (ti.cast(greatest, ti.u32) << ti.u32(16))


@ti.func
def least_of(both):
    return both & ti.u32(65535)


@ti.func
def column_of_three(pooled: ti.template(), begin, wide, rows, row, column):
    """(least, greatest) of a block and those above and below; beyond the map nothing is free."""
    least = 0
    greatest = 0
    if column < wide:
        least = 65535
        if row == 0 or row == rows - 1:
            least = 0
        for step in ti.static(range(-1, 2)):
            j = ti.min(ti.max(row + step, 0), rows - 1)
            both = pooled[begin + j * wide + column]
            least = ti.min(least, ti.cast(both & ti.u32(65535), ti.i32))
            greatest = ti.max(greatest, ti.cast(both >> ti.u32(16), ti.i32))
    return ti.math.ivec2(least, greatest)


@kernel
def lay_spans(
    # in
    arrival: ti.types.ndarray(dtype=ti.u16, ndim=2),  # [J, I], both even
    counts: Counts,
    share: ti.i32,  # indices of a loop that one thread is handed at a time
    # scratch
    pooled: Spans,  # [F] the same without the neighbours
    # out
    spans: Spans,  # [F]
):
    # A tile holds whole blocks of every level, so one thread pools all of its levels.
    across = (counts[2] + TILE - 1) // TILE
    for index in range(across * ((counts[3] + TILE - 1) // TILE) * share):
        tile = index // share
        j0 = (tile // across) * TILE
        i0 = (tile % across) * TILE
        # one of a tile's indices does all of its work
        end = ti.select(index % share == 0, ti.min(j0 + TILE, counts[3]), j0)
        # what is read of `counts` is read before the loops: each store could have changed it
        columns = blocks_along(counts[2], 0)
        columns_end = ti.min((i0 + TILE) >> 1, columns)
        begin = counts[BEGIN]
        for row in range(j0 >> 1, end >> 1):
            for column in range(i0 >> 1, columns_end):
                a = ti.cast(arrival[2 * row, 2 * column], ti.i32)
                b = ti.cast(arrival[2 * row, 2 * column + 1], ti.i32)
                c = ti.cast(arrival[2 * row + 1, 2 * column], ti.i32)
                d = ti.cast(arrival[2 * row + 1, 2 * column + 1], ti.i32)
                pooled[begin + row * columns + column] = packed(
                    ti.min(a, b, c, d), ti.max(a, b, c, d)
                )
        for level in range(1, LEVELS):
            wide = blocks_along(counts[2], level)
            below = blocks_along(counts[2], level - 1)
            below_rows = blocks_along(counts[3], level - 1)
            begin_below = counts[BEGIN + level - 1]
            begin = counts[BEGIN + level]
            shift = level + 1
            rows_end = ti.select(end > j0, blocks_along(end, level), 0)
            columns_end = ti.min((i0 + TILE) >> shift, wide)
            for row in range(j0 >> shift, rows_end):
                for column in range(i0 >> shift, columns_end):
                    at = begin_below + 2 * row * below + 2 * column
                    a = pooled[at]
                    # beyond the map nothing is ever free
                    b, c, d = ti.u32(0), ti.u32(0), ti.u32(0)
                    on_map = 2 * column + 1 < below
                    if on_map:
                        b = pooled[at + 1]
                    if 2 * row + 1 < below_rows:
                        c = pooled[at + below]
                        if on_map:
                            d = pooled[at + below + 1]
                    least = ti.min(least_of(a), least_of(b), least_of(c), least_of(d))
                    # of whole words the greatest has the greatest upper half
                    greatest = ti.max(a, b, c, d) >> ti.u32(16)
                    pooled[begin + row * wide + column] = packed(least, greatest)

    rows_of_all = 0
    for level in ti.static(range(LEVELS)):
        rows_of_all += blocks_along(counts[3], level)
    grain = (share + LINES - 1) // LINES
    for index in range(rows_of_all * grain):
        level = 0
        row = index // grain
        while row >= blocks_along(counts[3], level):
            row -= blocks_along(counts[3], level)
            level += 1
        wide = ti.select(index % grain == 0, blocks_along(counts[2], level), 0)
        rows = blocks_along(counts[3], level)
        begin = counts[BEGIN + level]
        before = ti.math.ivec2(0, 0)
        here = column_of_three(pooled, begin, wide, rows, row, 0)
        for column in range(wide):
            after = column_of_three(pooled, begin, wide, rows, row, column + 1)
            least = ti.min(before[0], here[0], after[0])
            greatest = ti.max(before[1], here[1], after[1])
            spans[begin + row * wide + column] = packed(least, greatest)
            before = here
            here = after
