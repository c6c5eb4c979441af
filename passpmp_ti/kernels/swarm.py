"""Particle swarm over priorities of tree nodes: Algorithms 1, 3 and 4.

A particle holds a priority for each node. Decoding walks from the root: of a node's children the
one with the least priority x duration is next (eq. 4), until a node has none. Only priorities of
children of nodes on a particle's walk can change where it goes, so only those are moved (eqs. 2
and 3): the cost of an iteration does not grow with nodes that no particle visits. Priorities
never yet met are drawn when they are, from a counter hash, so the outcome does not depend on
threads. Sub-swarms do not see each other.
"""

import taichi as ti

from passpmp_ti.kernels.tree import CHILDREN, FIRST, STEPS, Links

Floats = ti.types.ndarray(dtype=ti.f32, ndim=1)
Ints = ti.types.ndarray(dtype=ti.i32, ndim=1)
Table = ti.types.ndarray(dtype=ti.f32, ndim=2)
ROUND = 5  # iterations unrolled into one launch


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


@ti.kernel
def scatter(
    # in
    seed: ti.u32,
    velocity_max: ti.f32,
    count: ti.i32,  # nodes
    # out
    position: Table,  # [P, cap]
    velocity: Table,  # [P, cap]
    best_position: Table,  # [P, cap]
    best_cost: Floats,  # [P]
    group_position: Table,  # [S, cap]
    group_cost: Floats,  # [S]
):
    """Algorithm 4: random priorities and velocities."""
    for p in range(position.shape[0]):
        best_cost[p] = ti.math.inf
        for n in range(count):
            position[p, n] = uniform(seed, p, n, 0)
            velocity[p, n] = (2.0 * uniform(seed, p, n, 1) - 1.0) * velocity_max
            best_position[p, n] = position[p, n]
    for s in range(group_position.shape[0]):
        group_cost[s] = ti.math.inf
        for n in range(count):
            group_position[s, n] = uniform(seed, s * (position.shape[0] // group_position.shape[0]), n, 0)


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
    position: ti.template(),
    velocity: ti.template(),
    best_position: ti.template(),
    group_position: ti.template(),
):
    """Move the priorities that the walk meets, and walk by them; returns the leaf."""
    node = 0
    while link[node, CHILDREN] > 0:
        chosen = -1
        least = ti.math.inf
        for k in range(link[node, CHILDREN]):
            child = link[node, FIRST] + k
            x = position[p, child]
            if iteration > 0:
                v = (
                    velocity[p, child]
                    + cognitive * uniform(seed, p, child, 2 * iteration) * (best_position[p, child] - x)
                    + social
                    * uniform(seed, p, child, 2 * iteration + 1)
                    * (group_position[s, child] - x)
                )
                v = ti.min(ti.max(v, -velocity_max), velocity_max)
                x = x + v
                # priorities stay in [0, 1]; one that runs into the end comes to rest there
                if x < 0.0 or x > 1.0:
                    v = -0.5 * v
                    x = ti.min(ti.max(x, 0.0), 1.0)
                velocity[p, child] = v
                position[p, child] = x
            cost = x * link[child, STEPS]
            if cost < least:
                least = cost
                chosen = child
        node = chosen
    return node


@ti.kernel
def iterate(
    # in
    seed: ti.u32,
    first_iteration: ti.i32,
    most_iterations: ti.i32,
    velocity_max: ti.f32,
    cognitive: ti.f32,
    social: ti.f32,
    link: Links,  # [cap, 8]
    leaf_cost: Floats,  # [cap]
    # in / out
    position: Table,
    velocity: Table,
    best_position: Table,
    best_cost: Floats,
    group_position: Table,
    group_cost: Floats,
    leaf: Ints,  # [P] where each particle's walk ends
    group_leaf: Ints,  # [S]
):
    """`ROUND` iterations of Algorithm 3; particles in parallel, best ones kept in order."""
    for offset in ti.static(range(ROUND)):
        for p in range(position.shape[0]):
            iteration = first_iteration + offset
            if iteration <= most_iterations:
                group = position.shape[0] // group_position.shape[0]
                end = walk(
                    seed, p, p // group, iteration, velocity_max, cognitive, social, link,
                    position, velocity, best_position, group_position,
                )
                leaf[p] = end
                if leaf_cost[end] < best_cost[p]:
                    # Pbest is the best so far, not better than the last (DESIGN: slips)
                    best_cost[p] = leaf_cost[end]
                    node = 0
                    while link[node, CHILDREN] > 0:
                        chosen = -1
                        least = ti.math.inf
                        for k in range(link[node, CHILDREN]):
                            child = link[node, FIRST] + k
                            best_position[p, child] = position[p, child]
                            if position[p, child] * link[child, STEPS] < least:
                                least = position[p, child] * link[child, STEPS]
                                chosen = child
                        node = chosen
        for s in range(group_position.shape[0]):
            group = position.shape[0] // group_position.shape[0]
            winner = -1
            for k in range(group):
                p = s * group + k
                if best_cost[p] < group_cost[s]:
                    group_cost[s] = best_cost[p]
                    winner = p
            if winner >= 0:
                node = 0
                while link[node, CHILDREN] > 0:
                    chosen = -1
                    least = ti.math.inf
                    for k in range(link[node, CHILDREN]):
                        child = link[node, FIRST] + k
                        group_position[s, child] = best_position[winner, child]
                        if group_position[s, child] * link[child, STEPS] < least:
                            least = group_position[s, child] * link[child, STEPS]
                            chosen = child
                    node = chosen
                group_leaf[s] = node
