"""The swarm against the optimum over all leaves (Sec. 5.1.3: found in 100 % of runs)."""

import numpy as np
import pytest

from passpmp_ti.kernels.tree import CHILDREN, FIRST, PARENT, STEPS
from passpmp_ti.planner.swarm import Swarm, best_leaf
from passpmp_ti.settings import Settings


class BareTree:
    """A tree of links alone, all that the choice reads."""

    def __init__(self, link):
        self.link = link
        self.count = len(link)

    @property
    def leaves(self):
        return np.flatnonzero(self.link[:, CHILDREN] == 0)


def random_tree(nodes, generator):
    """A tree of `nodes` nodes whose leaf costs grow together along shared beginnings."""
    link = np.zeros((nodes, 8), dtype=np.int32)
    link[0, PARENT] = -1
    value = np.zeros(nodes)
    count, parent = 1, 0
    while count < nodes:
        fan = min(int(generator.integers(1, 5)), nodes - count)
        duration = int(generator.integers(5, 40))
        link[parent, FIRST], link[parent, CHILDREN] = count, fan
        for child in range(count, count + fan):
            link[child, PARENT] = parent
            link[child, STEPS] = duration
            value[child] = value[parent] + generator.normal()
        count += fan
        parent += 1
    costs = np.where(link[:, CHILDREN] == 0, value - value.min() + 1, np.inf).astype(np.float32)
    return BareTree(link), costs


@pytest.mark.parametrize("nodes", [13, 40, 135, 176, 237])
@pytest.mark.parametrize("particles", [20, 50, 100])
def test_the_swarm_finds_the_optimum_in_99_of_100_runs(nodes, particles):
    generator = np.random.default_rng(nodes * 1000 + particles)
    settings = Settings(particles=particles, sub_swarms=1, capacity=nodes, iterations=200)
    swarm = Swarm(settings)
    found = 0
    for _ in range(100):
        tree, costs = random_tree(nodes, generator)
        leaf, _ = swarm.choose(tree, costs, generator)
        found += costs[leaf] == costs[best_leaf(tree, costs)]
    assert found >= 99
