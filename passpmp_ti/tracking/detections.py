"""Segments as objects with a centre: the returns are the near side of a body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from passpmp_ti.settings import Settings
from passpmp_ti.tracking.segments import longest, segments_of
from passpmp_ti.tracking.sighting import Sighting

SHAPE_ERROR = 0.07
"""Standard deviation of a centre, since bodies are no discs [object widths]."""
HIDDEN_ERROR = 0.5
"""Likewise where an end of the body is hidden [radii]."""


@dataclass(frozen=True, slots=True)
class Detections:
    """Objects of one cycle; d counts objects, m their sides as seen by one sensor each."""

    group: np.ndarray
    """[m] object that each side belongs to."""
    origin: np.ndarray
    """[m, 2] the sensor that saw the side [m]."""
    first: np.ndarray
    """[m] bearing of the side's clockwise end, half a beam beyond its first return [rad]."""
    half: np.ndarray
    """[m] half of the bearing to its other end [rad]."""
    nearest: np.ndarray
    """[m] least range [m]."""
    spacing: np.ndarray
    """[m] between neighbouring returns, across the beams [m]."""
    whole: np.ndarray
    """[m, 2] bool: the first, the last end is the body's own, not an occluder's."""
    points: np.ndarray
    """[p, 2] all returns [m]."""
    owner: np.ndarray
    """[p] object that each return belongs to."""
    beams: tuple[tuple[np.ndarray, np.ndarray], ...]
    """Per sighting: the beams of returns, and the objects that these belong to."""
    count: int
    """d."""
    limits: tuple[float, float]
    """Least and greatest radius of a body [m]."""
    noise: float
    """Standard deviation of a centre that is well seen [m]."""

    def placed(self, radius: np.ndarray | None = None) -> tuple[np.ndarray, ...]:
        """Centre [d, 2] [m], its standard deviation [d] [m] and the body's radius [d] [m].

        The body is taken for a disc. Where both its ends are seen, at bearings 2 a apart, and its
        nearest return at range r, its radius is R = r sin(a) / (1 - sin(a)) and its centre lies R
        behind the nearest return, at the middle bearing. Where one end is hidden, the disc touches
        the bearing of the other one and `radius` is taken for R; where both are, its centre is put
        at the middle. Sides of one object count by the inverse of their variances, but no more
        than the best of them: their errors have one cause.

        Args:
            radius: [d] what is known of the radius, NaN where nothing is [m].
        """
        least, greatest = self.limits
        sine = np.sin(np.minimum(self.half, 1.0))
        visible = np.clip(self.nearest * sine / (1.0 - sine), least, greatest)
        hidden = ~self.whole.all(axis=1)
        if radius is not None:
            told = np.fmax(radius[self.group], least)
            visible = np.where(hidden, np.fmax(visible, told), visible)
        distance = self.nearest + visible
        off = np.arcsin(visible / distance)
        middle = self.first + self.half
        bearing = np.where(
            self.whole[:, 0] & hidden,
            self.first + off,
            np.where(self.whole[:, 1] & hidden, self.first + 2 * self.half - off, middle),
        )
        centre = self.origin + distance[:, None] * np.stack(
            [np.cos(bearing), np.sin(bearing)], axis=1
        )
        variance = self.noise**2 + (0.5 * self.spacing) ** 2
        variance += np.where(hidden, (HIDDEN_ERROR * visible) ** 2, 0.0)
        weight = 1.0 / variance
        total = np.bincount(self.group, weight, self.count)
        mean, body = (
            np.stack(
                [np.bincount(self.group, weight * c, self.count) / total for c in columns], axis=1
            )
            for columns in (centre.T, visible[None])
        )
        best = np.full(self.count, np.inf)
        np.minimum.at(best, self.group, variance)
        return mean, np.sqrt(best), body[:, 0]

    def clear(self) -> np.ndarray:
        """[d] bool: some sensor sees both ends of the object."""
        found = np.zeros(self.count, dtype=bool)
        np.logical_or.at(found, self.group, self.whole.all(axis=1))
        return found


def detect(sightings: Sequence[Sighting], settings: Settings) -> Detections:
    """Objects in the sightings of one instant.

    Sides that two sensors see are one object's if the centre of one lies in the other's disc.
    """
    parts = [segments_of(s, settings) for s in sightings]
    sides = [len(p.first) for p in parts]
    base = np.concatenate([[0], np.cumsum(sides)]).astype(int)
    halves = [0.5 * (p.span + s.increment) for p, s in zip(parts, sightings, strict=True)]
    found = Detections(
        group=np.arange(base[-1]),
        origin=_joined(
            [np.tile(s.origin, (m, 1)) for s, m in zip(sightings, sides, strict=True)], 2
        ),
        first=_joined([p.first - 0.5 * s.increment for p, s in zip(parts, sightings, strict=True)]),
        half=_joined(halves),
        nearest=_joined([p.nearest for p in parts]),
        spacing=_joined([p.nearest * s.increment for p, s in zip(parts, sightings, strict=True)]),
        whole=_joined([np.stack([p.open_first, p.open_last], axis=1) for p in parts], 2) > 0,
        points=_joined([p.points for p in parts], 2),
        owner=_joined([p.label + b for p, b in zip(parts, base, strict=False)]).astype(int),
        beams=tuple((p.beams, p.label + b) for p, b in zip(parts, base, strict=False)),
        count=int(base[-1]),
        limits=(0.5 * settings.object_width, 0.5 * longest(settings)),
        noise=float(np.hypot(settings.range_noise, SHAPE_ERROR * settings.object_width)),
    )
    if sum(m > 0 for m in sides) < 2:
        return found
    return _united(found, np.repeat(np.arange(len(parts)), sides))


def _united(found: Detections, sensor: np.ndarray) -> Detections:
    """Sides of different sensors that are one object's as one."""
    centre, _, body = found.placed()
    apart = np.hypot(*(centre[:, None] - centre[None]).T).T
    joined = (apart < np.maximum(body[:, None], body[None])) & (sensor[:, None] != sensor[None])
    group = np.arange(found.count)
    for a, b in np.argwhere(np.triu(joined)):
        # the lower number stays, so the outcome is one, whatever the order of the pairs
        low, high = sorted((group[a], group[b]))
        group[group == high] = low
    _, group = np.unique(group, return_inverse=True)
    return Detections(
        group=group,
        origin=found.origin,
        first=found.first,
        half=found.half,
        nearest=found.nearest,
        spacing=found.spacing,
        whole=found.whole,
        points=found.points,
        owner=group[found.owner],
        beams=tuple((beams, group[side]) for beams, side in found.beams),
        count=int(group.max()) + 1,
        limits=found.limits,
        noise=found.noise,
    )


def _joined(parts: list[np.ndarray], columns: int = 0) -> np.ndarray:
    """Arrays one after the other; an empty one of the right shape where there are none."""
    return np.concatenate([np.zeros((0, columns) if columns else 0), *parts])
