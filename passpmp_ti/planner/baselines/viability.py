"""Control inside the viability kernel of a world whose future is known (Sec. 6).

After Bouguerra, Fraichard & Fezari, "Viability-based guaranteed safe robot navigation", J. Intell.
Robot. Syst. 95(2), 2019 (the paper's ref. 14).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.baselines.cycle import Reactive, Sight
from passpmp_ti.planner.baselines.known import KnownWorld
from passpmp_ti.planner.baselines.lattice import LEVELS, STANDING, Lattice
from passpmp_ti.planner.baselines.motion import Motion
from passpmp_ti.planner.baselines.viability_kernel import ViabilityKernel, half_move
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

NEAR = 0.9
"""Of the goal's tolerance: nothing is gained by standing nearer."""


class Viability(Reactive):
    """Keeps the robot where it can go on for ever without a touch, in a world that it knows.

    Nothing is sensed: where everything will be is given. The kernel is computed once, in the first
    cycle, for the moves of `Lattice`; of the moves that stay inside it the one after which the
    robot could rest nearest to the goal is taken. That is absolute safety, not passive: while it
    knows the future and its start lies in the kernel, the robot is never touched, at rest neither.

    Args:
        world: what is there, for all time.

    Raises:
        ValueError: no world, or one whose period does not go with the cycle.
    """

    def __init__(
        self,
        robot: Robot,
        settings: Settings,
        goal: tuple[float, float] | Sequence[tuple[float, float]],
        static_map: StaticMap | None = None,
        *,
        seed: int | np.random.Generator = 0,
        world: KnownWorld | None = None,
    ) -> None:
        """See `Navigator`; nothing is random."""
        if world is None:
            raise ValueError(
                "Viability.world is missing: viability is computed for a known future; give a"
                " KnownWorld (a scenario whose movers are scripted or patrol has one)"
            )
        keeper = Keeper(robot, settings, world)
        super().__init__(keeper.plan, robot, settings, goal, static_map, stops=False)


class Keeper:
    """Chooses move after move; in between, what was chosen goes on."""

    def __init__(self, robot: Robot, settings: Settings, world: KnownWorld) -> None:
        self._settings = settings
        self._world = world
        self._lattice = Lattice(Motion(robot, settings), half_move(settings, world.period))
        self._kernel: ViabilityKernel | None = None
        self._driving: Trajectory | None = None
        self._until = -np.inf
        self._level = STANDING

    def plan(self, sight: Sight) -> Trajectory | None:
        """What is driven already, or the next move; None: no move stays inside the kernel."""
        if self._kernel is None:
            self._kernel = ViabilityKernel.computed(self._lattice, self._world, sight.start)
        if sight.start < self._until - 0.5 * self._settings.time_step:
            return self._driving
        self._driving = self._next(self._kernel, sight)
        return self._driving

    def _next(self, kernel: ViabilityKernel, sight: Sight) -> Trajectory | None:
        lattice = self._lattice
        if np.abs(sight.root[3:] - lattice.speeds(self._level)).max() > 1e-3:
            return None  # it had to brake: wait for rest
        best, least = None, np.inf
        for move in lattice.moves:
            if move.before != self._level:
                continue
            driven = lattice.drive(sight.root, sight.start, move)
            if not kernel.keeps(move, driven, sight.start):
                continue
            cost = self._cost(driven.at(sight.start + lattice.duration), move.after, sight.goal)
            if cost < least:
                best, least = (driven, move.after), cost
        if best is None:
            self._level = STANDING
            return None
        self._until = sight.start + lattice.duration
        self._level = best[1]
        return best[0]

    def _cost(self, state: np.ndarray, level: int, goal: tuple[float, float]) -> float:
        """Distance from the goal at which the robot could rest [m]; 0 near enough."""
        lattice, speed = self._lattice, LEVELS[level]
        way = 0.5 * speed * abs(speed) * lattice.level * lattice.duration
        rest = state[:2] + way * np.array([np.cos(state[2]), np.sin(state[2])])
        away = float(np.hypot(*(rest - goal)))
        return max(away - NEAR * self._settings.goal_tolerance, 0.0)
