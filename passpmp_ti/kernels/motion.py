"""How robots move: one time step of each motion model, as pure functions.

A pose on the device is seven numbers (x, y, cos theta, sin theta, theta, a, b): for a car a = v
and b = xi, for a differential drive a = v_r and b = v_l. Both models are integrated by the
midpoint rule: turn by half, move, turn by half; its order two is measured in the tests.

Robot parameters, as `Robot.parameters` gives them:
    0 top speed, 1 lowest speed, 2 top steering angle, 3 half the inverse of wheelbase or track,
    4 top acceleration, 5 unused.
"""

import taichi as ti

CAR = 0
BRAKE, BRAKE_IN_PROPORTION = 1, 2

pose7 = ti.types.vector(7, ti.f32)
robot6 = ti.types.vector(6, ti.f32)
control3 = ti.types.vector(3, ti.f32)
X, Y, C, S, THETA, A, B = range(7)


@ti.func
def clamp(value, low, high):
    return ti.min(ti.max(value, low), high)


@ti.func
def tangent(angle):
    """tan for |angle| <= 1 rad, to 1e-6 (Pade 5/4): no libm call in the inner loop."""
    q = angle * angle
    return angle * (945.0 + q * (q - 105.0)) / (945.0 + q * (15.0 * q - 420.0))


@ti.func
def turned(c, s, angle):
    """(c, s) turned by a small angle: the series is exact to f32 below 0.5 rad."""
    q = angle * angle
    sin = angle * (1.0 - q * (1.0 / 6.0 - q * (1.0 / 120.0 - q * (1.0 / 5040.0))))
    cos = 1.0 - q * (0.5 - q * (1.0 / 24.0 - q * (1.0 / 720.0)))
    return c * cos - s * sin, s * cos + c * sin


@ti.func
def toward_zero(value, amount):
    """`value` brought nearer to zero by `amount`, and to exactly zero when it is reached."""
    return ti.max(value - amount, 0.0) + ti.min(value + amount, 0.0)


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
def step(kind: ti.template(), robot: robot6, q: pose7, control: control3, direction, dt):
    """One time step. `control` = (what it does, first input, second input); see robots.py.

    Args:
        direction: `heading_for` the state that the primitive began with.
    """
    act = ti.cast(control[0], ti.i32)
    a = q[A]
    b = q[B]
    ds = 0.0
    half_turn = 0.0
    if ti.static(kind == CAR):
        if act == BRAKE:
            a = toward_zero(a, control[1] * dt)
        else:
            a = clamp(a + control[1] * dt, robot[1], robot[0])
            if direction > 0.0:
                a = ti.max(a, 0.0)
            if direction < 0.0:
                a = ti.min(a, 0.0)
        middle = clamp(b + 0.5 * control[2] * dt, -robot[2], robot[2])
        b = clamp(b + control[2] * dt, -robot[2], robot[2])
        ds = 0.5 * (q[A] + a) * dt
        half_turn = ds * tangent(middle) * robot[3]
    else:
        if act == BRAKE_IN_PROPORTION:
            fastest = ti.max(ti.abs(a), ti.abs(b))
            left = ti.max(fastest - control[1] * dt, 0.0)
            share = 0.0
            if left > 0.0:
                share = left / fastest
            a *= share
            b *= share
        elif act == BRAKE:
            a = toward_zero(a, control[1] * dt)
            b = toward_zero(b, control[2] * dt)
        else:
            a = clamp(a + control[1] * dt, robot[1], robot[0])
            b = clamp(b + control[2] * dt, robot[1], robot[0])
        ds = 0.25 * (q[A] + a + q[B] + b) * dt
        half_turn = 0.5 * (q[A] + a - q[B] - b) * dt * robot[3]
    c, s = turned(q[C], q[S], half_turn)
    x = q[X] + ds * c
    y = q[Y] + ds * s
    c, s = turned(c, s, half_turn)
    return pose7(x, y, c, s, q[THETA] + 2.0 * half_turn, a, b)
