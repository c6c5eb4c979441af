"""The moments into which a forecast is cut: more of them where its densities change fast.

Shared parameters, beside those of kernels/forecasts.py:
    moments f64 [J, 5]: 0 layer, 1 share of the stretch after it, 2 time [s]; what else is in there
        kernels/moments.py tells

docs/risk.md derives the bounds.
"""

import taichi as ti

from passpmp_ti.kernels.forecasts import (
    COARSEST,
    MOST_SIDE,
    SHARPEST,
    Counts,
    Covariances,
    Means,
    Numbers,
    Table,
    covariance_at,
    is_met,
    mean_at,
    width,
)
from passpmp_ti.kernels.gaussians import LEAST, bend_of, shape_of, vec4, vec8, vec10
from passpmp_ti.kernels.launch import kernel

BEND = 0.7
"""Greatest half length of a part times the root of how strongly a density is bent along time, that
stretches between layers are cut into parts for."""
STRAIGHT = 0.1
"""Greatest way of a mean off the middle of those before and after, for the layer to be left out
[standard deviations]."""
MOST_PARTS = 8
"""That a stretch is cut into."""


@kernel
def choose_moments(
    # in
    mean: Means,
    covariance: Covariances,
    weight: Table,
    radius: Numbers,
    robot: Numbers,
    layers: Table,  # [L, 2]: 0 time [s], 1 how far the robot may be then [m]
    tally: Counts,
    # scratch
    least: Table,  # [N * C, L] lesser deviations, where what the nodes blur anyway is blurred [m]
    bends: Table,  # [N * C, L - 1] until the next layer, 0 where nobody meets the object
    steepest: Numbers,  # [L] their greatest
    # out
    moments: Table,
    starts: Counts,  # [L]: the last moment that is no later than each layer
) -> ti.i32:  # J
    last = layers.shape[0] - 1
    length = robot[5]
    # they are few, here and below: a second thread would cost more than it saves
    ti.loop_config(parallelize=1)
    for i in range(tally[0] * tally[1]):
        n, c = i // tally[1], i % tally[1]
        before, shape_before = vec4(0.0), vec8(0.0)
        spread_before = vec10(0.0)
        met_before = False
        for k in range(last + 1):
            m, p = mean_at(mean, n, c, k), covariance_at(covariance, n, c, k)
            # what the nodes of a layer that wide will blur anyway needs no moments of its own
            coarse = 2 * layers[k, 1] / (MOST_SIDE - 2) / ti.f64(COARSEST)
            shape = shape_of(p, ti.max(radius[n] / SHARPEST, coarse))
            wide = width(m, p, shape[LEAST], radius[n], robot[2])
            met = is_met(m, wide, layers[ti.min(k + 1, last), 1], weight[n, c], robot)
            least[i, k] = shape[LEAST]
            if k > 0:
                bend = ti.f64(0.0)
                if met or met_before:
                    dx, dy = m[0] - before[0], m[1] - before[1]
                    bend = bend_of(shape_before, shape, spread_before, p, dx, dy, length)
                bends[i, k - 1] = bend
            before, shape_before, spread_before, met_before = m, shape, p, met
    ti.loop_config(parallelize=1)
    for k in range(last):
        most = ti.f64(0.0)
        for i in range(tally[0] * tally[1]):
            most = ti.max(most, bends[i, k])
        steepest[k] = most
    count = 0
    begin = 0
    while begin <= last:
        parts = 1
        end = begin + 1
        if begin < last:
            cut = ti.ceil(steepest[begin] / ti.f64(BEND))
            parts = ti.cast(ti.min(ti.max(cut, 1.0), MOST_PARTS), ti.i32)
            end = straight_until(mean, least, steepest, tally, begin, last)
        for part in range(parts):
            share = ti.cast(part, ti.f64) / parts
            moments[count + part, 0] = begin
            moments[count + part, 1] = share
            moments[count + part, 2] = layers[begin, 0] + share * length
        for k in range(begin, end):
            starts[k] = count
        count += parts
        begin = end
    return count


@ti.func
def straight_until(
    mean: ti.template(),
    least: ti.template(),
    steepest: ti.template(),
    tally: ti.template(),
    begin,
    last,
):
    """The next layer that is needed: until then means go straight on, densities hardly change."""
    end = begin + 1
    bent = steepest[begin]
    goes_on = True
    while goes_on and end < last:
        bent += steepest[end]
        goes_on = bent < ti.f64(BEND)
        if goes_on:
            goes_on = are_straight(mean, least, tally, begin, end + 1)
        if goes_on:
            end += 1
    return end


@ti.func
def are_straight(mean: ti.template(), least: ti.template(), tally: ti.template(), begin, end):
    """Whether means between two layers lie evenly on the way from the one to the other."""
    straight = True
    components = tally[1]
    for i in range(tally[0] * components):
        n, c = i // components, i % components
        x, y = mean[n, c, begin, 0], mean[n, c, begin, 1]
        dx, dy = mean[n, c, end, 0] - x, mean[n, c, end, 1] - y
        for k in range(begin + 1, end):
            share = ti.cast(k - begin, ti.f64) / (end - begin)
            ox = mean[n, c, k, 0] - (x + share * dx)
            oy = mean[n, c, k, 1] - (y + share * dy)
            if not ti.sqrt(ox * ox + oy * oy) / least[i, k] < ti.f64(STRAIGHT):
                straight = False
        if not straight:
            break
    return straight
