"""What risk makes of the tree: which children are too risky to be in it, and what the others weigh.

Of a child that is clear of what is there for sure, the risk is that of the whole plan: up to the
parent, along the primitive, and on to rest by a braking control (eqs. 11 and 12). The first control
that is allowed is taken: its risk bounds the least one.
"""

import taichi as ti

from passpmp_ti.kernels.check import brakes_clear, control_of, robot_of
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.motion import at_rest, braking_steps, heading_for
from passpmp_ti.kernels.risk import pose_in, risk2, risk_along, risk_begin, risk_of
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
SHORTEST = 1.0
"""[s] Shorter plans are allowed as much risk as one of this length: nobody could set off else."""
TRIES, EARLY = 2, 0.75
"""Clear brakings that are weighed before a child is refused, and the share of its time before which
one that is too risky speaks for all. Of 178,000 children that were kept in three scenarios, 62 owed
it to a third braking; none to another than the first where that was refused before 0.88."""
GRAIN = 4
"""Children that one thread weighs in one go."""
CARRIED, W_PS = 9, 11
"""Of a child, see there."""


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
    layers: Numbers,
    grids: Table,
    begins: Links,
    starts: Counts,
    odds: Numbers,
    tally: Counts,
    allowed: ti.f32,  # greatest risk of a plan
    allowed_rate: ti.f32,  # and for each second of it [1/s]
    first: ti.i32,  # nodes [first, last) are the parents
    last: ti.i32,
    steps: ti.i32,
    pose: Table,
    link: Links,
    risk: Table,  # [cap, 2] what the parents' plans carry on, see kernels/risk.py
    # in / out
    child: Table,  # [M, 12]
    child_proof: Counts,  # [M]
):
    """Refuse children whose plans are too risky; `child_proof` becomes the allowed control."""
    per_parent = counts[7]
    children = (last - first) * per_parent
    for index in range((children + GRAIN - 1) // GRAIN * share):
        if index % share == 0:
            begin = index // share * GRAIN
            for m in range(begin, ti.min(begin + GRAIN, children)):
                if child_proof[m] > 0:
                    robot = robot_of(numbers)
                    parent = first + m // per_parent
                    q = pose_in(pose, parent)
                    tick = link[parent, TICK]
                    elapsed = (tick - link[0, TICK]) * numbers[1] / counts[4]
                    carried = risk2(risk[parent, 0], risk[parent, 1])
                    # the primitive first, then the braking controls in turn: those before the one
                    # that the check found are not clear
                    clear_one = child_proof[m] - 1
                    proof = 0
                    tried = -1
                    b = -1
                    while b < counts[6]:
                        control = control_of(controls, m % per_parent)
                        direction = heading_for(kind, q)
                        length = steps
                        seconds = 0.0
                        bound = allowed
                        clear = True
                        if b >= 0:
                            control = control_of(braking, b)
                            direction = 0.0
                            length = -1
                            seconds = braking_steps(kind, q, control, numbers[1]) * numbers[1]
                            whole_time = ti.max(elapsed + seconds, SHORTEST)
                            bound = ti.min(allowed, allowed_rate * whole_time)
                            if b > clear_one:
                                clear = brakes_clear(
                                    kind, arrival, spans, numbers, counts, robot, q, tick, control
                                )
                        chance = 1.0
                        whole = carried
                        early = False
                        if clear:
                            whole, _, until = risk_along(
                                kind, hidden, hidden_spans, numbers, counts, robot, layers, grids,
                                begins, starts, odds, tally, q, tick, control, direction, length,
                                bound, carried,
                            )  # fmt: skip
                            chance = risk_of(odds, tally, whole)
                            early = (until - tick) * numbers[1] < EARLY * seconds * counts[4]
                            tried += 1
                        if b >= 0 and chance <= bound:
                            proof = b + 1
                            child[m, W_PS] = 1.0 / (1.0 - chance)
                            b = counts[6]
                        elif b < 0 and chance <= bound:
                            carried = whole
                            child[m, CARRIED] = whole[0]
                            child[m, CARRIED + 1] = whole[1]
                            for r in ti.static(range(7)):
                                q[r] = child[m, r]
                            tick += steps * counts[4]
                            elapsed += steps * numbers[1]
                            b = clear_one - 1
                        elif b < 0 or early or tried == TRIES or at_rest(kind, q):
                            b = counts[6]  # no braking mends it
                        b += 1
                    child_proof[m] = proof


@kernel
def begin_risk(
    # in
    kind: ti.template(),
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
    layers: Numbers,
    grids: Table,
    begins: Links,
    starts: Counts,
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
            kind, numbers, counts, layers, grids, begins, starts, odds, tally, pose_in(pose, 0),
            tick,
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
