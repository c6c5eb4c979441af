"""The planner as it is attacked: the real one, with a guide that is worked out less often."""

from __future__ import annotations

import numpy as np

from passpmp_ti.grid.model import FutureModel
from passpmp_ti.planner.guide import GuideField
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.planner.stall import Hill

GUIDE_CYCLES = 6


class Driver(Navigator):
    """`Navigator`, whose guide is kept for some cycles.

    The guide is most of a cycle's time. It only says which of the proven plans is liked best: an
    old one costs way, never safety.
    """

    _kept: tuple[int, tuple[float, float], GuideField] | None = None

    def _guide_field(
        self, model: FutureModel, state: np.ndarray, hill: Hill | None
    ) -> GuideField:
        if self._kept is not None:
            age, goal, field = self._kept
            same = goal == self.goal and field.anchor == model.window.anchor
            if age < GUIDE_CYCLES and same:
                self._kept = (age + 1, goal, field)
                return field
        field = super()._guide_field(model, state, hill)
        self._kept = (1, self.goal, field)
        return field
