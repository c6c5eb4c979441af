"""Arrival times as the safety modes take them: hidden movers, and tracked ones beside them.

A tube is where a tracked mover can be, seen from the robot's middle: for each moment of its
forecast an ellipse about where its track says, cut by the disc that it can have reached at the
bound of speed. A cell that a tube has come to is not given back when it has passed: arrival times
only tell when a place is first lost, which errs to the unsafe side.

    tubes f32 [K, 12], one tube's moments after another's: 0 first tick, 1 x, 2 y of the ellipse's
        middle, 3 xx, 4 xy, 5 yy of the form that is at most 1 inside it, 6 x, 7 y, 8 radius of the
        disc, 9: 1 where a tube begins, 10 least, 11 greatest y of what is inside both;
        places in metres from the anchor; both are grown by all margins (grid/tubes.py)
"""

import taichi as ti

from passpmp_ti.kernels.arrival import LATEST, NEVER, Arrival
from passpmp_ti.kernels.launch import kernel

MIDDLE, FORM, DISC, RADIUS, BEGINS, LOW, HIGH = 1, 3, 6, 8, 9, 10, 11
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


@ti.func
def lose(arrival: ti.template(), j, first, last, tick):
    """Cells [first, last] of a row are free no longer than until `tick`."""
    for i in range(first, last + 1):
        if ti.cast(arrival[j, i], ti.i32) > tick:
            arrival[j, i] = ti.cast(tick, ti.u16)


@kernel
def overlay(
    # in
    share: ti.template(),  # indices that one thread is handed at a time, see device.share
    hidden: Arrival,  # [J, I] at the bound of speed
    stretch: ti.f32,  # bound of speed by the greatest that is asked about
    end: ti.i32,  # tick from which on nothing is promised
    tubes: Tubes,  # [>= count, 12]
    count: ti.i32,
    strict: Arrival,  # [J, I] before which nothing is lost whatever
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
            # what of the row this tube has come to so far
            begin, end_ = 1, 0
            for k in range(count):
                if tubes[k, BEGINS] > 0.5:
                    begin, end_ = 1, 0
                crosses, low, high = False, 0.0, -1.0
                if tubes[k, LOW] <= y <= tubes[k, HIGH]:
                    crosses, low, high = crossed(tubes, k, y)
                if crosses:
                    first = ti.cast(ti.floor(low / cell - ROUNDING), ti.i32) - corner_i
                    last = ti.cast(ti.floor(high / cell + ROUNDING), ti.i32) - corner_i
                    first = ti.max(first, 0)
                    last = ti.min(last, arrival.shape[1] - 1)
                    tick = ti.cast(tubes[k, 0], ti.i32)
                    if first <= last and begin > end_:
                        lose(arrival, j, first, last, tick)
                        begin, end_ = first, last
                    elif first <= last:
                        # what lies between two of its places is lost as well: that is no less safe
                        lose(arrival, j, first, begin - 1, tick)
                        lose(arrival, j, end_ + 1, last, tick)
                        begin, end_ = ti.min(begin, first), ti.max(end_, last)
            for i in range(arrival.shape[1]):
                arrival[j, i] = ti.max(arrival[j, i], strict[j, i])
