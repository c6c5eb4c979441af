"""What was seen cannot be gone: a scan that says so is not to be believed."""

from __future__ import annotations

import math

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.kernels.vanished import squares_empty

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
    return int(np.count_nonzero(model.static) + np.count_nonzero(model.movable))


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
    asked = 0
    squares = []
    seen = now.seen
    shift = now.window.cells_to(before.window)
    for mask, speed in ((before.static, 0.0), (before.movable, settings.object_speed)):
        reach = math.ceil((speed * age + margin) / now.cell) + 1
        if reach > MOST_REACH or (timeless and speed > 0):
            continue
        j, i = np.divmod(np.flatnonzero(mask), mask.shape[1])
        i, j = i + shift[0], j + shift[1]
        size = now.window.size
        inside = (np.minimum(i, j) >= reach) & (np.maximum(i, j) < size - reach)
        i, j = i[inside], j[inside]
        asked += len(i)
        passed = seen[j, i]  # most are not: that is quick to ask
        if passed.any():
            j, i = j[passed], i[passed]
            squares.append(np.stack([j, i, np.full(len(i), reach)], axis=1))
    gone = _empty(seen, np.concatenate(squares)) if squares else 0
    if gone >= FEWEST and gone >= LEAST_SHARE * asked:
        return f"{gone} of {asked} surfaces are gone that cannot be"
    return ""


def _empty(seen: np.ndarray, squares: np.ndarray) -> int:
    """How many squares [n, 3] (row, column, cells to each side) are seen whole."""
    if len(squares) < FEWEST:
        return 0  # too few to matter
    empty = device.empty((len(squares),), np.int32)
    squares_empty(device.put(seen.view(np.uint8)), device.put(squares.astype(np.int32)), empty)
    return int(device.host(empty).sum())
