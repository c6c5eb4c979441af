"""Trees without a world, of any size: links and costs, all that the choice of a plan reads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti import device
from passpmp_ti.device import Array
from passpmp_ti.kernels.tree import CHILDREN, FIRST, PARENT, STEPS

FAN = 9
"""Most children of a node."""
SHORTEST, LONGEST = 5, 40
"""Steps of primitives."""


@dataclass(frozen=True, slots=True)
class RandomTree:
    """Link and cost as of kernels/tree.py; judged by the last state alone (distance="final")."""

    link: Array
    cost: Array
    count: int
    depth: int


def random_tree(nodes: int, generator: np.random.Generator) -> RandomTree:
    """A tree of 1 to 9 children a parent, whose plans cost alike the more beginning they share.

    A node costs what its parent does and a normal step; the cheapest one costs 1.

    Args:
        nodes: the root among them; at least 2.
        generator: source of all randomness.
    """
    fans = generator.integers(1, FAN + 1, nodes)
    first = np.concatenate(([1], 1 + np.cumsum(fans)))[:nodes]
    parents = int(np.searchsorted(first, nodes))  # those that got children before nodes ran out
    fans[:parents] = np.minimum(fans[:parents], nodes - first[:parents])
    parent = np.repeat(np.arange(parents), fans[:parents])
    link = np.zeros((nodes, 8), dtype=np.int32)
    link[0, PARENT] = -1
    link[1:, PARENT] = parent
    link[:, FIRST] = -1
    link[:parents, FIRST] = first[:parents]
    link[:parents, CHILDREN] = fans[:parents]
    link[1:, STEPS] = generator.integers(SHORTEST, LONGEST, nodes)[parent]
    value = generator.normal(size=nodes)
    depth, end = 0, 1
    while end < nodes:
        # the children of a level's nodes are the next level
        last = min(int(first[end]), nodes)
        value[end:last] += value[link[end:last, PARENT]]
        depth, end = depth + 1, last
    cost = np.ones((nodes, 6), dtype=np.float32)
    cost[:, :5] = 0.0
    cost[:, 1] = value - value.min() + 1.0
    return RandomTree(device.put(link), device.put(cost), nodes, depth)
