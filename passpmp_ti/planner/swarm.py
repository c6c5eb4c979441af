"""The choice of a plan: particle swarm over priorities (Algorithms 1, 3, 4), or all leaves."""

from __future__ import annotations

import numpy as np

from passpmp_ti.kernels.swarm import search
from passpmp_ti.planner.tree import Tree
from passpmp_ti.settings import Settings


class Swarm:
    """Owns the particles' arrays; they live as long as the planner."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        particles, groups, nodes = settings.particles, settings.sub_swarms, settings.capacity
        self._swarm = np.zeros((particles, nodes, 3), dtype=np.float32)
        self._group = np.zeros((groups, nodes), dtype=np.float32)
        self._best_cost = np.zeros(particles, dtype=np.float32)
        self._leaf = np.zeros(particles, dtype=np.int32)
        self._group_leaf = np.zeros(groups, dtype=np.int32)

    def choose(
        self, tree: Tree, costs: np.ndarray, generator: np.random.Generator
    ) -> tuple[int, tuple[int, ...]]:
        """The best plan that the swarm found (Algorithm 3).

        Args:
            tree: of this cycle.
            costs: [n] f of each node as a leaf (`objective.leaf_costs`).
            generator: source of all randomness.

        Returns:
            (the leaf where the best plan ends, the distinct leaves of the particles at the end).
        """
        settings = self._settings
        search(
            int(generator.integers(2**32)), settings.iterations, settings.velocity_max,
            settings.cognitive, settings.social, tree.link, costs, self._swarm, self._group,
            self._best_cost, self._leaf, self._group_leaf,
        )  # fmt: skip
        # sub-swarms share their best at the end; ties go to the lowest index
        winner = int(np.argmin(costs[self._group_leaf]))
        return int(self._group_leaf[winner]), tuple(int(n) for n in np.unique(self._leaf))


def best_leaf(tree: Tree, costs: np.ndarray) -> int:
    """The leaf where the cheapest plan of the tree ends; ties go to the lowest index."""
    leaves = tree.leaves
    return int(leaves[np.argmin(costs[leaves])])
