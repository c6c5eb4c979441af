"""The risk of motions: chances that something touches the robot at any time while it moves.

A risk is carried along a motion as two numbers, so that a motion can end, be kept, and go on:

    TOUCH: sum over tracked objects and discs of (P(start) + P(end)) / 2 + half of the expected
        number of entrances and leavings. Bounds the chance that any of them touches the robot at
        any time (Boole, Rice; docs/risk.md), without taking time steps for independent.
    NEED: least share of the speed bound at which something hidden could have met the robot; -1:
        it was where nothing is proven. One hidden mover has one random speed: of all moments only
        the worst counts.

A robot at rest may be touched (passive safety): what happens there is not counted, and each rest
is an end, and the next motion's start. Parameters: kernels/check.py, kernels/chances.py.
"""

import taichi as ti

from passpmp_ti.kernels.chances import touch_chance, touch_flow, vec2
from passpmp_ti.kernels.check import (
    LATEST,
    NEVER,
    arrival_at,
    control_of,
    free_steps,
    robot_of,
)
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
    heading_for,
    pose7,
    speed_of,
    step,
    tangent,
)
from passpmp_ti.kernels.spans import Spans

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
    rows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    first,
    last,
    q,
    tick,
):
    """Sum over objects [first, last) and discs of the chances to touch at one moment."""
    total = 0.0
    for n in range(first, last):
        for d in range(counts[5]):
            total += touch_chance(
                rows, places, slots, near, pool, odds, tally, n, disc_at(numbers, d, q), tick
            )
    return total


@ti.func
def flow_about(
    kind: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    robot,
    rows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    first,
    last,
    q,
    tick,
    before,
    after,
):
    """What a moment that speaks for `before` and `after` seconds adds to TOUCH."""
    total = 0.0
    for n in range(first, last):
        for d in range(counts[5]):
            total += touch_flow(
                rows, places, slots, near, pool, odds, tally, n, disc_at(numbers, d, q),
                disc_velocity(kind, robot, numbers, d, q), tick, before, after,
            )  # fmt: skip
    # objects that are too far to be looked up
    total += (last - first) * counts[5] * odds[2] * (before + after)
    # beyond its last layer a forecast says nothing
    if (tick - odds[0]) * odds[1] > tally[2] + 1e-3:
        total = 1.0
    return total


@ti.func
def risk_begin(
    kind: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    rows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    q,
    tick,
):
    """The risk with which a plan begins at q."""
    risk = risk2(odds[4], NO_NEED)
    if not at_rest(kind, q):
        risk[TOUCH] += 0.5 * touched_now(
            numbers, counts, rows, places, slots, near, pool, odds, tally, 0, tally[0], q, tick
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
    rows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
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
    free = 0
    level = 2
    moving = True
    going = left > 0
    if at_rest(kind, q):
        moving = False
        if steps < 0:
            going = False
    while going:
        # on to the next sample
        taken = 0
        while going and taken < tally[4]:
            ahead = step(kind, robot, q, control, direction, dt)
            if at_rest(kind, q) and not at_rest(kind, ahead):
                moving = True
                risk[TOUCH] += 0.5 * touched_now(
                    numbers, counts, rows, places, slots, near, pool, odds, tally, 0, tally[0], q,
                    tick,
                )  # fmt: skip
            if moving:
                if free == 0 and risk[NEED] >= 0.0:
                    # along a primitive speeds may grow, and no way is halved by braking
                    speed = speed_of(kind, q)
                    rest = left + 1
                    if steps >= 0:
                        speed = robot[0]
                        rest = 2 * left + 2
                    free, level = free_steps(
                        spans, numbers, counts, q, speed, heading_for(kind, q), tick, rest, level
                    )
                if free > 0:
                    free -= 1
                else:
                    risk[NEED] = way_need(
                        arrival, numbers, counts, odds, q, ahead, tick, risk[NEED]
                    )
                    free += 1
            q = ahead
            tick += counts[4]
            taken += 1
            left -= 1
            going = left > 0
            if steps < 0:
                going = not at_rest(kind, q)
            if moving and at_rest(kind, q):
                # a rest ends what is counted
                break
        if moving:
            after = 0.5 * taken * dt
            risk[TOUCH] += flow_about(
                kind, numbers, counts, robot, rows, places, slots, near, pool, odds, tally, 0,
                tally[0], sample, sample_tick, before, after,
            )  # fmt: skip
            before = after
            if at_rest(kind, q) or not going:
                risk[TOUCH] += flow_about(
                    kind, numbers, counts, robot, rows, places, slots, near, pool, odds, tally, 0,
                    tally[0], q, tick, before, 0.0,
                )  # fmt: skip
                before = 0.0
            if at_rest(kind, q):
                moving = False
                risk[TOUCH] += 0.5 * touched_now(
                    numbers, counts, rows, places, slots, near, pool, odds, tally, 0, tally[0], q,
                    tick,
                )  # fmt: skip
        sample = q
        sample_tick = tick
        if risk[TOUCH] > most:
            going = False
    return risk, q, tick


@ti.func
def risk_of(odds: ti.template(), tally: ti.template(), risk):
    """The chance that anything touches the robot at any time: tracked or hidden, independent."""
    tracks = ti.min(risk[TOUCH], 1.0)
    return 1.0 - (1.0 - tracks) * (1.0 - hidden_chance(odds, tally, risk[NEED]))


@ti.func
def risk_end(
    kind: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    rows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    q,
    tick,
    risk,
):
    """The chance that anything touches the robot by the time that it is at q."""
    whole = risk
    if not at_rest(kind, q):
        whole[TOUCH] += 0.5 * touched_now(
            numbers, counts, rows, places, slots, near, pool, odds, tally, 0, tally[0], q, tick
        )
    return risk_of(odds, tally, whole)


@ti.func
def least_braking_risk(
    kind: ti.template(),
    arrival: ti.template(),
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    braking: ti.template(),
    robot,
    rows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
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
                kind, arrival, spans, numbers, counts, robot, rows, places, slots, near, pool,
                odds, tally, q, tick, control_of(braking, b), 0.0, -1, least, risk,
            )  # fmt: skip
            chance = risk_of(odds, tally, whole)
            # one that was not followed to its end is worse already
            if chance < least:
                least = chance
                best = b
    return least, best


@ti.func
def printed_chance(
    arrival: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    rows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    q,
    tick,
):
    """Eqs. 14 and 17 as printed: the greatest over the discs of the least over the objects. What is
    hidden is one object more."""
    greatest = 0.0
    for d in range(counts[5]):
        p = disc_at(numbers, d, q)
        ticks = arrival_at(arrival, counts, numbers[0], p[0], p[1])
        least = hidden_chance(odds, tally, needed_share(ticks, tick, odds[SCANNED]))
        for n in range(tally[0]):
            least = ti.min(
                least, touch_chance(rows, places, slots, near, pool, odds, tally, n, p, tick)
            )
        greatest = ti.max(greatest, least)
    return greatest


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
    paper: ti.template(),  # eqs. 11, 12, 14 and 17 as printed
    arrival: Arrival,  # [J, I]
    spans: Spans,  # [F]
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
    braking: Table,  # [B, 3]
    rows: Table,
    places: Links,
    slots: Links,
    near: Table,
    pool: Numbers,
    odds: Numbers,
    tally: Counts,
    poses: Table,  # [N, 7]
    ticks: Counts,  # [N]
    # out
    chance: Numbers,  # [N]: least over the braking set of the risk on the way to rest
    control: Counts,  # [N]: which one that is
):
    for n in range(poses.shape[0]):
        robot = robot_of(numbers)
        start = pose_in(poses, n)
        if ti.static(paper):
            chance[n] = 1e30
            for b in range(counts[6]):
                q = start
                tick = ticks[n]
                product = 1.0
                going = True
                while going:
                    product *= printed_chance(
                        arrival, numbers, counts, rows, places, slots, near, pool, odds, tally, q,
                        tick,
                    )  # fmt: skip
                    going = not at_rest(kind, q)
                    if going:
                        q = step(kind, robot, q, control_of(braking, b), 0.0, numbers[1])
                        tick += counts[4]
                if product < chance[n]:
                    chance[n] = product
                    control[n] = b
        else:
            risk = risk_begin(
                kind, numbers, counts, rows, places, slots, near, pool, odds, tally, start, ticks[n]
            )
            least, best = least_braking_risk(
                kind, arrival, spans, numbers, counts, braking, robot, rows, places, slots, near,
                pool, odds, tally, start, ticks[n], risk,
            )  # fmt: skip
            chance[n] = least
            control[n] = best


@kernel
def path_risk(
    # in
    kind: ti.template(),
    paper: ti.template(),  # eqs. 12, 14 and 17 as printed
    share: ti.i32,  # indices of a loop that one thread is handed at a time
    arrival: Arrival,  # [J, I]
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
    rows: Table,
    places: Links,
    slots: Links,
    near: Table,
    pool: Numbers,
    odds: Numbers,
    tally: Counts,
    poses: Table,  # [M, 7], at most a sample apart
    ticks: Counts,  # [M]
    # out
    touch: Numbers,  # [N]: chance that each object touches the robot
    chance: Numbers,  # [3]: that any of them does, that something hidden does, that anything does
):
    """The risk of following a path while it moves; printed: the last of `chance` alone."""
    for index in range(tally[0] * share):
        if index % share == 0:
            n = index // share
            robot = robot_of(numbers)
            total = 0.0
            before = 0.0
            for m in range(poses.shape[0]):
                q = pose_in(poses, m)
                after = 0.0
                if m + 1 < poses.shape[0]:
                    if not (at_rest(kind, q) and at_rest(kind, pose_in(poses, m + 1))):
                        after = 0.5e-3 * (ticks[m + 1] - ticks[m])
                if (before > 0.0) != (after > 0.0):
                    total += 0.5 * touched_now(
                        numbers, counts, rows, places, slots, near, pool, odds, tally, n, n + 1, q,
                        ticks[m],
                    )  # fmt: skip
                if before + after > 0.0:
                    total += flow_about(
                        kind, numbers, counts, robot, rows, places, slots, near, pool, odds, tally,
                        n, n + 1, q, ticks[m], before, after,
                    )  # fmt: skip
                before = after
            touch[n] = ti.min(total, 1.0)
    ti.loop_config(serialize=True)
    for _ in range(1):
        none = ti.max(1.0 - odds[4], 0.0)
        for n in range(tally[0]):
            none *= 1.0 - touch[n]
        need = NO_NEED
        product = 1.0
        for m in range(poses.shape[0]):
            q = pose_in(poses, m)
            if ti.static(paper):
                product *= printed_chance(
                    arrival, numbers, counts, rows, places, slots, near, pool, odds, tally, q,
                    ticks[m],
                )  # fmt: skip
            elif m + 1 < poses.shape[0]:
                ahead = pose_in(poses, m + 1)
                if not (at_rest(kind, q) and at_rest(kind, ahead)):
                    need = way_need(arrival, numbers, counts, odds, q, ahead, ticks[m], need)
        hidden = hidden_chance(odds, tally, need)
        chance[0] = 1.0 - none
        chance[1] = hidden
        chance[2] = 1.0 - none * (1.0 - hidden)
        if ti.static(paper):
            chance[2] = product


@kernel
def layer_chances(
    # in
    arrival: Arrival,  # [J, I]
    rows: Table,
    places: Links,
    slots: Links,
    near: Table,
    pool: Numbers,
    odds: Numbers,
    tally: Counts,
    corner_i: ti.i32,
    corner_j: ti.i32,
    cell: ti.f32,
    begin: ti.f32,  # of the layer, and its end [ticks]
    end: ti.f32,
    looks: ti.i32,  # moments at which a layer is looked at, no more than a sample apart
    # out
    chances: Table,  # [J, I]
):
    """The chance that anything touches a robot disc that stays in a cell in [begin, end)."""
    for j, i in chances:
        p = vec2((i + corner_i + 0.5) * cell, (j + corner_j + 0.5) * cell)
        still = vec2(0.0)
        none = ti.max(1.0 - odds[4], 0.0)
        for n in range(tally[0]):
            total = 0.0
            piece = (end - begin) / looks
            for look in range(looks + 1):
                tick = begin + look * piece
                before = ti.select(look > 0, 0.5e-3 * piece, 0.0)
                after = ti.select(look < looks, 0.5e-3 * piece, 0.0)
                if look == 0 or look == looks:
                    total += 0.5 * touch_chance(
                        rows, places, slots, near, pool, odds, tally, n, p, tick
                    )
                total += touch_flow(
                    rows, places, slots, near, pool, odds, tally, n, p, still, tick, before, after
                )
            total += odds[2] * 1e-3 * (end - begin)
            none *= 1.0 - ti.min(total, 1.0)
        # a layer does not hold its end
        last = ti.cast(ti.ceil(end - 1e-3), ti.i32) - 1
        need = needed_share(ti.cast(arrival[j, i], ti.i32), last, odds[SCANNED])
        chances[j, i] = 1.0 - none * (1.0 - hidden_chance(odds, tally, need))
