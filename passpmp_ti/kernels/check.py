"""Collision and braking checks against the arrival map: eqs. 6 and 7.

The arrival map holds, for each cell [j, i], the number of milliseconds (ticks) after the model's
base at which a robot disc centred anywhere in the cell could first be touched; 0: never free.

A sample of a path speaks for half a time step before and after it. The motion in that time is
inside the clearance that the map was grown by (`settings.motion_margin`); the time is judged at
the interval's end, where the cones are widest. Both lean to the unsafe side.

Shared parameters:
    numbers f32: 0 cells a metre, 1 time step [s], 2-7 robot (kernels/motion.py), 8-15 disc offsets
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
def body_clear(arrival: ti.template(), numbers: ti.template(), counts: ti.template(), q, tick):
    """Whether no disc of the body can be touched up to and including `tick`."""
    clear = True
    for d in range(counts[5]):
        offset = numbers[8 + d]
        x = q[X] + offset * q[C]
        y = q[Y] + offset * q[S]
        ticks = arrival_at(arrival, counts, numbers[0], x, y)
        if ticks <= tick and ticks != NEVER:
            clear = False
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
    half = counts[4] // 2
    clear = True
    moving = not at_rest(kind, q)
    if moving:
        clear = body_clear(arrival, numbers, counts, q, tick + half)
    while moving and clear:
        q = step(kind, robot, q, control, 0.0, numbers[1])
        tick += counts[4]
        clear = body_clear(arrival, numbers, counts, q, tick + half)
        moving = not at_rest(kind, q)
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
    numbers: Numbers,  # [16]
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
def trace(
    # in
    kind: ti.template(),
    numbers: Numbers,  # [16]
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
