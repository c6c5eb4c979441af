"""A conservative model beside any planner: is the robot p-safe, whatever the planner thinks?"""

from __future__ import annotations

import numpy as np

from passpmp_ti.grid.model import FutureModel
from passpmp_ti.planner.plan import still_clear
from passpmp_ti.sim.episode import CycleInfo


class Observer:
    """Judges a drive by what the strict model proves from the planner's own scans.

    A cycle is *proven* if, by that model, something brings the robot from its state at t_{k+1} to
    rest before anything can touch it: a control of the braking set (eq. 6), or what it holds.
    """

    def __init__(self) -> None:
        self.cycles = 0
        self.proven = 0
        self.cycles_moving = 0
        """Cycles in which the robot moves at t_{k+1}: at rest it is p-safe by definition."""
        self.proven_moving = 0
        self._model: FutureModel | None = None

    def see(self, info: CycleInfo) -> None:
        """Judge one cycle of `simulate`."""
        navigator = info.navigator
        own = navigator.record.model
        if navigator.settings.mode == "conservative" and own is not None:
            self._model = own  # the same scans, the same memory: the strict model is at hand
        else:
            self._model = self._built(info)
        start = info.time + navigator.settings.cycle
        root = navigator.robot.within_limits(info.executing.at(start))
        moving = not bool(navigator.robot.at_rest(root))
        proven = bool(self._model.passively_safe(root[None], np.array([start]))[0]) or still_clear(
            self._model, navigator.held, start
        )
        self.cycles += 1
        self.proven += proven
        self.cycles_moving += moving
        self.proven_moving += moving and proven

    def _built(self, info: CycleInfo) -> FutureModel:
        """The strict model of this cycle, with the memory of those before."""
        navigator = info.navigator
        changes: dict[str, object] = {"mode": "conservative"}
        if self._model is not None:
            changes["clear_radius"] = 0.0  # declared of the start, and of nowhere else
        x, y, theta = (float(v) for v in info.state[:3])
        return FutureModel.from_scan(
            info.scans, navigator.robot, navigator.settings.changed(**changes), self._model,
            navigator.static_map, position=(x, y, theta),
        )  # fmt: skip

    def counts(self) -> dict[str, int]:
        """What was seen, for JSON."""
        return {
            "cycles": self.cycles,
            "proven": self.proven,
            "cycles_moving": self.cycles_moving,
            "proven_moving": self.proven_moving,
        }
