"""Whether a later scan contradicts an earlier one: then an assumption does not hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from passpmp_verify.certificate import Assumptions, Moment
from passpmp_verify.gridless import Gridless
from passpmp_verify.view import ends_of

SLACK = 0.01
"""[m] A return must be farther than this inside space that was proven free, beyond all errors."""


@dataclass(frozen=True, slots=True)
class Contradiction:
    """A return where, by an earlier scan, nothing can have been yet."""

    earlier: float
    """Stamp of the scan that is contradicted [s]."""
    time: float
    """Stamp of the return [s]."""
    x: float
    y: float
    """[m]"""

    def told(self) -> str:
        """For people."""
        return (
            f"the scan of t = {self.earlier:.3f} s is not relied on: something was met at"
            f" ({self.x:.3f}, {self.y:.3f}), t = {self.time:.3f} s, where by that scan nothing"
            " could be"
        )


def contradiction(
    model: Gridless, later: Sequence[Moment], assumptions: Assumptions
) -> Contradiction | None:
    """The first return of later moments that stands where `model` proves that nothing can be."""
    # both scans' poses may be wrong, and the return's range; the model has its own in it
    error = assumptions.range_noise + 2 * assumptions.localisation_error + SLACK
    for moment in later:
        points = np.concatenate([ends_of(scan) for scan in moment.scans])
        room = model.room(points, np.full(len(points), moment.stamp))
        if len(room) and room.max() > error:
            x, y = points[np.argmax(room)]
            return Contradiction(model.stamp, moment.stamp, float(x), float(y))
    return None
