"""Chances that tracked objects touch a disc, and how fast they come to: eq. 15 and its flow.

About each part of a forecast (an object, one of its components, a moment) lies a *window* of nodes
in the frame of the covariance's principal axes. A node holds integrals of the density f of the
object's place over the disc, and over its border, whose outward normal is n and whose length is l:

    0: P = integral of f over the disc      (eq. 15)
    1, 2, 3: M = contour integral of f n n^T dl (xx, yy, xy)
    4, 5: g = contour integral of f n dl

P, Mxx and Myy are even in both coordinates, Mxy is odd in both, and g in its own: a quarter of the
window is enough. docs/risk.md derives what is made of them, and the margins that are in them.

Windows are made for each of J moments, N objects and C components, in this order.

Shared parameters:
    rows f32 [J * N * C, 22], one for each window; vectors are in the window's frame:
        0, 1 mean [m], 2, 3 cosine and sine of the first axis, 4, 5 nodes a metre along each axis,
        6, 7 farther than this along an axis there is nothing [m], 8, 9 mean velocity [m/s],
        10-13 K = P_vx P_xx^-1 [1/s], 14 the part of K that is alike in all directions, times R,
        15 the rest of it, times R [m/s], 16-18 (2 / pi) Cv (xx, xy, yy) [m^2/s^2],
        19 unused, 20 weight, with the margin for
        what lies between moments, 21 margin for what lies between a layer's nodes
    places i32 [J * N * C, 4]: 0 first node (-1: no window), 1, 2 nodes along each axis, 3 points of
        a ring
    near f32 [J * N, 3]: disc (x, y, radius) beyond which nothing of an object is
    starts i32 [L]: the last moment that is no later than each layer of the forecast
    odds f32 [16 + H + J]: 0 ticks of layer 0, 1 layers a tick, 2 what objects that are left out may
        add [1/s], 3 where the ticks of the moments begin, 4 chance of components that are left out,
        5 emergence, 6 ticks at which the scan was taken, rounded up, 16- shares of the bound, then
        ticks of the moments
    tally i32 [5]: 0 objects N, 1 components C, 2 moments J, 3 hidden speeds H,
        4 time steps a sample
"""

import taichi as ti

from passpmp_ti.kernels.launch import kernel

CHANNELS = 6
LANES = 8
"""Nodes or points that are worked on together."""
MOST_NODES = 48
"""Along an axis; a multiple of LANES."""
MOST_POINTS = 96
"""Of a ring."""
MOST_HALF = 56
"""Points of half a ring with both its ends, up to a multiple of LANES."""
SCRATCH = (MOST_NODES + 8) * MOST_HALF
"""f32 that one worker of `rasterise` needs."""

Table = ti.types.ndarray(dtype=ti.f32, ndim=2)
Links = ti.types.ndarray(dtype=ti.i32, ndim=2)
Numbers = ti.types.ndarray(dtype=ti.f32, ndim=1)
vec2 = ti.types.vector(2, ti.f32)
channels6 = ti.types.vector(CHANNELS, ti.f32)
flow8 = ti.types.vector(8, ti.f32)
window22 = ti.types.vector(22, ti.f32)
place3 = ti.types.vector(3, ti.i32)
lanes = ti.types.vector(LANES, ti.f32)

ERROR_OF_CHORDS = 4e-7
"""Bound on the error of P: twice that of `tails`, and rounding."""


@ti.func
def bells(z: lanes):
    """exp(-z^2 / 2), to 3e-7 of it down to 1e-38: what is smaller is given as that (Cephes exp2f).

    No libm call: lanes become the CPU's own vectors.
    """
    y = ti.max(z * z * -0.7213475204, -126.0)
    whole = ti.floor(y + 0.5)
    f = y - whole
    series = 1.535336188e-4 * f + 1.339887440e-3
    series = (series * f + 9.618437358e-3) * f + 5.550332471e-2
    series = (series * f + 2.402264791e-1) * f + 6.931472029e-1
    series = series * f + 1.0
    for lane in ti.static(range(LANES)):
        power = (ti.cast(whole[lane], ti.i32) + 127) << 23
        series[lane] *= ti.bit_cast(power, ti.f32)
    return series


@ti.func
def tails(z: lanes, bell: lanes):
    """1 - Phi(z) for z >= 0, bell = exp(-z^2 / 2), to 1e-7 (Abramowitz & Stegun 7.1.26)."""
    t = 1.0 / (1.0 + 0.3275911 * 0.70710678 * z)
    series = 1.061405429 * t - 1.453152027
    series = (series * t + 1.421413741) * t - 0.284496736
    return 0.5 * (series * t + 0.254829592) * t * bell


@ti.func
def chords(low: lanes, high: lanes, bell_low: lanes, bell_high: lanes):
    """Chance that a standard normal number lies in [low, high], high >= 0 and -low <= high."""
    above = tails(high, bell_high)
    below = tails(ti.abs(low), bell_low)
    inside = below - above
    for lane in ti.static(range(LANES)):
        inside[lane] = ti.select(low[lane] >= 0.0, inside[lane], 1.0 - below[lane] - above[lane])
    return inside


@ti.func
def from_scratch(scratch: ti.template(), at):
    values = lanes(0.0)
    for lane in ti.static(range(LANES)):
        values[lane] = scratch[at + lane]
    return values


@ti.func
def to_scratch(scratch: ti.template(), at, values: lanes):
    for lane in ti.static(range(LANES)):
        scratch[at + lane] = values[lane]


@ti.func
def raster_window(
    pool: ti.template(),
    scratch: ti.template(),
    base,
    first,
    columns,
    rows_of,
    points,
    spacing: vec2,
    deviation: vec2,
    radius,
    margin,
):
    """Fill one window's nodes by the trapezoidal rule over its ring (periodic: see docs/risk.md).

    The density is a product in this frame, so its factors along each axis are worked out once. Both
    halves of the ring share theirs along the first axis. All is done to LANES points of the ring,
    or LANES nodes, at once; those beyond the last are not asked for.
    """
    half = points // 2 + 1
    width = 2.0 * ti.math.pi / points
    inverse = 1.0 / deviation
    scale = margin / (2.0 * ti.math.pi) * inverse[0] * inverse[1] * radius * width
    chord_scale = margin * inverse[0] * radius * width * 0.3989422804
    ramp = lanes(0.0)
    for lane in ti.static(range(LANES)):
        ramp[lane] = lane

    circle = base
    bells_x = circle + 2 * MOST_HALF
    own = bells_x + MOST_NODES * MOST_HALF
    for m in range(half):
        scratch[circle + m] = ti.cos(m * width)
        scratch[circle + MOST_HALF + m] = ti.sin(m * width)
    for m in range(half):
        offset = radius * scratch[circle + m]
        for block in range((columns + LANES - 1) // LANES):
            z = ((ramp + block * LANES) * spacing[0] + offset) * inverse[0]
            to_scratch(scratch, bells_x + m * MOST_NODES + block * LANES, bells(z))
    for j in range(rows_of):
        y = j * spacing[1]
        for block in range((half + LANES - 1) // LANES):
            at = block * LANES
            c = from_scratch(scratch, circle + at)
            s = from_scratch(scratch, circle + MOST_HALF + at)
            high = (y + radius * s) * inverse[1]
            low = (y - radius * s) * inverse[1]
            bell_high = bells(high)
            bell_low = bells(low)
            once = lanes(scale)
            for lane in ti.static(range(LANES)):
                # both ends of the half ring are on the axis, and counted once
                if at + lane == 0 or at + lane == half - 1:
                    once[lane] = 0.5 * scale
            even = (bell_high + bell_low) * once
            odd = (bell_high - bell_low) * once
            inside = chords(low, high, bell_low, bell_high)
            to_scratch(scratch, own + at, inside * s * chord_scale)
            to_scratch(scratch, own + MOST_HALF + at, even * c * c)
            to_scratch(scratch, own + 2 * MOST_HALF + at, even * s * s)
            to_scratch(scratch, own + 3 * MOST_HALF + at, odd * c * s)
            to_scratch(scratch, own + 4 * MOST_HALF + at, even * c)
            to_scratch(scratch, own + 5 * MOST_HALF + at, odd * s)
        for block in range((columns + LANES - 1) // LANES):
            touch = lanes(0.0)
            xx = lanes(0.0)
            yy = lanes(0.0)
            xy = lanes(0.0)
            gx = lanes(0.0)
            gy = lanes(0.0)
            for m in range(half):
                bell = from_scratch(scratch, bells_x + m * MOST_NODES + block * LANES)
                touch += bell * scratch[own + m]
                xx += bell * scratch[own + MOST_HALF + m]
                yy += bell * scratch[own + 2 * MOST_HALF + m]
                xy += bell * scratch[own + 3 * MOST_HALF + m]
                gx += bell * scratch[own + 4 * MOST_HALF + m]
                gy += bell * scratch[own + 5 * MOST_HALF + m]
            for lane in ti.static(range(LANES)):
                i = block * LANES + lane
                if i < columns:
                    at = (first + i * rows_of + j) * CHANNELS
                    pool[at] = touch[lane] + margin * ERROR_OF_CHORDS
                    pool[at + 1] = xx[lane]
                    pool[at + 2] = yy[lane]
                    pool[at + 3] = xy[lane]
                    pool[at + 4] = gx[lane]
                    pool[at + 5] = gy[lane]


@kernel
def rasterise_windows(
    # in
    share: ti.i32,  # indices of a loop that one thread is handed at a time
    workers: ti.i32,
    places: Links,  # [W, 4]
    shapes: Table,  # [W, 6] standard deviations, disc's radius, node spacings [m], margin
    # scratch
    scratch: Numbers,  # [workers * SCRATCH]
    # out
    pool: Numbers,  # [nodes * CHANNELS]
):
    for index in range(workers * share):
        if index % share == 0:
            worker = index // share
            w = worker
            while w < places.shape[0]:
                if places[w, 0] >= 0:
                    raster_window(
                        pool, scratch, worker * SCRATCH, places[w, 0], places[w, 1], places[w, 2],
                        places[w, 3], vec2(shapes[w, 3], shapes[w, 4]),
                        vec2(shapes[w, 0], shapes[w, 1]), shapes[w, 2], shapes[w, 5],
                    )  # fmt: skip
                w += workers


@ti.func
def window_of(rows: ti.template(), places: ti.template(), row):
    """(row, place) of one window: read once where many places ask for it."""
    window = window22(0.0)
    for r in ti.static(range(22)):
        window[r] = rows[row, r]
    return window, place3(places[row, 0], places[row, 1], places[row, 2])


@ti.func
def values_at(window: window22, place: place3, pool: ti.template(), x, y):
    """[6] channels of one window at (x, y) in its frame; 0 where nothing is."""
    value = channels6(0.0)
    if place[0] >= 0 and ti.abs(x) < window[6] and ti.abs(y) < window[7]:
        # beyond the last node all falls: its value bounds what is there
        fx = ti.min(ti.abs(x) * window[4], place[1] - 1.001)
        fy = ti.min(ti.abs(y) * window[5], place[2] - 1.001)
        i = ti.cast(fx, ti.i32)
        j = ti.cast(fy, ti.i32)
        fx -= i
        fy -= j
        at = (place[0] + i * place[2] + j) * CHANNELS
        right = at + place[2] * CHANNELS
        both = fx * fy
        far_x, far_y = fx - both, fy - both
        near = 1.0 - fx - far_y
        for r in ti.static(range(CHANNELS)):
            low = near * pool[at + r] + far_y * pool[at + CHANNELS + r]
            value[r] = low + far_x * pool[right + r] + both * pool[right + CHANNELS + r]
        if x < 0.0:
            value[3] = -value[3]
            value[4] = -value[4]
        if y < 0.0:
            value[3] = -value[3]
            value[5] = -value[5]
    return value


@ti.func
def parts_at(window: window22, place: place3, pool: ti.template(), p: vec2):
    """[8] M, G, q, rest and P of one window about its own mean, as kernels/hazard.py sums them."""
    c = window[2]
    s = window[3]
    dx = p[0] - window[0]
    dy = p[1] - window[1]
    x = c * dx + s * dy
    y = c * dy - s * dx
    value = values_at(window, place, pool, x, y)
    # mean velocity at p, and what all of the ring has on top of it, outwards
    wx = window[8] + window[10] * x + window[11] * y
    wy = window[9] + window[12] * x + window[13] * y
    outwards = window[14]
    touch, xx, yy, xy, gx, gy = value[0], value[1], value[2], value[3], value[4], value[5]
    flow_x = xx * wx + xy * wy + outwards * gx
    flow_y = xy * wx + yy * wy + outwards * gy
    q = wx * flow_x + wy * flow_y + outwards * (wx * gx + wy * gy + outwards * (xx + yy))
    q += window[16] * xx + 2.0 * window[17] * xy + window[18] * yy
    cc = c * c
    ss = s * s
    cs = c * s
    return flow8(
        cc * xx + ss * yy - 2.0 * cs * xy,
        ss * xx + cc * yy + 2.0 * cs * xy,
        cs * (xx - yy) + (cc - ss) * xy,
        c * flow_x - s * flow_y,
        s * flow_x + c * flow_y,
        ti.max(q, 0.0),
        window[15] * (xx + yy),
        touch,
    )


@ti.func
def flow_parts(rows: ti.template(), places: ti.template(), pool: ti.template(), row, p: vec2):
    """`parts_at` of the window of a row."""
    window, place = window_of(rows, places, row)
    return parts_at(window, place, pool, p)


@ti.func
def moment_of(starts: ti.template(), odds: ti.template(), tick):
    """(moment before a time [ticks], share of the way to the next that has passed)."""
    last = starts.shape[0] - 1
    k = ti.cast(ti.max((tick - odds[0]) * odds[1], 0.0), ti.i32)
    j = ti.min(starts[ti.min(k, last)], starts[last] - 1)
    clock = ti.cast(odds[3], ti.i32)
    while j + 1 < starts[last] and odds[clock + j + 1] <= tick:
        j += 1
    share = (tick - odds[clock + j]) / (odds[clock + j + 1] - odds[clock + j])
    return j, ti.min(ti.max(share, 0.0), 1.0)


@ti.func
def is_near(near: ti.template(), at, p: vec2):
    x = p[0] - near[at, 0]
    y = p[1] - near[at, 1]
    return x * x + y * y < near[at, 2] * near[at, 2]


@ti.func
def between(
    rows: ti.template(), places: ti.template(), pool: ti.template(), row, later, share, p: vec2
):
    """`flow_parts` at a share of the way from a row to a `later` one, its mean moving along."""
    way = vec2(rows[later, 0] - rows[row, 0], rows[later, 1] - rows[row, 1])
    before = rows[row, 20] * flow_parts(rows, places, pool, row, p - share * way)
    after = rows[later, 20] * flow_parts(rows, places, pool, later, p + (1.0 - share) * way)
    return (1.0 - share) * before + share * after


@ti.func
def touch_chance(
    rows: ti.template(),
    places: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    n,
    p: vec2,
    tick,
):
    """Bound on the chance that object n touches a disc at p at a time [ticks] (eq. 15)."""
    j, share = moment_of(starts, odds, tick)
    chance = 0.0
    at = j * tally[0] + n
    if is_near(near, at, p) or is_near(near, at + tally[0], p):
        for c in range(tally[1]):
            row = at * tally[1] + c
            chance += between(rows, places, pool, row, row + tally[0] * tally[1], share, p)[7]
    return ti.min(chance, 1.0)


@ti.func
def touch_flow(
    rows: ti.template(),
    places: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    n,
    p: vec2,
    tick,
):
    """How often a second object n is expected to enter or leave a disc that stays at p [1/s]."""
    j, share = moment_of(starts, odds, tick)
    rate = 0.0
    at = j * tally[0] + n
    if is_near(near, at, p) or is_near(near, at + tally[0], p):
        for c in range(tally[1]):
            row = at * tally[1] + c
            flow = between(rows, places, pool, row, row + tally[0] * tally[1], share, p)
            rate += ti.sqrt((flow[0] + flow[1]) * flow[5]) + flow[6]
    return rate
