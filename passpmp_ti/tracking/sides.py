"""The sides of objects that sensors see: bearings, ranges, and which ends are the object's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from passpmp_ti.tracking.segments import Segments
from passpmp_ti.tracking.sighting import Sighting


@dataclass(frozen=True, slots=True)
class Sides:
    """What each sensor sees of each object; m counts sides."""

    sensor: np.ndarray
    """[m] int: the sighting."""
    origin: np.ndarray
    """[m, 2] the sensor's place [m]."""
    first: np.ndarray
    """[m] bearing of the clockwise end, half a beam beyond its first return [rad]."""
    half: np.ndarray
    """[m] half of the bearing from there to the other end [rad]."""
    nearest: np.ndarray
    """[m] least range [m]."""
    spacing: np.ndarray
    """[m] between neighbouring returns, across the beams [m]."""
    whole: np.ndarray
    """[m, 2] bool: the first, the last end is the object's own, not an occluder's."""

    @classmethod
    def of(cls, parts: Sequence[Segments], sightings: Sequence[Sighting]) -> Sides:
        """The segments of each sighting, one sighting after the other."""
        pairs = list(zip(parts, sightings, strict=True))
        return cls(
            sensor=np.repeat(np.arange(len(pairs)), [len(p.first) for p in parts]),
            origin=_joined([np.tile(s.origin, (len(p.first), 1)) for p, s in pairs], 2),
            first=_joined([p.first - 0.5 * s.increment for p, s in pairs]),
            half=_joined([0.5 * (p.span + s.increment) for p, s in pairs]),
            nearest=_joined([p.nearest for p in parts]),
            spacing=_joined([p.nearest * s.increment for p, s in pairs]),
            whole=_joined([np.stack([p.open_first, p.open_last], 1) for p in parts], 2) > 0,
        )

    def __len__(self) -> int:
        return len(self.sensor)

    def merged(self, group: np.ndarray) -> tuple[Sides, np.ndarray]:
        """Pieces of one side, parted by something in front, as one.

        Args:
            group: [m] the object of each side.

        Returns:
            The sides, at most one a sensor and object, and the object of each.
        """
        pair = group * (int(self.sensor.max(initial=0)) + 1) + self.sensor
        _, chief, of = np.unique(pair, return_index=True, return_inverse=True)
        if len(chief) == len(self):
            return self, group
        taken = {f.name: getattr(self, f.name)[chief] for f in fields(self)}
        for k in np.flatnonzero(np.bincount(of) > 1):
            own = np.flatnonzero(of == k)
            # bearings from the middle of the first piece on, so that none is a turn away
            turn = self.first[own] + self.half[own] - self.first[own[0]] - self.half[own[0]]
            begin = np.remainder(turn + np.pi, 2 * np.pi) - np.pi - self.half[own]
            end = begin + 2.0 * self.half[own]
            low, high = int(np.argmin(begin)), int(np.argmax(end))
            taken["half"][k] = 0.5 * (end[high] - begin[low])
            taken["first"][k] = self.first[own[0]] + self.half[own[0]] + begin[low]
            taken["nearest"][k] = self.nearest[own].min()
            taken["spacing"][k] = self.spacing[own].min()
            taken["whole"][k] = self.whole[own[low], 0], self.whole[own[high], 1]
        return Sides(**taken), group[chief]


def _joined(parts: list[np.ndarray], columns: int = 0) -> np.ndarray:
    """Arrays one after the other; an empty one of the right shape where there are none."""
    return np.concatenate([np.zeros((0, columns) if columns else 0), *parts])
