"""Collision and braking checks against the arrival map: eqs. 6 and 7.

The arrival map holds, for each cell [j, i], the number of milliseconds (ticks) after the model's
base at which a robot disc centred anywhere in the cell could first be touched; 0: never free.

A time step is looked at as often as it takes, the more the faster the robot: each look speaks for
a piece of the way, from whose middle no disc's centre is farther than the clearance allows that the
map was grown by (`settings.motion_margin`), and is judged at the piece's end, when the cones are
widest. Both lean to the unsafe side.

Shared parameters:
    numbers f32: 0 cells a metre, 1 time step [s], 2-7 robot (kernels/motion.py), 8-15 disc offsets,
        16 looks a metre, 17 way of the fastest object in a time step [m]
    counts i32: 0 i0, 1 j0 (cell of the map's corner), 2 columns, 3 rows, 4 ticks a step,
        5 discs, 6 braking controls, 7 tree controls
"""

import taichi as ti

from passpmp_ti.kernels.motion import (
    C,
    S,
    X,
    Y,
    at_rest,
    control3,
    heading_for,
    pose7,
    robot6,
    step,
)

Numbers = ti.types.ndarray(dtype=ti.f32, ndim=1)
Counts = ti.types.ndarray(dtype=ti.i32, ndim=1)
Arrival = ti.types.ndarray(dtype=ti.u16, ndim=2)
Table = ti.types.ndarray(dtype=ti.f32, ndim=2)
NEVER = 65535


@ti.func
def arrival_at(arrival: ti.template(), counts: ti.template(), scale, x, y):
    """Ticks of the cell that holds (x, y); nothing is proven outside the map, so 0 there."""
    i = ti.cast(ti.floor(x * scale), ti.i32) - counts[0]
    j = ti.cast(ti.floor(y * scale), ti.i32) - counts[1]
    ticks = 0
    if i >= 0 and j >= 0 and i < counts[2] and j < counts[3]:
        ticks = ti.cast(arrival[j, i], ti.i32)
    return ticks


@ti.func
def way_clear(
    arrival: ti.template(), numbers: ti.template(), counts: ti.template(), before, after, tick
):
    """Whether no disc of the body can be touched in the time step from `before`, at `tick`, on."""
    clear = True
    for d in range(counts[5]):
        offset = numbers[8 + d]
        x = before[X] + offset * before[C]
        y = before[Y] + offset * before[S]
        dx = after[X] + offset * after[C] - x
        dy = after[Y] + offset * after[S] - y
        # pieces short for the robot, and short in time for what comes towards it
        way = ti.sqrt(dx * dx + dy * dy) + numbers[17]
        looks = ti.max(ti.cast(ti.ceil(way * numbers[16]), ti.i32), 1)
        k = 0
        while clear and k < looks:
            share = (k + 0.5) / looks
            ticks = arrival_at(arrival, counts, numbers[0], x + share * dx, y + share * dy)
            # the piece's end, rounded up
            end = tick + ((k + 1) * counts[4] + looks - 1) // looks
            clear = ticks > end or ticks == NEVER
            k += 1
    return clear


@ti.func
def robot_of(numbers: ti.template()):
    return robot6(numbers[2], numbers[3], numbers[4], numbers[5], numbers[6], numbers[7])


@ti.func
def control_of(table: ti.template(), k):
    return control3(table[k, 0], table[k, 1], table[k, 2])


@ti.func
def brakes_clear(
    kind: ti.template(),
    arrival: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    robot,
    start,
    start_tick,
    control,
):
    """Whether braking by one control from `start`, itself included, touches nothing to rest."""
    q = start
    tick = start_tick
    clear = True
    while clear and not at_rest(kind, q):
        before = q
        q = step(kind, robot, q, control, 0.0, numbers[1])
        clear = way_clear(arrival, numbers, counts, before, q, tick)
        tick += counts[4]
    return clear


@ti.func
def proving_brake(
    kind: ti.template(),
    arrival: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    braking: ti.template(),
    robot,
    q,
    tick,
):
    """1 + index of the first control that brakes clear to rest from q (eq. 6); 0: q is ICS^b."""
    proof = 0
    b = 0
    while b < counts[6] and proof == 0:
        control = control_of(braking, b)
        if brakes_clear(kind, arrival, numbers, counts, robot, q, tick, control):
            proof = b + 1
        b += 1
    return proof


@ti.kernel
def check_states(
    # in
    kind: ti.template(),
    arrival: Arrival,  # [J, I]
    numbers: Numbers,  # [18]
    counts: Counts,  # [8]
    braking: Table,  # [B, 3]
    poses: Table,  # [N, 7]
    ticks: Counts,  # [N]
    # out
    proof: Counts,  # [N]: 1 + index of the braking control that proves the state, 0: ICS^b
):
    for n in range(poses.shape[0]):
        robot = robot_of(numbers)
        q = pose7(0.0)
        for r in ti.static(range(7)):
            q[r] = poses[n, r]
        proof[n] = proving_brake(kind, arrival, numbers, counts, braking, robot, q, ticks[n])


@ti.kernel
def check_path(
    # in
    kind: ti.template(),
    arrival: Arrival,  # [J, I]
    numbers: Numbers,  # [18]
    counts: Counts,  # [8]
    poses: Table,  # [N, 7], at most a time step apart
    ticks: Counts,  # [N]
    # out
    touched: Counts,  # [N]: 1: something could touch the robot on its way to the next pose
):
    for n in range(poses.shape[0]):
        touched[n] = 0
        if n + 1 < poses.shape[0]:
            before = pose7(0.0)
            after = pose7(0.0)
            for r in ti.static(range(7)):
                before[r] = poses[n, r]
                after[r] = poses[n + 1, r]
            if not (at_rest(kind, before) and at_rest(kind, after)):
                # a longer step may be anything but straight; a shorter one is judged late
                clear = ticks[n + 1] - ticks[n] <= counts[4] + 1  # times are rounded up
                if clear:
                    clear = way_clear(arrival, numbers, counts, before, after, ticks[n])
                if not clear:
                    touched[n] = 1


@ti.kernel
def trace(
    # in
    kind: ti.template(),
    numbers: Numbers,  # [18]
    start: Table,  # [N, 7]
    controls: Table,  # [N, M, 3] flattened to [N * M, 3]
    steps: Counts,  # [N * M]: steps of each control in turn; -1: until at rest
    # out
    path: Table,  # [N * L, 7]
    length: Counts,  # [N]: samples written, the start among them; at most L
):
    for n in range(start.shape[0]):
        robot = robot_of(numbers)
        rows = path.shape[0] // start.shape[0]
        parts = steps.shape[0] // start.shape[0]
        q = pose7(0.0)
        for r in ti.static(range(7)):
            q[r] = start[n, r]
            path[n * rows, r] = q[r]
        written = 1
        for m in range(parts):
            control = control_of(controls, n * parts + m)
            direction = heading_for(kind, q)
            left = steps[n * parts + m]
            while written < rows and (left > 0 or (left < 0 and not at_rest(kind, q))):
                q = step(kind, robot, q, control, direction, numbers[1])
                for r in ti.static(range(7)):
                    path[n * rows + written, r] = q[r]
                written += 1
                left -= 1
        length[n] = written
