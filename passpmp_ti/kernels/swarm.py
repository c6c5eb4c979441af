"""Particle swarm over priorities of tree nodes: Algorithms 1, 3 and 4.

A particle holds a priority for each node. Decoding walks from the root: of a node's children the
one with the least priority x duration is next (eq. 4), until a node has none. Only priorities of
children of nodes on a particle's walk can change where it goes, so only those are moved (eqs. 2
and 3): the cost of an iteration does not grow with nodes that no particle visits. Priorities
never yet met are drawn when they are, from a counter hash, so the outcome does not depend on
threads. Sub-swarms run in parallel and do not see each other: no iteration waits for another
thread, and the whole search is one launch.
"""

import taichi as ti

from passpmp_ti.kernels.tree import CHILDREN, FIRST, PARENT, STEPS, Links

POSITION, VELOCITY, BEST = range(3)
UNKNOWN = -1.0  # no priority: they lie in [0, 1]

Floats = ti.types.ndarray(dtype=ti.f32, ndim=1)
Ints = ti.types.ndarray(dtype=ti.i32, ndim=1)
Table = ti.types.ndarray(dtype=ti.f32, ndim=2)


@ti.func
def scrambled(x):
    """A 32-bit integer hash with full avalanche."""
    x ^= x >> ti.u32(16)
    x *= ti.u32(0x7FEB352D)
    x ^= x >> ti.u32(15)
    x *= ti.u32(0x846CA68B)
    x ^= x >> ti.u32(16)
    return x


@ti.func
def uniform(seed, particle, node, draw):
    """A number in [0, 1) that depends on nothing but its arguments."""
    h = scrambled(ti.cast(seed, ti.u32) ^ ti.cast(draw, ti.u32) * ti.u32(0x9E3779B9))
    h = scrambled(h ^ ti.cast(particle, ti.u32) * ti.u32(0x85EBCA6B))
    h = scrambled(h ^ ti.cast(node, ti.u32) * ti.u32(0xC2B2AE35))
    return ti.cast(h >> ti.u32(8), ti.f32) * (1.0 / 16777216.0)


@ti.func
def drawn(seed, velocity_max, count, swarm: ti.template(), p):
    """Algorithm 4: random priorities and velocities of one particle."""
    for n in range(count):
        swarm[p, n, POSITION] = uniform(seed, p, n, 0)
        swarm[p, n, VELOCITY] = (2.0 * uniform(seed, p, n, 1) - 1.0) * velocity_max
        swarm[p, n, BEST] = swarm[p, n, POSITION]


@ti.func
def walk(
    seed,
    p,
    s,
    iteration,
    velocity_max,
    cognitive,
    social,
    link: ti.template(),
    swarm: ti.template(),
    group: ti.template(),
):
    """Move the priorities that the walk meets (eqs. 2, 3) and walk by them; returns the leaf."""
    node = 0
    while link[node, CHILDREN] > 0:
        chosen = -1
        least = ti.math.inf
        for k in range(link[node, CHILDREN]):
            child = link[node, FIRST] + k
            x = swarm[p, child, POSITION]
            if iteration > 0:
                to_best = cognitive * uniform(seed, p, child, 2 * iteration)
                to_group = social * uniform(seed, p, child, 2 * iteration + 1)
                target = group[s, child]
                if target == UNKNOWN:
                    # the best walk never met this node: nothing pulls there
                    target = x
                v = (
                    swarm[p, child, VELOCITY]
                    + to_best * (swarm[p, child, BEST] - x)
                    + to_group * (target - x)
                )
                v = ti.min(ti.max(v, -velocity_max), velocity_max)
                x = x + v
                # priorities stay in [0, 1]: one that runs into an end bounces off it
                if x < 0.0 or x > 1.0:
                    v = -0.5 * v
                    x = ti.min(ti.max(x, 0.0), 1.0)
                swarm[p, child, VELOCITY] = v
                swarm[p, child, POSITION] = x
            cost = x * link[child, STEPS]
            if cost < least:
                least = cost
                chosen = child
        node = chosen
    return node


@ti.func
def keep(
    p,
    s,
    leaf,
    of_group: ti.template(),
    link: ti.template(),
    swarm: ti.template(),
    group: ti.template(),
):
    """Copy the priorities along the walk to `leaf` into the particle's best, or the group's."""
    node = leaf
    while node != 0:
        above = link[node, PARENT]
        for k in range(link[above, CHILDREN]):
            child = link[above, FIRST] + k
            if ti.static(of_group):
                group[s, child] = swarm[p, child, POSITION]
            else:
                swarm[p, child, BEST] = swarm[p, child, POSITION]
        node = above


@ti.func
def strew(seed, velocity_max, p, iteration, leaf, link: ti.template(), swarm: ti.template()):
    """Draw the priorities along a walk anew: a particle that has nothing left to find."""
    node = leaf
    while node != 0:
        above = link[node, PARENT]
        for k in range(link[above, CHILDREN]):
            child = link[above, FIRST] + k
            swarm[p, child, POSITION] = uniform(seed, p, child, -2 * iteration - 2)
            swarm[p, child, VELOCITY] = (
                2.0 * uniform(seed, p, child, -2 * iteration - 3) - 1.0
            ) * velocity_max
        node = above


@ti.kernel
def search(
    # in
    seed: ti.u32,
    iterations: ti.i32,
    velocity_max: ti.f32,
    cognitive: ti.f32,
    social: ti.f32,
    link: Links,  # [n, 8]
    leaf_cost: Floats,  # [n]
    # scratch
    swarm: ti.types.ndarray(dtype=ti.f32, ndim=3),  # [P, cap, 3]
    group: Table,  # [S, cap]
    best_cost: Floats,  # [P]
    # out
    leaf: Ints,  # [P] where each particle's last walk ends
    group_leaf: Ints,  # [S] where the best plan of each sub-swarm ends
):
    """Algorithm 3. Pbest and Gbest are the best so far, not better than the iteration before."""
    size = swarm.shape[0] // group.shape[0]
    for s in range(group.shape[0]):
        group_cost = ti.math.inf
        for n in range(link.shape[0]):
            group[s, n] = UNKNOWN
        for p in range(s * size, (s + 1) * size):
            best_cost[p] = ti.math.inf
            drawn(seed, velocity_max, link.shape[0], swarm, p)
        for iteration in range(iterations + 1):
            winner = -1
            for p in range(s * size, (s + 1) * size):
                end = walk(
                    seed, p, s, iteration, velocity_max, cognitive, social, link, swarm, group
                )
                if iteration > 0 and end == group_leaf[s] and end == leaf[p]:
                    strew(seed, velocity_max, p, iteration, end, link, swarm)
                    best_cost[p] = ti.math.inf
                leaf[p] = end
                if leaf_cost[end] < best_cost[p]:
                    best_cost[p] = leaf_cost[end]
                    keep(p, s, end, False, link, swarm, group)
                    if leaf_cost[end] < group_cost:
                        group_cost = leaf_cost[end]
                        winner = p
            # the group's best moves only between iterations: all particles see the same one
            if winner >= 0:
                group_leaf[s] = leaf[winner]
                keep(winner, s, leaf[winner], True, link, swarm, group)
