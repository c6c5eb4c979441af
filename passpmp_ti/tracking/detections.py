"""Objects of one cycle, each with a centre: the returns are the near side of a body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from passpmp_ti.settings import Settings
from passpmp_ti.tracking.segments import longest, segments_of
from passpmp_ti.tracking.sides import Sides
from passpmp_ti.tracking.sighting import Sighting

SHAPE_ERROR = 0.06
"""Standard deviation of a centre, since bodies are no discs [object widths]."""
HIDDEN_ERROR = 0.5
"""Likewise where an end of the body is hidden [radii]."""


@dataclass(frozen=True, slots=True)
class Detections:
    """Objects of one cycle; d counts objects, m their sides, p returns."""

    sides: Sides
    group: np.ndarray
    """[m] object that each side belongs to."""
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

    def placed(self, radius: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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
        sides, (least, greatest) = self.sides, self.limits
        sine = np.sin(np.minimum(sides.half, 1.0))
        visible = np.clip(sides.nearest * sine / (1.0 - sine), least, greatest)
        hidden = ~sides.whole.all(axis=1)
        if radius is not None:
            visible = np.where(hidden, np.fmax(visible, radius[self.group]), visible)
        distance = sides.nearest + visible
        off = np.arcsin(visible / distance)
        bearing = sides.first + np.where(
            sides.whole[:, 0] & hidden,
            off,
            np.where(sides.whole[:, 1] & hidden, 2 * sides.half - off, sides.half),
        )
        way = np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
        centre = sides.origin + distance[:, None] * way
        variance = self.noise**2 + (0.5 * sides.spacing) ** 2
        variance += np.where(hidden, (HIDDEN_ERROR * visible) ** 2, 0.0)
        weight = 1.0 / variance
        total = np.bincount(self.group, weight, self.count)
        x, y, body = (
            np.bincount(self.group, weight * value, self.count) / total
            for value in (centre[:, 0], centre[:, 1], visible)
        )
        best = np.full(self.count, np.inf)
        np.minimum.at(best, self.group, variance)
        return np.stack([x, y], axis=1), np.sqrt(best), body

    def clear(self) -> np.ndarray:
        """[d] bool: some sensor sees both ends of the object."""
        found = np.zeros(self.count, dtype=bool)
        np.logical_or.at(found, self.group, self.sides.whole.all(axis=1))
        return found

    def reach(self, places: np.ndarray) -> np.ndarray:
        """[d, n] distance of each object's farthest return from places [n, 2] [m]."""
        found = np.zeros((self.count, len(places)))
        apart = np.hypot(*np.moveaxis(self.points[:, None] - places[None], -1, 0))
        np.maximum.at(found, self.owner, apart)
        return found

    def united(self, label: np.ndarray) -> Detections:
        """Objects [d] with equal labels as one, numbered by their labels' order."""
        _, label = np.unique(label, return_inverse=True)
        count = int(label.max(initial=-1)) + 1
        if count == self.count:
            return self
        sides, group = self.sides.merged(label[self.group])
        return replace(
            self,
            sides=sides,
            group=group,
            owner=label[self.owner],
            beams=tuple((beams, label[own]) for beams, own in self.beams),
            count=count,
        )


def detect(sightings: Sequence[Sighting], settings: Settings) -> Detections:
    """Objects in the sightings of one instant.

    What two sensors see is one object if the one's centre lies in the other's disc.
    """
    parts = [segments_of(s, settings) for s in sightings]
    sides = Sides.of(parts, sightings)
    base = np.searchsorted(sides.sensor, np.arange(len(parts)))
    beams = tuple((p.beams, p.label + b) for p, b in zip(parts, base, strict=True))
    found = Detections(
        sides=sides,
        group=np.arange(len(sides)),
        points=np.concatenate([np.zeros((0, 2)), *(p.points for p in parts)]),
        owner=np.concatenate([np.zeros(0, dtype=int), *(own for _, own in beams)]),
        beams=beams,
        count=len(sides),
        limits=(0.5 * settings.object_width, 0.5 * longest(settings)),
        noise=float(np.hypot(settings.range_noise, SHAPE_ERROR * settings.object_width)),
    )
    return found.united(_seen_twice(found)) if len(parts) > 1 else found


def _seen_twice(found: Detections) -> np.ndarray:
    """[d] labels, equal where different sensors see one object."""
    centre, _, body = found.placed()
    sensor = found.sides.sensor
    apart = np.hypot(*np.moveaxis(centre[:, None] - centre[None], -1, 0))
    joined = (apart < np.maximum(body[:, None], body[None])) & (sensor[:, None] != sensor[None])
    label = np.arange(found.count)
    for a, b in np.argwhere(np.triu(joined)):
        # the lower number stays, so that the outcome does not hang on the order of the pairs
        low, high = sorted((label[a], label[b]))
        label[label == high] = low
    return label
