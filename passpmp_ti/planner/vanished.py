"""What was seen cannot be gone: a scan that says so is not to be believed."""

from __future__ import annotations

import math

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.kernels.vanished import count_surfaces, surfaces_gone

FEWEST, LEAST_SHARE = 3, 0.05
"""Surfaces that must be gone before the scan is doubted, and their share of those asked about: a
single one may have been a raindrop."""
MOST_REACH = 200
"""[cells] Who may have gone farther than this is not asked about."""


LONGEST_DOUBT = 5.0
"""[s] for which scans are not believed that say that surfaces are gone."""
BELIEVED_AT_LAST = "surfaces were gone for long"
"""Why memory is given up against such scans."""


class Belief:
    """Counts for how long scans have not been believed."""

    def __init__(self) -> None:
        self._cycles = 0

    def doubt(self, before: FutureModel, now: FutureModel, *, timeless: bool, rests: bool) -> str:
        """Why the scans of `now` are not believed; empty where they are.

        Once doubted, they are believed again when they see about as much as before, or, with
        `BELIEVED_AT_LAST`, after `LONGEST_DOUBT` of cycles, when the robot is long at rest.

        Args:
            before: the last model that was believed.
            now: the model of the scans in question.
            timeless: nobody knows how long ago `before` was.
            rests: what the robot follows has ended.
        """
        doubt = vanished(before, now, timeless=timeless)
        if not doubt and (not self._cycles or 2 * surfaces(now) >= surfaces(before)):
            self._cycles = 0
            return ""
        self._cycles += 1
        if rests and self._cycles * now.settings.cycle > LONGEST_DOUBT:
            self._cycles = 0
            return BELIEVED_AT_LAST
        return doubt or "fewer surfaces than before they were gone"


def surfaces(model: FutureModel) -> int:
    """How many cells hold a surface."""
    return int(count_surfaces(device.put(model.marks)))


def vanished(before: FutureModel, now: FutureModel, *, timeless: bool = False) -> str:
    """Why the scans of `now` cannot be true after those of `before`; empty where they can.

    Whoever was met at a place is still within reach of it, and a surface that stays is still
    there. So not all of the square about it, as wide as it may have moved, can be proven empty.
    Where it is, a beam passed through something: a sensor that sees nothing any more and says
    "nothing there".

    Args:
        before: the last model that was believed.
        now: the model of the scans in question.
        timeless: nobody knows how long ago `before` was; only what stays is asked about.
    """
    settings = now.settings
    age = now.stamp - before.stamp + settings.stamp_error
    # both scans may be off, and a surface is known to a cell only
    margin = 2 * (settings.range_noise + settings.localisation_error) + 2 * now.cell
    reaches = []
    for speed in (0.0, settings.object_speed):
        reach = math.ceil((speed * age + margin) / now.cell) + 1
        skipped = reach > MOST_REACH or (timeless and speed > 0)
        reaches.append(-1 if skipped else reach)
    found = device.put(np.zeros(2, dtype=np.int32))
    shift = now.window.cells_to(before.window)
    surfaces_gone(device.put(before.marks), device.put(now.seen_cells), *shift, *reaches, found)
    asked, gone = (int(n) for n in device.host(found))
    if gone >= FEWEST and gone >= LEAST_SHARE * asked:
        return f"{gone} of {asked} surfaces are gone that cannot be"
    return ""
