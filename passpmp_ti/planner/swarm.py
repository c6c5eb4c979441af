"""The choice of a plan: particle swarm over priorities (Algorithms 1, 3, 4), or all leaves."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from passpmp_ti import device
from passpmp_ti.device import Array
from passpmp_ti.kernels.objective import BLOCK, cheapest, every_cost
from passpmp_ti.kernels.swarm import FIELDS, LEAF, TURNS, forget_all, search, search_together
from passpmp_ti.planner.objective import objective_numbers
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

MOST = 2**31 - 1
"""Numbers in one array that a kernel can tell apart."""


class Branches(Protocol):
    """What the choice reads of a tree."""

    @property
    def link(self) -> Array:
        """[>= count, 8] int32, see kernels/tree.py."""

    @property
    def cost(self) -> Array:
        """[>= count, 6] float32, see there."""

    @property
    def count(self) -> int:
        """Nodes, the root among them."""

    @property
    def depth(self) -> int:
        """Most parents on the way to a leaf, or more."""


class Swarm:
    """Owns the particles' tables; they live as long as the planner.

    Raises:
        ValueError: the tables would be larger than a kernel can address.
    """

    def __init__(self, robot: Robot, settings: Settings) -> None:
        self._settings = settings
        self._fan = len(robot.controls)
        self._rows = settings.particles + settings.sub_swarms
        own = (settings.velocity_max, settings.cognitive, settings.social)
        self._numbers = device.put(
            np.concatenate((objective_numbers(settings, robot), np.array(own, dtype=np.float32)))
        )
        self._ends = device.empty((self._rows, 2), np.int32)
        self._least = device.empty((self._rows,), np.float32)
        self._slots = self._room = 0
        self._hold(len(settings.levels), settings.capacity)

    def choose(
        self, tree: Branches, generator: np.random.Generator
    ) -> tuple[int, tuple[int, ...], float]:
        """The best plan that the swarm found (Algorithm 3).

        Args:
            tree: of this cycle; it has more nodes than the root.
            generator: source of all randomness.

        Returns:
            (the leaf where the best plan ends, the distinct leaves of the particles at the end,
            what the plan costs); the root where no plan costs less than infinity.
        """
        settings = self._settings
        slots, room = self._hold(max(tree.depth, len(settings.levels)), tree.count)
        task = (
            int(generator.integers(2**32)), settings.iterations, settings.particles,
            settings.sub_swarms, slots, room, tree.count, tree.link, tree.cost, self._numbers,
            self._keys, self._state, self._ends, self._least,
        )  # fmt: skip
        if device.resident():
            forget_all(self._rows, slots, self._keys, self._ends, self._least)
            for begin in range(0, settings.iterations + 1, TURNS):
                search_together(begin, *task)
        else:
            search(device.share(), *task)
        end, least = device.host(self._ends)[:, LEAF], device.host(self._least)
        # sub-swarms share their best at the end; ties go to the lowest index
        winner = settings.particles + int(np.argmin(least[settings.particles :]))
        leaves = np.unique(end[: settings.particles])
        return int(end[winner]), tuple(int(n) for n in leaves), float(least[winner])

    def _hold(self, depth: int, nodes: int) -> tuple[int, int]:
        """Have tables that a tree needs: (slots, room of each)."""
        settings = self._settings
        slots, room = table_size(settings.iterations, depth, nodes, self._fan)
        if self._rows * max(2 * slots, room) > MOST:
            raise ValueError(
                f"Settings.particles = {settings.particles} with iterations ="
                f" {settings.iterations} may meet {self._rows * room:.2g} numbers, and a kernel"
                f" addresses {MOST}; take fewer particles or fewer iterations"
            )
        if slots > self._slots:
            self._keys = device.empty((self._rows * slots, 2), np.int32)
            self._slots = slots
        if room > self._room:
            self._state = device.empty((self._rows * room,), np.float32)
            self._room = room
        return slots, room


def table_size(iterations: int, depth: int, nodes: int, fan: int) -> tuple[int, int]:
    """(slots, a power of two, and numbers) that a particle needs, so that neither can run out.

    A walk meets at most `depth` parents of `fan` children each, and a search is `iterations` + 1
    walks: twice as many slots leave half of them empty. A tree of fewer nodes gets a slot for
    each, and needs no more numbers than it has nodes.
    """
    parents = (iterations + 1) * depth
    slots = 1 << (min(2 * parents, nodes) - 1).bit_length()
    return slots, FIELDS * min(parents * fan, nodes)


def leaf_costs(tree: Branches, robot: Robot, settings: Settings) -> np.ndarray:
    """[count] float32 f of eq. 5 for the plan to each leaf; inf where no plan ends."""
    f = device.empty((tree.count,), np.float32)
    numbers = device.put(objective_numbers(settings, robot))
    every_cost(tree.count, tree.link, tree.cost, numbers, f)
    return device.host(f)


def best_leaf(tree: Branches, robot: Robot, settings: Settings) -> tuple[int, float]:
    """(the leaf where the cheapest plan of the tree ends, its cost); ties go to the lowest index.

    The root where no plan costs less than infinity.
    """
    blocks = -(-tree.count // BLOCK)
    leaf = device.empty((blocks,), np.int32)
    least = device.empty((blocks,), np.float32)
    numbers = device.put(objective_numbers(settings, robot))
    cheapest(tree.count, tree.link, tree.cost, numbers, leaf, least)
    block = int(np.argmin(device.host(least)))
    return int(device.host(leaf)[block]), float(device.host(least)[block])
