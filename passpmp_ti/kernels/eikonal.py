"""Time to the goal over a grid: the eikonal equation |grad time| = slowness.

First order and upwind: a cell's time solves (t - a)+^2 + (t - b)+^2 = slowness^2, where a and b are
the lesser of its neighbours' times along each axis. kernels/sweep.py solves it in one thread,
kernels/relax.py in many; both end where no cell's time falls any more, which is the same place.

Not part of the guarantee: a wrong guide costs time, never safety.
"""

import taichi as ti

from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.stretch import STRETCH, bare
from passpmp_ti.kernels.visibility import MOVABLE_CELLS, STANDING_SOURCES, STATIC_CELLS

UNREACHED = 1e9
SETTLED = 5e-4  # share of its slowness by which a cell's time must fall to count as changed

RUN = 16  # cells in a row that one thread lays out

Field = ti.types.ndarray(dtype=ti.f32, ndim=2)  # [J, I]
Whole = ti.types.ndarray(dtype=ti.i32, ndim=2)
Mask = ti.types.ndarray(dtype=ti.u8, ndim=2)
Line = ti.types.ndarray(dtype=ti.i32, ndim=1)


@ti.func
def fallen(old, a, b, slowness):
    """The time that a cell's neighbours leave it, where that is less than `old`; else `old`."""
    most = old - SETTLED * slowness
    da = ti.max(most - a, 0.0)
    db = ti.max(most - b, 0.0)
    result = old
    # almost all cells that are asked stay as they are: that is told without a root
    if da * da + db * db > slowness * slowness:
        apart = a - b
        t = ti.min(a, b) + slowness
        if ti.abs(apart) < slowness:
            t = 0.5 * (a + b + ti.sqrt(2.0 * slowness * slowness - apart * apart))
        if t < most:
            result = t
    return result


@ti.func
def block_about(blocked: ti.template(), row, column, reach):
    """Mark the cells in which the robot cannot be for a wall at [row, column]."""
    span = ti.cast(reach, ti.i32) + 1
    for dj, di in ti.ndrange((-span, span + 1), (-span, span + 1)):
        j = row + dj
        i = column + di
        if j >= 0 and i >= 0 and j < blocked.shape[0] and i < blocked.shape[1]:
            if ti.sqrt(ti.cast(dj * dj + di * di, ti.f32)) < reach:
                blocked[j, i] = ti.u8(1)  # whoever else writes here writes the same


@kernel
def block(
    # in
    cells: Whole,  # [N, 2] row and column of walls
    reach: ti.f32,  # cells from a wall in which the robot cannot be
    # in / out
    blocked: Mask,  # [J, I] 1: near a wall
):
    for n in range(cells.shape[0]):
        block_about(blocked, cells[n, 0], cells[n, 1], reach)


@kernel
def meet(
    # in
    marks: ti.types.ndarray(dtype=ti.u8, ndim=3),  # [5, K, N] 0 marks, of a model
    rows: Line,  # [K] row of this grid that a row of the model lies in; < 0: none
    columns: Line,  # [N] the same of columns
    movers: ti.i32,  # 1: something may step out from surfaces that may move, too
    reach: ti.f32,  # cells from a wall in which the robot cannot be
    # in / out
    walls: Mask,  # [J, I] 0: a wall was met there
    blocked: Mask,  # [J, I] 1: near a wall
    corners: Mask,  # [J, I] of 1; 0 where something may step out
):
    """What a model shows, on the guide's grid. All that write to a cell write the same there."""
    for k in range(marks.shape[1]):
        for stretch in range((marks.shape[2] + STRETCH - 1) // STRETCH):
            begin = stretch * STRETCH
            passed = bare(marks, STATIC_CELLS, STANDING_SOURCES, k, begin)
            if movers == 1 and passed:
                passed = bare(marks, MOVABLE_CELLS, MOVABLE_CELLS, k, begin)
            if rows[k] >= 0 and not passed:
                for n in range(begin, ti.min(begin + STRETCH, marks.shape[2])):
                    j = rows[k]
                    i = columns[n]
                    if i >= 0:
                        if marks[STATIC_CELLS, k, n] == 0 and walls[j, i] != 0:
                            walls[j, i] = ti.u8(0)
                            block_about(blocked, j, i, reach)
                        if marks[STANDING_SOURCES, k, n] == 0:
                            corners[j, i] = ti.u8(0)
                        if movers == 1 and marks[MOVABLE_CELLS, k, n] == 0:
                            corners[j, i] = ti.u8(0)


@kernel
def lay_out(
    # in
    numbers: ti.types.ndarray(dtype=ti.f32, ndim=1),  # [5], see below
    blocked: Mask,  # [J, I] 1: near a wall
    to_corner: Field,  # [J, I] cells to where something may step out from
    goal_j: ti.i32,
    goal_i: ti.i32,
    # out
    slowness: Field,  # [J, I] seconds to cross a cell
    time: Field,  # [J, I] 0 at the goal, the rest UNREACHED
):
    """The speed that will be safe at each place, as the time to cross it.

    numbers: speeds [cells/s]: 0 near a wall, 1 the slowest elsewhere, 2 the cruise speed, 3 what
    each cell farther from a corner allows, 4 what is to be taken off that.
    """
    rows, columns = time.shape[0], time.shape[1]
    for j, run in ti.ndrange(rows, (columns + RUN - 1) // RUN):
        for i in range(run * RUN, ti.min(run * RUN + RUN, columns)):
            speed = numbers[3] * to_corner[j, i] - numbers[4]
            speed = ti.min(ti.max(speed, numbers[1]), numbers[2])
            if blocked[j, i] != 0:
                speed = numbers[0]
            slowness[j, i] = 1.0 / speed
            time[j, i] = UNREACHED
            if j == goal_j and i == goal_i:
                time[j, i] = 0.0


@kernel
def heap(
    # in
    hill: ti.types.ndarray(dtype=ti.f32, ndim=1),  # [4] column and row of the top, reach, height
    # in / out
    time: Field,  # [J, I]
):
    """Add a cone to the times: places that the robot is to leave."""
    for j, i in time:
        away = ti.sqrt((i + 0.5 - hill[0]) ** 2 + (j + 0.5 - hill[1]) ** 2)
        if away < hill[2]:
            time[j, i] += hill[3] * (1.0 - away / hill[2])


@kernel
def point_ahead(
    # in
    time: Field,  # [J, I]
    steps: ti.i32,  # cells to walk down
    low_j: ti.i32,  # the part of the grid that is wanted
    low_i: ti.i32,
    # out
    down: Whole,  # [J, I] scratch: which of its neighbours a cell's way goes on to
    ahead: ti.types.ndarray(dtype=ti.f32, ndim=3),  # [j, i, 2] unit vectors; zero at the goal
):
    """Direction from each cell to where its way down the field is some steps later.

    The gradient itself points across a narrow valley; the way ahead points along it.
    """
    rows, columns = time.shape[0], time.shape[1]
    # a way leaves the part that is wanted by no more than its steps
    for wj, wi in ti.ndrange(ahead.shape[0] + 2 * steps, ahead.shape[1] + 2 * steps):
        j = low_j + wj - steps
        i = low_i + wi - steps
        if j >= 0 and i >= 0 and j < rows and i < columns:
            least = time[j, i]
            way = 5
            for dj in range(-1, 2):
                for di in range(-1, 2):
                    nj = j + dj
                    ni = i + di
                    if nj >= 0 and ni >= 0 and nj < rows and ni < columns:
                        if time[nj, ni] < least:
                            least = time[nj, ni]
                            way = 4 * (dj + 1) + di + 1
            down[j, i] = way
    for wj, wi in ti.ndrange(ahead.shape[0], ahead.shape[1]):
        j = low_j + wj
        i = low_i + wi
        for _ in range(steps):
            way = down[j, i]
            j += (way >> 2) - 1
            i += (way & 3) - 1
        dx = ti.cast(i - low_i - wi, ti.f32)
        dy = ti.cast(j - low_j - wj, ti.f32)
        length = ti.max(ti.sqrt(dx * dx + dy * dy), 1.0)
        ahead[wj, wi, 0] = dx / length
        ahead[wj, wi, 1] = dy / length
