"""Arrival times as the safety modes take them: hidden movers, and tracked ones beside them.

A tube is where a tracked mover can be, seen from the robot's middle: for each moment of its
forecast an ellipse about where its track says, cut by the disc that it can have reached at the
bound of speed. A cell that a tube has come to is not given back when it has passed: arrival times
only tell when a place is first lost, which errs to the unsafe side.

    tubes f32 [K, 9], in order of time: 0 first tick, 1 x, 2 y of the ellipse's middle, 3 xx, 4 xy,
        5 yy of the form that is at most 1 inside it, 6 x, 7 y, 8 radius of the disc;
        places in metres from the anchor, grown by the clearance and by half a cell's diagonal
"""

import taichi as ti

from passpmp_ti.kernels.arrival import LATEST, NEVER, Arrival
from passpmp_ti.kernels.launch import kernel

MIDDLE, FORM, DISC, RADIUS = 1, 3, 6, 8
ROUNDING = 1e-3
"""[cells] by which f32 sums may put a border short."""

Tubes = ti.types.ndarray(dtype=ti.f32, ndim=2)


@ti.func
def stretched(ticks, stretch):
    """When somebody `stretch` times as slow could be where one at the bound is at `ticks`.

    Ticks count from up to one before the scan: that one is not stretched.
    """
    later = ticks
    if ticks != NEVER and ticks > 0:
        slow = ti.floor((ti.cast(ticks, ti.f32) - 1.0) * stretch * (1.0 - 1e-6)) + 1.0
        later = ti.cast(ti.min(slow, ti.cast(LATEST, ti.f32)), ti.i32)
        later = ti.max(later, ticks)
    return later


@ti.func
def crossed(tubes: ti.template(), k, y):
    """(whether the line at `y` crosses tube k, where it does from x to x)."""
    dy = y - tubes[k, MIDDLE + 1]
    xx, xy, yy = tubes[k, FORM], tubes[k, FORM + 1], tubes[k, FORM + 2]
    left = xy * xy * dy * dy - xx * (yy * dy * dy - 1.0)
    up = y - tubes[k, DISC + 1]
    half = tubes[k, RADIUS] * tubes[k, RADIUS] - up * up
    low, high = 0.0, -1.0
    if left > 0.0 and half > 0.0:
        middle = tubes[k, MIDDLE] - xy * dy / xx
        wide = ti.sqrt(left) / xx
        reach = ti.sqrt(half)
        low = ti.max(middle - wide, tubes[k, DISC] - reach)
        high = ti.min(middle + wide, tubes[k, DISC] + reach)
    return high >= low, low, high


@kernel
def overlay(
    # in
    share: ti.template(),  # indices that one thread is handed at a time, see device.share
    hidden: Arrival,  # [J, I] at the bound of speed
    stretch: ti.f32,  # bound of speed by the greatest that is asked about
    end: ti.i32,  # tick from which on nothing is promised
    tubes: Tubes,  # [>= count, 9]
    count: ti.i32,
    corner_i: ti.i32,
    corner_j: ti.i32,
    cell: ti.f32,
    # out
    arrival: Arrival,  # [J, I]
):
    rows = arrival.shape[0]
    for index in range(rows * share):
        if index % share == 0:
            j = index // share
            for i in range(arrival.shape[1]):
                ticks = stretched(ti.cast(hidden[j, i], ti.i32), stretch)
                arrival[j, i] = ti.cast(ti.min(ticks, end), ti.u16)
            y = (j + corner_j + 0.5) * cell
            for k in range(count):
                crosses, low, high = crossed(tubes, k, y)
                if crosses:
                    first = ti.cast(ti.floor(low / cell - ROUNDING), ti.i32) - corner_i
                    last = ti.cast(ti.floor(high / cell + ROUNDING), ti.i32) - corner_i
                    tick = ti.cast(tubes[k, 0], ti.i32)
                    for i in range(ti.max(first, 0), ti.min(last, arrival.shape[1] - 1) + 1):
                        if ti.cast(arrival[j, i], ti.i32) > tick:
                            arrival[j, i] = ti.cast(tick, ti.u16)
