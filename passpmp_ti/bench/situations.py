"""Situations along a drive: what a tree is grown from, kept to be grown from again."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from passpmp_ti.grid.model import FutureModel
from passpmp_ti.planner.guide import Guide, GuideField
from passpmp_ti.planner.tree import Tree, TreeGrower
from passpmp_ti.robots import Robot
from passpmp_ti.sim.episode import CycleInfo, simulate
from passpmp_ti.sim.scenario import Scenario


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """One cycle's model and guide, and the state that its plan begins with."""

    robot: Robot
    model: FutureModel
    guide: GuideField
    root: np.ndarray
    """[5] state at `start`."""
    start: float
    """t_{k+1}, absolute [s]."""

    def grow(self, grower: TreeGrower) -> Tree:
        """The tree that `grower` makes of it."""
        proof = int(self.model.proving_brakes(self.root[None], np.array([self.start]))[0])
        return grower.grow(self.model, self.guide, self.root, self.start, proof)

    @property
    def here(self) -> float:
        """The guide at the root: what staying there for good costs [s]."""
        return float(self.guide.at(self.root[None])[0])


def situations_of(scenario: Scenario, every: float, most: int, seed: int = 0) -> list[Situation]:
    """Situations of one drive, `every` seconds [s] from the first on, at most `most`.

    Cycles whose root is not proven, or that braked or arrived, make none.
    """
    watcher = _Watcher(scenario, every, most)
    simulate(scenario, seed=seed, on_cycle=watcher)
    return watcher.found


@dataclass
class _Watcher:
    """Sees every cycle, since a guide remembers the walls met on the way."""

    scenario: Scenario
    every: float
    most: int
    found: list[Situation] = field(default_factory=list)
    guide: Guide | None = None
    due: float | None = None

    def __call__(self, info: CycleInfo) -> None:
        navigator, settings = info.navigator, self.scenario.settings
        model = navigator.model
        if self.due is None:
            self.due = info.time + self.every
        if self.guide is None or self.guide.anchor != model.window.anchor:
            self.guide = Guide(
                self.scenario.robot, settings, (float(info.state[0]), float(info.state[1])),
                navigator.goals, model.window.anchor, model.window.inner_radius,
                self.scenario.static_map,
            )  # fmt: skip
        guide = self.guide.field(model, navigator.goal, info.state[:2])
        wanted = len(self.found) < self.most and info.time >= self.due - 1e-9
        if wanted and navigator.record.root_proved and navigator.record.decision in ("new", "held"):
            start = info.time + settings.cycle
            root = info.executing.at(start)
            self.found.append(Situation(self.scenario.robot, model, guide, root, start))
            self.due += self.every
