"""Surfaces that are known to stay: an occupancy map, read from a file or drawn from lines."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from passpmp_ti import door
from passpmp_ti.grid.map_file import read_map


@dataclass(frozen=True, slots=True, eq=False)
class StaticMap:
    """Which cells of a fixed grid hold something that never moves.

    Unknown cells count as empty: calling a surface static is what must be earned, since nothing
    is expected to come out of it.
    """

    occupied: np.ndarray
    """[J, I] bool; row 0 is the lowest y of the map's own frame."""
    resolution: float
    """Side of a cell [m]."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """World (x, y, yaw) of the outer corner of cell [0, 0] [m, m, rad]."""
    _dilated: dict[float, np.ndarray] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        occupied = np.array(self.occupied)
        if occupied.ndim != 2 or not occupied.size or occupied.dtype != np.bool_:
            raise ValueError(
                "StaticMap.occupied must be bool of shape (J, I), J and I >= 1;"
                f" got {occupied.dtype} {occupied.shape}"
            )
        occupied.setflags(write=False)
        set_ = object.__setattr__
        set_(self, "occupied", occupied)
        resolution = door.finite("StaticMap", "resolution", self.resolution, above=0.0, unit="m")
        set_(self, "resolution", resolution)
        x, y, yaw = door.array("StaticMap", "origin", self.origin, (3,))
        set_(self, "origin", (float(x), float(y), float(yaw)))

    @classmethod
    def load(cls, path: str | Path) -> StaticMap:
        """Read a map_server pair: a YAML file and the PGM or PNG image it names.

        An image may be gzipped. Colours are averaged; a pixel less than half opaque is unknown.

        Args:
            path: the YAML file.

        Raises:
            ValueError: the file, the key and the rule that is broken.
        """
        return cls(*read_map(Path(path)))

    @classmethod
    def from_segments(
        cls, segments: np.ndarray, resolution: float = 0.05, thickness: float = 0.0
    ) -> StaticMap:
        """Draw wall lines into a map that just holds them.

        Args:
            segments: [n, 4] x1, y1, x2, y2 [m], n >= 1.
            resolution: side of a cell [m].
            thickness: of the walls [m]; 0: the cells that the lines pass through.

        Raises:
            ValueError: no segments, wrong shape, not finite, resolution not > 0.
        """
        owner = "StaticMap.from_segments"
        lines = door.array(owner, "segments", segments, (None, 4))
        door.finite(owner, "resolution", resolution, above=0.0, unit="m")
        door.finite(owner, "thickness", thickness, least=0.0, unit="m")
        if not len(lines):
            raise ValueError(f"{owner}.segments is empty; a map needs at least one wall")
        ends = lines.reshape(-1, 2)
        margin = resolution + thickness
        low = np.floor((ends.min(axis=0) - margin) / resolution) * resolution
        i_count, j_count = np.ceil((ends.max(axis=0) + margin - low) / resolution).astype(int)
        occupied = np.zeros((j_count, i_count), dtype=bool)
        for x1, y1, x2, y2 in lines:
            # steps of a quarter cell miss no more than a cell's clipped corner
            count = math.ceil(4 * math.hypot(x2 - x1, y2 - y1) / resolution) + 2
            i = np.floor((np.linspace(x1, x2, count) - low[0]) / resolution).astype(int)
            j = np.floor((np.linspace(y1, y2, count) - low[1]) / resolution).astype(int)
            occupied[j, i] = True
        drawn = cls(occupied, resolution, (float(low[0]), float(low[1]), 0.0))
        return (
            drawn if thickness == 0 else cls(drawn.dilated(thickness / 2), resolution, drawn.origin)
        )

    def cells(self, points: np.ndarray) -> np.ndarray:
        """[n, 2] cell (j, i) of world points [n, 2] [m]; outside the map: beyond its shape."""
        x, y, yaw = self.origin
        d = np.asarray(points, dtype=np.float64) - (x, y)
        c, s = math.cos(yaw), math.sin(yaw)
        own = np.stack([c * d[..., 0] + s * d[..., 1], c * d[..., 1] - s * d[..., 0]], axis=-1)
        return np.floor(own[..., ::-1] / self.resolution).astype(np.int64)

    def contains(self, points: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
        """Whether each point is within `tolerance` of an occupied cell.

        True is never said of a point that is further away; within one cell of the limit a point
        may be missed, which only takes a known surface for one that may move.

        Args:
            points: [n, 2] world [m].
            tolerance: [m], >= 0.

        Returns:
            [n] bool.
        """
        points = door.array("StaticMap.contains", "points", points, (None, 2))
        grown = self.dilated(tolerance)
        j, i = self.cells(points).T
        inside = (j >= 0) & (i >= 0) & (j < grown.shape[0]) & (i < grown.shape[1])
        found = np.zeros(len(points), dtype=bool)
        found[inside] = grown[j[inside], i[inside]]
        return found

    def dilated(self, tolerance: float) -> np.ndarray:
        """[J, I] bool, read-only: cells all of which is within `tolerance` [m] of an occupied cell.

        Centres at most `tolerance` apart bound every point of the one cell against the whole
        square of the other: both squares have the same half side, so it cancels.
        """
        tolerance = door.finite("StaticMap.dilated", "tolerance", tolerance, least=0.0, unit="m")
        if tolerance not in self._dilated:
            if self.occupied.any():
                # only here: it takes long to import, and many robots have no map
                from scipy.ndimage import distance_transform_edt

                distance = distance_transform_edt(~self.occupied, sampling=self.resolution)
                grown = distance <= tolerance
            else:
                grown = np.zeros_like(self.occupied)
            grown.setflags(write=False)
            self._dilated[tolerance] = grown
        return self._dilated[tolerance]

    def segments(self) -> np.ndarray:
        """[n, 4] outline of the occupied cells as world line segments x1, y1, x2, y2 [m]."""
        across = _runs(self.occupied)  # (row edge, first column, last column)
        along = _runs(self.occupied.T)
        own = (
            np.concatenate(
                [
                    np.stack([across[:, 1], across[:, 0], across[:, 2], across[:, 0]], axis=1),
                    np.stack([along[:, 0], along[:, 1], along[:, 0], along[:, 2]], axis=1),
                ]
            )
            * self.resolution
        )
        x, y, yaw = self.origin
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, s], [-s, c]])
        return (own.reshape(-1, 2) @ turn + (x, y)).reshape(-1, 4)


def _runs(occupied: np.ndarray) -> np.ndarray:
    """[n, 3] unbroken edges between occupied and free rows: edge row, first and last column."""
    padded = np.pad(occupied, ((1, 1), (0, 0)))
    edge = padded[1:] != padded[:-1]
    # an edge also ends where the occupied side changes, so that outlines stay outlines
    side = np.where(edge, np.where(padded[1:], 1, 2), 0)
    walled = np.pad(side, ((0, 0), (1, 1)))
    changes = walled[:, 1:] != walled[:, :-1]
    found = []
    for row in np.flatnonzero(edge.any(axis=1)):
        cuts = np.flatnonzero(changes[row])
        for first, last in pairwise(cuts):
            if side[row, first]:
                found.append((row, first, last))
    return np.array(found, dtype=np.float64).reshape(-1, 3)
