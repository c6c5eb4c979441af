"""Everywhere something could be, and when at the earliest: the model itself, without a grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from passpmp_verify.border import SMALLEST, border, sources
from passpmp_verify.distance import distance_to
from passpmp_verify.opening import Opening, Origins
from passpmp_verify.pieces import joined
from passpmp_verify.static_map import StaticMap, Surfaces
from passpmp_verify.view import Scan
from passpmp_verify.wedges import views_of

ROUNDING = 1e-3
"""[m] What a shutting surface and another view's border before it may differ by without noise."""
RESOLUTION = 4 * SMALLEST
"""[m] Distances are never longer than they are, and shorter by no more than this."""

Disc = tuple[float, float, float]
"""(x, y, radius) [m]."""


class Gridless:
    """What scans of one instant prove of the future.

    Args:
        scans: of one instant.
        body_discs: the robot's own body then: nobody else is there.
        clear_disc: declared empty then.
        object_width: no object is narrower [m].
        range_noise: greatest error of a range [m].
        object_speed: no object is faster [m/s].
        blind_speed: of what comes out of bearings that no scan covers [m/s]; None: as above.
        stamp_error: the scans may be this much older than their stamp says [s].
        static_map: declares surfaces that stay.
        map_tolerance: returns nearer than this to a mapped surface are that surface [m].
        localisation_error: greatest error of the scans' poses [m]; here it only says which wedges
            a map may shut and how large a disc surely hides, the radius that is asked for holds
            the rest of it.
        object_radius: every point of what moves lies in a disc of this radius inside it [m].

    Raises:
        ValueError: no scan, or scans of different instants.
    """

    def __init__(
        self,
        scans: Sequence[Scan],
        body_discs: Sequence[Disc],
        clear_disc: Disc | None = None,
        *,
        object_width: float,
        range_noise: float,
        object_speed: float,
        blind_speed: float | None = None,
        stamp_error: float = 0.0,
        static_map: StaticMap | None = None,
        map_tolerance: float = 0.1,
        localisation_error: float = 0.0,
        object_radius: float = 0.0,
    ) -> None:
        if not scans:
            raise ValueError("Gridless: no scan given; nothing is proven without one")
        if max(s.stamp for s in scans) - min(s.stamp for s in scans) > 1e-6:
            raise ValueError("Gridless: scans of one instant have one stamp; make a model of each")
        self.stamp = float(scans[0].stamp)
        self.object_speed = object_speed
        self.blind_speed = object_speed if blind_speed is None else blind_speed
        self.stamp_error = stamp_error
        discs = [*body_discs, *([] if clear_disc is None else [clear_disc])]
        surfaces = Surfaces(static_map, map_tolerance, localisation_error)
        self.views = views_of(scans, discs, object_width, range_noise, surfaces)
        self._border = border(self.views)
        self._sources, self._blind = sources(
            self.views, 2 * range_noise + ROUNDING, self.blind_speed < object_speed
        )
        self._origins: tuple[Origins, ...] = ()
        # views whose poses err apart leave less of a disc hidden, by no more than one error
        radius = object_radius - localisation_error
        if radius > 0:
            pieces = joined([self._border, self._sources, self._blind])
            opening = Opening(self.views, pieces, radius)
            self._origins = tuple(map(opening.origins, (self._sources, self._blind)))

    def margins(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How far points [n, 2] [m] are from what is not proven, at `stamp`.

        Returns:
            [n] distances [m] to the nearest place that is not proven empty (0 where the point
            itself is not), to the nearest place that something may come out of, and to the nearest
            one of bearings that no scan covers, where those have a bound of their own. None is
            longer than the true one; each is shorter by at most `RESOLUTION`, where objects have
            no radius.
        """
        points = np.asarray(points, dtype=np.float64)
        proven = np.zeros(len(points), dtype=bool)
        for view in self.views:
            proven |= view.proves(points)
        to_unseen = np.where(proven, distance_to(points, self._border), 0.0)
        to_source = distance_to(points, self._sources)
        to_blind = distance_to(points, self._blind)
        if self._origins:
            # whoever comes passed both: neither is nearer than the other everywhere
            seen, blind = self._origins
            to_source = np.maximum(to_source, seen.distance_to(points))
            to_blind = np.maximum(to_blind, blind.distance_to(points))
        return (
            np.maximum(to_unseen - RESOLUTION, 0.0),
            np.maximum(to_source - RESOLUTION, 0.0),
            np.maximum(to_blind - RESOLUTION, 0.0),
        )

    def room(self, points: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Radius of the disc about each point that nothing can touch, then [m]; <= 0: none.

        Args:
            points: [n, 2] [m].
            times: [n] absolute [s], none before `stamp`.

        Raises:
            ValueError: a time before the scan.
        """
        times = np.asarray(times, dtype=np.float64)
        if len(times) and times.min() < self.stamp - 1e-9:
            raise ValueError(
                f"Gridless: {times.min():.6f} s is before the scan, {self.stamp:.6f} s; it proves"
                " nothing of the past"
            )
        elapsed = times - self.stamp + self.stamp_error
        to_unseen, to_source, to_blind = self.margins(points)
        # infinite distances stay infinite
        room = np.minimum(to_unseen, to_source - self.object_speed * elapsed)
        return np.minimum(room, to_blind - self.blind_speed * elapsed)

    def free(self, points: np.ndarray, radius: float, times: np.ndarray) -> np.ndarray:
        """[n] bool: nothing can touch a disc of `radius` [m] about each point, then."""
        return self.room(points, times) > radius
