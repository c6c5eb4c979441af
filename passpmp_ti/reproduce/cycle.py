"""A planning cycle made again from what it saw: any robot, settings, goal and delay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.grid.model import FutureModel
from passpmp_ti.planner.guide import Guide, GuideField
from passpmp_ti.planner.tree import Tree, TreeGrower
from passpmp_ti.reproduce.runs import Glimpse
from passpmp_ti.robots import FREE, CarLike, Robot
from passpmp_ti.settings import Settings

PAPERS = {"guide": "euclidean", "distance": "final", "weight_turn": 0.0}
"""Settings by which a plan is judged as eqs. 18 and 19 say."""


class AcceleratingCar(CarLike):
    """The car as Sec. 5.1.3 grows its trees: full acceleration, steering right, not, or left.

    It brakes as `CarLike` does.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        a, w = self.acceleration, self.xi_rate
        object.__setattr__(self, "controls", tuple((FREE, a, s) for s in (-w, 0.0, w)))


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """What a tree is grown on: the model of one scan without memory, a guide, and a root."""

    robot: Robot
    model: FutureModel
    guide: GuideField
    root: np.ndarray
    """[5] state at `start`."""
    start: float
    """[s]"""

    @classmethod
    def of(
        cls,
        glimpse: Glimpse,
        robot: Robot,
        settings: Settings,
        goal: tuple[float, float],
        *,
        root: np.ndarray | None = None,
        delay: float | None = None,
    ) -> Ground:
        """The ground of a cycle.

        Args:
            glimpse: what it saw.
            robot: that plans.
            settings: of the model and the guide.
            goal: (x, y) [m].
            root: [5] the state to plan from; None: the glimpse's own.
            delay: from the scan to the root [s]; None: a cycle.
        """
        x, y, theta = (float(v) for v in glimpse.state[:3])
        model = FutureModel.from_scan(glimpse.scans, robot, settings, position=(x, y, theta))
        guide = Guide(
            robot, settings, (x, y), [goal], model.window.anchor, model.window.inner_radius, None
        )
        return cls(
            robot, model, guide.field(model, goal, glimpse.state[:2]),
            glimpse.root if root is None else root,
            glimpse.time + (settings.cycle if delay is None else delay),
        )  # fmt: skip

    def grow(self, settings: Settings) -> Tree:
        """The tree of some settings."""
        proof = int(self.model.proving_brakes(self.root[None], np.array([self.start]))[0])
        grower = TreeGrower(self.robot, settings)
        return grower.grow(self.model, self.guide, self.root, self.start, proof)


def leaf_distances(tree: Tree, goal: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """(Cost_d [m], Cost_t [s]) of every leaf, [n] each: eqs. 18 and 19."""
    tree = tree.on_host()
    away = np.hypot(*(tree.states[tree.leaves, :2] - np.array(goal)).T)
    return away, tree.elapsed[tree.leaves]
