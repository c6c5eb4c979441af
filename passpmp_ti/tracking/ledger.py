"""What is known of each track beside its filters, while a cycle works on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.tracking.detections import Detections
from passpmp_ti.tracking.tracks import Tracks

BIRTH, SURE, GONE = 0.8, 0.97, 0.2
"""Chance that something just met exists; the greatest that is ever said; that of forgetting."""
DETECTS = 0.9
"""Chance that an object in plain view is met."""
COAST = 3.0
"""What was not met for so long is forgotten [s]."""
SHRINK = 2.0
"""Time constant in which a radius is forgotten that is not seen from side to side [s]."""
ROUND_UP = 1.0 + 1e-9
"""Discs are said to be this much larger, so that no rounding leaves a return outside."""


@dataclass(slots=True)
class Ledger:
    """Columns of `Tracks`, of the same names; changed in place."""

    ids: np.ndarray
    radius: np.ndarray
    body: np.ndarray
    seen: np.ndarray
    born: np.ndarray
    last_seen: np.ndarray
    last_centre: np.ndarray
    last_radius: np.ndarray
    existence: np.ndarray

    @classmethod
    def of(cls, tracks: Tracks | None) -> Ledger:
        """The tracks of the cycle before, none of them met yet; empty without any."""
        if tracks is None:
            return cls.opened(np.arange(0), 0.0)
        columns = {name: getattr(tracks, name).copy() for name in cls.__slots__}
        columns["seen"][:] = False
        return cls(**columns)

    @classmethod
    def opened(cls, ids: np.ndarray, stamp: float) -> Ledger:
        """New tracks of these ids, at `stamp` [s]."""
        count = len(ids)
        return cls(
            ids=ids,
            radius=np.zeros(count),
            body=np.full(count, np.nan),
            seen=np.zeros(count, dtype=bool),
            born=np.full(count, stamp),
            last_seen=np.full(count, stamp),
            last_centre=np.zeros((count, 2)),
            last_radius=np.zeros(count),
            existence=np.full(count, BIRTH),
        )

    def joined(self, other: Ledger) -> Ledger:
        """These, then the other's."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in self.__slots__)
        return Ledger(*(np.concatenate(pair) for pair in pairs))

    def taken(self, which: np.ndarray) -> dict[str, np.ndarray]:
        """The columns of some tracks, for `Tracks`."""
        return {name: getattr(self, name)[which] for name in self.__slots__}

    def meet(
        self,
        found: Detections,
        track: np.ndarray,
        centre: np.ndarray,
        deviation: np.ndarray,
        body: np.ndarray,
        stamp: float,
        since: float,
    ) -> None:
        """Take down where each detection's track was met, and how large it seemed.

        Args:
            found: the detections.
            track: [d] of each, no two the same.
            centre: [d, 2] [m].
            deviation: [d] of the centres [m].
            body: [d] radius of what was seen [m].
            stamp: absolute [s].
            since: time since the cycle before [s].
        """
        clear = found.clear()
        self.seen[track] = True
        self.last_seen[track] = stamp
        self.last_centre[track] = centre
        self.body[track[clear]] = body[clear]
        reach = np.zeros(found.count)
        np.maximum.at(reach, found.owner, np.hypot(*(found.points - centre[found.owner]).T))
        self.last_radius[track] = reach * ROUND_UP
        # the centre's own error is in the covariance already
        now = np.maximum(self.last_radius[track] - deviation, body)
        # what is seen from side to side is as large as it seems; of the rest memory tells more
        gone = np.where(clear, 1.0, min(since / SHRINK, 1.0))
        self.radius[track] = np.maximum(now, self.radius[track] * (1.0 - gone) + now * gone)
        self.existence[track] = np.minimum(1.0 - 0.2 * (1.0 - self.existence[track]), SURE)

    def miss(self, which: np.ndarray, share: np.ndarray) -> None:
        """Doubt tracks [n] that were not met, whose places were seen empty by a share [n]."""
        missed, exists = DETECTS * share, self.existence[which]
        self.existence[which] = exists * (1.0 - missed) / (1.0 - exists * missed)

    def alive(self, stamp: float) -> np.ndarray:
        """[N] bool: tracks that are worth following on."""
        return (self.existence >= GONE) & (stamp - self.last_seen <= COAST)
