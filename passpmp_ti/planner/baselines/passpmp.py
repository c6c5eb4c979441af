"""PASSPMP, the planner before PASSPMP-PSO: the same safe tree, and the node nearest to the goal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings


class Passpmp(Navigator):
    """Safe as `Navigator` is, but it only ever looks for the leaf nearest to its goal.

    Secs. 5.1.4 and 6.2: the tree and its safety are the same, and what is chosen minimises "a
    simple cost function which depends on the trajectory's distance and time costs". So the
    distance is the straight one of the last state (eq. 18), no swarm searches, and time only
    decides between equals: with the weights of Sec. 5.1.3 a slow robot would stand still.
    """

    def __init__(
        self,
        robot: Robot,
        settings: Settings,
        goal: tuple[float, float] | Sequence[tuple[float, float]],
        static_map: StaticMap | None = None,
        *,
        seed: int | np.random.Generator = 0,
    ) -> None:
        """See `Navigator`."""
        own = settings.changed(
            guide="euclidean", distance="final", optimizer="exhaustive", weight_turn=0.0
        )
        super().__init__(robot, own, goal, static_map, seed=seed)
