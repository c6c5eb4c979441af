"""Motions that are tried against obstacles as they stand now: the baselines' look ahead.

Nothing here is proven: what moves is taken to stand, and what is not seen to be empty.

Numbers of a robot, [11 + discs]: 0-5 as in kernels/motion.py, 6 time step [s], 7 and 8 how fast its
two inputs change at most [m/s^2; m/s^2 or rad/s], 9 radius of its discs and what rounding to cells
may add [m], 10 overhang [m], then the offset of each disc [m].

A field of gaps [J, I] tells the distance from each cell's centre to the nearest return [m]; its
frame: 0, 1 the corner of cell [0, 0], 2 cells a metre. Outside nothing stands.
"""

import taichi as ti

from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.motion import (
    CAR,
    FREE,
    A,
    B,
    C,
    S,
    X,
    Y,
    clamp,
    control3,
    pose7,
    robot6,
    step,
    tangent,
)

DT, RATE_A, RATE_B, RADIUS, OVERHANG, DISCS = 6, 7, 8, 9, 10, 11
MEAN, LAST, STEPS, GAP = range(4)
"""What `roll_out` tells of each motion."""
OPEN = 1e6  # gap where nothing stands [m]

Numbers = ti.types.ndarray(dtype=ti.f32, ndim=1)
Table = ti.types.ndarray(dtype=ti.f32, ndim=2)


@ti.func
def robot_in(numbers: ti.template()):
    return robot6(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5])


@ti.func
def pose_in(table: ti.template(), row):
    q = pose7(0.0)
    for r in ti.static(range(7)):
        q[r] = table[row, r]
    return q


@ti.func
def gap_at(q: pose7, gaps: ti.template(), frame: ti.template(), numbers: ti.template()):
    """Distance from the robot's body to the nearest return [m]; below 0 where they may touch."""
    least = OPEN
    for d in range(DISCS, numbers.shape[0]):
        x = q[X] + numbers[d] * q[C]
        y = q[Y] + numbers[d] * q[S]
        i = ti.cast(ti.floor((x - frame[0]) * frame[2]), ti.i32)
        j = ti.cast(ti.floor((y - frame[1]) * frame[2]), ti.i32)
        if i >= 0 and j >= 0 and j < gaps.shape[0]:
            if i < gaps.shape[1]:
                least = ti.min(least, gaps[j, i] - numbers[RADIUS])
    return least


@ti.func
def towards(q: pose7, a, b, numbers: ti.template()):
    """The control that brings the speeds (for a car speed and steering) to a and b, as fast as the
    robot can."""
    per_step = 1.0 / numbers[DT]
    return control3(
        FREE,
        clamp((a - q[A]) * per_step, -numbers[RATE_A], numbers[RATE_A]),
        clamp((b - q[B]) * per_step, -numbers[RATE_B], numbers[RATE_B]),
    )


@kernel
def roll_out(
    # in
    kind: ti.template(),
    share: ti.i32,  # indices that a thread is handed at a time
    numbers: Numbers,  # [11 + discs]
    gaps: Table,  # [J, I]
    frame: Numbers,  # [3]
    start: Table,  # [1, 7]
    targets: Table,  # [N * T, 2] what the inputs are steered to, for each stage of each motion
    stages: ti.i32,  # T
    steps: ti.i32,  # time steps of a stage
    goal_x: ti.f32,
    goal_y: ti.f32,
    # out
    found: Table,  # [N, 4]
):
    """Of each motion: mean distance to the goal [m], distance at its end [m], time steps before it
    touches anything (all of them where it does not), and the least gap until then [m]."""
    for index in range(found.shape[0] * share):
        if index % share == 0:
            n = index // share
            robot = robot_in(numbers)
            q = pose_in(start, 0)
            least = gap_at(q, gaps, frame, numbers)
            away = ti.sqrt((q[X] - goal_x) ** 2 + (q[Y] - goal_y) ** 2)
            total = 0.0
            taken = 0
            free = 0
            while taken < stages * steps:
                row = n * stages + taken // steps
                control = towards(q, targets[row, 0], targets[row, 1], numbers)
                q = step(kind, robot, q, control, 0.0, numbers[DT])
                away = ti.sqrt((q[X] - goal_x) ** 2 + (q[Y] - goal_y) ** 2)
                total += away
                if free == taken:
                    gap = gap_at(q, gaps, frame, numbers)
                    if gap >= 0.0:
                        free += 1
                        least = ti.min(least, gap)
                taken += 1
            found[n, MEAN] = total / (stages * steps)
            found[n, LAST] = away
            found[n, STEPS] = free
            found[n, GAP] = least


@kernel
def drive(
    # in
    kind: ti.template(),
    numbers: Numbers,  # [11 + discs]
    start: Table,  # [1, 7]
    targets: Table,  # [T, 2]
    steps: ti.i32,  # time steps of each stage
    # out
    path: Table,  # [T * steps + 1, 7]
):
    """The poses of one motion, the start first."""
    for _ in range(1):  # the steps below follow one another
        robot = robot_in(numbers)
        q = pose_in(start, 0)
        for row in range(path.shape[0]):
            for r in ti.static(range(7)):
                path[row, r] = q[r]
            stage = ti.min(row // steps, targets.shape[0] - 1)
            control = towards(q, targets[stage, 0], targets[stage, 1], numbers)
            q = step(kind, robot, q, control, 0.0, numbers[DT])


@ti.func
def turn_rate(kind: ti.template(), robot: robot6, q: pose7):
    """[rad/s]"""
    rate = 2.0 * q[A] * tangent(q[B]) * robot[3]
    if ti.static(kind != CAR):
        rate = 2.0 * (q[A] - q[B]) * robot[3]
    return rate


@ti.func
def forward_speed(kind: ti.template(), q: pose7):
    """[m/s]"""
    speed = q[A]
    if ti.static(kind != CAR):
        speed = 0.5 * (q[A] + q[B])
    return speed


@kernel
def follow_arcs(
    # in
    kind: ti.template(),
    share: ti.i32,
    numbers: Numbers,  # [11 + discs]
    gaps: Table,  # [J, I]
    frame: Numbers,  # [3]
    start: Table,  # [1, 7]
    speeds: Table,  # [N, 2] kept all along
    longest: ti.f32,  # [m]
    # out
    arc: Table,  # [N, 3]: forward speed [m/s], turn rate [rad/s], free way along the arc [m]
):
    """How far a robot gets along each arc of constant speeds, `longest` at most.

    The way is that of the body's outermost disc, so that turning on the spot has one where the
    body is no disc about its middle.
    """
    for index in range(arc.shape[0] * share):
        if index % share == 0:
            n = index // share
            robot = robot_in(numbers)
            q = pose_in(start, 0)
            q[A] = speeds[n, 0]
            q[B] = speeds[n, 1]
            turning = turn_rate(kind, robot, q)
            speed = forward_speed(kind, q)
            pace = ti.abs(speed) + ti.abs(turning) * numbers[OVERHANG]
            way = longest
            if pace > 1e-6:
                # half a cell between two looks
                stride = 0.5 / frame[2]
                way = 0.0
                while way < longest and gap_at(q, gaps, frame, numbers) >= 0.0:
                    q = step(kind, robot, q, control3(0.0), 0.0, stride / pace)
                    way += stride
                way = ti.min(way, longest)
            arc[n, 0] = speed
            arc[n, 1] = turning
            arc[n, 2] = way
