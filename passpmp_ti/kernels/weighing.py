"""What risk makes of the tree: which nodes are too risky to be in it, and what the others weigh."""

import taichi as ti

from passpmp_ti.kernels.check import brakes_clear, control_of
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.motion import at_rest, braking_steps
from passpmp_ti.kernels.risk import pose_in, risk_along, risk_begin, risk_of

Counts = ti.types.ndarray(dtype=ti.i32, ndim=1)
Links = ti.types.ndarray(dtype=ti.i32, ndim=2)
Numbers = ti.types.ndarray(dtype=ti.f32, ndim=1)
Table = ti.types.ndarray(dtype=ti.f32, ndim=2)
PARENT = 0
"""Of a node's link, see kernels/tree.py."""
WEIGHT = 5
"""Of a node's cost: w_ps, see there."""


@ti.func
def borne_brake(
    kind: ti.template(),
    arrival: ti.template(),
    spans: ti.template(),
    hidden: ti.template(),
    hidden_spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    braking: ti.template(),
    robot,
    windows: ti.template(),
    places: ti.template(),
    slots: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    q,
    tick,
    risk,
    elapsed,
    allowed,
    allowed_rate,
):
    """(1 + index of the braking control of least risk from q, that risk), 0 where none is allowed.

    The risk is that of the whole plan: up to q, where it is `risk` after `elapsed` seconds, and on
    to rest (eqs. 11 and 12). A control counts only if it brakes clear of what is there for sure.
    """
    proof = 0
    least = allowed
    b = 0
    while b < counts[6]:
        control = control_of(braking, b)
        seconds = elapsed + braking_steps(kind, q, control, numbers[1]) * numbers[1]
        bound = ti.min(allowed, allowed_rate * seconds)
        if brakes_clear(kind, arrival, spans, numbers, counts, robot, q, tick, control):
            whole, _, _ = risk_along(
                kind, hidden, hidden_spans, numbers, counts, robot, windows, places, slots, near,
                pool, odds, tally, q, tick, control, 0.0, -1, least, risk,
            )  # fmt: skip
            chance = risk_of(odds, tally, whole)
            # equal risks: the first control; what is too much for its own time is for any
            if chance <= bound and (proof == 0 or chance < least):
                proof = b + 1
                least = chance
        b += 1
        if at_rest(kind, q):
            b = counts[6]
    return proof, least


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
