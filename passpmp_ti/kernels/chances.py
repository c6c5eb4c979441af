"""Chances that tracked objects touch a disc, and how fast they come to: eq. 15 and its flow.

About each part of a forecast (an object, one of its components, a moment) lies a *window* of nodes
in the frame of the covariance's principal axes. A node holds integrals of the density f of the
object's place over the disc, and over its border, whose outward normal is n and whose length is l:

    0: P = integral of f over the disc      (eq. 15)
    1, 2, 3: M = contour integral of f n n^T dl (xx, yy, xy)
    4, 5: g = contour integral of f n dl

P, Mxx and Myy are even in both coordinates, Mxy is odd in both, and g in its own: a quarter of the
window is enough. docs/risk.md derives what is made of them, and the margins that are in them.

Shared parameters:
    rows f32 [W, 22], one for each window:
        0, 1 mean [m], 2, 3 cosine and sine of the first axis, 4, 5 nodes a metre along each axis,
        6, 7 farther than this along an axis there is nothing [m], 8, 9 mean velocity [m/s],
        10-13 K = P_vx P_xx^-1 [1/s], 14 the part of K that is alike in all directions, times R,
        15 the rest of it, times R [m/s], 16-18 (2 / pi) Cv (xx, xy, yy) [m^2/s^2],
        19 half the inverse of the part's least standard deviation [1/m], 20 weight times the part's
        margin, 21 leap: 0: a part lies between its two windows; else: it is at most this times the
        one at its end. 15 and 19-21 speak of the part that begins with the window; vectors are in
        the window's frame
    places i32 [W, 4]: 0 first node (-1: no window), 1, 2 nodes along each axis, 3 points of a ring
    slots i32 [N * C * (L - 1), 2]: first row of each stretch between two layers (-1: nothing is
        near), how many parts the stretch is cut into
    near f32 [N * (L - 1), 3]: disc (x, y, radius) beyond which nothing of an object is in a stretch
    odds f32 [16 + H]: 0 ticks of layer 0, 1 layers a tick, 2 what an object that is left out may
        add [1/s], 3 sample length [s], 4 chance of components that are left out,
        5 emergence, 6 ticks at which the scan was taken, rounded up, 16- shares of the bound
    tally i32 [5]: 0 objects, 1 components, 2 stretches, 3 hidden speeds, 4 time steps a sample
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
flow3 = ti.types.vector(3, ti.f32)
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
    halves of the ring share theirs along the first axis. Whatever is done is done to LANES points of
    the ring or LANES nodes at once; those beyond the last are not asked for.
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
def flow_of(
    rows: ti.template(),
    places: ti.template(),
    pool: ti.template(),
    row,
    mean: vec2,
    p: vec2,
    u: vec2,
):
    """(b0, Q, P) of one window at p - mean for a disc that moves at u: see docs/risk.md.

    b0 is the contour integral of f, Q that of f E[(n.(v - u))^2], the rest of K left out.
    """
    flow = flow3(0.0)
    c = rows[row, 2]
    s = rows[row, 3]
    off = p - mean
    x = c * off[0] + s * off[1]
    y = c * off[1] - s * off[0]
    if places[row, 0] >= 0 and ti.abs(x) < rows[row, 6] and ti.abs(y) < rows[row, 7]:
        # beyond the last node all falls: its value bounds what is there
        nodes_y = places[row, 2]
        fx = ti.min(ti.abs(x) * rows[row, 4], places[row, 1] - 1.001)
        fy = ti.min(ti.abs(y) * rows[row, 5], nodes_y - 1.001)
        i = ti.cast(fx, ti.i32)
        j = ti.cast(fy, ti.i32)
        fx -= i
        fy -= j
        at = (places[row, 0] + i * nodes_y + j) * CHANNELS
        right = at + nodes_y * CHANNELS
        w00 = (1.0 - fx) * (1.0 - fy)
        w01 = (1.0 - fx) * fy
        w10 = fx * (1.0 - fy)
        w11 = fx * fy
        value = ti.Vector.zero(ti.f32, CHANNELS)
        for r in ti.static(range(CHANNELS)):
            value[r] = (
                w00 * pool[at + r]
                + w01 * pool[at + CHANNELS + r]
                + w10 * pool[right + r]
                + w11 * pool[right + CHANNELS + r]
            )
        sign_x = ti.select(x < 0.0, -1.0, 1.0)
        sign_y = ti.select(y < 0.0, -1.0, 1.0)
        wx = rows[row, 8] + rows[row, 10] * x + rows[row, 11] * y - (c * u[0] + s * u[1])
        wy = rows[row, 9] + rows[row, 12] * x + rows[row, 13] * y - (c * u[1] - s * u[0])
        spread = rows[row, 14]
        b0 = value[1] + value[2]
        q = (wx * wx + rows[row, 16]) * value[1] + (wy * wy + rows[row, 18]) * value[2]
        q += 2.0 * (wx * wy + rows[row, 17]) * sign_x * sign_y * value[3]
        q += spread * (2.0 * (wx * sign_x * value[4] + wy * sign_y * value[5]) + spread * b0)
        flow = flow3(b0, ti.max(q, 0.0), value[0])
    return flow


@ti.func
def stretch_of(odds: ti.template(), tally: ti.template(), tick):
    """(stretch between two layers that a time [ticks] lies in, share of it that has passed)."""
    along = ti.max((tick - odds[0]) * odds[1], 0.0)
    k = ti.min(ti.cast(along, ti.i32), tally[2] - 1)
    return k, ti.min(along - k, 1.0)


@ti.func
def part_of(slots: ti.template(), slot, share):
    """(row that the part of a stretch begins with, share of the part that has passed)."""
    along = share * slots[slot, 1]
    part = ti.min(ti.cast(along, ti.i32), slots[slot, 1] - 1)
    return slots[slot, 0] + part, along - part


@ti.func
def mean_at(rows: ti.template(), row, share):
    return vec2(
        rows[row, 0] + share * (rows[row + 1, 0] - rows[row, 0]),
        rows[row, 1] + share * (rows[row + 1, 1] - rows[row, 1]),
    )


@ti.func
def is_near(near: ti.template(), stretch, p: vec2):
    x = p[0] - near[stretch, 0]
    y = p[1] - near[stretch, 1]
    return x * x + y * y < near[stretch, 2] * near[stretch, 2]


@ti.func
def between(
    rows: ti.template(),
    places: ti.template(),
    pool: ti.template(),
    row,
    share,
    p: vec2,
    u: vec2,
):
    """`flow_of` at a share of the part that begins with `row`."""
    mean = mean_at(rows, row, share)
    flow = flow_of(rows, places, pool, row + 1, mean, p, u)
    if rows[row, 21] > 0.0:
        flow *= rows[row, 21]
    else:
        flow = share * flow + (1.0 - share) * flow_of(rows, places, pool, row, mean, p, u)
    return flow


@ti.func
def touch_chance(
    rows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    n,
    p: vec2,
    tick,
):
    """Bound on the chance that object n touches a disc at p at a time [ticks] (eq. 15)."""
    k, share = stretch_of(odds, tally, tick)
    chance = 0.0
    if is_near(near, n * tally[2] + k, p):
        for c in range(tally[1]):
            slot = (n * tally[1] + c) * tally[2] + k
            if slots[slot, 0] >= 0:
                row, along = part_of(slots, slot, share)
                flow = between(rows, places, pool, row, along, p, vec2(0.0))
                chance += rows[row, 20] * flow[2]
    return ti.min(chance, 1.0)


@ti.func
def pieces_for(rows: ti.template(), row, u: vec2, span):
    """How many equal pieces a sample of `span` seconds is looked at in: an odd number."""
    c = rows[row, 2]
    s = rows[row, 3]
    x = rows[row, 8] - (c * u[0] + s * u[1])
    y = rows[row, 9] - (c * u[1] - s * u[0])
    turn = ti.sqrt(x * x + y * y) * span * rows[row, 19]
    # a piece of the way is at most 1.4 standard deviations long
    half = ti.cast(ti.ceil((turn * (1.0 / 0.7) - 1.0) * 0.5), ti.i32)
    pieces = 2 * ti.min(ti.max(half, 0), 50) + 1
    turn /= pieces
    q = turn * turn
    # tan(turn) / turn from above, for turn <= 1
    return pieces, 1.0 + q * (1.0 / 3.0 + 0.23 * q)


@ti.func
def touch_flow(
    rows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    n,
    p: vec2,
    u: vec2,
    tick,
    before,
    after,
):
    """Half the expected number of times that object n enters or leaves a disc about a moment.

    Args:
        p: where the disc is [m].
        u: how it moves [m/s].
        tick: when [ticks].
        before: time that the moment speaks for before it, and after it [s].
    """
    k, share = stretch_of(odds, tally, tick)
    total = 0.0
    if is_near(near, n * tally[2] + k, p):
        for c in range(tally[1]):
            slot = (n * tally[1] + c) * tally[2] + k
            if slots[slot, 0] >= 0:
                row, along = part_of(slots, slot, share)
                pieces, margin = pieces_for(rows, row, u, 2.0 * ti.max(before, after))
                reach = pieces // 2
                step_before = 2.0 * before / pieces
                step_after = 2.0 * after / pieces
                crossings = 0.0
                for j in range(-reach, reach + 1):
                    length = ti.select(j < 0, step_before, step_after)
                    weight = ti.select(j == 0, 0.5 * (step_before + step_after), length)
                    if weight > 0.0:
                        later = j * length
                        if j != 0:
                            k, share = stretch_of(odds, tally, tick + later * 1000.0)
                            slot = (n * tally[1] + c) * tally[2] + k
                            row = -1
                            if slots[slot, 0] >= 0:
                                row, along = part_of(slots, slot, share)
                        if row >= 0:
                            flow = between(rows, places, pool, row, along, p + later * u, u)
                            rate = ti.sqrt(flow[0] * flow[1]) + rows[row, 15] * flow[0]
                            crossings += weight * rows[row, 20] * rate
                total += 0.5 * margin * crossings
    return total
