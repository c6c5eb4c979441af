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
    LATEST,
    Counts,
    Numbers,
    Table,
    control_of,
    robot_of,
    way_clear,
)
from passpmp_ti.kernels.motion import (
    CAR,
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
    sign,
    step,
)
from passpmp_ti.kernels.spans import LEVELS, level_for, span_about

FINEST = 4
"""Time steps of the shortest sections."""
DOOMS = 3
SAME = 5e-7
"""Speeds and angles that differ by less than this share of the greatest are taken for one."""

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
def key_of(value, greatest):
    """Equal for speeds that are taken for one. Rest is like nothing but rest, and forwards is
    unlike backwards."""
    rounded = ti.cast(ti.round(value / (SAME * greatest)), ti.i32)
    return 2 * rounded + ti.cast(sign(value), ti.i32)


@ti.func
def gait_for(
    kind: ti.template(), numbers: ti.template(), a, b, number, gaits: ti.template(),
    slots: ti.template(),
):
    """(gait of the speeds a and b, gaits now); -1 where there is no room for another."""
    greatest = numbers[2]
    if ti.static(kind == CAR):
        greatest = numbers[4]
    key_a = key_of(a, numbers[2])
    key_b = key_of(b, greatest)
    mask = slots.shape[0] - 1
    slot = (key_a * 73856093 ^ key_b * 19349663) & mask
    found = -1
    looking = True
    while looking:
        gait = slots[slot]
        if gait < 0:
            looking = False
            if number < gaits.shape[0]:
                slots[slot] = number
                gaits[number, 0] = a
                gaits[number, 1] = b
                found = number
                number += 1
        elif key_of(gaits[gait, 0], numbers[2]) == key_a:
            if key_of(gaits[gait, 1], greatest) == key_b:
                found = gait
                looking = False
        slot = (slot + 1) & mask
    return found, number


@ti.kernel
def sort_gaits(
    # in
    kind: ti.template(),
    numbers: Numbers,
    pose: Table,  # [cap, 7]
    first: ti.i32,  # nodes [first, last) are sorted
    last: ti.i32,
    # scratch
    slots: Counts,  # [a power of two, more than the gaits]
    # out
    gait: Counts,  # [cap]
    gaits: Table,  # [G, 2]: their speeds
) -> ti.i32:
    """How many gaits there are; -1: more than there is room for."""
    number = 0
    ti.loop_config(serialize=True)
    for slot in range(slots.shape[0]):
        slots[slot] = -1
    ti.loop_config(serialize=True)
    for _ in range(1):
        n = first
        while n < last and number >= 0:
            found, number_now = gait_for(
                kind, numbers, pose[n, A], pose[n, B], number, gaits, slots
            )
            gait[n] = found
            number = number_now
            if found < 0:
                number = -1
            n += 1
    return number


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
    rows: ti.template(), numbers: ti.template(), counts: ti.template(), samples, steps, sections,
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
        lay_disc(
            rows, row, numbers[0], rows[row, 0], rows[row, 1], rows[row, 2], rows[row, 3]
        )


@ti.func
def lay_dooms(
    rows: ti.template(), numbers: ti.template(), counts: ti.template(), roads: ti.template(), first,
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


@ti.kernel
def lay_roads(
    # in
    kind: ti.template(),
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
    for p in range(ways):
        begin = p * rows_for(steps)
        sections = begin + steps + 1
        if begin + rows_for(steps) <= rows.shape[0]:
            robot = robot_of(numbers)
            g = p // counts[7]
            control = control_of(controls, p % counts[7])
            q = pose7(0.0)
            q[C] = 1.0
            q[A] = gaits[g, 0]
            q[B] = gaits[g, 1]
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
            roads[p, 0] = begin
            roads[p, 1] = moving
            roads[p, 2] = sections
            roads[p, 3] = depth
            rows[sections, 0] = q[THETA]
            rows[sections, 1] = q[A]
            rows[sections, 2] = q[B]
            lay_sections(rows, numbers, counts, begin, moving, sections, depth)

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

    for gait in range(ti.max(laid[0], 0)):
        robot = robot_of(numbers)
        for b in range(counts[6]):
            road = ways + gait * counts[6] + b
            begin = roads[road, 0]
            control = control_of(braking, b)
            q = pose7(0.0)
            q[C] = 1.0
            q[A] = ends[gait, 0]
            q[B] = ends[gait, 1]
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
        lay_dooms(rows, numbers, counts, roads, ways + gait * counts[6])


@ti.func
def placed(rows: ti.template(), row, x, y, c, s):
    """A sample of a road that begins at (x, y) with heading (c, s), as a pose without speeds."""
    q = pose7(0.0)
    q[X] = x + c * rows[row, 0] - s * rows[row, 1]
    q[Y] = y + s * rows[row, 0] + c * rows[row, 1]
    q[C] = c * rows[row, 2] - s * rows[row, 3]
    q[S] = s * rows[row, 2] + c * rows[row, 3]
    return q


@ti.func
def disc_spans(
    spans: ti.template(), numbers: ti.template(), counts: ti.template(), rows: ti.template(), row,
    x, y, c, s,
):  # fmt: skip
    """What `span_about` tells of the disc in a row; (0, 65535), which is nothing, where none does.
    """
    least = 0
    latest = 65535
    level = ti.cast(rows[row, 2], ti.i32)
    if level < LEVELS:
        forth = rows[row, 0]
        left = rows[row, 1]
        least, latest = span_about(
            spans, counts, numbers[0], x + c * forth - s * left, y + s * forth + c * left, level
        )
    return least, latest


@ti.func
def road_clear(
    arrival: ti.template(),
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    roads: ti.template(),
    rows: ti.template(),
    road,
    x,
    y,
    c,
    s,
    tick,
):
    """Whether a road that begins at (x, y) with heading (c, s) at `tick` touches nothing.

    The whole of it is asked about first, then the later and the earlier half of what that leaves
    open, and so on; the looks are taken where no span tells. The answer is that of all the looks.
    """
    samples = roads[road, 0]
    steps = roads[road, 1]
    sections = roads[road, 2]
    depth = roads[road, 3]
    clear = True
    d = 0
    h = 1
    if steps == 0:
        h = 0
    while h > 0:
        p = h - (1 << d)
        first = steps * p >> d
        last = steps * (p + 1) >> d
        least, latest = disc_spans(
            spans, numbers, counts, rows, sections + h, x, y, c, s
        )
        open = least <= ti.min(tick + last * counts[4], LATEST)
        if latest <= ti.min(tick + first * counts[4], LATEST):
            # whatever is looked at, nothing is free by then
            clear = False
            h = 0
        elif open and d < depth:
            h = 2 * h + 1
            d += 1
        else:
            if open:
                k = last
                after = placed(rows, samples + k, x, y, c, s)
                while clear and k > first:
                    k -= 1
                    before = placed(rows, samples + k, x, y, c, s)
                    clear = way_clear(
                        arrival, numbers, counts, before, after, tick + k * counts[4]
                    )
                    after = before
            # on to the other half of the last section whose later half this ends
            while h > 1 and h & 1 == 0:
                h >>= 1
                d -= 1
            h -= 1
            if not clear:
                h = 0
    return clear


@ti.func
def proving_road(
    arrival: ti.template(),
    spans: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    roads: ti.template(),
    rows: ti.template(),
    first,
    x,
    y,
    c,
    s,
    tick,
):
    """1 + index of the first braking road from `first` on that is clear to rest (eq. 6); 0: none
    is."""
    proof = 0
    b = 0
    for k in ti.static(range(DOOMS)):
        if b == 0:
            row = roads[first, 0] - 1 - k
            _, latest = disc_spans(spans, numbers, counts, rows, row, x, y, c, s)
            # each of them takes a look in there, in the time step that ends then
            at = ti.cast(rows[row, 3], ti.i32) - 1
            if latest <= ti.min(tick + at * counts[4], LATEST):
                b = counts[6]
    while b < counts[6] and proof == 0:
        if road_clear(
            arrival, spans, numbers, counts, roads, rows, first + b, x, y, c, s, tick
        ):
            proof = b + 1
        b += 1
    return proof
