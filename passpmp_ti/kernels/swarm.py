"""Particle swarm over priorities of tree nodes: Algorithms 1, 3 and 4.

A particle holds a priority for each node. Decoding walks from the root: of a node's children the
one with the least priority x duration is next (eq. 4), until a node has none. Only priorities of
children of nodes on a particle's walk can change where it goes, so only those are moved (eqs. 2
and 3) and only those are kept: neither time nor memory grows with nodes that no particle visits.
Priorities never yet met are drawn when they are, from a counter hash, so the outcome depends
neither on threads nor on the order in which nodes are met.

Rows [0, P) are particles, [P, P + S) the best of the sub-swarms. Each row has a hash table of
`mask` + 1 slots, a power of two, one slot a parent that its walks met, and a stretch of numbers,
handed out to one parent's children after the other: what a row uses lies together.

    keys [rows * slots, 2] i32: the parent, or EMPTY; where its children's numbers begin
    state [rows * room] f32: position, velocity, best of each child; a sub-swarm's row has the
        best alone
    ends [rows, 2] i32: the leaf where the last walk ended, or where the sub-swarm's best does;
        numbers handed out

All may be longer. A parent is sought from slot `parent & mask` on: where there are as many slots
as parents, each has its own. Else a walk meets one new parent a level at most, and the caller
gives at least twice walks x levels slots: the table is never more than half full, so that every
search ends. Parents must be numbered as their children are, as a tree grown by levels is.
"""

import taichi as ti

from passpmp_ti.kernels.draws import drawn, stream
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.objective import TICK_LENGTH, Costs, Numbers, plan_cost
from passpmp_ti.kernels.tree import CHILDREN, FIRST, PARENT, STEPS, Links

POSITION, VELOCITY, BEST = range(3)
FIELDS = 3
PARENT_KEY, PLACE = range(2)
LEAF, USED = range(2)
EMPTY = -1
VELOCITY_MAX, COGNITIVE, SOCIAL = range(TICK_LENGTH + 1, TICK_LENGTH + 4)
"""What the swarm is told, after what `plan_cost` is: V_pmax, w_c, w_s."""
TURNS = 4  # iterations in one launch of `search_together`


@ti.func
def mask_for(slots, count, link: ti.template()):
    """Slots less one of each table: all of them, or fewer where parents are fewer."""
    mask = slots - 1
    while mask > 0 and mask >> 1 >= link[count - 1, PARENT]:
        mask >>= 1
    return mask


@ti.func
def slot_of(row, parent, mask, keys: ti.template()):
    """The slot where a row keeps the children of `parent`, or the empty one where it would."""
    first = row * (mask + 1)
    slot = parent & mask
    while keys[first + slot, PARENT_KEY] != parent and keys[first + slot, PARENT_KEY] != EMPTY:
        slot = (slot + 1) & mask
    return first + slot


@ti.func
def home(row, parent, children, mask, room, keys: ti.template(), ends: ti.template()):
    """(where a row's numbers for the children of `parent` begin, whether they are new there)."""
    slot = slot_of(row, parent, mask, keys)
    new = keys[slot, PARENT_KEY] == EMPTY
    if new:
        keys[slot, PARENT_KEY] = parent
        keys[slot, PLACE] = row * room + ends[row, USED]
        ends[row, USED] = ends[row, USED] + children * FIELDS  # one writer a row: no atomic
    return keys[slot, PLACE], new


@ti.func
def cast_lots(start, at, first, children, numbers: ti.template(), state: ti.template()):
    """Algorithm 4: random priorities and velocities of siblings, whose state begins at `at`."""
    for k in range(children):
        place, push = drawn(start, first + k)
        state[at + FIELDS * k + POSITION] = place
        state[at + FIELDS * k + VELOCITY] = (2.0 * push - 1.0) * numbers[VELOCITY_MAX]


@ti.func
def walk(
    seed,
    p,
    group,
    iteration,
    mask,
    room,
    link: ti.template(),
    numbers: ti.template(),
    keys: ti.template(),
    state: ti.template(),
    ends: ti.template(),
):
    """Move the priorities that the walk meets (eqs. 2, 3) and walk by them; returns the leaf."""
    velocity_max = numbers[VELOCITY_MAX]
    cognitive = numbers[COGNITIVE]
    social = numbers[SOCIAL]
    now = stream(seed, p, 2 * iteration)
    node = 0
    children = link[0, CHILDREN]
    while children > 0:
        first = link[node, FIRST]
        at, new = home(p, node, children, mask, room, keys, ends)
        if new:
            cast_lots(stream(seed, p, 0), at, first, children, numbers, state)
            for k in range(children):
                state[at + FIELDS * k + BEST] = state[at + FIELDS * k + POSITION]
        # where the best walk never was, nothing pulls: the target is where the particle is
        target = at + POSITION
        if iteration > 0:
            theirs = slot_of(group, node, mask, keys)
            if keys[theirs, PARENT_KEY] == node:
                target = keys[theirs, PLACE] + BEST
        chosen = first
        least = ti.math.inf
        for k in range(children):
            own = at + FIELDS * k
            x = state[own + POSITION]
            if iteration > 0:
                to_best, to_group = drawn(now, first + k)
                v = (
                    state[own + VELOCITY]
                    + cognitive * to_best * (state[own + BEST] - x)
                    + social * to_group * (state[target + FIELDS * k] - x)
                )
                v = ti.min(ti.max(v, -velocity_max), velocity_max)
                x = x + v
                # priorities stay in [0, 1]: one that runs into an end bounces off it
                inside = ti.min(ti.max(x, 0.0), 1.0)
                state[own + VELOCITY] = ti.select(x == inside, v, -0.5 * v)
                x = inside
                state[own + POSITION] = x
            cost = x * link[first + k, STEPS]
            chosen = ti.select(cost < least, first + k, chosen)
            least = ti.min(cost, least)
        node = chosen
        children = link[node, CHILDREN]
    return node


@ti.func
def keep(
    p,
    row,
    leaf,
    mask,
    room,
    link: ti.template(),
    keys: ti.template(),
    state: ti.template(),
    ends: ti.template(),
):
    """Make a particle's priorities along its walk to `leaf` the best of a row: its own, or its
    sub-swarm's."""
    node = leaf
    while node != 0:
        node = link[node, PARENT]
        children = link[node, CHILDREN]
        own = keys[slot_of(p, node, mask, keys), PLACE]
        theirs, _ = home(row, node, children, mask, room, keys, ends)
        for k in range(children):
            state[theirs + FIELDS * k + BEST] = state[own + FIELDS * k + POSITION]


@ti.func
def strew(
    seed,
    p,
    iteration,
    leaf,
    mask,
    link: ti.template(),
    numbers: ti.template(),
    keys: ti.template(),
    state: ti.template(),
):
    """Draw the priorities along a walk anew: a particle that has nothing left to find."""
    anew = stream(seed, p, 2 * iteration + 1)
    node = leaf
    while node != 0:
        node = link[node, PARENT]
        at = keys[slot_of(p, node, mask, keys), PLACE]
        cast_lots(anew, at, link[node, FIRST], link[node, CHILDREN], numbers, state)


@ti.func
def advance(
    seed,
    p,
    group,
    iteration,
    mask,
    room,
    link: ti.template(),
    cost: ti.template(),
    numbers: ti.template(),
    keys: ti.template(),
    state: ti.template(),
    ends: ti.template(),
    least: ti.template(),
):
    """One iteration of one particle. Its best is its best so far, not better than before."""
    leaf = walk(seed, p, group, iteration, mask, room, link, numbers, keys, state, ends)
    if leaf == ends[group, LEAF] and leaf == ends[p, LEAF]:
        strew(seed, p, iteration, leaf, mask, link, numbers, keys, state)
        least[p] = ti.math.inf
    ends[p, LEAF] = leaf
    f = plan_cost(leaf, link, cost, numbers)
    if f < least[p]:
        least[p] = f
        keep(p, p, leaf, mask, room, link, keys, state, ends)


@ti.func
def elect(
    group,
    first,
    last,
    mask,
    room,
    link: ti.template(),
    keys: ti.template(),
    state: ti.template(),
    ends: ti.template(),
    least: ti.template(),
):
    """The best of particles [first, last), ties to the lowest index, becomes their sub-swarm's.

    It moves only between iterations: all particles see the same one. Whose best is below the
    sub-swarm's found it in this iteration, so it is where that particle is now.
    """
    winner = -1
    for p in range(first, last):
        if least[p] < least[group]:
            least[group] = least[p]
            winner = p
    if winner >= 0:
        ends[group, LEAF] = ends[winner, LEAF]
        keep(winner, group, ends[winner, LEAF], mask, room, link, keys, state, ends)


@ti.func
def forget(row, mask, keys: ti.template(), ends: ti.template(), least: ti.template()):
    """Clear a row by its keys alone: what no key leads to is never read."""
    for slot in range(row * (mask + 1), (row + 1) * (mask + 1)):
        keys[slot, PARENT_KEY] = EMPTY
    ends[row, LEAF] = 0
    ends[row, USED] = 0
    least[row] = ti.math.inf


@kernel
def search(
    # in
    share: ti.template(),  # indices that one thread is handed at a time, see device.share
    seed: ti.u32,
    iterations: ti.i32,
    particles: ti.i32,  # P
    groups: ti.i32,  # S, divides P
    slots: ti.i32,  # a power of two
    room: ti.i32,
    count: ti.i32,  # nodes, more than one
    link: Links,  # [>= count, 8]
    cost: Costs,  # [>= count, 6]
    numbers: Numbers,  # [8]
    # scratch
    keys: Links,  # [>= (P + S) * slots, 2]
    state: Numbers,  # [>= (P + S) * room]
    # out
    ends: Links,  # [P + S, 2]
    least: Numbers,  # [P + S] the best cost of each; inf, at the root: none found
):
    """Algorithm 3 on the threads of a CPU: sub-swarms run in parallel and do not see each other,
    so that no iteration waits for another thread, and the whole search is one launch."""
    for i in range(groups * share):
        if i % share == 0:
            mask = mask_for(slots, count, link)
            group = particles + i // share
            first = i // share * (particles // groups)
            last = first + particles // groups
            forget(group, mask, keys, ends, least)
            for p in range(first, last):
                forget(p, mask, keys, ends, least)
            for iteration in range(iterations + 1):
                for p in range(first, last):
                    advance(
                        seed, p, group, iteration, mask, room, link, cost, numbers, keys, state,
                        ends, least,
                    )  # fmt: skip
                elect(group, first, last, mask, room, link, keys, state, ends, least)


@kernel
def forget_all(
    rows: ti.i32,
    slots: ti.i32,
    # out, as of `search`
    keys: Links,
    ends: Links,
    least: Numbers,
):
    """Begin a search by `search_together`."""
    for slot in range(rows * slots):
        keys[slot, PARENT_KEY] = EMPTY
    for row in range(rows):
        ends[row, LEAF] = 0
        ends[row, USED] = 0
        least[row] = ti.math.inf


@kernel
def search_together(
    # in
    begin: ti.i32,  # iterations [begin, begin + TURNS) are done, up to and with `iterations`
    seed: ti.u32,
    iterations: ti.i32,
    particles: ti.i32,
    groups: ti.i32,
    slots: ti.i32,
    room: ti.i32,
    count: ti.i32,
    link: Links,
    cost: Costs,
    numbers: Numbers,
    # in / out, as of `search`
    keys: Links,
    state: Numbers,
    ends: Links,
    least: Numbers,
):
    """Some iterations of Algorithm 3 where threads are many: all particles at once, then all
    sub-swarms. Each row has one writer at a time, so it ends as `search` does, to the bit."""
    for turn in ti.static(range(TURNS)):
        for p in range(particles):
            if begin + turn <= iterations:
                mask = mask_for(slots, count, link)
                group = particles + p // (particles // groups)
                advance(
                    seed, p, group, begin + turn, mask, room, link, cost, numbers, keys, state,
                    ends, least,
                )  # fmt: skip
        for s in range(groups):
            mask = mask_for(slots, count, link)
            first = s * (particles // groups)
            last = first + particles // groups
            elect(particles + s, first, last, mask, room, link, keys, state, ends, least)
