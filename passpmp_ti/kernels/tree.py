"""Growing one level of the tree: Algorithm 2, every child of a level in parallel.

Nodes are rows of flat arrays, parents before children, siblings side by side.

    pose [cap, 7] f32: see kernels/motion.py
    link [cap, 8] i32: 0 parent, 1 control, 2 steps of the primitive, 3 tick, 4 braking control
        that proves the node, 5 first child, 6 number of children, 7 what the node is
    cost [cap, 5] f32: 0 integral of the guide along the plan to the node, 1 guide at the node,
        2 integral along the braking that proves the node, 3 guide at its end, 4 its duration [s]
"""

import taichi as ti

from passpmp_ti.kernels.check import (
    Arrival,
    Counts,
    Numbers,
    Table,
    control_of,
    proving_brake,
    robot_of,
    way_clear,
)
from passpmp_ti.kernels.guide import guide_at
from passpmp_ti.kernels.motion import C, S, X, Y, at_rest, heading_for, pose7, step

GROWN, BRAKED = 0, 1
"""What a node is: the end of a primitive, or the rest that a braking trajectory leads to."""

PARENT, CONTROL, STEPS, TICK, PROOF, FIRST, CHILDREN, WHAT = range(8)
SAMPLES = 4  # of the guide along a primitive
BRAKING_PACE = 5  # steps between samples of the guide along a braking

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
def braking_cost(
    kind: ti.template(),
    guide: ti.template(),
    ahead: ti.template(),
    guide_frame: ti.template(),
    numbers: ti.template(),
    robot,
    start,
    control,
):
    """(integral of the guide along a braking, steps it takes, where it ends)."""
    q = start
    taken = 0
    spent = 0.0
    while not at_rest(kind, q):
        q = step(kind, robot, q, control, 0.0, numbers[1])
        taken += 1
        if taken % BRAKING_PACE == 0:
            spent += guide_at(guide, ahead, guide_frame, q[X], q[Y], q[C], q[S]) * BRAKING_PACE
    spent += guide_at(guide, ahead, guide_frame, q[X], q[Y], q[C], q[S]) * (taken % BRAKING_PACE)
    return spent * numbers[1], taken, q


@ti.kernel
def grow_level(
    # in
    kind: ti.template(),
    arrival: Arrival,  # [J, I]
    guide: ti.types.ndarray(dtype=ti.f32, ndim=2),
    ahead: ti.types.ndarray(dtype=ti.f32, ndim=3),
    guide_frame: Numbers,  # [11]
    numbers: Numbers,  # [18]
    counts: Counts,  # [8]
    braking: Table,  # [B, 3]
    controls: Table,  # [U, 3]
    first: ti.i32,  # nodes [first, last) are this level's parents
    last: ti.i32,
    steps: ti.i32,
    # in / out
    pose: Table,
    link: Links,
    cost: Table,
    # scratch
    child_pose: Table,  # [M, 7]
    child_proof: Counts,  # [M]: 1 + braking control, 0: not safe
    child_cost: Table,  # [M, 2]
    # out
    grown: Counts,  # [2]: nodes in the tree now, parents that found no room
):
    per_parent = counts[7]
    capacity = pose.shape[0]
    for m in range((last - first) * per_parent):
        parent = first + m // per_parent
        proof = 0
        if link[parent, WHAT] == GROWN:
            robot = robot_of(numbers)
            q = pose_of(pose, parent)
            tick = link[parent, TICK]
            control = control_of(controls, m % per_parent)
            direction = heading_for(kind, q)
            clear = True
            spent = 0.0
            pace = ti.max(steps // SAMPLES, 1)
            resting = at_rest(kind, q)
            for k in range(steps):
                if clear:
                    before = q
                    q = step(kind, robot, q, control, direction, numbers[1])
                    still = at_rest(kind, q)
                    # waiting is not checked, leaving is
                    if not (resting and still):
                        clear = way_clear(arrival, numbers, counts, before, q, tick)
                    tick += counts[4]
                    resting = still
                    if (k + 1) % pace == 0 or k + 1 == steps:
                        span = pace
                        if (k + 1) % pace != 0:
                            span = steps % pace
                        spent += (
                            guide_at(guide, ahead, guide_frame, q[X], q[Y], q[C], q[S])
                            * span
                            * numbers[1]
                        )
            if clear:
                proof = proving_brake(kind, arrival, numbers, counts, braking, robot, q, tick)
                store_pose(child_pose, m, q)
                child_cost[m, 0] = cost[parent, 0] + spent
                child_cost[m, 1] = guide_at(guide, ahead, guide_frame, q[X], q[Y], q[C], q[S])
        child_proof[m] = proof

    # Slots are given in order, by one thread: the same tree on every run.
    ti.loop_config(serialize=True)
    for _ in range(1):
        slot = last
        short = 0
        for parent in range(first, last):
            found = 0
            for k in range(per_parent):
                if child_proof[(parent - first) * per_parent + k] > 0:
                    found += 1
            if found == 0 and link[parent, WHAT] == GROWN:
                # no safe child: the braking trajectory that its own check proved, if it moves
                if link[parent, PROOF] >= 0 and not at_rest(kind, pose_of(pose, parent)):
                    found = -1
            room = ti.abs(found)
            if slot + room > capacity:
                short += 1
                found = 0
                room = 0
            link[parent, FIRST] = slot
            if found == 0:
                link[parent, FIRST] = -1
            link[parent, CHILDREN] = found
            slot += room
        grown[0] = slot
        grown[1] = short

    for parent in range(first, last):
        slot = link[parent, FIRST]
        if link[parent, CHILDREN] > 0:
            for k in range(per_parent):
                m = (parent - first) * per_parent + k
                if child_proof[m] > 0:
                    store_pose(pose, slot, pose_of(child_pose, m))
                    link[slot, PARENT] = parent
                    link[slot, CONTROL] = k
                    link[slot, STEPS] = steps
                    link[slot, TICK] = link[parent, TICK] + steps * counts[4]
                    link[slot, PROOF] = child_proof[m] - 1
                    link[slot, FIRST] = -1
                    link[slot, CHILDREN] = 0
                    link[slot, WHAT] = GROWN
                    cost[slot, 0] = child_cost[m, 0]
                    cost[slot, 1] = child_cost[m, 1]
                    spent, taken, rest = braking_cost(
                        kind,
                        guide,
                        ahead,
                        guide_frame,
                        numbers,
                        robot_of(numbers),
                        pose_of(pose, slot),
                        control_of(braking, link[slot, PROOF]),
                    )
                    cost[slot, 2] = spent
                    cost[slot, 3] = guide_at(
                        guide, ahead, guide_frame, rest[X], rest[Y], rest[C], rest[S]
                    )
                    cost[slot, 4] = taken * numbers[1]
                    slot += 1
        elif link[parent, CHILDREN] < 0:
            link[parent, CHILDREN] = 1
            spent, taken, rest = braking_cost(
                kind,
                guide,
                ahead,
                guide_frame,
                numbers,
                robot_of(numbers),
                pose_of(pose, parent),
                control_of(braking, link[parent, PROOF]),
            )
            store_pose(pose, slot, rest)
            link[slot, PARENT] = parent
            link[slot, CONTROL] = link[parent, PROOF]
            link[slot, STEPS] = taken
            link[slot, TICK] = link[parent, TICK] + taken * counts[4]
            link[slot, PROOF] = 0
            link[slot, FIRST] = -1
            link[slot, CHILDREN] = 0
            link[slot, WHAT] = BRAKED
            cost[slot, 0] = cost[parent, 0] + spent
            cost[slot, 1] = guide_at(guide, ahead, guide_frame, rest[X], rest[Y], rest[C], rest[S])
            cost[slot, 2] = 0.0
            cost[slot, 3] = cost[slot, 1]
            cost[slot, 4] = 0.0
