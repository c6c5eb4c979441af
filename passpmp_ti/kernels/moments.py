"""The Gaussians of a forecast's objects at the moments at which it is rasterised.

All is worked out in double precision; rows, discs and boxes are rounded to single precision last.

Shared parameters, beside those of kernels/forecasts.py:
    moments f64 [J, 5]: 0 layer, 1 share of the stretch after it, 2 time [s], 3 how far the robot
        may be until the next moment [m], 4 side of a cell of the layer of hazard [m]
    known f64 [J * N * C, 24], moments first: 0 mean, 4 covariance, 14 shape (kernels/gaussians.py),
        22 bend until the next moment, 23 at first how far about its mean the object is looked up,
        then the deviation that its bend asks for, at last how far about its mean windows reach [m]
    wanted u8 [J * N * C]: the robot may meet it

docs/risk.md derives the bounds.
"""

import math

import taichi as ti

from passpmp_ti.kernels.forecasts import (
    BLUR,
    COARSEST,
    MOST_SIDE,
    SHARPEST,
    Counts,
    Covariances,
    Means,
    Numbers,
    Table,
    covariance_at,
    farness,
    is_met,
    mean_at,
    width,
)
from passpmp_ti.kernels.gaussians import (
    GREAT,
    LEAST,
    NOISE,
    along,
    bend_of,
    between,
    shape_of,
    vec2,
    vec4,
    vec8,
    vec10,
)
from passpmp_ti.kernels.launch import kernel

STEEPEST = 1.0
"""Bend from which on Gaussians are blurred."""
TWICE_ROOT = 2 * math.sqrt(2)
"""In double precision."""
STRONGEST = 1.3
"""Bend that a margin can make up for."""
LOST = 1e3
"""Margin where they are bent more than any bound allows for: the risk is 1."""
MADE_UP = 1 / (1 - math.exp(-0.5 * BLUR * BLUR))
"""That factor: noise is no farther out in the rest of the cases."""
NODE = 0.8
"""Side of a cell of the layers of hazard [standard deviations of the sharper objects]."""
SHARPER = 10
"""One object of so many is sharper than the sharper objects are."""
ROUNDING = 1e-3
"""[m] of places in single precision."""
MOMENT, KNOWN, ROW, GRID = 5, 24, 22, 9
"""Numbers of a moment, of a component then in `known`, of one in `rows`, of a layer in `grids`."""
SHAPE, BENT, WIDE = 14, 22, 23
"""Where in `known`."""

Singles = ti.types.ndarray(dtype=ti.f32, ndim=2)
Links = ti.types.ndarray(dtype=ti.i32, ndim=2)
Flags = ti.types.ndarray(dtype=ti.u8, ndim=1)


@kernel
def lay_moments(
    # in
    mean: Means,
    covariance: Covariances,
    weight: Table,
    radius: Numbers,
    robot: Numbers,
    tally: Counts,
    # in and out
    moments: Table,
    # scratch
    known: Table,
    # out
    rows: Singles,  # [J * N * C, 22] of kernels/chances.py, node spacings of windows are missing
    near: Singles,  # [J * N, 3] of kernels/chances.py
    wanted: Flags,
    sizes: Table,  # [J * N * C, 3]: deviations along the principal axes, radius of touch [m]
    grids: Singles,  # [J, 9] of kernels/hazard.py
    sides: Links,  # [2, J] nodes along the sides of a layer of hazard
):
    components = tally[1]
    each = tally[0] * components
    count = moments.shape[0]
    # here and below: for some hundred rows a second thread costs more than it saves
    ti.loop_config(parallelize=1)
    for row in range(count * each):
        j, n, c = row // each, row % each // components, row % components
        k = ti.cast(moments[j, 0], ti.i32)
        after = ti.min(k + 1, mean.shape[2] - 1)
        share = moments[j, 1]
        m = mean_at(mean, n, c, k)
        m += share * (mean_at(mean, n, c, after) - m)
        first, second = covariance_at(covariance, n, c, k), covariance_at(covariance, n, c, after)
        p = between(first, second, share, robot[5])
        for r in ti.static(range(4)):
            known[row, r] = m[r]
        for r in ti.static(range(10)):
            known[row, 4 + r] = p[r]
        plain = shape_of(p, 0.0)
        wide = width(m, p, plain[LEAST], radius[n], robot[2])
        known[row, SHAPE + LEAST] = plain[LEAST]
        known[row, WIDE] = wide
        wanted[row] = ti.cast(is_met(m, wide, moments[j, 3], weight[n, c], robot), ti.u8)
    ti.loop_config(parallelize=1)
    for j in range(count):
        low, high, met = box_about(known, wanted, robot, moments[j, 3], j * each, (j + 1) * each)
        extent = high - low
        side = ti.f64(1.0)
        if met > 0:
            fine = sharper(known, wanted, j * each, (j + 1) * each, met // SHARPER)
            side = ti.max(ti.f64(NODE) * fine, ti.max(extent[0], extent[1]) / (MOST_SIDE - 2))
        moments[j, 4] = side
        for axis in ti.static(range(2)):
            sides[axis, j] = ti.cast(ti.ceil(extent[axis] / side), ti.i32) + 2
            # rounding must not take the last cell away
            grids[j, axis] = ti.cast(low[axis] - robot[3 + axis] - 0.5 * side, ti.f32)
            grids[j, 6 + axis] = ti.cast(robot[axis] - robot[3 + axis], ti.f32)
        grids[j, 2], grids[j, 3] = ti.cast(1 / side, ti.f32), ti.cast(side, ti.f32)
        way = moments[j, 3] + ti.f64(ROUNDING)
        grids[j, 8] = ti.cast(way * way, ti.f32)
    ti.loop_config(parallelize=1)
    for row in range(count * each):
        n = row % each // components
        floor = ti.max(radius[n] / SHARPEST, moments[row // each, 4] / ti.f64(COARSEST))
        keep_shape(known, row, floor)
    ti.loop_config(parallelize=1)
    for row in range((count - 1) * each):
        length = moments[row // each + 1, 2] - moments[row // each, 2]
        known[row, BENT] = bend_after(known, row, row + each, length)
    ti.loop_config(parallelize=1)
    for row in range(count * each):
        # each has two neighbours
        j = row // each
        need = ti.f64(0.0)
        if j + 1 < count:
            need = way_bent(known, row, row + each, moments[j + 1, 2] - moments[j, 2])
        if j > 0:
            length = moments[j, 2] - moments[j - 1, 2]
            need = ti.max(need, way_bent(known, row - each, row, length))
        known[row, WIDE] = need
    ti.loop_config(parallelize=1)
    for row in range(count * each):
        if known[row, WIDE] > 0.0:
            n = row % each // components
            floor = ti.max(radius[n] / SHARPEST, moments[row // each, 4] / ti.f64(COARSEST))
            keep_shape(known, row, ti.max(floor, known[row, WIDE]))
    ti.loop_config(parallelize=1)
    for row in range((count - 1) * each):
        if known[row, WIDE] > 0.0 or known[row + each, WIDE] > 0.0:
            length = moments[row // each + 1, 2] - moments[row // each, 2]
            known[row, BENT] = bend_after(known, row, row + each, length)
    ti.loop_config(parallelize=1)
    for row in range(count * each):
        j, n, c = row // each, row % each // components, row % components
        m, p, shape = mean_of(known, row), covariance_of(known, row), shape_kept(known, row)
        noise = shape[NOISE]
        # what lies between two moments is bounded by both, and noise that fades as the covariance
        # grows moves what it blurs
        bend, fading = ti.f64(0.0), ti.f64(0.0)
        if j + 1 < count:
            length = moments[j + 1, 2] - moments[j, 2]
            bend = known[row, BENT]
            fading += BLUR * ti.abs(known[row + each, SHAPE + NOISE] - noise) / length
        if j > 0:
            length = moments[j, 2] - moments[j - 1, 2]
            bend = ti.max(bend, known[row - each, BENT])
            fading += BLUR * ti.abs(noise - known[row - each, SHAPE + NOISE]) / length
        size = radius[n] + BLUR * noise
        far = farness(m, p, shape, radius[n], robot[2])
        known[row, WIDE] = size + far * shape[GREAT]
        rows[row, 0] = ti.cast(m[0] - robot[3], ti.f32)
        rows[row, 1] = ti.cast(m[1] - robot[4], ti.f32)
        rows[row, 4], rows[row, 5] = 0.0, 0.0
        rows[row, 6] = ti.cast(size + far * shape[GREAT], ti.f32)
        rows[row, 7] = ti.cast(size + far * shape[LEAST], ti.f32)
        lay_velocity(rows, row, m, p, shape, size, fading)
        factor = weight[n, c] * margin_of(bend)
        if noise > 0.0:
            factor *= ti.f64(MADE_UP)
        rows[row, 19] = 0.0
        rows[row, 20] = ti.cast(factor, ti.f32)
        rows[row, 21] = ti.cast(layer_margin(shape, moments[j, 4]), ti.f32)
        sizes[row, 0], sizes[row, 1], sizes[row, 2] = shape[GREAT], shape[LEAST], size
    ti.loop_config(parallelize=1)
    for j in range(count):
        lay_near(known, wanted, robot, near, j * tally[0], tally[0], components)
        sharpest, fastest = ti.f64(0.0), ti.f64(0.0)
        for row in range(j * each, (j + 1) * each):
            if wanted[row] > 0:
                sharpest = ti.max(sharpest, 0.5 / known[row, SHAPE + LEAST])
                vx, vy = known[row, 2], known[row, 3]
                fastest = ti.max(fastest, ti.sqrt(vx * vx + vy * vy))
        grids[j, 4], grids[j, 5] = ti.cast(sharpest, ti.f32), ti.cast(fastest, ti.f32)


@ti.func
def mean_of(known: ti.template(), row):
    """[4]"""
    return vec4(known[row, 0], known[row, 1], known[row, 2], known[row, 3])


@ti.func
def covariance_of(known: ti.template(), row):
    """[10]"""
    p = vec10(0.0)
    for r in ti.static(range(10)):
        p[r] = known[row, 4 + r]
    return p


@ti.func
def shape_kept(known: ti.template(), row):
    """[8]"""
    shape = vec8(0.0)
    for r in ti.static(range(8)):
        shape[r] = known[row, SHAPE + r]
    return shape


@ti.func
def keep_shape(known: ti.template(), row, floor):
    """The shape none of whose deviations is below `floor` [m]."""
    shape = shape_of(covariance_of(known, row), floor)
    for r in ti.static(range(8)):
        known[row, SHAPE + r] = shape[r]


@ti.func
def bend_after(known: ti.template(), row, after, length):
    """Bend from a row to that of the next moment, `length` seconds later."""
    dx, dy = known[after, 0] - known[row, 0], known[after, 1] - known[row, 1]
    return bend_of(
        shape_kept(known, row), shape_kept(known, after), covariance_of(known, row),
        covariance_of(known, after), dx, dy, length,
    )  # fmt: skip


@ti.func
def way_bent(known: ti.template(), row, after, length):
    """Deviation down to which two Gaussians, `length` seconds apart, are blurred so that they are
    not bent too steeply [m]; 0 where they are not.

    Half of `STEEPEST` each for what the mean's way and the covariance's growth make of it.
    """
    need = ti.f64(0.0)
    if known[row, BENT] > STEEPEST:
        first, second = covariance_of(known, row), covariance_of(known, after)
        dx, dy = known[after, 0] - known[row, 0], known[after, 1] - known[row, 1]
        rate = ti.abs(second[0] + second[1] - (first[0] + first[1]))
        rate += 2 * ti.abs(second[2] - first[2])
        speed = ti.sqrt(ti.max(first[7] + first[8], second[7] + second[8])) * length
        need = ti.sqrt(ti.max(dx * dx + dy * dy, ti.f64(TWICE_ROOT) * rate))
        need = ti.max(need, ti.f64(TWICE_ROOT) * speed) / STEEPEST
    return need


@ti.func
def margin_of(bend):
    """By how much linear values between moments may fall short, as a factor."""
    margin = ti.f64(LOST)
    if bend < ti.f64(STRONGEST):
        margin = 1 / ti.cos(bend)
    return margin


@ti.func
def layer_margin(shape, side):
    """By how much bilinear values between a layer's nodes may fall short, as a factor."""
    determinant = (shape[GREAT] * shape[LEAST]) * (shape[GREAT] * shape[LEAST])
    x = 0.5 * side * ti.sqrt(shape[1] / determinant)
    y = 0.5 * side * ti.sqrt(shape[0] / determinant)
    return 1 / (ti.cos(x) * ti.cos(y))


@ti.func
def lay_velocity(rows: ti.template(), row, mean, p, shape, size, fading):
    """Columns 2, 3 and 8 to 18: the frame, and what is known there of the velocity.

    Args:
        size: radius within which it touches a disc [m].
        fading: how fast noise moves what it blurs [m/s].
    """
    c, s = shape[3], shape[4]
    # K = P_vx P_xx^-1 and what it leaves of P_vv, in the frame in which P_xx is diagonal
    x0, x1 = c * p[3] + s * p[5], c * p[4] + s * p[6]
    y0, y1 = c * p[5] - s * p[3], c * p[6] - s * p[4]
    px, py, qx, qy = c * x0 + s * x1, c * x1 - s * x0, c * y0 + s * y1, c * y1 - s * y0
    great, least = shape[GREAT] * shape[GREAT], shape[LEAST] * shape[LEAST]
    kxx, kxy, kyx, kyy = px / great, py / least, qx / great, qy / least
    apart, across = 0.5 * (kxx - kyy), 0.5 * (kxy + kyx)
    v = along(shape, p[7], p[8], p[9])
    # E|a| of a normal number is at most the root of mean^2 + (2 / pi) variance
    share = ti.f64(2 / math.pi)
    rows[row, 2], rows[row, 3] = ti.cast(c, ti.f32), ti.cast(s, ti.f32)
    rows[row, 8] = ti.cast(c * mean[2] + s * mean[3], ti.f32)
    rows[row, 9] = ti.cast(c * mean[3] - s * mean[2], ti.f32)
    rows[row, 10], rows[row, 11] = ti.cast(kxx, ti.f32), ti.cast(kxy, ti.f32)
    rows[row, 12], rows[row, 13] = ti.cast(kyx, ti.f32), ti.cast(kyy, ti.f32)
    rows[row, 14] = ti.cast(0.5 * (kxx + kyy) * size, ti.f32)
    rows[row, 15] = ti.cast(size * ti.sqrt(apart * apart + across * across) + fading, ti.f32)
    rows[row, 16] = ti.cast(share * ti.max(v[0] - kxx * px - kxy * py, 0.0), ti.f32)
    rows[row, 17] = ti.cast(share * (v[2] - kxx * qx - kxy * qy), ti.f32)
    rows[row, 18] = ti.cast(share * ti.max(v[1] - kyx * qx - kyy * qy, 0.0), ti.f32)


@ti.func
def box_about(known: ti.template(), wanted: ti.template(), robot: ti.template(), way, begin, end):
    """Corners (low [2], high [2]) of a box about all of the rows that the robot may meet, where it
    may be [m], and how many rows that are."""
    inf = ti.f64(math.inf)
    low, high = vec2(inf), vec2(-inf)
    met = 0
    for row in range(begin, end):
        if wanted[row] > 0:
            met += 1
            wide = known[row, WIDE]
            for axis in ti.static(range(2)):
                low[axis] = ti.min(low[axis], known[row, axis] - wide)
                high[axis] = ti.max(high[axis], known[row, axis] + wide)
    for axis in ti.static(range(2)):
        low[axis] = ti.max(low[axis], robot[axis] - way)
        high[axis] = ti.min(high[axis], robot[axis] + way)
    if not (low[0] < high[0] and low[1] < high[1]):
        low, high = vec2(0.0), vec2(0.0)
    return low, high, met


@ti.func
def sharper(known: ti.template(), wanted: ti.template(), begin, end, rank):
    """The lesser deviation that `rank` of the wanted rows are below [m]; there are more of them."""
    found = ti.f64(0.0)
    below = 0
    while below <= rank:
        # the next one, and how often it is there
        least = ti.f64(math.inf)
        times = 0
        for row in range(begin, end):
            value = known[row, SHAPE + LEAST]
            if wanted[row] > 0 and (below == 0 or value > found):
                if value < least:
                    least = value
                    times = 1
                elif value == least:
                    times += 1
        found = least
        # at least one, whatever the values are
        below += ti.max(times, 1)
    return found


@ti.func
def lay_near(
    known: ti.template(),
    wanted: ti.template(),
    robot: ti.template(),
    near: ti.template(),
    first,
    objects,
    components,
):
    """For each object at a moment a disc beyond which nothing is of it; radius -1: nowhere."""
    inf = ti.f64(math.inf)
    for at in range(first, first + objects):
        low, high = vec2(inf), vec2(-inf)
        for row in range(at * components, (at + 1) * components):
            if wanted[row] > 0:
                for axis in ti.static(range(2)):
                    place = known[row, axis] - robot[3 + axis]
                    low[axis] = ti.min(low[axis], place)
                    high[axis] = ti.max(high[axis], place)
        middle = vec2(0.0)
        if low[0] < inf:
            middle = 0.5 * (low + high)
        radius = ti.f64(-1.0)
        for row in range(at * components, (at + 1) * components):
            if wanted[row] > 0:
                # the greater deviation reaches farthest
                x = known[row, 0] - robot[3] - middle[0]
                y = known[row, 1] - robot[4] - middle[1]
                radius = ti.max(radius, ti.sqrt(x * x + y * y) + known[row, WIDE])
        near[at, 0], near[at, 1] = ti.cast(middle[0], ti.f32), ti.cast(middle[1], ti.f32)
        near[at, 2] = ti.cast(radius, ti.f32)
