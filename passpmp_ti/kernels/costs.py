"""What a tree's nodes cost: the guide along their ways. Nothing is proven by it."""

import taichi as ti

from passpmp_ti.kernels.along import placed
from passpmp_ti.kernels.guide import guide_at
from passpmp_ti.kernels.motion import CAR, C, S, X, Y, braking_steps, step

SAMPLES, BRAKING_SAMPLES = 4, 4
"""Samples of the guide along a primitive, and along a braking. Each stands for the piece that it
ends: a plan is judged by where it leads, and one that has to turn away first is not held up by it.
Trapezoids of them drove faster among movers, but a car could stand before its goal for good."""


@ti.func
def cost_at(guide: ti.template(), ahead: ti.template(), guide_frame: ti.template(), q):
    return guide_at(guide, ahead, guide_frame, q[X], q[Y], q[C], q[S])


@ti.func
def braking_cost(
    kind: ti.template(),
    guide: ti.template(),
    ahead: ti.template(),
    guide_frame: ti.template(),
    numbers: ti.template(),
    robot,
    start,
    here,
    control,
):
    """(integral of the guide along a braking, guide where it ends, its duration [s]).

    In a few long steps: costs need no more, and nothing is proven by them. `here`: guide at start.
    """
    seconds = (braking_steps(kind, start, control, numbers[1]) - 2) * numbers[1]
    pace = seconds * (1.0 / BRAKING_SAMPLES)
    q = start
    there = here
    spent = 0.0
    if seconds > 0.0:
        for _ in range(BRAKING_SAMPLES):
            for _half in range(2):
                q = step(kind, robot, q, control, 0.0, 0.5 * pace)
                if ti.static(kind != CAR):
                    # a fast spin is more than the series of so long a step tells
                    length = 1.0 / ti.max(ti.sqrt(q[C] * q[C] + q[S] * q[S]), 1e-3)
                    q[C] *= length
                    q[S] *= length
            there = cost_at(guide, ahead, guide_frame, q)
            spent += there * pace
    return spent, there, seconds


@ti.func
def road_cost(
    guide: ti.template(),
    ahead: ti.template(),
    guide_frame: ti.template(),
    numbers: ti.template(),
    roads: ti.template(),
    rows: ti.template(),
    road,
    steps,
    samples: ti.template(),
    start,
    here,
):
    """(integral of the guide along the first `steps` of a road from `start`, guide at its end)."""
    there = here
    spent = 0.0
    done = 0
    pace = ti.max((steps + samples - 1) // samples, 1)
    for n in ti.static(range(samples)):
        at = ti.min(pace * (n + 1), steps)
        if at > done:
            q = placed(rows, roads[road, 0] + at, start[X], start[Y], start[C], start[S])
            there = cost_at(guide, ahead, guide_frame, q)
            spent += there * (at - done) * numbers[1]
            done = at
    return spent, there
