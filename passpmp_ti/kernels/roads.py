"""Roads: the ways of primitives and brakings, worked out once for all nodes that move alike.

How a robot moves depends on neither its place nor its heading: nodes of one gait, that is with the
same two speeds (a, b), have the same ways before them, seen from where they are. A level of a tree
has many nodes of few gaits.

    roads i32 [P, 5]: 0 row of its first sample, 1 time steps in which it moves, 2 row of its
        sections, 3 their depth, 4 gait at its end. Road g U + u is the primitive of gait g under
        control u; from `number` U on, those of the gaits at their ends under the braking controls.
    rows f32 [R, 4]: samples (x, y, cos, sin) after each time step, the start among them; then its
        sections. Section 0: turn, speeds a and b at its end. Section 1 is all of the road, section
        2 h and 2 h + 1 the halves of section h: 0, 1 a middle, 2 the level of spans whose discs
        hold the section about it.

Samples differ from those that are integrated from where the node is by the rounding of sums and of
the gaits that are taken for one: less than a tenth of the millimetre that
`settings.integration_margin` keeps for it.
"""

import taichi as ti

from passpmp_ti.kernels.check import (
    Counts,
    Numbers,
    Table,
    control_of,
    robot_of,
)
from passpmp_ti.kernels.gaits import gait_for
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.motion import (
    THETA,
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
    step,
)
from passpmp_ti.kernels.spans import LEVELS, level_for

FINEST = 4
"""Time steps of the shortest sections."""
DOOMS = 3
"""Discs that tell at once of all brakings of a gait."""

Links = ti.types.ndarray(dtype=ti.i32, ndim=2)


@ti.func
def depth_for(steps):
    depth = 0
    while (FINEST << depth) < steps:
        depth += 1
    return depth


@ti.func
def rows_for(steps):
    """Rows that a road takes."""
    return steps + 1 + (2 << depth_for(steps))


@ti.func
def setting_off_with(gaits: ti.template(), gait):
    """A robot of a gait, as seen from where it is."""
    q = pose7(0.0)
    q[C] = 1.0
    q[A] = gaits[gait, 0]
    q[B] = gaits[gait, 1]
    return q


@ti.func
def lay_sample(rows: ti.template(), row, q):
    rows[row, 0] = q[X]
    rows[row, 1] = q[Y]
    rows[row, 2] = q[C]
    rows[row, 3] = q[S]


@ti.func
def box_about(rows: ti.template(), numbers: ti.template(), counts: ti.template(), first, last):
    """(least x, least y, greatest x, greatest y) of the discs' centres at samples first to last."""
    low_x, low_y, high_x, high_y = 1e9, 1e9, -1e9, -1e9
    for row in range(first, last + 1):
        for d in range(counts[5]):
            x = rows[row, 0] + numbers[8 + d] * rows[row, 2]
            y = rows[row, 1] + numbers[8 + d] * rows[row, 3]
            low_x = ti.min(low_x, x)
            low_y = ti.min(low_y, y)
            high_x = ti.max(high_x, x)
            high_y = ti.max(high_y, y)
    return low_x, low_y, high_x, high_y


@ti.func
def lay_disc(rows: ti.template(), row, scale, low_x, low_y, high_x, high_y):
    """The disc about a box. Looks lie on straight ways between samples, so they are in it too."""
    rows[row, 0] = 0.5 * (low_x + high_x)
    rows[row, 1] = 0.5 * (low_y + high_y)
    dx = high_x - low_x
    dy = high_y - low_y
    rows[row, 2] = ti.cast(level_for(0.5 * ti.sqrt(dx * dx + dy * dy), scale), ti.f32)


@ti.func
def lay_sections(
    rows: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    samples,
    steps,
    sections,
    depth,
):
    """Boxes of the shortest sections from their samples, of the others from their halves; then
    discs in place of the boxes."""
    for n in range(1, 2 << depth):
        h = (2 << depth) - n
        if h >= 1 << depth:
            p = h - (1 << depth)
            low_x, low_y, high_x, high_y = box_about(
                rows, numbers, counts, samples + (steps * p >> depth),
                samples + (steps * (p + 1) >> depth),
            )  # fmt: skip
            rows[sections + h, 0] = low_x
            rows[sections + h, 1] = low_y
            rows[sections + h, 2] = high_x
            rows[sections + h, 3] = high_y
        else:
            low = sections + 2 * h
            for r in ti.static(range(2)):
                rows[sections + h, r] = ti.min(rows[low, r], rows[low + 1, r])
                rows[sections + h, 2 + r] = ti.max(rows[low, 2 + r], rows[low + 1, 2 + r])
    for h in range(1, 2 << depth):
        row = sections + h
        lay_disc(rows, row, numbers[0], rows[row, 0], rows[row, 1], rows[row, 2], rows[row, 3])


@ti.func
def lay_dooms(
    rows: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    roads: ti.template(),
    first,
):
    """Discs in which the robot is in one time step, whichever way it brakes: [3] that step."""
    shortest = roads[first, 1]
    for b in range(1, counts[6]):
        shortest = ti.min(shortest, roads[first + b, 1])
    for k in ti.static(range(DOOMS)):
        row = roads[first, 0] - DOOMS + k
        at = shortest >> (DOOMS - 1 - k)
        rows[row, 2] = ti.cast(LEVELS, ti.f32)
        if at > 0:
            low_x, low_y, high_x, high_y = 1e9, 1e9, -1e9, -1e9
            for b in range(counts[6]):
                sample = roads[first + b, 0] + at
                low_u, low_v, high_u, high_v = box_about(
                    rows, numbers, counts, sample - 1, sample
                )
                low_x = ti.min(low_x, low_u)
                low_y = ti.min(low_y, low_v)
                high_x = ti.max(high_x, high_u)
                high_y = ti.max(high_y, high_v)
            lay_disc(rows, row, numbers[0], low_x, low_y, high_x, high_y)
        rows[row, 3] = ti.cast(at, ti.f32)


@ti.func
def lay_primitive(
    kind: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    controls: ti.template(),
    gaits: ti.template(),
    steps,
    road,
    roads: ti.template(),
    rows: ti.template(),
):
    begin = road * rows_for(steps)
    sections = begin + steps + 1
    if begin + rows_for(steps) <= rows.shape[0]:
        robot = robot_of(numbers)
        control = control_of(controls, road % counts[7])
        q = setting_off_with(gaits, road // counts[7])
        direction = heading_for(kind, q)
        lay_sample(rows, begin, q)
        moving = 0
        resting = at_rest(kind, q)
        for k in range(steps):
            q = step(kind, robot, q, control, direction, numbers[1])
            lay_sample(rows, begin + k + 1, q)
            # waiting is not checked, and what waits goes on waiting
            if not (resting and at_rest(kind, q)):
                moving = k + 1
            resting = at_rest(kind, q)
        depth = depth_for(moving)
        roads[road, 0] = begin
        roads[road, 1] = moving
        roads[road, 2] = sections
        roads[road, 3] = depth
        rows[sections, 0] = q[THETA]
        rows[sections, 1] = q[A]
        rows[sections, 2] = q[B]
        lay_sections(rows, numbers, counts, begin, moving, sections, depth)


@ti.func
def lay_brakings(
    kind: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    braking: ti.template(),
    gaits: ti.template(),
    gait,
    first,
    roads: ti.template(),
    rows: ti.template(),
):
    """The roads of a gait under all braking controls, from road `first` on; they have their rows
    already."""
    robot = robot_of(numbers)
    for b in range(counts[6]):
        road = first + b
        begin = roads[road, 0]
        control = control_of(braking, b)
        q = setting_off_with(gaits, gait)
        lay_sample(rows, begin, q)
        moving = 0
        while begin + moving + 1 < roads[road, 2] and not at_rest(kind, q):
            q = step(kind, robot, q, control, 0.0, numbers[1])
            moving += 1
            lay_sample(rows, begin + moving, q)
        depth = depth_for(moving)
        roads[road, 1] = moving
        roads[road, 3] = depth
        roads[road, 4] = -1
        lay_sections(rows, numbers, counts, begin, moving, roads[road, 2], depth)
    lay_dooms(rows, numbers, counts, roads, first)


@kernel
def lay_roads(
    # in
    kind: ti.template(),
    share: ti.template(),  # indices that one thread is handed at a time, see device.share
    piece: ti.template(),  # gaits whose roads one thread lays in one go
    numbers: Numbers,
    counts: Counts,
    braking: Table,  # [B, 3]
    controls: Table,  # [U, 3]
    gaits: Table,  # [G, 2]
    number: ti.i32,  # of gaits
    steps: ti.i32,  # of the primitives
    # scratch
    slots: Counts,  # [a power of two, more than the gaits]
    # out
    roads: Links,  # [P, 5]
    rows: Table,  # [R, 4]
    ends: Table,  # [G, 2]: gaits at the primitives' ends
    laid: Counts,  # [1]: how many of them; -1: they find no room
):
    ways = number * counts[7]
    for index in range((number + piece - 1) // piece * share):
        if index % share == 0:
            first = index // share * piece * counts[7]
            for road in range(first, ti.min(first + piece * counts[7], ways)):
                lay_primitive(kind, numbers, counts, controls, gaits, steps, road, roads, rows)

    ti.loop_config(serialize=True)
    for slot in range(slots.shape[0]):
        slots[slot] = -1
    ti.loop_config(serialize=True)
    for _ in range(1):
        ending = 0
        begin = ways * rows_for(steps)
        p = 0
        fits = begin < rows.shape[0]
        while p < ways and fits:
            row = roads[p, 2]
            gait, ending_now = gait_for(
                kind, numbers, rows[row, 1], rows[row, 2], ending, ends, slots
            )
            if ending_now > ending:
                begin += DOOMS
                q = pose7(0.0)
                q[A] = rows[row, 1]
                q[B] = rows[row, 2]
                for b in range(counts[6]):
                    most = braking_steps(kind, q, control_of(braking, b), numbers[1])
                    road = ways + gait * counts[6] + b
                    roads[road, 0] = begin
                    roads[road, 2] = begin + most + 1
                    begin += rows_for(most)
            roads[p, 4] = gait
            ending = ending_now
            fits = gait >= 0 and begin < rows.shape[0]
            p += 1
        laid[0] = ending
        if not fits:
            laid[0] = -1

    for index in range((ti.max(laid[0], 0) + piece - 1) // piece * share):
        if index % share == 0:
            begin = index // share * piece
            for gait in range(begin, ti.min(begin + piece, laid[0])):
                first = ways + gait * counts[6]
                lay_brakings(kind, numbers, counts, braking, ends, gait, first, roads, rows)
