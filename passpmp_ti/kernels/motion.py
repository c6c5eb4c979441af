"""How robots move: one time step of each motion model, as pure functions.

A pose on the device is seven numbers (x, y, cos theta, sin theta, theta, a, b): for a car a = v
and b = xi, for a differential drive a = v_r and b = v_l. Both models are integrated by the
midpoint rule: turn by half, move, turn by half; its order two is measured in the tests.

Primitives are integrated as seen from where they begin, and then put there: small numbers are
rounded less, and the same whatever the place and the heading.

Robot parameters, as `Robot.parameters` gives them:
    0 top speed, 1 lowest speed, 2 top steering angle of a car; of a differential drive the greatest
    difference of its wheels' speeds (0: whatever the wheels can do), 3 half the inverse of the
    wheelbase or track, 4 top acceleration, 5 unused.
"""

import taichi as ti

CAR = 0
FREE, BRAKE, BRAKE_IN_PROPORTION = 0, 1, 2

pose7 = ti.types.vector(7, ti.f32)
robot6 = ti.types.vector(6, ti.f32)
control3 = ti.types.vector(3, ti.f32)
X, Y, C, S, THETA, A, B = range(7)


@ti.func
def setting_off(q: pose7):
    """A robot with q's speeds, as seen from where it is."""
    return pose7(0.0, 0.0, 1.0, 0.0, 0.0, q[A], q[B])


@ti.func
def seen_from(start: pose7, q: pose7):
    """Where a robot is that is at q as seen from `start`."""
    return pose7(
        start[X] + start[C] * q[X] - start[S] * q[Y],
        start[Y] + start[S] * q[X] + start[C] * q[Y],
        start[C] * q[C] - start[S] * q[S],
        start[S] * q[C] + start[C] * q[S],
        start[THETA] + q[THETA],
        q[A],
        q[B],
    )


@ti.func
def clamp(value, low, high):
    """`value` between `low` and `high`; a choice is one instruction where a minimum is four."""
    above = ti.select(value > low, value, low)
    return ti.select(above < high, above, high)


@ti.func
def tangent(angle):
    """tan for |angle| <= 1 rad, to 1e-6 (Pade 5/4): no libm call in the inner loop."""
    q = angle * angle
    return angle * (945.0 + q * (q - 105.0)) / (945.0 + q * (15.0 * q - 420.0))


@ti.func
def sine_and_cosine(angle):
    """(sin, cos) of a small angle: the series is exact to f32 below 0.5 rad."""
    q = angle * angle
    sin = angle * (1.0 - q * (1.0 / 6.0 - q * (1.0 / 120.0 - q * (1.0 / 5040.0))))
    cos = 1.0 - q * (0.5 - q * (1.0 / 24.0 - q * (1.0 / 720.0)))
    return sin, cos


@ti.func
def toward_zero(value, amount):
    """`value` brought nearer to zero by `amount`, and to exactly zero when it is reached."""
    left = ti.abs(value) - amount
    left = ti.select(left > 0.0, left, 0.0)
    return ti.select(value < 0.0, -left, left)


@ti.func
def sign(value):
    result = 0.0
    if value > 0.0:
        result = 1.0
    if value < 0.0:
        result = -1.0
    return result


@ti.func
def at_rest(kind: ti.template(), q):
    """Whether nothing on the robot moves."""
    resting = q[A] == 0.0
    if ti.static(kind != CAR):
        resting = q[A] == 0.0 and q[B] == 0.0
    return resting


@ti.func
def heading_for(kind: ti.template(), q):
    """Direction of travel that a primitive starts with: a car that brakes to zero stays there."""
    direction = 0.0
    if ti.static(kind == CAR):
        direction = sign(q[A])
    return direction


@ti.func
def setting_out(kind: ti.template(), q, control):
    """Direction of travel along a primitive, from rest as well."""
    direction = heading_for(kind, q)
    if ti.static(kind == CAR):
        if direction == 0.0:
            direction = sign(control[1])
    return direction


@ti.func
def speed_of(kind: ti.template(), q):
    """Bound on the reference point's speed [m/s]."""
    speed = ti.abs(q[A])
    if ti.static(kind != CAR):
        speed = 0.5 * (ti.abs(q[A]) + ti.abs(q[B]))
    return speed


@ti.func
def braking_steps(kind: ti.template(), q, control, dt):
    """Bound on the time steps that braking takes to rest: sums of f32 may take a step more."""
    time = ti.abs(q[A]) / control[1]
    if ti.static(kind != CAR):
        if ti.cast(control[0], ti.i32) == BRAKE_IN_PROPORTION:
            time = ti.max(ti.abs(q[A]), ti.abs(q[B])) / control[1]
        else:
            time = ti.max(time, ti.abs(q[B]) / control[2])
    return ti.cast(time / dt, ti.i32) + 2


@ti.func
def steered(kind: ti.template(), robot: robot6, b, control: control3, dt):
    """(steering angle after a time step, curvature half of it in the middle of the step) of a car;
    of other robots (b, 0)."""
    after = b
    half_curvature = 0.0
    if ti.static(kind == CAR):
        middle = clamp(b + 0.5 * control[2] * dt, -robot[2], robot[2])
        after = clamp(b + control[2] * dt, -robot[2], robot[2])
        half_curvature = tangent(middle) * robot[3]
    return after, half_curvature


@ti.func
def braked(kind: ti.template(), q: pose7, control: control3, dt):
    """Speeds (a, b) after a time step of a braking control; a car's b is left to `steered`."""
    a = q[A]
    b = q[B]
    if ti.static(kind == CAR):
        a = toward_zero(a, control[1] * dt)
    elif ti.cast(control[0], ti.i32) == BRAKE_IN_PROPORTION:
        fastest = ti.max(ti.abs(a), ti.abs(b))
        left = ti.max(fastest - control[1] * dt, 0.0)
        share = 0.0
        if left > 0.0:
            share = left / fastest
        a *= share
        b *= share
    else:
        a = toward_zero(a, control[1] * dt)
        b = toward_zero(b, control[2] * dt)
    return a, b


@ti.func
def driven(kind: ti.template(), robot: robot6, q: pose7, control: control3, direction, dt):
    """The same after a time step of a control that accelerates freely."""
    a = clamp(q[A] + control[1] * dt, robot[1], robot[0])
    b = q[B]
    if ti.static(kind == CAR):
        if direction > 0.0:
            a = ti.max(a, 0.0)
        if direction < 0.0:
            a = ti.min(a, 0.0)
    else:
        b = clamp(b + control[2] * dt, robot[1], robot[0])
        if robot[2] > 0.0:
            # both wheels give up as much: neither changes faster than it was told to
            over = 0.5 * (a - b - clamp(a - b, -robot[2], robot[2]))
            a -= over
            b += over
    return a, b


@ti.func
def moved(kind: ti.template(), robot: robot6, q: pose7, a, b, half_curvature, dt):
    """The pose after a time step in which the speeds went from q's to a and b: turn by half, move,
    turn by half."""
    ds = 0.0
    half_turn = 0.0
    if ti.static(kind == CAR):
        ds = 0.5 * (q[A] + a) * dt
        half_turn = ds * half_curvature
    else:
        ds = 0.25 * (q[A] + a + q[B] + b) * dt
        half_turn = 0.5 * (q[A] + a - q[B] - b) * dt * robot[3]
    sin, cos = sine_and_cosine(half_turn)
    c = q[C] * cos - q[S] * sin
    s = q[S] * cos + q[C] * sin
    return pose7(
        q[X] + ds * c,
        q[Y] + ds * s,
        c * cos - s * sin,
        s * cos + c * sin,
        q[THETA] + 2.0 * half_turn,
        a,
        b,
    )


@ti.func
def step(kind: ti.template(), robot: robot6, q: pose7, control: control3, direction, dt):
    """One time step. `control` = (what it does, first input, second input); see robots.py.

    Args:
        direction: `heading_for` the state that the primitive began with.
    """
    a, b = q[A], q[B]
    if ti.cast(control[0], ti.i32) == FREE:
        a, b = driven(kind, robot, q, control, direction, dt)
    else:
        a, b = braked(kind, q, control, dt)
    steering, half_curvature = steered(kind, robot, q[B], control, dt)
    if ti.static(kind == CAR):
        b = steering
    return moved(kind, robot, q, a, b, half_curvature, dt)
