"""Growing one level of the tree: Algorithm 2, every child of a level in parallel.

Nodes are rows of flat arrays, parents before children, siblings side by side.

    pose [cap, 7] f32: see kernels/motion.py
    link [cap, 8] i32: 0 parent, 1 control, 2 steps of the primitive, 3 tick, 4 braking control
        that proves the node, 5 first child, 6 number of children, 7 what the node is
    cost [cap, 6] f32: 0 integral of the guide along the plan to the node, 1 guide at the node,
        2 integral along the braking that proves the node, 3 guide at its end, 4 its duration [s],
        5 w_ps of the plan that ends here (eqs. 8 and 9): 1 where no risk is taken
    risk [cap, 2] f32, where risk is weighed: what the motion to the node carries on, see
        kernels/risk.py

A level of few gaits for its nodes is grown along roads (kernels/roads.py), any other one by
integrating from each node.

A level is grown in chunks of parents, so that what is kept of the children between their check and
their place in the tree stays small whatever the tree's size.
"""

import taichi as ti

from passpmp_ti.kernels.along import placed, proving_road, road_clear, road_end
from passpmp_ti.kernels.check import (
    Arrival,
    Counts,
    Numbers,
    Table,
    control_of,
    free_steps,
    proving_brake,
    robot_of,
    way_clear,
)
from passpmp_ti.kernels.costs import BRAKING_SAMPLES, SAMPLES, braking_cost, cost_at, road_cost
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.motion import (
    CAR,
    C,
    S,
    X,
    Y,
    at_rest,
    heading_for,
    pose7,
    seen_from,
    setting_off,
    setting_out,
    speed_of,
    step,
)
from passpmp_ti.kernels.spans import Spans

CHECK, PLACE, BOTH = 1, 2, 3
"""Parts of the growth of a chunk: which children are safe, and where in the tree they go."""
GROWN, BRAKED = 0, 1
"""What a node is: the end of a primitive, or the rest that a braking trajectory leads to."""

PARENT, CONTROL, STEPS, TICK, PROOF, FIRST, CHILDREN, WHAT = range(8)
FEW = 256  # parents that are given their slots in one go

Links = ti.types.ndarray(dtype=ti.i32, ndim=2)


@ti.func
def pose_of(pose: ti.template(), n):
    q = pose7(0.0)
    for r in ti.static(range(7)):
        q[r] = pose[n, r]
    return q


@ti.func
def store_pose(pose: ti.template(), n, q):
    for r in ti.static(range(7)):
        pose[n, r] = q[r]


@ti.func
def driven_clear(
    kind: ti.template(),
    arrival: ti.template(),
    spans: ti.template(),
    guide: ti.template(),
    ahead: ti.template(),
    guide_frame: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    robot,
    start,
    start_tick,
    control,
    steps,
):
    """(whether a primitive from `start` touches nothing, its end, integral of the guide along it,
    guide at its end). Waiting is not checked, leaving is."""
    q = setting_off(start)
    tick = start_tick
    direction = heading_for(kind, q)
    towards = setting_out(kind, q, control)
    clear = True
    resting = at_rest(kind, q)
    free = 0
    level = 2
    spent = 0.0
    there = 0.0
    pace = ti.max((steps + SAMPLES - 1) // SAMPLES, 1)
    since = 0
    k = 0
    while clear and k < steps:
        if free == 0:
            # no robot gains more in the time that is left
            gain = ti.max(ti.abs(control[1]), ti.abs(control[2]))
            if ti.static(kind == CAR):
                gain = ti.abs(control[1])
            left = steps - k
            fastest = speed_of(kind, q) + gain * left * numbers[1]
            # as a braking it would cover half of the way that it covers at one speed
            free, level = free_steps(
                spans, numbers, counts, seen_from(start, q), ti.min(fastest, robot[0]), towards,
                tick, 2 * left, level,
            )  # fmt: skip
        before = q
        q = step(kind, robot, q, control, direction, numbers[1])
        if free > 0:
            free -= 1
        else:
            still = at_rest(kind, q)
            if not (resting and still):
                clear = way_clear(
                    arrival, numbers, counts, seen_from(start, before), seen_from(start, q), tick
                )
            free += 1
        resting = at_rest(kind, q)
        tick += counts[4]
        k += 1
        since += 1
        if since == pace or k == steps:
            there = cost_at(guide, ahead, guide_frame, seen_from(start, q))
            spent += there * since * numbers[1]
            since = 0
    return clear, seen_from(start, q), spent, there


@ti.func
def block_begin(b, blocks, first, last):
    """First parent of a block."""
    return first + ti.cast(ti.cast(b, ti.i64) * (last - first) // blocks, ti.i32)


@ti.func
def room_for(
    kind: ti.template(), pose: ti.template(), link: ti.template(), child_proof: ti.template(),
    parent, first, per_parent,
):
    """How many slots a parent's children take; -1: one, for the braking that its check proved."""
    found = 0
    for k in range(per_parent):
        if child_proof[(parent - first) * per_parent + k] > 0:
            found += 1
    if found == 0 and link[parent, WHAT] == GROWN:
        # no safe child: it brakes, if it moves
        if link[parent, PROOF] >= 0 and not at_rest(kind, pose_of(pose, parent)):
            found = -1
    return found


@kernel
def grow_level(
    # in
    kind: ti.template(),
    by_roads: ti.template(),  # whether `roads` hold the ways of the parents' gaits
    share: ti.template(),  # indices that one thread is handed at a time, see device.share
    grain: ti.template(),  # children that one thread checks in one go
    part: ti.template(),  # CHECK, PLACE, or BOTH: between them risks are weighed (kernels/weighing)
    arrival: Arrival,  # [J, I]
    spans: Spans,  # [F]
    guide: ti.types.ndarray(dtype=ti.f32, ndim=2),
    ahead: ti.types.ndarray(dtype=ti.f32, ndim=3),
    guide_frame: Numbers,  # [11]
    numbers: Numbers,
    counts: Counts,
    braking: Table,  # [B, 3]
    controls: Table,  # [U, 3]
    first: ti.i32,  # nodes [first, last) are this chunk's parents
    last: ti.i32,
    slot: ti.i32,  # nodes in the tree so far
    steps: ti.i32,
    number: ti.i32,  # of the parents' gaits
    roads: Links,  # [P, 5]
    rows: Table,  # [R, 4]
    # in / out
    pose: Table,
    link: Links,
    cost: Table,
    gait: Counts,  # [cap], of parents and children where `by_roads`
    risk: Table,  # [cap, 2], of parents and children where `weighed`
    # scratch
    child: Table,  # [M, 12] pose, integral of the guide, guide at the end, risk carried on, w_ps
    child_proof: Counts,  # [M]: 1 + braking control, 0: not safe
    block: Counts,  # [blocks + 1] slots that blocks of parents take, then where they begin
    # out
    grown: Counts,  # [2]: nodes in the tree now, parents of this chunk that found no room
):
    per_parent = counts[7]
    capacity = pose.shape[0]
    blocks = ti.min(block.shape[0] - 1, 1 + (last - first) // FEW)
    children = (last - first) * per_parent
    if ti.static(part != PLACE):
        for index in range((children + grain - 1) // grain * share):
            if index % share == 0:
                begin = index // share * grain
                for m in range(begin, ti.min(begin + grain, children)):
                    parent = first + m // per_parent
                    proof = 0
                    if ti.static(by_roads):
                        if link[parent, WHAT] == GROWN:
                            tick = link[parent, TICK]
                            road = gait[parent] * per_parent + m % per_parent
                            x, y = pose[parent, X], pose[parent, Y]
                            c, s = pose[parent, C], pose[parent, S]
                            if road_clear(
                                arrival, spans, numbers, counts, roads, rows, road, x, y, c, s, tick
                            ):
                                q = placed(rows, roads[road, 0] + steps, x, y, c, s)
                                proof = proving_road(
                                    arrival, spans, numbers, counts, roads, rows,
                                    number * per_parent + roads[road, 4] * counts[6],
                                    q[X], q[Y], q[C], q[S], tick + steps * counts[4],
                                )  # fmt: skip
                    elif link[parent, WHAT] == GROWN:
                        robot = robot_of(numbers)
                        tick = link[parent, TICK]
                        clear, q, spent, there = driven_clear(
                            kind, arrival, spans, guide, ahead, guide_frame, numbers, counts, robot,
                            pose_of(pose, parent), tick,
                            control_of(controls, m % per_parent), steps,
                        )  # fmt: skip
                        if clear:
                            proof = proving_brake(
                                kind, arrival, spans, numbers, counts, braking, robot, q,
                                tick + steps * counts[4],
                            )  # fmt: skip
                        if proof > 0:
                            store_pose(child, m, q)
                            child[m, 7] = cost[parent, 0] + spent
                            child[m, 8] = there
                    child_proof[m] = proof

    if ti.static(part != CHECK):
        # Slots go by the order of nodes, whoever counts them: the same tree on every run.
        for index in range(blocks * share):
            if index % share == 0:
                b = index // share
                end = block_begin(b + 1, blocks, first, last)
                taken = 0
                for parent in range(block_begin(b, blocks, first, last), end):
                    taken += ti.abs(room_for(kind, pose, link, child_proof, parent, first, per_parent))
                block[b] = taken
        ti.loop_config(serialize=True)
        for _ in range(1):
            begin = slot
            for b in range(blocks):
                taken = block[b]
                block[b] = begin
                begin += taken
            block[blocks] = begin
            grown[0] = begin
            grown[1] = 0
            if begin > capacity:
                # from the first parent that does not fit, none does
                b = blocks - 1
                while block[b] > capacity:
                    b -= 1
                end = block[b]
                parent = block_begin(b, blocks, first, last)
                full = False
                while not full:
                    room = ti.abs(room_for(kind, pose, link, child_proof, parent, first, per_parent))
                    if end + room > capacity:
                        full = True
                    else:
                        end += room
                        parent += 1
                grown[0] = end
                grown[1] = last - parent

        for index in range(blocks * share):
            if index % share == 0:
                b = index // share
                slot_now = block[b]
                end = block_begin(b + 1, blocks, first, last)
                for parent in range(block_begin(b, blocks, first, last), end):
                    found = room_for(kind, pose, link, child_proof, parent, first, per_parent)
                    room = ti.abs(found)
                    fits = found != 0 and slot_now + room <= capacity
                    link[parent, FIRST] = -1
                    link[parent, CHILDREN] = 0
                    if fits:
                        link[parent, FIRST] = slot_now
                        link[parent, CHILDREN] = room
                    if fits and found > 0:
                        at = slot_now
                        for k in range(per_parent):
                            m = (parent - first) * per_parent + k
                            if child_proof[m] > 0:
                                q = pose7(0.0)
                                spent, there, after, at_rest_cost, seconds = 0.0, 0.0, 0.0, 0.0, 0.0
                                if ti.static(by_roads):
                                    road = gait[parent] * per_parent + k
                                    start = pose_of(pose, parent)
                                    q = road_end(rows, roads, road, steps, start)
                                    spent, there = road_cost(
                                        guide, ahead, guide_frame, numbers, roads, rows, road, steps,
                                        SAMPLES, start, cost[parent, 1],
                                    )  # fmt: skip
                                    spent += cost[parent, 0]
                                    gait[at] = roads[road, 4]
                                    brake = number * per_parent + roads[road, 4] * counts[6]
                                    brake += child_proof[m] - 1
                                    seconds = roads[brake, 1] * numbers[1]
                                    after, at_rest_cost = road_cost(
                                        guide, ahead, guide_frame, numbers, roads, rows, brake,
                                        roads[brake, 1], BRAKING_SAMPLES, q, there,
                                    )  # fmt: skip
                                else:
                                    q = pose_of(child, m)
                                    spent = child[m, 7]
                                    there = child[m, 8]
                                    after, at_rest_cost, seconds = braking_cost(
                                        kind, guide, ahead, guide_frame, numbers, robot_of(numbers), q,
                                        there, control_of(braking, child_proof[m] - 1),
                                    )  # fmt: skip
                                store_pose(pose, at, q)
                                link[at, PARENT] = parent
                                link[at, CONTROL] = k
                                link[at, STEPS] = steps
                                link[at, TICK] = link[parent, TICK] + steps * counts[4]
                                link[at, PROOF] = child_proof[m] - 1
                                link[at, FIRST] = -1
                                link[at, CHILDREN] = 0
                                link[at, WHAT] = GROWN
                                cost[at, 0] = spent
                                cost[at, 1] = there
                                cost[at, 2] = after
                                cost[at, 3] = at_rest_cost
                                cost[at, 4] = seconds
                                cost[at, 5] = 1.0
                                if ti.static(part == PLACE):
                                    risk[at, 0] = child[m, 9]
                                    risk[at, 1] = child[m, 10]
                                    cost[at, 5] = child[m, 11]
                                at += 1
                    elif fits:
                        store_braking(
                            kind, guide, ahead, guide_frame, numbers, counts, braking, parent, slot_now,
                            pose, link, cost,
                        )  # fmt: skip
                    slot_now += room


@ti.func
def store_braking(
    kind: ti.template(),
    guide: ti.template(),
    ahead: ti.template(),
    guide_frame: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    braking: ti.template(),
    parent,
    at,
    pose: ti.template(),
    link: ti.template(),
    cost: ti.template(),
):
    """Put the rest that a parent's own braking leads to into slot `at`, its only child."""
    start = pose_of(pose, parent)
    control = control_of(braking, link[parent, PROOF])
    robot = robot_of(numbers)
    q = setting_off(start)
    taken = 0
    while not at_rest(kind, q):
        q = step(kind, robot, q, control, 0.0, numbers[1])
        taken += 1
    q = seen_from(start, q)
    store_pose(pose, at, q)
    spent, _, _ = braking_cost(
        kind, guide, ahead, guide_frame, numbers, robot, start, cost[parent, 1], control
    )
    there = cost_at(guide, ahead, guide_frame, q)
    link[at, PARENT] = parent
    link[at, CONTROL] = link[parent, PROOF]
    link[at, STEPS] = taken
    link[at, TICK] = link[parent, TICK] + taken * counts[4]
    link[at, PROOF] = 0
    link[at, FIRST] = -1
    link[at, CHILDREN] = 0
    link[at, WHAT] = BRAKED
    cost[at, 0] = cost[parent, 0] + spent
    cost[at, 1] = there
    cost[at, 2] = 0.0
    cost[at, 3] = there
    cost[at, 4] = 0.0
    cost[at, 5] = cost[parent, 5]  # the same motion as the parent's own plan


@kernel
def trail(
    # in
    link: Links,  # [cap, 8]
    node: ti.i32,
    # out
    rows: Links,  # [D, 9] node and its link, from `node` up to the root
) -> ti.i32:
    """How many rows were written: what of a tree on a device has to be known of one plan."""
    count = 0
    ti.loop_config(serialize=True)
    for _ in range(1):
        at = node
        while at >= 0 and count < rows.shape[0]:
            rows[count, 0] = at
            for r in ti.static(range(8)):
                rows[count, 1 + r] = link[at, r]
            count += 1
            at = link[at, PARENT]
    return count


@kernel
def plant(
    # in
    root_pose: Numbers,  # [7]
    root_link: Counts,  # [8]
    root_cost: Numbers,  # [6]
    # out
    pose: Table,
    link: Links,
    cost: Table,
):
    """Write the root into a tree on a device."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        for r in ti.static(range(7)):
            pose[0, r] = root_pose[r]
        for r in ti.static(range(8)):
            link[0, r] = root_link[r]
        for r in ti.static(range(6)):
            cost[0, r] = root_cost[r]
