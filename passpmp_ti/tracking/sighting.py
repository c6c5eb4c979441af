"""One scan as the tracker reads it: which returns may belong to something that moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from passpmp_ti import door
from passpmp_ti.scan import Scan


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sighting:
    """One sweep of a range finder, with what is known of each return."""

    origin: tuple[float, float]
    """(x, y) of the sensor in the world [m]."""
    bearings: np.ndarray
    """[n] in the world, counter-clockwise [rad]."""
    ranges: np.ndarray
    """[n] [m]; of beams that met nothing: `range_max` or more. Of lost beams: not read."""
    movable: np.ndarray
    """[n] bool: a return that neither a label nor the map explains by something that stays."""
    lost: np.ndarray
    """[n] bool: the beam tells nothing."""
    increment: float
    """Between neighbouring beams [rad]."""
    closed: bool
    """The beams go all the way round."""
    range_max: float
    """[m]."""

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        x, y = door.array("Sighting", "origin", self.origin, (2,))
        set_(self, "origin", (float(x), float(y)))
        bearings = door.array("Sighting", "bearings", self.bearings, (None,))
        door.finite("Sighting", "increment", self.increment, above=0.0, unit="rad")
        door.finite("Sighting", "range_max", self.range_max, above=0.0, unit="m")
        for name in ("movable", "lost"):
            value = np.asarray(getattr(self, name))
            if value.dtype != np.bool_ or value.shape != bearings.shape:
                raise ValueError(
                    f"Sighting.{name} must be bool of shape {bearings.shape}, one a bearing;"
                    f" got {value.dtype} {value.shape}"
                )
            set_(self, name, value)
        ranges = np.asarray(self.ranges, dtype=np.float64)
        if ranges.shape != bearings.shape:
            raise ValueError(
                f"Sighting.ranges must have shape {bearings.shape}, one a bearing;"
                f" got {ranges.shape}"
            )
        with np.errstate(invalid="ignore"):
            bad = np.flatnonzero(self.movable & ~((ranges > 0) & np.isfinite(ranges)))
            unsaid = np.flatnonzero(~self.lost & ~(ranges > 0))
        if len(bad):
            raise ValueError(
                f"Sighting.ranges[{bad[0]}] = {ranges[bad[0]]} m is no return, but movable there is"
                f" true ({len(bad)} bad); leave beams without a return out of movable"
            )
        if len(unsaid):
            raise ValueError(
                f"Sighting.ranges[{unsaid[0]}] = {ranges[unsaid[0]]} m must be > 0"
                f" ({len(unsaid)} bad); mark such beams as lost"
            )
        if (both := np.flatnonzero(self.movable & self.lost)).size:
            raise ValueError(
                f"Sighting: beam {both[0]} is both movable and lost ({len(both)} bad);"
                " a lost beam has no return"
            )
        set_(self, "bearings", bearings)
        set_(self, "ranges", ranges)

    @classmethod
    def of(cls, scan: Scan, movable: np.ndarray | None = None) -> Sighting:
        """A scan as a sighting.

        Args:
            scan: what was seen.
            movable: [n] bool, which returns may move; None: those that the scan labels so, or all.
        """
        n = len(scan.ranges)
        if movable is None:
            movable = np.ones(n, dtype=bool) if scan.moving is None else scan.moving
        closing = 2 * math.pi - (n - 1) * scan.angle_increment
        return cls(
            origin=scan.pose[:2],
            bearings=scan.bearings,
            ranges=scan.ranges,
            movable=movable & scan.returned,
            lost=scan.lost,
            increment=scan.angle_increment,
            closed=closing < 1.5 * scan.angle_increment,
            range_max=scan.range_max,
        )
