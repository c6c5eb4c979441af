"""The viability kernel on a state-time grid, by backward iteration.

A state is a cell of the plane [j, i], a heading h and a speed level l; levels are the bits of one
byte. A slice holds the states of one moment. Moves lead from the states of one slice to those of
the next. Where exactly in its cell and heading a robot is, is not known: a move leads to any cell
of a box of cells and headings, and all of them must be viable.

    moves  [U, 2] i32: level before, level after
    ways   [H * U * M, 2] f32: places along a move from heading h, seen from the cell's centre
           [cells]; row (h * U + u) * M + m
    needed [U * M] f32: what must be free about each of them [m]
    boxes  [H * U, 6] i32: first and last i, j and h after the move, seen from where it begins
"""

import taichi as ti

from passpmp_ti.kernels.launch import kernel

Table = ti.types.ndarray(dtype=ti.f32, ndim=2)
Whole = ti.types.ndarray(dtype=ti.i32, ndim=2)
States = ti.types.ndarray(dtype=ti.u8, ndim=3)  # [H, J, I]


@ti.func
def way_free(
    gaps: ti.template(), ways: ti.template(), needed: ti.template(), first, row, move, j, i, looks
):
    """Whether all looks along a move find room enough; outside the grid there is none."""
    free = True
    m = 0
    while free and m < looks:
        # halves are rounded either way: the room that is needed covers a whole cell
        x = i + ti.cast(ti.floor(ways[row * looks + m, 0] + 0.5), ti.i32)
        y = j + ti.cast(ti.floor(ways[row * looks + m, 1] + 0.5), ti.i32)
        free = False
        if x >= 0 and y >= 0 and x < gaps.shape[2] and y < gaps.shape[1]:
            free = gaps[first + m, y, x] >= needed[move * looks + m]
        m += 1
    return free


@ti.func
def all_viable(after: ti.template(), boxes: ti.template(), row, level, h, j, i):
    """Whether every state that a move may lead to is viable; outside the grid none is."""
    headings = after.shape[0]
    viable = True
    if i + boxes[row, 0] < 0 or i + boxes[row, 1] >= after.shape[2]:
        viable = False
    if j + boxes[row, 2] < 0 or j + boxes[row, 3] >= after.shape[1]:
        viable = False
    dh = boxes[row, 4]
    while viable and dh <= boxes[row, 5]:
        turned = (h + dh + headings) % headings
        for y in range(j + boxes[row, 2], j + boxes[row, 3] + 1):
            for x in range(i + boxes[row, 0], i + boxes[row, 1] + 1):
                if (ti.cast(after[turned, y, x], ti.i32) >> level) & 1 == 0:
                    viable = False
        dh += 1
    return viable


@kernel
def step_back(
    # in
    gaps: ti.types.ndarray(dtype=ti.f32, ndim=3),  # [K * M, J, I] [m]
    first: ti.i32,  # of this slice's looks in `gaps`
    levels: ti.i32,
    moves: Whole,  # [U, 2]
    ways: Table,
    needed: ti.types.ndarray(dtype=ti.f32, ndim=1),
    boxes: Whole,
    after: States,  # the slice that follows; not this one itself, or threads would race
    # in / out
    now: States,
) -> ti.i32:
    """Take out of a slice all states that no move leads from to viable ones; how many lost any."""
    lost = 0
    for h, j, i in now:
        before = ti.cast(now[h, j, i], ti.i32)
        kept = 0
        count = moves.shape[0]
        looks = needed.shape[0] // count
        for level in range(levels):
            if (before >> level) & 1 == 1:
                found = False
                u = 0
                while not found and u < count:
                    if moves[u, 0] == level:
                        row = h * count + u
                        if way_free(gaps, ways, needed, first, row, u, j, i, looks):
                            found = all_viable(after, boxes, row, moves[u, 1], h, j, i)
                    u += 1
                if found:
                    kept |= 1 << level
        if kept != before:
            now[h, j, i] = ti.cast(kept, ti.u8)
            lost += 1
    return lost
