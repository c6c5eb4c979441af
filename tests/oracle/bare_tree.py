"""Trees without a world: links and costs, all that the choice of a plan reads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.kernels.tree import CHILDREN, FIRST, PARENT, STEPS, TICK


@dataclass
class BareTree:
    """Arrays as of kernels/tree.py; rows from `count` on are nobody's."""

    link: np.ndarray
    cost: np.ndarray
    count: int
    depth: int

    @property
    def leaves(self):
        return np.flatnonzero(self.link[: self.count, CHILDREN] == 0)


def random_tree(nodes, generator, fans=(1, 5), spare=0):
    """A tree of `nodes` nodes whose leaf costs grow together along shared beginnings.

    What is judged by the last state alone costs what [n, 1] says. `spare` rows of rubbish follow.
    """
    link = generator.integers(0, 2**31 - 1, (nodes + spare, 8), dtype=np.int32)
    cost = np.full((nodes + spare, 6), -1e9, dtype=np.float32)
    link[:nodes] = 0
    link[0, PARENT] = -1
    value, depth = np.zeros(nodes), np.zeros(nodes, dtype=int)
    count, parent = 1, 0
    while count < nodes:
        fan = min(int(generator.integers(*fans)), nodes - count)
        duration = int(generator.integers(5, 40))
        link[parent, FIRST], link[parent, CHILDREN] = count, fan
        for child in range(count, count + fan):
            link[child, PARENT] = parent
            link[child, STEPS] = duration
            link[child, TICK] = link[parent, TICK] + 20 * duration
            value[child] = value[parent] + generator.normal()
            depth[child] = depth[parent] + 1
        count += fan
        parent += 1
    cost[:nodes, :5] = generator.uniform(0.0, 3.0, (nodes, 5))
    cost[:nodes, 5] = 1.0
    cost[:nodes, 1] = value - value.min() + 1
    return BareTree(link, cost, nodes, int(depth.max()))
