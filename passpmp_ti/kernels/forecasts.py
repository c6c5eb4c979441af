"""Forecasts of objects, and which of what is in them a robot may meet.

Shared parameters, in double precision (kernels/gaussians.py), of N objects with C components at L
layers, equally far apart in time:
    mean f64 [N, C, L, 4] and covariance f64 [N, C, L, 4, 4] of (x, y, vx, vy) [m, m/s]
    weight f64 [N, C] of the components
    radius f64 [N] within which an object touches a disc of the robot [m]
    robot f64 [6]: 0, 1 where it is at the scan [m], 2 greatest speed of its discs [m/s],
        3, 4 from where places count [m], 5 from one layer of the forecast to the next [s]
    tally i32 [2]: 0 objects N, 1 components C

docs/risk.md derives the bounds.
"""

import math

import taichi as ti

from passpmp_ti.kernels.gaussians import GREAT, LEAST, NOISE, shape_of, vec4, vec10

SHARPEST = 16.0
"""Greatest ratio of a disc's radius to a standard deviation that windows are made for."""
BLUR = 2.0
"""Sharper ones are blurred by noise; what is farther out in it than this [its standard deviations]
is made up for by a factor."""
LEFT_OUT = 2e-5
"""What an object that is not looked up may add to the risk [1/s]."""
SMALLEST = 1e-6
"""Components of less weight than this are not looked up: their weight is risk."""
COARSEST = 1.2
"""Side of a cell of the layers of hazard [standard deviations of the sharpest object]; what is
sharper is blurred."""
MOST_SIDE = 28
"""Nodes along a side of a layer of hazard."""

Numbers = ti.types.ndarray(dtype=ti.f64, ndim=1)
Table = ti.types.ndarray(dtype=ti.f64, ndim=2)
Means = ti.types.ndarray(dtype=ti.f64, ndim=4)
Covariances = ti.types.ndarray(dtype=ti.f64, ndim=5)
Counts = ti.types.ndarray(dtype=ti.i32, ndim=1)


@ti.func
def mean_at(mean: ti.template(), n, c, k):
    """[4] of a layer."""
    return vec4(mean[n, c, k, 0], mean[n, c, k, 1], mean[n, c, k, 2], mean[n, c, k, 3])


@ti.func
def covariance_at(p: ti.template(), n, c, k):
    """[10] of a layer."""
    return vec10(
        p[n, c, k, 0, 0], p[n, c, k, 1, 1], p[n, c, k, 0, 1],
        p[n, c, k, 2, 0], p[n, c, k, 2, 1], p[n, c, k, 3, 0], p[n, c, k, 3, 1],
        p[n, c, k, 2, 2], p[n, c, k, 3, 3], p[n, c, k, 2, 3],
    )  # fmt: skip


@ti.func
def farness(mean, covariance, shape, radius, disc_speed):
    """Standard deviations beyond which an object may be left out."""
    # how fast it may come, as the root of the mean square
    speed = ti.sqrt(mean[2] * mean[2] + mean[3] * mean[3]) + disc_speed
    speed += 8 * ti.sqrt(covariance[7] + covariance[8])
    rate = (radius + BLUR * shape[NOISE]) * speed / (shape[GREAT] * shape[LEAST])
    return ti.sqrt(2 * ti.log(ti.max(rate / ti.f64(LEFT_OUT), ti.f64(math.e))))


@ti.func
def width(mean, covariance, least, radius, disc_speed):
    """How far about its mean an object whose lesser deviation is `least` is looked up, with room
    for what blurring adds [m]."""
    sharp = shape_of(covariance, ti.max(least, radius / SHARPEST))
    far = farness(mean, covariance, sharp, radius, disc_speed)
    return (1 + BLUR / SHARPEST) * radius + far * sharp[GREAT]


@ti.func
def is_met(mean, wide, way, weight, robot: ti.template()):
    """Whether the robot, which may be so far `way`, may meet an object that is so `wide`."""
    x, y = mean[0] - robot[0], mean[1] - robot[1]
    return ti.sqrt(x * x + y * y) - wide <= way and weight >= ti.f64(SMALLEST)
