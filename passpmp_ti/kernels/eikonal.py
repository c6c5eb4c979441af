"""Time to the goal over a grid: the eikonal equation |grad time| = slowness, solved two ways.

First order and upwind: a cell's time solves (t - a)+^2 + (t - b)+^2 = slowness^2, where a and b are
the lesser of its neighbours' times along each axis. `sweep` solves it in one thread, `relax` in as
many as there are tiles; both end where no cell's time falls any more, which is the same place.

Not part of the guarantee: a wrong guide costs time, never safety.
"""

import taichi as ti

UNREACHED = 1e9
SETTLED = 5e-4  # share of its slowness by which a cell's time must fall to count as changed

RUN = 16  # cells in a row that one thread lays out
TILE = 8  # cells along a side of what one thread relaxes
TURNS = 16  # in one launch; an even number

Field = ti.types.ndarray(dtype=ti.f32, ndim=2)  # [J, I]
Whole = ti.types.ndarray(dtype=ti.i32, ndim=2)


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


@ti.kernel
def lay_out(
    # in
    numbers: ti.types.ndarray(dtype=ti.f32, ndim=1),  # [6], see below
    to_wall: Field,  # [J, I] cells
    to_corner: Field,  # [J, I] cells to where something may step out from
    goal_j: ti.i32,
    goal_i: ti.i32,
    # out
    slowness: Field,  # [J, I] seconds to cross a cell
    time: Field,  # [J, I] 0 at the goal, the rest UNREACHED
):
    """The speed that will be safe at each place, as the time to cross it.

    numbers: 0 cells from a wall in which the robot cannot be; speeds [cells/s]: 1 there, 2 the
    slowest elsewhere, 3 the cruise speed; 4 speed that each cell farther from a corner allows, 5
    what is to be taken off that.
    """
    rows, columns = time.shape[0], time.shape[1]
    for j, run in ti.ndrange(rows, (columns + RUN - 1) // RUN):
        for i in range(run * RUN, ti.min(run * RUN + RUN, columns)):
            speed = numbers[4] * to_corner[j, i] - numbers[5]
            speed = ti.min(ti.max(speed, numbers[2]), numbers[3])
            if to_wall[j, i] < numbers[0]:
                speed = numbers[1]
            slowness[j, i] = 1.0 / speed
            time[j, i] = UNREACHED
            if j == goal_j and i == goal_i:
                time[j, i] = 0.0


@ti.func
def include(span: ti.template(), j, first, last):
    """Let the columns from `first` to `last` of row j be looked at again."""
    if j >= 0 and j < span.shape[0] and first <= last:
        span[j, 0] = ti.min(span[j, 0], ti.max(first, 0))
        span[j, 1] = ti.max(span[j, 1], last)


@ti.func
def sweep_row(
    slowness: ti.template(), time: ti.template(), span: ti.template(), j, first, last, step
):
    """Look at a row's cells from `first` to `last`, from the left for step 1, from the right for
    -1, and on as long as times fall; whether one did."""
    rows, columns = time.shape[0], time.shape[1]
    # at the border a cell stands for its own neighbour, which tells it nothing
    below = ti.max(j - 1, 0)
    above = ti.min(j + 1, rows - 1)
    i = first
    if step < 0:
        i = last
    left = last - first + 1
    behind = time[j, ti.min(ti.max(i - step, 0), columns - 1)]
    # what has to be looked at again of this row, the one below and the one above
    least = ti.Vector([columns, columns, columns])
    most = ti.Vector([-1, -1, -1])
    fell = False
    while left > 0:
        ahead = time[j, ti.min(ti.max(i + step, 0), columns - 1)]
        under = time[below, i]
        over = time[above, i]
        old = time[j, i]
        new = fallen(old, ti.min(behind, ahead), ti.min(under, over), slowness[j, i])
        left -= 1
        if new < old:
            fell = True
            time[j, i] = new
            # only what is later can hear of it; what lies ahead comes next
            if behind > new:
                least[0] = ti.min(least[0], i - step)
                most[0] = ti.max(most[0], i - step)
            if under > new:
                least[1] = ti.min(least[1], i)
                most[1] = ti.max(most[1], i)
            if over > new:
                least[2] = ti.min(least[2], i)
                most[2] = ti.max(most[2], i)
            if left == 0 and i + step >= 0 and i + step < columns:
                left = 1
        behind = new
        i += step
    include(span, j, least[0], most[0])
    include(span, below, least[1], most[1])
    include(span, above, least[2], most[2])
    return fell


@ti.kernel
def sweep(
    # in
    slowness: Field,  # [J, I]
    goal_j: ti.i32,
    goal_i: ti.i32,
    most_sweeps: ti.i32,
    # in / out
    time: Field,  # [J, I] as `lay_out` leaves it
    span: Whole,  # [J, 2] scratch: first and last column of each row that has to be looked at
) -> ti.i32:
    """Sweep up and down, each row both ways, until nothing changes; returns the sweeps it took.

    A row is looked at only from the first to the last cell with a neighbour that changed since.
    """
    rows, columns = time.shape[0], time.shape[1]
    sweeps = 0
    ti.loop_config(serialize=True)
    for _ in range(1):
        for j in range(rows):
            span[j, 0] = columns
            span[j, 1] = -1
        include(span, goal_j, goal_i - 1, goal_i + 1)
        include(span, goal_j - 1, goal_i, goal_i)
        include(span, goal_j + 1, goal_i, goal_i)
        busy = True
        while busy and sweeps < most_sweeps:
            busy = False
            for jj in range(rows):
                j = jj
                if sweeps % 2 == 1:
                    j = rows - 1 - jj
                for way in range(2):
                    first = span[j, 0]
                    last = ti.min(span[j, 1], columns - 1)
                    start = first
                    # at first times grow away from the goal's column, as a rule
                    if sweeps < 2 and way == 0:
                        start = ti.max(first, goal_i)
                    if start <= last:
                        span[j, 0] = columns
                        span[j, 1] = -1
                        include(span, j, first, start - 1)
                        if sweep_row(slowness, time, span, j, start, last, 1 - 2 * way):
                            busy = True
            sweeps += 1
    return sweeps


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


@ti.kernel
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


@ti.kernel
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
