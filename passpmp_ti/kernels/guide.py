"""Time to the goal: an eikonal equation swept over a coarse grid, and its look-up.

Not part of the guarantee: a wrong guide costs time, never safety.
"""

import taichi as ti

UNREACHED = 1e9

Field = ti.types.ndarray(dtype=ti.f32, ndim=2)  # [J, I]


@ti.func
def from_neighbours(time: ti.template(), j, i, slowness):
    """First-order upwind time of a cell; slowness: seconds to cross one cell."""
    rows, columns = time.shape[0], time.shape[1]
    a = UNREACHED
    b = UNREACHED
    if i > 0:
        a = time[j, i - 1]
    if i < columns - 1:
        a = ti.min(a, time[j, i + 1])
    if j > 0:
        b = time[j - 1, i]
    if j < rows - 1:
        b = ti.min(b, time[j + 1, i])
    low = ti.min(a, b)
    high = ti.max(a, b)
    result = low + slowness
    if high - low < slowness:
        apart = high - low
        result = 0.5 * (low + high + ti.sqrt(2.0 * slowness * slowness - apart * apart))
    return result


@ti.kernel
def sweep(
    # in
    slowness: Field,  # [J, I] seconds to cross a cell
    most_rounds: ti.i32,
    # in / out
    time: Field,  # [J, I] seeds hold their time, the rest UNREACHED
) -> ti.i32:
    """Sweep in the four diagonal orders until nothing changes; returns the rounds it took."""
    rows, columns = time.shape[0], time.shape[1]
    rounds = 0
    ti.loop_config(serialize=True)
    for _ in range(1):
        quiet = 0  # sweeps in turn that changed nothing: after one of each order all is settled
        while quiet < 4 and rounds < most_rounds:
            for direction in range(4):
                changed = 0
                if quiet < 4:
                    for jj in range(rows):
                        j = jj
                        if direction % 2 == 1:
                            j = rows - 1 - jj
                        for ii in range(columns):
                            i = ii
                            if direction >= 2:
                                i = columns - 1 - ii
                            better = from_neighbours(time, j, i, slowness[j, i])
                            if better < time[j, i] - 1e-4:
                                time[j, i] = better
                                changed = 1
                    quiet += 1
                    if changed == 1:
                        quiet = 0
            rounds += 1
    return rounds


@ti.kernel
def point_ahead(
    # in
    time: Field,  # [J, I]
    steps: ti.i32,  # cells to walk down
    low_j: ti.i32,  # the part of the grid that is wanted
    low_i: ti.i32,
    # out
    ahead: ti.types.ndarray(dtype=ti.f32, ndim=3),  # [j, i, 2] unit vectors; zero at the goal
):
    """Direction from each cell to where its way down the field is some steps later.

    The gradient itself points across a narrow valley; the way ahead points along it.
    """
    rows, columns = time.shape[0], time.shape[1]
    for wj, wi in ti.ndrange(ahead.shape[0], ahead.shape[1]):
        j = low_j + wj
        i = low_i + wi
        for _ in range(steps):
            least = time[j, i]
            best_j = j
            best_i = i
            for dj in range(-1, 2):
                for di in range(-1, 2):
                    nj = j + dj
                    ni = i + di
                    if nj >= 0 and ni >= 0 and nj < rows and ni < columns:
                        if time[nj, ni] < least:
                            least = time[nj, ni]
                            best_j = nj
                            best_i = ni
            j = best_j
            i = best_i
        dx = ti.cast(i - low_i - wi, ti.f32)
        dy = ti.cast(j - low_j - wj, ti.f32)
        length = ti.max(ti.sqrt(dx * dx + dy * dy), 1.0)
        ahead[wj, wi, 0] = dx / length
        ahead[wj, wi, 1] = dy / length


@ti.func
def guide_at(time: ti.template(), ahead: ti.template(), frame: ti.template(), x, y, c, s):
    """Cost to go from (x, y) with heading (c, s) = (cos theta, sin theta).

    The field knows places, not headings: the time to turn towards the way ahead is added, fading
    near the goal, so that a robot that faces the wrong way finds turning worth while.

    frame: 0, 1 corner of cell [0, 0]; 2 cells a metre; 3, 4 goal; 5: 1 straight distance [m],
    0 the field [s]; 6 radius about the goal within which the cost is 0 [m]; 7 time that a turn
    by a right angle takes [s]; 8, 9 column and row at which `ahead`
    begins; 10 seconds a metre in the open.
    """
    dx = x - frame[3]
    dy = y - frame[4]
    cost = ti.max(ti.sqrt(dx * dx + dy * dy) - frame[6], 0.0)
    if frame[5] < 0.5 and cost > 0.0:
        rows, columns = time.shape[0], time.shape[1]
        px = (x - frame[0]) * frame[2]
        py = (y - frame[1]) * frame[2]
        fx = ti.min(ti.max(px - 0.5, 0.0), columns - 1.001)
        fy = ti.min(ti.max(py - 0.5, 0.0), rows - 1.001)
        i = ti.cast(fx, ti.i32)
        j = ti.cast(fy, ti.i32)
        u = fx - i
        v = fy - j
        low = time[j, i] * (1 - u) + time[j, i + 1] * u
        high = time[j + 1, i] * (1 - u) + time[j + 1, i + 1] * u
        # off the grid, the way back to it is added
        cost = (
            low * (1 - v)
            + high * v
            + ti.sqrt((px - 0.5 - fx) ** 2 + (py - 0.5 - fy) ** 2) * (frame[10] / frame[2])
        )
        ai = ti.cast(ti.floor(px - frame[8]), ti.i32)
        aj = ti.cast(ti.floor(py - frame[9]), ti.i32)
        if frame[7] > 0.0 and ai >= 0 and aj >= 0 and ai < ahead.shape[1] and aj < ahead.shape[0]:
            facing = ahead[aj, ai, 0] * c + ahead[aj, ai, 1] * s
            cost += frame[7] * (1.0 - facing) * ti.min(0.5 * cost / frame[7], 1.0)
    return cost


@ti.kernel
def guide_costs(
    # in
    time: Field,
    ahead: ti.types.ndarray(dtype=ti.f32, ndim=3),
    frame: ti.types.ndarray(dtype=ti.f32, ndim=1),  # [11]
    places: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [N, 4]: x, y, cos theta, sin theta
    # out
    cost: ti.types.ndarray(dtype=ti.f32, ndim=1),  # [N]
):
    for n in range(places.shape[0]):
        cost[n] = guide_at(
            time, ahead, frame, places[n, 0], places[n, 1], places[n, 2], places[n, 3]
        )
