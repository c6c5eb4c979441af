"""Collision and braking checks against the arrival map: eqs. 6 and 7.

The arrival map holds, for each cell [j, i], the number of milliseconds (ticks) after the model's
base at which a robot disc centred anywhere in the cell could first be touched; 0: never free.

A time step is looked at as often as it takes, the more the faster the robot: each look speaks for
a piece of the way, from whose middle no disc's centre is farther than the clearance allows that the
map was grown by (`settings.motion_margin`), and is judged at the piece's end, when the cones are
widest. Both lean to the unsafe side.

Most looks need not be taken: `spans` (kernels/spans.py) tells at once until when all of a disc is
free, and from when on none of it is. While the robot stays inside a free disc no look could find
anything; when every braking has to pass through one that is not, some look of each would. So far
the answers are those of all the looks. `runs_into` gives up on less than that: it may call a state
unsafe that all looks would find safe, never the other way.

Shared parameters:
    numbers f32: 0 cells a metre, 1 time step [s], 2-7 robot (kernels/motion.py), 8-15 disc offsets,
        16 looks a metre, 17 way of the fastest object in a time step [m], 18 farthest disc offset,
        19 half a piece [m], 20 greatest acceleration of a disc's middle [m/s^2], 21 time steps a
        tick, 22 the one rate at which all braking controls of a car brake, 23 their fastest
        steering (0: they differ), 24- ways of each level
    counts i32: 0 i0, 1 j0 (cell of the map's corner), 2 columns, 3 rows, 4 ticks a step,
        5 discs, 6 braking controls, 7 tree controls, 8- where each level of `spans` begins
"""

import taichi as ti

from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.motion import (
    CAR,
    A,
    B,
    C,
    S,
    X,
    Y,
    at_rest,
    braked,
    braking_steps,
    control3,
    heading_for,
    moved,
    pose7,
    robot6,
    seen_from,
    setting_off,
    speed_of,
    steered,
    step,
    tangent,
)
from passpmp_ti.kernels.spans import LEVELS, Spans, level_for, span_about

Numbers = ti.types.ndarray(dtype=ti.f32, ndim=1)
Counts = ti.types.ndarray(dtype=ti.i32, ndim=1)
Arrival = ti.types.ndarray(dtype=ti.u16, ndim=2)
Table = ti.types.ndarray(dtype=ti.f32, ndim=2)
NEVER, LATEST = 65535, 65534
STRIDES = 6
"""Long steps in which a braking is followed to see what it runs into."""
WIDE = 0
"""Level of the places that are asked about there: wide enough for the errors of such steps."""
PAUSE = -2
"""Less than zero: steps whose looks are taken before spans are asked again."""
WAYS = 24
"""Where the ways of the levels of `spans` begin in `numbers`."""


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
        looks = ti.max(ti.ceil(way * numbers[16]), 1.0)
        piece = 1.0 / looks
        length = counts[4] * piece
        # the last piece first: that is where most ways end
        k = looks
        while clear and k > 0.5:
            share = (k - 0.5) * piece
            ticks = arrival_at(arrival, counts, numbers[0], x + share * dx, y + share * dy)
            # the piece's end, rounded up; 1e-3: a whole number of ticks may come out a bit above
            end = tick + ti.cast(ti.ceil(k * length - 1e-3), ti.i32)
            clear = ticks > ti.min(end, LATEST)
            k -= 1.0
    return clear


@ti.func
def robot_of(numbers: ti.template()):
    return robot6(numbers[2], numbers[3], numbers[4], numbers[5], numbers[6], numbers[7])


@ti.func
def control_of(table: ti.template(), k):
    return control3(table[k, 0], table[k, 1], table[k, 2])


@ti.func
def free_steps(
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    q,
    speed,
    direction,
    tick,
    left,
    level,
):
    """(time steps from q at `tick` on in which no look could find anything, level to try next).

    Level after level, down from `level`, until a disc stays free for a step at least. Below 0: in
    so many steps the looks have to be taken before it is worth to ask again.

    Args:
        speed: no robot is faster within these steps [m/s].
        direction: of travel: 1, -1, or 0 where it is not known.
        left: steps of a braking until it is at rest, at least: on all of them it gets half as far
            as at one speed.

    numbers from WAYS on, for each level: how far ahead of the robot a disc's middle is put, and the
    way that no robot leaves the disc on (`Body.of`).
    """
    steps = 0
    at = level
    next_level = 1
    pace = 1.0 / (speed + 1e-3)
    while at >= 0:
        forth = numbers[WAYS + 2 * at] * direction
        until, _ = span_about(
            spans, counts, numbers[0], q[X] + forth * q[C], q[Y] + forth * q[S], at
        )
        by_time = ti.cast((until - 1 - tick) * numbers[21], ti.i32)
        if until == NEVER:
            by_time = 65535
        if by_time > 0:
            by_way = ti.cast(numbers[WAYS + 2 * at + 1] * pace, ti.i32)
            if numbers[WAYS + 2 * at + 1] >= 0.5 * speed * left:
                by_way = left
            steps = ti.min(by_way, by_time)
            next_level = at
            if by_time > by_way:
                # more would have been free than the disc holds
                next_level = ti.min(at + 1, LEVELS - 1)
            at = 0
        at -= 1
    if steps == 0:
        steps = PAUSE
    return steps, next_level


@ti.func
def doomed(spans: ti.template(), numbers: ti.template(), counts: ti.template(), robot, q, tick, m):
    """Whether every braking of a car is sure to find a look that is not free in its m-th time step.

    All of them brake at one rate, so they are as far along their ways then; how far these have bent
    apart bounds the disc in which the robot is.
    """
    span = m * numbers[1]
    way = ti.abs(q[A]) * span - 0.5 * numbers[22] * span * span
    bend = 2.0 * robot[3] * tangent(ti.min(ti.abs(q[B]) + numbers[23] * span, robot[2])) * way
    offset = numbers[8]
    radius = way * bend * (0.5 + bend * (1.0 / 6.0)) + ti.abs(offset) * bend + numbers[19]
    level = level_for(radius, numbers[0])
    sure = False
    if level < LEVELS:
        forth = way * heading_for(0, q) + offset
        x = q[X] + forth * q[C]
        y = q[Y] + forth * q[S]
        _, latest = span_about(spans, counts, numbers[0], x, y, level)
        sure = latest <= tick + m * counts[4]
    return sure


@ti.func
def runs_into(
    kind: ti.template(),
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    robot,
    start,
    start_tick,
    control,
    steps,
):
    """Whether a braking of at least `steps` steps runs into a place none of which is free by then.

    Followed in a few long steps, whose errors the places' size allows for. Were it wrong, a state
    would be called unsafe that is not.
    """
    q = start
    tick = start_tick
    stride = ti.max(steps // STRIDES, 1)
    dt = stride * numbers[1]
    met = False
    k = stride
    while k <= steps and not met:
        q = step(kind, robot, q, control, 0.0, dt)
        tick += stride * counts[4]
        x = q[X] + numbers[8] * q[C]
        y = q[Y] + numbers[8] * q[S]
        _, latest = span_about(spans, counts, numbers[0], x, y, WIDE)
        met = latest <= tick
        k += stride
    return met


@ti.func
def brakes_clear(
    kind: ti.template(),
    arrival: ti.template(),
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    robot,
    start,
    start_tick,
    control,
):
    """Whether braking by one control from `start` touches nothing to rest."""
    q = start
    tick = start_tick
    clear = True
    dt = numbers[1]
    left = braking_steps(kind, q, control, dt)
    free = 0
    level = 2
    asked = False
    _, half_curvature = steered(kind, robot, q[B], control, dt)
    while clear and not at_rest(kind, q):
        if free == 0:
            free, level = free_steps(
                spans, numbers, counts, q, speed_of(kind, q), heading_for(kind, q), tick, left + 1,
                level,
            )  # fmt: skip
            if free < left and not asked:
                asked = True
                clear = not runs_into(
                    kind, spans, numbers, counts, robot, q, tick, control, left - 4
                )
        if free > 0 and free >= left:
            # nothing until it is at rest
            q[A] = 0.0
            q[B] = 0.0
        elif clear:
            before = q
            a, b = braked(kind, q, control, dt)
            if ti.static(kind == CAR):
                b = q[B]
                if control[2] != 0.0:
                    b, half_curvature = steered(kind, robot, b, control, dt)
            q = moved(kind, robot, q, a, b, half_curvature, dt)
            if free > 0:
                free -= 1
            else:
                clear = way_clear(arrival, numbers, counts, before, q, tick)
                free += 1
            tick += counts[4]
            left -= 1
    return clear


@ti.func
def proving_brake(
    kind: ti.template(),
    arrival: ti.template(),
    spans: ti.template(),
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
    if ti.static(kind == CAR):
        if numbers[22] > 0.0:
            # while it is still moving for sure
            last = ti.cast(ti.abs(q[A]) / (numbers[22] * numbers[1]), ti.i32) - 1
            # soon enough for the disc to be small, late enough to be where it matters
            m = last // 3
            if m > 0:
                if doomed(spans, numbers, counts, robot, q, tick, m):
                    b = counts[6]
    while b < counts[6] and proof == 0:
        control = control_of(braking, b)
        if brakes_clear(kind, arrival, spans, numbers, counts, robot, q, tick, control):
            proof = b + 1
        b += 1
    return proof


@kernel
def check_states(
    # in
    kind: ti.template(),
    arrival: Arrival,  # [J, I]
    spans: Spans,  # [F]
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
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
        proof[n] = proving_brake(
            kind, arrival, spans, numbers, counts, braking, robot, q, ticks[n]
        )


@kernel
def check_path(
    # in
    kind: ti.template(),
    arrival: Arrival,  # [J, I]
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
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


@kernel
def trace(
    # in
    kind: ti.template(),
    numbers: Numbers,  # [38]
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
            start_of_part = q
            seen = setting_off(q)
            direction = heading_for(kind, q)
            left = steps[n * parts + m]
            while written < rows and (left > 0 or (left < 0 and not at_rest(kind, q))):
                seen = step(kind, robot, seen, control, direction, numbers[1])
                q = seen_from(start_of_part, seen)
                for r in ti.static(range(7)):
                    path[n * rows + written, r] = q[r]
                written += 1
                left -= 1
        length[n] = written
