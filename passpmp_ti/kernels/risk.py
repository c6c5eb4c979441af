"""The risk of motions: chances that something touches the robot at any time while it moves.

A risk is carried along a motion as two numbers, so that a motion can end, be kept, and go on:

    TOUCH: sum over tracked objects and discs of (P(start) + P(end)) / 2 + half of the expected
        number of entrances and leavings. Bounds the chance that any of them touches the robot at
        any time (Boole, Rice; docs/risk.md), without taking time steps for independent.
    NEED: least share of the speed bound at which something hidden could have met the robot; -1:
        it was where nothing is proven. One hidden mover has one random speed: of all moments only
        the worst counts.

A robot at rest may be touched (passive safety): what happens there is not counted, and each rest
is an end, and the next motion's start. Parameters: kernels/check.py, kernels/chances.py,
kernels/hazard.py.
"""

import taichi as ti

from passpmp_ti.kernels.chances import vec2
from passpmp_ti.kernels.check import (
    LATEST,
    NEVER,
    arrival_at,
    control_of,
    robot_of,
)
from passpmp_ti.kernels.hazard import crossings, touch_sum
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.motion import (
    CAR,
    A,
    B,
    C,
    S,
    X,
    Y,
    at_rest,
    braking_steps,
    pose7,
    step,
    tangent,
)
from passpmp_ti.kernels.spans import LEVELS, Spans, level_for, span_about

Numbers = ti.types.ndarray(dtype=ti.f32, ndim=1)
Counts = ti.types.ndarray(dtype=ti.i32, ndim=1)
Arrival = ti.types.ndarray(dtype=ti.u16, ndim=2)
Table = ti.types.ndarray(dtype=ti.f32, ndim=2)
Links = ti.types.ndarray(dtype=ti.i32, ndim=2)

risk2 = ti.types.vector(2, ti.f32)
TOUCH, NEED = 0, 1
NO_NEED = 2.0
"""More than any share of the bound: nothing hidden can have met the robot."""
EMERGENCE, SCANNED, SPEEDS = 5, 6, 16
"""Where they begin in `odds`."""


@ti.func
def needed_share(ticks, tick, scanned):
    """Share of the speed bound that something hidden needs to be at a place by a tick.

    Args:
        ticks: of the place in the arrival map.
        tick: rounded up.
        scanned: ticks of the scan, rounded up: from then on it may have moved. Later is nearer.
    """
    need = NO_NEED
    if ticks == 0:
        need = -1.0
    elif ticks != NEVER:
        by = ti.min(tick, LATEST)
        # at the bound just as kernels/check.py has it; slower ones are given the whole last tick
        if ticks <= by:
            need = ti.max(ticks - scanned, 0.0) / ti.max(by + 1 - scanned, 1.0)
    return need


@ti.func
def hidden_chance(odds: ti.template(), tally: ti.template(), need):
    """Chance that something hidden is there and fast enough."""
    chance = 1.0
    if need >= 0.0:
        enough = 0
        for h in range(tally[3]):
            # speeds equal to the needed one suffice: rounding must not lose them
            if odds[SPEEDS + h] >= need - 1e-6:
                enough += 1
        chance = odds[EMERGENCE] * enough / tally[3]
    return chance


@ti.func
def way_need(
    arrival: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    odds: ti.template(),
    before,
    after,
    tick,
    need,
):
    """The least of `need` and of what a time step from `before`, at `tick`, on needs.

    The looks are those of kernels/check.py: with all hidden movers at the bound, a step that is
    clear there needs more than the bound here.
    """
    least = need
    for d in range(counts[5]):
        offset = numbers[8 + d]
        x = before[X] + offset * before[C]
        y = before[Y] + offset * before[S]
        dx = after[X] + offset * after[C] - x
        dy = after[Y] + offset * after[S] - y
        way = ti.sqrt(dx * dx + dy * dy) + numbers[17]
        looks = ti.cast(ti.max(ti.ceil(way * numbers[16]), 1.0), ti.i32)
        piece = 1.0 / looks
        length = counts[4] * piece
        for k in range(looks):
            share = (k + 0.5) * piece
            ticks = arrival_at(arrival, counts, numbers[0], x + share * dx, y + share * dy)
            end = tick + ti.cast(ti.ceil((k + 1) * length - 1e-3), ti.i32)
            least = ti.min(least, needed_share(ticks, end, odds[SCANNED]))
    return least


@ti.func
def disc_at(numbers: ti.template(), d, q):
    offset = numbers[8 + d]
    return vec2(q[X] + offset * q[C], q[Y] + offset * q[S])


@ti.func
def sample_need(
    kind: ti.template(),
    arrival: ti.template(),
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    robot,
    odds: ti.template(),
    before,
    after,
    tick,
    control,
    direction,
    steps,
    need,
):
    """The least of `need` and of what a sample of a motion needs: `steps` time steps from `before`,
    at `tick`, to `after`.

    One look a disc, which speaks for all places about the middle of its way: a need that may be too
    small, never too great. Where some of them are never free, beside a wall, all looks are taken.
    """
    least = need
    seconds = steps * numbers[1]
    beside = False
    for d in range(counts[5]):
        p = disc_at(numbers, d, before)
        way = disc_at(numbers, d, after) - p
        middle = p + 0.5 * way
        # the true way leaves the straight one by no more
        radius = 0.5 * way.norm() + 0.125 * numbers[20] * seconds * seconds + numbers[19]
        level = level_for(radius, numbers[0])
        ticks = 0
        if level < LEVELS:
            ticks, _ = span_about(spans, counts, numbers[0], middle[0], middle[1], level)
        if ticks == 0:
            beside = True
        else:
            end = tick + steps * counts[4]
            least = ti.min(least, needed_share(ticks, end, odds[SCANNED]))
    if beside:
        q = before
        now = tick
        for _ in range(steps):
            ahead = step(kind, robot, q, control, direction, numbers[1])
            least = way_need(arrival, numbers, counts, odds, q, ahead, now, least)
            q = ahead
            now += counts[4]
    return least


@ti.func
def disc_velocity(kind: ti.template(), robot, numbers: ti.template(), d, q):
    """Velocity of a disc's middle [m/s]."""
    forth = q[A]
    turn = 0.0
    if ti.static(kind == CAR):
        turn = 2.0 * q[A] * tangent(q[B]) * robot[3]
    else:
        forth = 0.5 * (q[A] + q[B])
        turn = 2.0 * (q[A] - q[B]) * robot[3]
    across = turn * numbers[8 + d]
    return vec2(forth * q[C] - across * q[S], forth * q[S] + across * q[C])


@ti.func
def touched_now(
    numbers: ti.template(),
    counts: ti.template(),
    layers: ti.template(),
    grids: ti.template(),
    begins: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    q,
    tick,
):
    """Sum over objects and discs of the chances to touch at one moment."""
    total = 0.0
    for d in range(counts[5]):
        total += touch_sum(layers, grids, begins, starts, odds, disc_at(numbers, d, q), tick)
    return total


@ti.func
def crossed_about(
    kind: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    robot,
    layers: ti.template(),
    grids: ti.template(),
    begins: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    q,
    tick,
    before,
    after,
):
    """What a moment that speaks for `before` and `after` seconds adds to TOUCH."""
    total = 0.0
    for d in range(counts[5]):
        total += crossings(
            layers, grids, begins, starts, odds, disc_at(numbers, d, q),
            disc_velocity(kind, robot, numbers, d, q), tick, before, after,
        )  # fmt: skip
    return 0.5 * total


@ti.func
def risk_begin(
    kind: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    layers: ti.template(),
    grids: ti.template(),
    begins: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    q,
    tick,
):
    """The risk with which a plan begins at q."""
    risk = risk2(odds[4], NO_NEED)
    if not at_rest(kind, q):
        risk[TOUCH] += 0.5 * touched_now(
            numbers, counts, layers, grids, begins, starts, odds, q, tick
        )
    return risk


@ti.func
def risk_along(
    kind: ti.template(),
    arrival: ti.template(),
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    robot,
    layers: ti.template(),
    grids: ti.template(),
    begins: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    start,
    start_tick,
    control,
    direction,
    steps,
    most,
    risk,
):
    """(risk, pose, tick) after a control: `steps` time steps of it, or to rest where `steps` < 0.

    Tracks are looked up every tally[4] time steps, which the margins allow for (docs/risk.md). A
    risk above `most` is not followed further.
    """
    q = start
    tick = start_tick
    sample = q
    sample_tick = tick
    dt = numbers[1]
    before = 0.0
    left = steps
    if steps < 0:
        left = braking_steps(kind, q, control, dt)
    resting = at_rest(kind, q)
    moving = not resting
    going = left > 0
    if resting and steps < 0:
        going = False
    while going:
        # on to the next sample
        taken = 0
        while going and taken < tally[4]:
            ahead = step(kind, robot, q, control, direction, dt)
            rests = at_rest(kind, ahead)
            if resting and not rests:
                moving = True
                risk[TOUCH] += 0.5 * touched_now(
                    numbers, counts, layers, grids, begins, starts, odds, q, tick
                )
            q = ahead
            resting = rests
            tick += counts[4]
            taken += 1
            left -= 1
            going = left > 0
            if steps < 0:
                going = not resting
            if moving and resting:
                # a rest ends what is counted
                break
        if moving:
            after = 0.5 * taken * dt
            risk[NEED] = sample_need(
                kind, arrival, spans, numbers, counts, robot, odds, sample, q, sample_tick, control,
                direction, taken, risk[NEED],
            )  # fmt: skip
            risk[TOUCH] += crossed_about(
                kind, numbers, counts, robot, layers, grids, begins, starts, odds, sample,
                sample_tick, before, after,
            )  # fmt: skip
            before = after
            if resting or not going:
                risk[TOUCH] += crossed_about(
                    kind, numbers, counts, robot, layers, grids, begins, starts, odds, q, tick,
                    before, 0.0,
                )  # fmt: skip
                before = 0.0
            if resting:
                moving = False
                risk[TOUCH] += 0.5 * touched_now(
                    numbers, counts, layers, grids, begins, starts, odds, q, tick
                )
        sample = q
        sample_tick = tick
        if risk_of(odds, tally, risk) > most:
            going = False  # it only grows
    return risk, q, tick


@ti.func
def risk_of(odds: ti.template(), tally: ti.template(), risk):
    """The chance that anything touches the robot at any time: tracked or hidden, independent."""
    tracks = ti.min(risk[TOUCH], 1.0)
    return 1.0 - (1.0 - tracks) * (1.0 - hidden_chance(odds, tally, risk[NEED]))


@ti.func
def least_braking_risk(
    kind: ti.template(),
    arrival: ti.template(),
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    braking: ti.template(),
    robot,
    layers: ti.template(),
    grids: ti.template(),
    begins: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    q,
    tick,
    risk,
):
    """(least risk of going on to rest from q by a braking control, its index): eqs. 11 and 12."""
    least = 1e30
    best = 0
    for b in range(counts[6]):
        if b == 0 or not at_rest(kind, q):
            whole, _, _ = risk_along(
                kind, arrival, spans, numbers, counts, robot, layers, grids, begins, starts, odds,
                tally, q, tick, control_of(braking, b), 0.0, -1, least, risk,
            )  # fmt: skip
            chance = risk_of(odds, tally, whole)
            # one that was not followed to its end is worse already
            if chance < least:
                least = chance
                best = b
    return least, best


@ti.func
def pose_in(poses: ti.template(), n):
    q = pose7(0.0)
    for r in ti.static(range(7)):
        q[r] = poses[n, r]
    return q


@kernel
def states_risk(
    # in
    kind: ti.template(),
    arrival: Arrival,  # [J, I]
    spans: Spans,  # [F]
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
    braking: Table,  # [B, 3]
    layers: Numbers,
    grids: Table,
    begins: Links,
    starts: Counts,
    odds: Numbers,
    tally: Counts,
    poses: Table,  # [N, 7]
    ticks: Counts,  # [N]
    # out
    chance: Numbers,  # [N]: least over the braking set of the risk on the way to rest
    control: Counts,  # [N]: which one that is
):
    for n in range(poses.shape[0]):
        start = pose_in(poses, n)
        risk = risk_begin(
            kind, numbers, counts, layers, grids, begins, starts, odds, tally, start, ticks[n]
        )
        least, best = least_braking_risk(
            kind, arrival, spans, numbers, counts, braking, robot_of(numbers), layers, grids,
            begins, starts, odds, tally, start, ticks[n], risk,
        )  # fmt: skip
        chance[n] = least
        control[n] = best


@kernel
def path_risk(
    # in
    kind: ti.template(),
    arrival: Arrival,  # [J, I]
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
    layers: Numbers,
    grids: Table,
    begins: Links,
    starts: Counts,
    odds: Numbers,
    tally: Counts,
    poses: Table,  # [M, 7], at most a sample apart
    ticks: Counts,  # [M]
    # out
    share: Table,  # [M, 2]: what each pose adds to TOUCH, NEED on the way to the next
    chance: Numbers,  # [3]: that what is tracked touches the robot, what is hidden, anything
):
    """The risk of following a path while the robot moves."""
    for m in range(poses.shape[0]):
        q = pose_in(poses, m)
        before = 0.0
        after = 0.0
        need = NO_NEED
        if m > 0:
            if not (at_rest(kind, q) and at_rest(kind, pose_in(poses, m - 1))):
                before = 0.5e-3 * (ticks[m] - ticks[m - 1])
        if m + 1 < poses.shape[0]:
            ahead = pose_in(poses, m + 1)
            if not (at_rest(kind, q) and at_rest(kind, ahead)):
                after = 0.5e-3 * (ticks[m + 1] - ticks[m])
                need = way_need(arrival, numbers, counts, odds, q, ahead, ticks[m], NO_NEED)
        total = 0.0
        if (before > 0.0) != (after > 0.0):
            total += 0.5 * touched_now(
                numbers, counts, layers, grids, begins, starts, odds, q, ticks[m]
            )
        if before + after > 0.0:
            total += crossed_about(
                kind, numbers, counts, robot_of(numbers), layers, grids, begins, starts, odds, q,
                ticks[m], before, after,
            )  # fmt: skip
        share[m, 0] = total
        share[m, 1] = need
    ti.loop_config(serialize=True)
    for _ in range(1):
        risk = risk2(odds[4], NO_NEED)
        for m in range(poses.shape[0]):
            risk[TOUCH] += share[m, 0]
            risk[NEED] = ti.min(risk[NEED], share[m, 1])
        chance[0] = ti.min(risk[TOUCH], 1.0)
        chance[1] = hidden_chance(odds, tally, risk[NEED])
        chance[2] = risk_of(odds, tally, risk)
