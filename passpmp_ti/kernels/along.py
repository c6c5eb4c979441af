"""What the checks and costs of a tree find along roads, wherever these begin; see roads.py."""

import taichi as ti

from passpmp_ti.kernels.check import LATEST, way_clear
from passpmp_ti.kernels.motion import THETA, A, B, C, S, X, Y, pose7
from passpmp_ti.kernels.roads import DOOMS
from passpmp_ti.kernels.spans import LEVELS, span_about


@ti.func
def placed(rows: ti.template(), row, x, y, c, s):
    """A sample of a road that begins at (x, y) with heading (c, s), as a pose without speeds."""
    q = pose7(0.0)
    q[X] = x + c * rows[row, 0] - s * rows[row, 1]
    q[Y] = y + s * rows[row, 0] + c * rows[row, 1]
    q[C] = c * rows[row, 2] - s * rows[row, 3]
    q[S] = s * rows[row, 2] + c * rows[row, 3]
    return q


@ti.func
def road_end(rows: ti.template(), roads: ti.template(), road, steps, start):
    """The pose at the end of a primitive's road."""
    row = roads[road, 2]
    q = placed(rows, roads[road, 0] + steps, start[X], start[Y], start[C], start[S])
    q[THETA] = start[THETA] + rows[row, 0]
    q[A] = rows[row, 1]
    q[B] = rows[row, 2]
    return q


@ti.func
def disc_spans(
    spans: ti.template(), numbers: ti.template(), counts: ti.template(), rows: ti.template(), row,
    x, y, c, s,
):  # fmt: skip
    """What `span_about` tells of the disc in a row; where none does, nothing: (0, 65535)."""
    least = 0
    latest = 65535
    level = ti.cast(rows[row, 2], ti.i32)
    if level < LEVELS:
        forth = rows[row, 0]
        left = rows[row, 1]
        least, latest = span_about(
            spans, counts, numbers[0], x + c * forth - s * left, y + s * forth + c * left, level
        )
    return least, latest


@ti.func
def road_clear(
    arrival: ti.template(),
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    roads: ti.template(),
    rows: ti.template(),
    road,
    x,
    y,
    c,
    s,
    tick,
):
    """Whether a road that begins at (x, y) with heading (c, s) at `tick` touches nothing.

    The whole of it is asked about first, then the later and the earlier half of what that leaves
    open, and so on; the looks are taken where no span tells. The answer is that of all the looks.
    """
    samples = roads[road, 0]
    steps = roads[road, 1]
    sections = roads[road, 2]
    depth = roads[road, 3]
    clear = True
    d = 0
    h = 1
    if steps == 0:
        h = 0
    while h > 0:
        p = h - (1 << d)
        first = steps * p >> d
        last = steps * (p + 1) >> d
        least, latest = disc_spans(spans, numbers, counts, rows, sections + h, x, y, c, s)
        open = least <= ti.min(tick + last * counts[4], LATEST)
        if latest <= ti.min(tick + first * counts[4], LATEST):
            # whatever is looked at, nothing is free by then
            clear = False
            h = 0
        elif open and d < depth:
            h = 2 * h + 1
            d += 1
        else:
            if open:
                k = last
                after = placed(rows, samples + k, x, y, c, s)
                while clear and k > first:
                    k -= 1
                    before = placed(rows, samples + k, x, y, c, s)
                    clear = way_clear(arrival, numbers, counts, before, after, tick + k * counts[4])
                    after = before
            # on to the other half of the last section whose later half this ends
            while h > 1 and h & 1 == 0:
                h >>= 1
                d -= 1
            h -= 1
            if not clear:
                h = 0
    return clear


@ti.func
def proving_road(
    arrival: ti.template(),
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    roads: ti.template(),
    rows: ti.template(),
    first,
    x,
    y,
    c,
    s,
    tick,
):
    """1 + index of the first braking road from `first` on that is clear to rest (eq. 6); 0: none
    is."""
    proof = 0
    b = 0
    for k in ti.static(range(DOOMS)):
        if b == 0:
            row = roads[first, 0] - 1 - k
            _, latest = disc_spans(spans, numbers, counts, rows, row, x, y, c, s)
            # each of them takes a look in there, in the time step that ends then
            at = ti.cast(rows[row, 3], ti.i32) - 1
            if latest <= ti.min(tick + at * counts[4], LATEST):
                b = counts[6]
    while b < counts[6] and proof == 0:
        if road_clear(arrival, spans, numbers, counts, roads, rows, first + b, x, y, c, s, tick):
            proof = b + 1
        b += 1
    return proof
