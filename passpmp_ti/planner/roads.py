"""Which levels of a tree are grown along roads, and the memory that these take."""

from __future__ import annotations

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.kernels.gaits import sort_gaits
from passpmp_ti.kernels.roads import lay_roads
from passpmp_ti.robots import Robot

GAITS = 1024
"""Most gaits of a level; a power of two."""
ROWS = 1 << 21
"""Samples and sections of all roads of a level; what is never written costs nothing on a CPU."""
WORTH, DEVICE_WORTH = 3, 1 << 30
"""Nodes that there must be for each gait: for fewer, laying roads takes longer than they save. On a
device every child is integrated at once; gaits would be sorted out by one slow thread."""
PIECE = 16
"""Gaits whose roads one thread of a CPU lays in one go."""
FEWEST, MOST = 32, 4096
"""Nodes of a level whose gaits are sorted out one after the other. Of those that were grown along
roads themselves, the gaits are known."""


class Roads:
    """Roads of one level of a tree after the other; arrays as in kernels/roads.py."""

    def __init__(self, robot: Robot, capacity: int, worth: float | None = None) -> None:
        if worth is None:
            worth = DEVICE_WORTH if device.resident() else WORTH
        self._worth = worth
        most = GAITS * (len(robot.controls) + len(robot.braking))
        self.gait = device.empty((capacity,), np.int32)
        """[capacity] gait of each node that was grown along a road, or is to have children so."""
        self.links = device.empty((most, 5), np.int32)
        self.rows = device.empty((ROWS, 4), np.float32)
        self.number = 0
        """Gaits of the level whose roads are laid; 0: none are."""
        self._gaits = device.empty((GAITS, 2), np.float32)
        self._ends = device.empty((GAITS, 2), np.float32)
        self._slots = device.empty((4 * GAITS,), np.int32)
        self._laid = device.empty((1,), np.int32)
        self._ending = 0

    def clear(self) -> None:
        """Forget the tree before."""
        self.number = self._ending = 0

    def lay(
        self, model: FutureModel, pose: device.Array, first: int, last: int, steps: int, likely: int
    ) -> bool:
        """Lay the roads of nodes [first, last), the level after the last one that was asked about.

        Args:
            model: whose robot drives them.
            pose: [capacity, 7] of the tree's nodes.
            first: its first node.
            last: the node after its last one.
            steps: of the primitives that begin there.
            likely: about how many of them will be grown before the tree is full.

        Returns:
            Whether they are; not where the gaits are too many for the nodes, or for the memory.
        """
        body = model.there
        number, self.number = self._ending, 0
        self._gaits, self._ends = self._ends, self._gaits
        self._ending = 0
        nodes = min(last - first, likely)
        worth = self._worth
        if number == 0 and nodes >= max(FEWEST, worth) and last - first <= MOST:
            sort_gaits(
                body.kind, body.numbers, pose, first, last, self._slots, self.gait, self._gaits,
                self._laid,
            )  # fmt: skip
            number = int(device.host(self._laid)[0])
        if not 0 < worth * number <= nodes:
            return False
        lay_roads(
            body.kind, device.share(), 1 if device.resident() else PIECE, body.numbers,
            model.counts, body.braking, body.controls, self._gaits, number, steps, self._slots,
            self.links, self.rows, self._ends, self._laid,
        )  # fmt: skip
        ending = int(device.host(self._laid)[0])
        if ending < 0:
            return False
        self.number, self._ending = number, ending
        return True
