"""Everything that is being followed, at one instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.tracking.forecast import Forecast, forecast
from passpmp_ti.tracking.imm import Bank


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tracks:
    """N tracks after a cycle; in order of their ids."""

    stamp: float
    """Absolute [s]."""
    speed: float
    """Bound on every object's speed [m/s]."""
    ids: np.ndarray
    """[N] int, never given twice."""
    bank: Bank
    """What the filters know."""
    radius: np.ndarray
    """[N] disc about the mean place that covers the object, rather too large [m]."""
    body: np.ndarray
    """[N] what its radius seemed to be when both its sides were last seen; NaN: never [m]."""
    seen: np.ndarray
    """[N] bool: met in this cycle; the others are coasting."""
    born: np.ndarray
    """[N] when each was first met [s]."""
    last_seen: np.ndarray
    """[N] when each was last met [s]."""
    last_centre: np.ndarray
    """[N, 2] where it was then [m]."""
    last_radius: np.ndarray
    """[N] every return of it then lies in the disc of this radius about `last_centre` [m]."""
    existence: np.ndarray
    """[N] chance that there is such an object."""
    owner: tuple[np.ndarray, ...]
    """Per sighting [n] int: the id of the track that each beam's return belongs to; -1: none."""
    ended: bool
    """A track of the cycle before is gone, or has begun anew and may be about somebody else."""
    next_id: int
    """The id that the next track gets."""

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def age(self) -> np.ndarray:
        """[N] since each was first met [s]."""
        return self.stamp - self.born

    @property
    def positions(self) -> np.ndarray:
        """[N, 2] mean places [m]."""
        return self.bank.combined()[0][:, :2]

    @property
    def velocities(self) -> np.ndarray:
        """[N, 2] mean velocities [m/s]."""
        return self.bank.combined()[0][:, 2:]

    def forecast(self, times: np.ndarray) -> Forecast:
        """Where the objects will be at absolute times [L], increasing, from the stamp on [s]."""
        return forecast(self.bank, self.radius, self.stamp, times, self.speed)
