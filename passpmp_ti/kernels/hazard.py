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

from passpmp_ti.kernels.chances import flow_parts, is_near, moment_of, vec2
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.spread import spread, spread_over

KINDS = 8
LOST = 1e3
"""Stands for what is beyond a layer or a forecast: a risk of 1."""
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
    most: ti.i32,  # nodes of the widest layer
    # out
    layers: Numbers,
):
    # late layers have more in them than early ones
    pieces = begins.shape[0] * most
    for task in range(spread_over(pieces)):
        index = spread(task, pieces)
        j = ti.min(index // most, begins.shape[0] - 1)
        node = index % most
        columns = begins[j, 1]
        if index < pieces and node < columns * begins[j, 2]:
            p = vec2(node % columns, node // columns) * grids[j, 3]
            p += vec2(grids[j, 0], grids[j, 1])
            total = kinds8(0.0)
            # farther than a cell from where the robot may be, no look asks for a node
            off = p - vec2(grids[j, 6], grids[j, 7])
            reach = ti.sqrt(grids[j, 8]) + 1.5 * grids[j, 3]
            objects = ti.select(off.dot(off) < reach * reach, tally[0], 0)
            for n in range(objects):
                if is_near(near, j * tally[0] + n, p):
                    for c in range(tally[1]):
                        row = (j * tally[0] + n) * tally[1] + c
                        total += (
                            rows[row, 20] * rows[row, 21] * flow_parts(rows, places, pool, row, p)
                        )
            for r in ti.static(range(KINDS)):
                layers[(begins[j, 0] + node) * KINDS + r] = total[r]


@ti.func
def layer_at(layers: ti.template(), grids: ti.template(), begins: ti.template(), j, p: vec2):
    """[8] of one layer, bilinear; nothing is beyond it, LOST where the robot cannot be."""
    fx = (p[0] - grids[j, 0]) * grids[j, 2]
    fy = (p[1] - grids[j, 1]) * grids[j, 2]
    column = ti.cast(ti.floor(fx), ti.i32)
    row = ti.cast(ti.floor(fy), ti.i32)
    value = kinds8(0.0)
    if column >= 0 and row >= 0 and column < begins[j, 1] - 1 and row < begins[j, 2] - 1:
        fx -= column
        fy -= row
        at = (begins[j, 0] + row * begins[j, 1] + column) * KINDS
        up = at + begins[j, 1] * KINDS
        for r in ti.static(range(KINDS)):
            low = layers[at + r] + fx * (layers[at + KINDS + r] - layers[at + r])
            high = layers[up + r] + fx * (layers[up + KINDS + r] - layers[up + r])
            value[r] = low + fy * (high - low)
    off = p - vec2(grids[j, 6], grids[j, 7])
    if off.dot(off) > grids[j, 8]:
        value = kinds8(LOST)
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
    before = layer_at(layers, grids, begins, j, p)
    value = before + share * (layer_at(layers, grids, begins, j + 1, p) - before)
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
    # a piece of the way is at most a standard deviation long, as seen from what is near
    speed = ti.sqrt(u.dot(u)) + grids[j, 5]
    turn = speed * ti.max(before, after) * 2.0 * ti.max(grids[j, 4], grids[j + 1, 4])
    reach = ti.min(ti.cast(ti.ceil(turn - 0.5), ti.i32), MOST_PIECES)
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
