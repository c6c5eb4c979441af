"""Looking up the cost to go, for the tree and for whole trajectories.

Not part of the guarantee: a wrong guide costs time, never safety.
"""

import taichi as ti

from passpmp_ti.kernels.launch import kernel

Field = ti.types.ndarray(dtype=ti.f32, ndim=2)  # [J, I]


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


@kernel
def guide_costs(
    # in
    time: Field,
    ahead: ti.types.ndarray(dtype=ti.f32, ndim=3),
    frame: ti.types.ndarray(dtype=ti.f32, ndim=1),  # [11]
    places: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [N, 4]: x, y, cos theta, sin theta
    # out
    cost: ti.types.ndarray(dtype=ti.f32, ndim=1),  # [N]
):
    ti.loop_config(parallelize=1)  # they are few: a second thread would cost more than it saves
    for n in range(places.shape[0]):
        cost[n] = guide_at(
            time, ahead, frame, places[n, 0], places[n, 1], places[n, 2], places[n, 3]
        )
