"""Scans as views: what each wedge between two beams proves, as arrays for the kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from passpmp_ti.kernels import beams as wedges
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings

if TYPE_CHECKING:
    from passpmp_ti.grid.static_map import StaticMap

DISC_BEAMS = 64


@dataclass(frozen=True, slots=True)
class Views:
    """Polar regions of one instant: the scans first, then discs that are known to be empty."""

    view: np.ndarray
    """[V, 8] float32, see kernels/beams.py."""
    beams: np.ndarray
    """[V] int32."""
    ranges: np.ndarray
    """[V, n] float32 [m]."""
    met: np.ndarray
    """[V, n] int32."""
    reach: np.ndarray
    """[V, n] float32: each wedge is proven empty up to here [m]."""
    far_side: np.ndarray
    """[V, n] int32: what the wedge's far side lets through."""
    scans: int

    def points(self, v: int, anchor: tuple[float, float]) -> np.ndarray:
        """[n, 2] world positions where the beams of scan `v` end [m]."""
        n = self.beams[v]
        bearing = self.view[v, 2] + self.view[v, 3] * np.arange(n)
        r = self.ranges[v, :n]
        return np.stack(
            [
                anchor[0] + self.view[v, 0] + r * np.cos(bearing),
                anchor[1] + self.view[v, 1] + r * np.sin(bearing),
            ],
            axis=1,
        )

    def untracked(self, anchor: tuple[float, float]) -> np.ndarray:
        """[m, 2] world positions of every return but those of tracked movers [m]."""
        found = [np.zeros((0, 2))]
        for v in range(self.scans):
            met = self.met[v, : self.beams[v]]
            hit = (met > wedges.NOTHING) & (met != wedges.TRACKED)
            found.append(self.points(v, anchor)[hit])
        return np.concatenate(found)


@dataclass(frozen=True, slots=True)
class Labels:
    """What each beam of some scans met, before anything is concluded from it."""

    scans: Sequence[Scan]
    view: np.ndarray
    """[V, 8] float32, see kernels/beams.py."""
    ranges: Sequence[np.ndarray]
    """For each scan [n] float32 [m]; what lies beyond the grid is cut off."""
    met: Sequence[np.ndarray]
    """For each scan [n] int32, see kernels/beams.py."""
    closed: Sequence[bool]
    """Whether the beams go all the way round."""
    map_cells: np.ndarray
    frame: np.ndarray
    """The map's surfaces and their frame, as kernels/beams.py reads them."""


def labels_of(
    scans: Sequence[Scan],
    settings: Settings,
    anchor: tuple[float, float],
    reach_of: Sequence[float],
    static_map: StaticMap | None,
) -> Labels:
    """Tell what each beam met.

    Args:
        scans: of one instant.
        settings: object width, map tolerance.
        anchor: of the window [m].
        reach_of: for each scan, the range beyond which the grid holds nothing [m].
        static_map: declares surfaces that stay.
    """
    view = np.zeros((len(scans), 8), dtype=np.float32)
    ranges, met, closed = [], [], []
    map_cells, frame = _map_arrays(static_map, settings.map_tolerance, anchor)
    for v, scan in enumerate(scans):
        limit = min(scan.range_max, reach_of[v])
        closing = 2 * math.pi - (len(scan.ranges) - 1) * scan.angle_increment
        closed.append(closing < 1.5 * scan.angle_increment)
        x, y, theta = scan.pose
        bearing = math.remainder(theta + scan.angle_min, 2 * math.pi)
        view[v, :6] = (
            x - anchor[0], y - anchor[1], bearing, scan.angle_increment, closing, limit,
        )  # fmt: skip
        r = np.where(scan.lost, 0.0, np.minimum(scan.ranges, limit)).astype(np.float32)
        labels = np.where(scan.returned & (scan.ranges < limit), wedges.MOVABLE, wedges.NOTHING)
        if scan.moving is not None:
            labels[(labels == wedges.MOVABLE) & ~scan.moving] = wedges.STATIC
        labels[scan.lost] = wedges.LOST
        labels = labels.astype(np.int32)
        if static_map is not None:
            wedges.label_by_map(
                r, view, v, int(closed[v]), settings.object_width, map_cells, frame, labels
            )
        ranges.append(r)
        met.append(labels)
    return Labels(scans, view, ranges, met, closed, map_cells, frame)


def views_of(
    labels: Labels,
    empty_discs: Sequence[tuple[float, float, float]],
    settings: Settings,
    anchor: tuple[float, float],
    static_map: StaticMap | None,
    owners: Sequence[np.ndarray] | None = None,
) -> Views:
    """Work out what the scans prove.

    Args:
        labels: what their beams met.
        empty_discs: (x, y, radius) of discs known to be empty then [m].
        settings: object width, noise, map tolerance.
        anchor: of the window [m].
        static_map: declares surfaces that stay.
        owners: for each scan [n] the mover that a return belongs to, which is asked about by
            itself; -1: none.
    """
    scans = labels.scans
    count = len(scans) + len(empty_discs)
    longest = max([len(s.ranges) for s in scans] + [DISC_BEAMS])
    view = np.zeros((count, 8), dtype=np.float32)
    view[: len(scans)] = labels.view
    beams = np.zeros(count, dtype=np.int32)
    ranges = np.zeros((count, longest), dtype=np.float32)
    met = np.zeros((count, longest), dtype=np.int32)
    reach = np.zeros((count, longest), dtype=np.float32)
    far_side = np.full((count, longest), wedges.OPEN, dtype=np.int32)
    by_map_width = 0.0
    if static_map is not None:
        # how far from a surface's true place a return may be that is taken for it
        off = settings.map_tolerance + math.sqrt(2) * static_map.resolution
        off += settings.range_noise + settings.localisation_error
        by_map_width = settings.object_width - off

    for v, scan in enumerate(scans):
        n = len(scan.ranges)
        beams[v] = n
        own, owner = labels.met[v], labels.met[v]  # nobody is tracked: nobody's owner is asked for
        if owners is not None:
            owner = owners[v].astype(np.int32)
            own = np.where((own == wedges.MOVABLE) & (owner >= 0), wedges.TRACKED, own)
            own = own.astype(np.int32)
        wedges.prove_wedges(
            labels.ranges[v], own, owner, view, v, int(labels.closed[v]), settings.object_width,
            by_map_width, settings.range_noise, labels.map_cells, labels.frame, reach, far_side,
        )  # fmt: skip
        ranges[v, :n] = labels.ranges[v]
        met[v, :n] = own
    for v, (x, y, radius) in enumerate(empty_discs, start=len(scans)):
        step = 2 * math.pi / DISC_BEAMS
        view[v, :6] = (x - anchor[0], y - anchor[1], 0.0, step, step, radius)
        beams[v] = DISC_BEAMS
        reach[v, :DISC_BEAMS] = radius
        ranges[v, :DISC_BEAMS] = radius
    return Views(view, beams, ranges, met, reach, far_side, len(scans))


def _map_arrays(
    static_map: StaticMap | None, tolerance: float, anchor: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """The map's surfaces and their frame, as kernels/beams.py reads them."""
    if static_map is None:
        return np.zeros((1, 1), dtype=np.uint8), np.zeros(6, dtype=np.float32)
    x, y, yaw = static_map.origin
    frame = np.array(
        [x - anchor[0], y - anchor[1], math.cos(yaw), math.sin(yaw), 1 / static_map.resolution, 1],
        dtype=np.float32,
    )
    return static_map.dilated(tolerance).astype(np.uint8, copy=False), frame
