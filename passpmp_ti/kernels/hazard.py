"""Layers of hazard: how likely, and how often, any tracked object comes to touch a disc.

At each moment lies a *layer*, a box of nodes where the robot can be by then, and objects too. It
sums up the windows of all objects (kernels/chances.py): a look costs the same for any number.
With f the density of an object's place, over the border of a disc at p:

    0-2: M = sum of contour integrals of f n n^T dl (xx, yy, xy) [1/m]
    3, 4: G = the same of f n E[n.v] dl [1/s]
    5: q = the same of f E[(n.v)^2] dl [m/s^2]
    6: what the linear parts of the velocities that differ by direction add [1/s]
    7: P, sum of the chances to touch (eq. 15)

A disc that moves at u is entered or left at most sqrt(tr M (u^T M u - 2 u.G + q)) + (6) times a
second (Cauchy and Schwarz, over rings, components and objects; docs/risk.md).

Shared parameters, beside those of kernels/chances.py:
    layers f32 [nodes * 8]
    grids f32 [J, 9]: 0, 1 first node (x, y) [m], 2 nodes a metre, 3 [m] between nodes,
        4 half the inverse of the least standard deviation of what is near [1/m], 5 its speed [m/s],
        6, 7 where the robot is at the scan [m], 8 the square of how far from there it may be [m^2]
    begins i32 [J, 3]: first node of each layer, columns, rows
"""

import taichi as ti

from passpmp_ti.kernels.chances import moment_of, parts_at, vec2, window_of
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.spread import spread, spread_over

KINDS = 8
LOST = 1e3
"""Stands for what is beyond a layer or a forecast: a risk of 1."""
LONGEST = 0.7
"""What lies about the middle of a piece is made up for by tan(x) / x of this: 1.2 at most."""
MOST_PIECES = 8
"""To either side of a moment."""

Table = ti.types.ndarray(dtype=ti.f32, ndim=2)
Links = ti.types.ndarray(dtype=ti.i32, ndim=2)
Numbers = ti.types.ndarray(dtype=ti.f32, ndim=1)
Counts = ti.types.ndarray(dtype=ti.i32, ndim=1)
kinds8 = ti.types.vector(KINDS, ti.f32)


@kernel
def lay_hazard(
    # in
    rows: Table,
    places: Links,
    near: Table,
    pool: Numbers,
    tally: Counts,
    grids: Table,
    begins: Links,
    most: ti.i32,  # nodes along the longest side of a layer
    strip: ti.i32,  # nodes side by side that one thread lays in one go
    # out
    layers: Numbers,
):
    strips = (most + strip - 1) // strip
    # late layers have more in them than early ones
    pieces = begins.shape[0] * most * strips
    for task in range(spread_over(pieces)):
        index = spread(task, pieces)
        j = ti.min(index // (most * strips), begins.shape[0] - 1)
        line = index % (most * strips) // strips
        first = index % strips * strip
        columns = begins[j, 1]
        last = ti.min(first + strip, columns)
        if index < pieces and line < begins[j, 2] and first < last:
            side = grids[j, 3]
            left = grids[j, 0]
            y = line * side + grids[j, 1]
            start = (begins[j, 0] + line * columns) * KINDS
            for at in range(start + first * KINDS, start + last * KINDS):
                layers[at] = 0.0
            # farther than a cell from where the robot may be, no look asks for a node
            reach = ti.sqrt(grids[j, 8]) + 1.5 * side
            begin, end = columns_within(
                left, grids[j, 2], first, last, grids[j, 6], y - grids[j, 7], reach * reach
            )
            objects = ti.select(begin < end, tally[0], 0)
            for n in range(objects):
                of = j * tally[0] + n
                off = y - near[of, 1]
                components = ti.select(ti.abs(off) < near[of, 2], tally[1], 0)
                for c in range(components):
                    row = of * tally[1] + c
                    window, place = window_of(rows, places, row)
                    # the greater deviation reaches farthest
                    farthest = window[6] * window[6]
                    low, high = columns_within(
                        left, grids[j, 2], begin, end, window[0], y - window[1],
                        ti.select(place[0] >= 0, farthest, -1.0),
                    )  # fmt: skip
                    weight = window[20] * window[21]
                    for i in range(low, high):
                        part = parts_at(window, place, pool, vec2(i * side + left, y))
                        for r in ti.static(range(KINDS)):
                            # not +=, which is atomic: nobody else writes here
                            at = start + i * KINDS + r
                            layers[at] = layers[at] + weight * part[r]


@ti.func
def columns_within(left, density, first, last, x, off, square):
    """(begin, end) of the columns of [first, last) whose nodes a disc may hold, in a line of nodes.

    Args:
        left: of column 0 [m].
        density: nodes a metre.
        x: middle of the disc [m].
        off: how far from it the line runs [m].
        square: of the disc's radius [m^2].
    """
    begin = first
    end = first
    room = square - off * off
    if room > 0.0:
        half = ti.sqrt(room)
        # a column more on either side, for rounding
        begin = ti.cast(ti.max((x - half - left) * density - 1.0, first * 1.0), ti.i32)
        end = ti.cast(ti.min((x + half - left) * density + 2.0, last * 1.0), ti.i32)
    return begin, end


@ti.func
def layer_at(
    layers: ti.template(), grids: ti.template(), begins: ti.template(), j, share, p: vec2
):
    """[8] a share of one layer, bilinear; nothing is beyond it, LOST where the robot cannot be."""
    fx = (p[0] - grids[j, 0]) * grids[j, 2]
    fy = (p[1] - grids[j, 1]) * grids[j, 2]
    column = ti.cast(ti.floor(fx), ti.i32)
    row = ti.cast(ti.floor(fy), ti.i32)
    value = kinds8(0.0)
    if column >= 0 and row >= 0 and column < begins[j, 1] - 1 and row < begins[j, 2] - 1:
        fx -= column
        fy -= row
        above = share * fy
        below = share - above
        right, up_right = below * fx, above * fx
        left, up_left = below - right, above - up_right
        at = (begins[j, 0] + row * begins[j, 1] + column) * KINDS
        up = at + begins[j, 1] * KINDS
        for r in ti.static(range(KINDS)):
            low = left * layers[at + r] + right * layers[at + KINDS + r]
            value[r] = low + up_left * layers[up + r] + up_right * layers[up + KINDS + r]
    off = p - vec2(grids[j, 6], grids[j, 7])
    if off.dot(off) > grids[j, 8]:
        value = kinds8(share * LOST)
    return value


@ti.func
def hazard_at(
    layers: ti.template(),
    grids: ti.template(),
    begins: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    p: vec2,
    tick,
):
    """[8] at a time [ticks], linear between moments; beyond the forecast nothing is known."""
    j, share = moment_of(starts, odds, tick)
    value = layer_at(layers, grids, begins, j, 1.0 - share, p)
    value += layer_at(layers, grids, begins, j + 1, share, p)
    if (tick - odds[0]) * odds[1] > starts.shape[0] - 1 + 1e-3:
        value = kinds8(LOST)
    return value


@ti.func
def touch_sum(
    layers: ti.template(),
    grids: ti.template(),
    begins: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    p: vec2,
    tick,
):
    """Sum over the objects of bounds on their chances to touch a disc at p (eq. 15)."""
    return hazard_at(layers, grids, begins, starts, odds, p, tick)[7]


@ti.func
def crossings(
    layers: ti.template(),
    grids: ti.template(),
    begins: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    p: vec2,
    u: vec2,
    tick,
    before,
    after,
):
    """Expected number of times that any object enters or leaves a disc about a moment.

    Args:
        p: where the disc is [m].
        u: how it moves [m/s].
        tick: when [ticks].
        before: time that the moment speaks for before it, and after it [s].
    """
    j, _ = moment_of(starts, odds, tick)
    # half of a piece of the way is at most LONGEST standard deviations long, seen from what is near
    speed = ti.sqrt(u.dot(u)) + grids[j, 5]
    turn = speed * ti.max(before, after) * 2.0 * ti.max(grids[j, 4], grids[j + 1, 4])
    reach = ti.min(ti.cast(ti.ceil(turn - LONGEST), ti.i32), MOST_PIECES)
    pieces = 2 * reach + 1
    turn /= pieces
    total = 0.0
    for piece in range(-reach, reach + 1):
        span = ti.select(piece < 0, before, after) * 2.0 / pieces
        weight = ti.select(piece == 0, (before + after) / pieces, span)
        if weight > 0.0:
            later = piece * span
            flow = hazard_at(
                layers, grids, begins, starts, odds, p + later * u, tick + later * 1000.0
            )
            q = flow[0] * u[0] * u[0] + flow[1] * u[1] * u[1] + 2.0 * flow[2] * u[0] * u[1]
            q += flow[5] - 2.0 * (flow[3] * u[0] + flow[4] * u[1])
            rate = ti.sqrt((flow[0] + flow[1]) * ti.max(q, 0.0)) + flow[6]
            total += weight * rate
    # tan(turn) / turn from above, for turn <= 1
    square = turn * turn
    return total * (1.0 + square * (1.0 / 3.0 + 0.23 * square)) + odds[2] * (before + after)
