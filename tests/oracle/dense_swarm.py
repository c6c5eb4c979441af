"""Algorithm 3 as it is written: every particle has a priority for every node, from the start on.

Only where arithmetic decides is it float32, in the kernel's order, so that both can be compared to
the bit.
"""

from __future__ import annotations

import numpy as np

from passpmp_ti.kernels.tree import CHILDREN, FIRST, STEPS

ONE_WORD = 0xFFFFFFFF
F = np.float32


def scrambled(x):
    x = np.asarray(x, dtype=np.uint64) & ONE_WORD
    x ^= x >> np.uint64(16)
    x = x * np.uint64(0x7FEB352D) & ONE_WORD
    x ^= x >> np.uint64(15)
    x = x * np.uint64(0x846CA68B) & ONE_WORD
    return x ^ x >> np.uint64(16)


def draws(seed, particle, turn, nodes):
    """Two numbers in [0, 1) for each of `nodes`."""
    start = scrambled(seed ^ (turn * 0x9E3779B9 & ONE_WORD))
    start = scrambled(start ^ np.uint64(particle * 0x85EBCA6B & ONE_WORD))
    h = scrambled(start ^ (np.asarray(nodes, dtype=np.uint64) * np.uint64(0xC2B2AE35) & ONE_WORD))
    return (h >> np.uint64(16)).astype(F) / F(65536), (h & 0xFFFF).astype(F) / F(65536)


def search(tree, costs, seed, settings):
    """(leaf of the best plan, its cost, the distinct leaves of the particles at the end).

    Args:
        costs: [n] float32 of each node as a leaf.
    """
    link, most = tree.link, F(settings.velocity_max)
    size = settings.particles // settings.sub_swarms
    everything = np.arange(tree.count)
    best, ends = [], []
    for s in range(settings.sub_swarms):
        position, velocity = np.zeros((2, size, tree.count), dtype=F)
        for i in range(size):
            position[i], push = draws(seed, s * size + i, 0, everything)
            velocity[i] = (F(2) * push - F(1)) * most
        own, of_group = position.copy(), np.full(tree.count, np.nan, dtype=F)
        own_cost, group_cost, group_leaf = np.full(size, np.inf, dtype=F), F(np.inf), 0
        end = np.zeros(size, dtype=int)
        for iteration in range(settings.iterations + 1):
            winner = -1
            for i in range(size):
                p, met, node = s * size + i, [], 0
                while link[node, CHILDREN]:
                    children = link[node, FIRST] + np.arange(link[node, CHILDREN])
                    met.append(children)
                    x = position[i, children]
                    if iteration:
                        r1, r2 = draws(seed, p, 2 * iteration, children)
                        target = np.where(np.isnan(of_group[children]), x, of_group[children])
                        v = (
                            velocity[i, children]
                            + F(settings.cognitive) * r1 * (own[i, children] - x)
                            + F(settings.social) * r2 * (target - x)
                        )
                        v = np.clip(v, -most, most)
                        x = x + v
                        velocity[i, children] = np.where((x < 0) | (x > 1), F(-0.5) * v, v)
                        x = position[i, children] = np.clip(x, F(0), F(1))
                    node = children[np.argmin(x * link[children, STEPS].astype(F))]
                met = np.concatenate(met)
                if node == group_leaf and node == end[i]:
                    position[i, met], push = draws(seed, p, 2 * iteration + 1, met)
                    velocity[i, met] = (F(2) * push - F(1)) * most
                    own_cost[i] = np.inf
                end[i] = node
                if costs[node] < own_cost[i]:
                    own_cost[i] = costs[node]
                    own[i, met] = position[i, met]
                    if costs[node] < group_cost:
                        group_cost, winner, road = costs[node], i, met
            if winner >= 0:
                group_leaf = end[winner]
                of_group[road] = position[winner, road]
        best.append((group_cost, group_leaf))
        ends.extend(end)
    cost, leaf = min(best, key=lambda found: found[0])
    return int(leaf), cost, tuple(np.unique(ends).tolist())
