"""What risk makes of the tree: which children are too risky to be in it, and what the others weigh.

Of a child that is clear of what is there for sure, the risk is that of the whole plan: up to the
parent, along the primitive, and on to rest by a braking control (eqs. 11 and 12). The first control
that is allowed is taken: its risk bounds the least one.
"""

import taichi as ti

from passpmp_ti.kernels.check import brakes_clear, control_of, free_steps, robot_of
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
    speed_of,
    step,
)
from passpmp_ti.kernels.risk import (
    flow_about,
    hidden_chance,
    pose_in,
    risk_begin,
    touched_now,
    way_need,
)
from passpmp_ti.kernels.spans import Spans

Arrival = ti.types.ndarray(dtype=ti.u16, ndim=2)
Counts = ti.types.ndarray(dtype=ti.i32, ndim=1)
Links = ti.types.ndarray(dtype=ti.i32, ndim=2)
Numbers = ti.types.ndarray(dtype=ti.f32, ndim=1)
Table = ti.types.ndarray(dtype=ti.f32, ndim=2)
PARENT, TICK = 0, 3
"""Of a node's link, see kernels/tree.py."""
WEIGHT = 5
"""Of a node's cost: w_ps, see there."""
TOUCH, NEED, W_PS = 9, 10, 11
"""Of a child, see there."""
OUT = 1e-3
"""[m] for what f32 sums may be short."""


@ti.func
def need_along(
    kind: ti.template(),
    hidden: ti.template(),
    hidden_spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    robot,
    odds: ti.template(),
    start,
    start_tick,
    control,
    direction,
    steps,
    fastest,
    need,
):
    """The least of `need` and of what a motion needs, see kernels/risk.py."""
    q = start
    tick = start_tick
    least = need
    free = 0
    level = 2
    k = 0
    while k < steps and least >= 0.0:
        if free == 0:
            free, level = free_steps(
                hidden_spans, numbers, counts, q, fastest, 0.0, tick, 2 * (steps - k) + 2, level
            )
        ahead = step(kind, robot, q, control, direction, numbers[1])
        if free > 0:
            free -= 1
        else:
            if not (at_rest(kind, q) and at_rest(kind, ahead)):
                least = way_need(hidden, numbers, counts, odds, q, ahead, tick, least)
            free += 1
        q = ahead
        tick += counts[4]
        k += 1
    return least


@ti.func
def comes_near(near: ti.template(), odds: ti.template(), tally: ti.template(), n, x, y, way, tick, end):
    """Whether object n can be near a disc of radius `way` about (x, y) in [tick, end]."""
    first = ti.cast(ti.max((tick - odds[0]) * odds[1], 0.0), ti.i32)
    last = ti.min(ti.cast(ti.max((end - odds[0]) * odds[1], 0.0), ti.i32), tally[2] - 1)
    found = False
    k = ti.min(first, tally[2] - 1)
    while k <= last and not found:
        at = n * tally[2] + k
        dx = near[at, 0] - x
        dy = near[at, 1] - y
        reach = near[at, 2] + way
        found = dx * dx + dy * dy < reach * reach
        k += 1
    return found


@ti.func
def touch_along(
    kind: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    robot,
    windows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    n,
    start,
    start_tick,
    control,
    direction,
    steps,
    most,
):
    """What object n adds to TOUCH along a motion, followed until that is more than `most`; see
    kernels/risk.py.

    Rests begin and end what is counted: there, half the chance to be touching is added.
    """
    q = start
    tick = start_tick
    total = 0.0
    before = 0.0
    k = 0
    going = True
    while going:
        ahead = q
        taken = 0
        moves = False
        while taken < tally[4] and k < steps and not (moves and at_rest(kind, ahead)):
            following = step(kind, robot, ahead, control, direction, numbers[1])
            moves = moves or not (at_rest(kind, ahead) and at_rest(kind, following))
            ahead = following
            taken += 1
            k += 1
        after = 0.0
        if moves:
            after = 0.5 * taken * numbers[1]
        if at_rest(kind, q) and (before > 0.0) != (after > 0.0):
            total += 0.5 * touched_now(
                numbers, counts, windows, places, slots, near, pool, odds, tally, n, n + 1, q, tick
            )
        if before + after > 0.0:
            total += flow_about(
                kind, numbers, counts, robot, windows, places, slots, near, pool, odds, tally, n,
                n + 1, q, tick, before, after,
            )  # fmt: skip
        before = after
        q = ahead
        tick += taken * counts[4]
        going = taken > 0 and total <= most
    return total


@kernel
def weigh_children(
    # in
    kind: ti.template(),
    share: ti.template(),  # indices that one thread is handed at a time, see device.share
    arrival: Arrival,  # [J, I] of what is there for sure
    spans: Spans,
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
    braking: Table,  # [B, 3]
    controls: Table,  # [U, 3]
    hidden: Arrival,  # [J, I], this and the next ones: see kernels/risk.py
    hidden_spans: Spans,
    windows: Table,
    places: Links,
    slots: Links,
    near: Table,
    pool: Numbers,
    odds: Numbers,
    tally: Counts,
    allowed: ti.f32,  # greatest risk of a plan
    allowed_rate: ti.f32,  # and for each second of it [1/s]
    first: ti.i32,  # nodes [first, last) are the parents
    last: ti.i32,
    steps: ti.i32,
    pose: Table,
    link: Links,
    risk: Table,  # [cap, 2] TOUCH and NEED of the parents' plans
    # in / out
    child: Table,  # [M, 12]
    child_proof: Counts,  # [M]
):
    """Refuse children whose plans are too risky; `child_proof` then is the control that is allowed."""
    per_parent = counts[7]
    children = (last - first) * per_parent
    for index in range(children * share):
        m = index // share
        if index % share == 0 and child_proof[m] > 0:
            robot = robot_of(numbers)
            parent = first + m // per_parent
            q = pose_in(pose, parent)
            tick = link[parent, TICK]
            elapsed = (tick - link[0, TICK]) * numbers[1] / counts[4]
            touch = risk[parent, 0]
            need = risk[parent, 1]
            proof = 0
            b = -1
            while b < counts[6]:
                control = control_of(controls, m % per_parent)
                direction = heading_for(kind, q)
                count = steps
                clear = True
                # no robot gains more in the time that is left
                gain = ti.max(ti.abs(control[1]), ti.abs(control[2]))
                if ti.static(kind == CAR):
                    gain = ti.abs(control[1])
                if b >= 0:
                    control = control_of(braking, b)
                    direction = 0.0
                    count = braking_steps(kind, q, control, numbers[1])
                    gain = 0.0
                    clear = brakes_clear(
                        kind, arrival, spans, numbers, counts, robot, q, tick, control
                    )
                seconds = count * numbers[1]
                fastest = ti.min(speed_of(kind, q) + gain * seconds, robot[0])
                bound = allowed
                if b >= 0:
                    bound = ti.min(allowed, allowed_rate * (elapsed + seconds))
                if clear:
                    least = need_along(
                        kind, hidden, hidden_spans, numbers, counts, robot, odds, q, tick, control,
                        direction, count, fastest, need,
                    )  # fmt: skip
                    unhidden = 1.0 - hidden_chance(odds, tally, least)
                    total = touch
                    way = fastest * seconds + numbers[18] + OUT
                    n = 0
                    while n < tally[0] and 1.0 - (1.0 - total) * unhidden <= bound:
                        if comes_near(
                            near, odds, tally, n, q[X], q[Y], way, tick, tick + count * counts[4]
                        ):
                            total += touch_along(
                                kind, numbers, counts, robot, windows, places, slots, near, pool,
                                odds, tally, n, q, tick, control, direction, count, bound - total,
                            )  # fmt: skip
                        else:
                            total += counts[5] * odds[2] * seconds
                        n += 1
                    chance = 1.0 - (1.0 - ti.min(total, 1.0)) * unhidden
                    if b >= 0 and chance <= bound:
                        proof = b + 1
                        child[m, W_PS] = 1.0 / (1.0 - chance)
                        b = counts[6]
                    elif b < 0 and chance <= bound:
                        touch = total
                        need = least
                        child[m, TOUCH] = total
                        child[m, NEED] = least
                        for r in ti.static(range(7)):
                            q[r] = child[m, r]
                        tick += steps * counts[4]
                        elapsed += seconds
                    elif b < 0:
                        b = counts[6]
                b += 1
            child_proof[m] = proof


@kernel
def begin_risk(
    # in
    kind: ti.template(),
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
    windows: Table,
    places: Links,
    slots: Links,
    near: Table,
    pool: Numbers,
    odds: Numbers,
    tally: Counts,
    pose: Table,  # [>= 1, 7], the root first
    tick: ti.i32,
    # out
    risk: Table,  # [>= 1, 2]
):
    """The risk with which the root begins."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        begun = risk_begin(
            kind, numbers, counts, windows, places, slots, near, pool, odds, tally,
            pose_in(pose, 0), tick,
        )  # fmt: skip
        risk[0, 0] = begun[0]
        risk[0, 1] = begun[1]


@kernel
def multiply_weights(
    # in
    count: ti.i32,  # nodes in the tree
    link: Links,  # [>= count, 8]
    chance: Numbers,  # [count] P_ICS of each node
    # in / out
    cost: Table,  # [>= count, 6]
):
    """w_ps of eqs. 9 and 10 as printed: the product of P_ICS over the states of the plan."""
    for n in range(count):
        product = 1.0
        at = n
        while at >= 0:
            product *= chance[at]
            at = link[at, PARENT]
        cost[n, WEIGHT] = product
