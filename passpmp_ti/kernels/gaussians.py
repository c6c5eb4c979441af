"""Gaussians of places and velocities: their shapes, what lies between two of them, and how bent.

All in double precision: what is left of the difference of two covariances decides. A constant that
single precision does not hold is to be written `ti.f64(...)`.

A *covariance* is its ten numbers: 0-2 the places' (xx, yy, xy) [m^2], 3-6 those of velocities with
places (vx x, vx y, vy x, vy y) [m^2/s], 7-9 the velocities' (xx, yy, xy) [m^2/s^2].

A *shape* is that of the places, blurred by noise where they are too sharp: 0-2 its covariance,
noise included (xx, yy, xy) [m^2], 3, 4 cosine and sine of the principal axis of the greater
deviation, 5, 6 the greater and the lesser standard deviation [m], 7 that of the noise [m].

docs/risk.md derives the bounds.
"""

import taichi as ti

FARTHEST = 4.5
"""Standard deviations that count where a covariance shrinks."""
TINY = 1e-300
"""Instead of nothing, to divide by."""
DUST = 1e-9
"""What rounding may take from the diagonal of a covariance that still counts as one."""
GREAT, LEAST, NOISE = 5, 6, 7

vec2 = ti.types.vector(2, ti.f64)
vec3 = ti.types.vector(3, ti.f64)
vec4 = ti.types.vector(4, ti.f64)
vec8 = ti.types.vector(8, ti.f64)
vec10 = ti.types.vector(10, ti.f64)


@ti.func
def shape_of(covariance, floor):
    """[8] none of whose deviations is below `floor` [m]."""
    xx, yy, xy = covariance[0], covariance[1], covariance[2]
    half = 0.5 * (xx - yy)
    gap = ti.sqrt(half * half + xy * xy)
    greater = 0.5 * (xx + yy) + gap
    # both make the determinant; their difference would lose the smaller one
    smaller = ti.max(xx * yy - xy * xy, 0.0) / greater
    square = ti.max(floor * floor - smaller, 0.0)
    # half of an angle from its cosine; a round one's axes are any
    cosine = half / ti.max(gap, ti.f64(TINY))
    s = ti.sqrt(0.5 - 0.5 * cosine)
    return vec8(
        xx + square, yy + square, xy, ti.sqrt(0.5 + 0.5 * cosine), ti.select(xy < 0.0, -s, s),
        ti.sqrt(greater + square), ti.sqrt(smaller + square), ti.sqrt(square),
    )  # fmt: skip


@ti.func
def along(shape, xx, yy, xy):
    """(xx, yy, xy) of a symmetric matrix in the frame of the principal axes."""
    cc, ss, cs = shape[3] * shape[3], shape[4] * shape[4], shape[3] * shape[4]
    return vec3(
        cc * xx + ss * yy + 2 * cs * xy,
        ss * xx + cc * yy - 2 * cs * xy,
        cs * (yy - xx) + (cc - ss) * xy,
    )


@ti.func
def drifted(p, t):
    """[10] a covariance after t seconds at constant velocity."""
    q = p
    q[0] += t * (2 * p[3] + t * p[7])
    q[1] += t * (2 * p[6] + t * p[8])
    q[2] += t * (p[4] + p[5] + t * p[9])
    q[3] += t * p[7]
    q[4] += t * p[9]
    q[5] += t * p[9]
    q[6] += t * p[8]
    return q


@ti.func
def is_positive(p):
    """Whether a covariance is positive definite, but for `DUST`: all its pivots are positive."""
    xx, yy = p[0] + ti.f64(DUST), p[1] + ti.f64(DUST)
    determinant = xx * yy - p[2] * p[2]
    positive = xx > 0.0 and determinant > 0.0
    if positive:
        # what the places leave of the velocities: P_vv - P_vx P_xx^-1 P_xv
        ux, uy = yy * p[3] - p[2] * p[4], xx * p[4] - p[2] * p[3]
        wx, wy = yy * p[5] - p[2] * p[6], xx * p[6] - p[2] * p[5]
        vxx = p[7] + ti.f64(DUST) - (ux * p[3] + uy * p[4]) / determinant
        vyy = p[8] + ti.f64(DUST) - (wx * p[5] + wy * p[6]) / determinant
        vxy = p[9] - (ux * p[5] + uy * p[6]) / determinant
        positive = vxx > 0.0 and vxx * vyy - vxy * vxy > 0.0
    return positive


@ti.func
def between(first, second, share, length):
    """[10] the covariance at a share of the stretch from one to another, `length` seconds later.

    What a constant velocity would not make of the one before is put down to noise of the
    acceleration: its parts grow as s^3, s^2 and s. Where that cannot be, they are mixed.
    """
    covariance = first + share * (second - first)
    if share > 0.0:
        noise = second - drifted(first, length)
        if is_positive(noise):
            covariance = drifted(first, share * length)
            for r in ti.static(range(10)):
                grown = share
                for _ in ti.static(range(2 if r < 3 else 1 if r < 7 else 0)):
                    grown *= share
                covariance[r] += grown * noise[r]
    return covariance


@ti.func
def bend_of(shape, after, spread, spread_after, dx, dy, length):
    """How strongly a density is bent, as seen from one place, from one moment to the next.

    Along a time in which the mean moves evenly and the covariance goes at a constant rate and bends
    as Pvv makes it, a Gaussian has f'' >= -k f: half of the time times the root of k. It is asked
    at both ends, and the stronger one counts.

    Args:
        shape: [8] at the one, as `after` at the next.
        spread: [10] the covariance at the one, as `spread_after` at the next.
        dx, dy: the mean's way [m].
        length: from the one to the next [s].
    """
    rate = vec3(after[0] - shape[0], after[1] - shape[1], after[2] - shape[2]) / length
    vx, vy = dx / length, dy / length
    strongest = ti.max(
        bend_at(shape, spread, rate, vx, vy), bend_at(after, spread_after, rate, vx, vy)
    )
    return 0.5 * length * strongest


@ti.func
def bend_at(shape, spread, rate, vx, vy):
    """The root of k [1/s] where the covariance goes at `rate` and the mean at (vx, vy)."""
    determinant = (shape[GREAT] * shape[LEAST]) * (shape[GREAT] * shape[LEAST])
    inverse = vec3(shape[1], shape[0], -shape[2]) / determinant
    # the inverse makes of the rate what it is as seen from where the Gaussian is a standard one
    middle = 0.5 * trace(inverse, rate)
    product = rate[0] * rate[1] - rate[2] * rate[2]
    square = ti.max(middle * middle - product / determinant, 0.0)
    gap = ti.sqrt(square)
    up, down = ti.max(middle + gap, 0.0), ti.max(gap - middle, 0.0)
    own = up * (up + 2 * ti.max(middle, 0.0)) - middle * middle - square
    own += 2 * FARTHEST * FARTHEST * down * (up + down)
    own = ti.max(own, 0.0) + trace(inverse, vec3(spread[7], spread[8], spread[9]))
    way = ti.sqrt(ti.max(trace(inverse, vec3(vx * vx, vy * vy, vx * vy)), 0.0))
    return way + ti.sqrt(ti.max(own, 0.0))


@ti.func
def trace(first, second):
    """Of the product of symmetric matrices (xx, yy, xy)."""
    return first[0] * second[0] + first[1] * second[1] + 2 * first[2] * second[2]
