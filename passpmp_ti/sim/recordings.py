"""Recorded people as movers, each with its true clock and nobody born in the middle."""

from __future__ import annotations

import gzip
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from passpmp_ti import door
from passpmp_ti.sim import geometry
from passpmp_ti.sim.movers import PathMovers
from passpmp_ti.sim.world import Bounds

FORMATS = ("obsmat", "frame_id_x_y")
STANDING = 0.05  # slower than this a person stands [m/s]


@dataclass(frozen=True, kw_only=True)
class Recording:
    """A file of recorded people."""

    path: Path
    """The file, gzipped or not."""
    format: str
    """"obsmat": 8 columns frame, id, x, -, y, vx, -, vy; "frame_id_x_y": 4 columns; metres."""
    clock: float
    """Frames a second [1/s]; the files do not tell, and a wrong one changes every speed."""

    def tracks(self) -> list[np.ndarray]:
        """Per person [n, 3] rows t, x, y [s, m, m], in order of their ids.

        Somebody seen once only is left out: there is no motion to extend.

        Raises:
            ValueError: the file is absent or is not what `format` says.
        """
        if not self.path.is_file():
            raise ValueError(
                f"{self.path}: no such recording; set the environment variable PASSPMP_DATA to"
                " the folder that holds the recorded data"
            )
        opener = gzip.open if self.path.suffix == ".gz" else open
        try:
            with opener(self.path, "rt") as file:
                rows = np.loadtxt(file, ndmin=2)
        except (OSError, EOFError, ValueError) as cause:
            raise ValueError(f"{self.path}: not a table of numbers: {cause}") from cause
        columns = {"obsmat": (0, 1, 2, 4), "frame_id_x_y": (0, 1, 2, 3)}[self.format]
        width = 8 if self.format == "obsmat" else 4
        if rows.shape[1] != width:
            raise ValueError(
                f"{self.path}: format {self.format!r} has {width} columns; got {rows.shape[1]}"
            )
        rows = rows[:, columns]
        if not np.isfinite(rows).all():
            raise ValueError(f"{self.path}: holds numbers that are not finite")
        found = []
        for person in np.unique(rows[:, 1]):
            own = rows[rows[:, 1] == person]
            _, first = np.unique(own[:, 0], return_index=True)
            own = own[first]
            if len(own) > 1:
                found.append(
                    np.column_stack([own[:, 0] / self.clock, own[:, 2], own[:, 3]])
                )
        return found


def recorded_movers(
    tracks: list[np.ndarray], edge: Bounds, walls: np.ndarray, radius: float = 0.25
) -> PathMovers:
    """People who walk as recorded and come from, and leave by, the edge of the scene.

    Before its first and after its last sample each walks on at its own first or last velocity to
    the edge; one who stands there, or whose way a wall blocks, stands there all the time.

    Args:
        tracks: per person [n, 3] rows t, x, y, n >= 2 [s, m, m].
        edge: (x low, y low, x high, y high) beyond which nobody sees them [m].
        walls: [n, 4] segments x1, y1, x2, y2 that no extension passes [m].
        radius: of a person's disc [m].
    """
    door.finite("recorded_movers", "radius", radius, above=0.0, unit="m")
    paths, born, gone = [], [], []
    for track in tracks:
        head, before = _extension(track[0], track[0] - track[1], edge, walls, radius)
        tail, after = _extension(track[-1], track[-1] - track[-2], edge, walls, radius)
        paths.append(np.concatenate([head, track, tail]))
        born.append(before)
        gone.append(after)
    return PathMovers(
        paths, np.full(len(paths), radius), born=np.array(born), gone=np.array(gone)
    )


def _extension(
    last: np.ndarray, step: np.ndarray, edge: Bounds, walls: np.ndarray, radius: float
) -> tuple[np.ndarray, float]:
    """Rows to add beyond `last` (none or one), and the time from which the person is not there."""
    sign = np.sign(step[0])
    velocity = step[1:] / abs(step[0])
    speed = float(np.hypot(*velocity))
    forever = sign * np.inf
    inside = edge[0] < last[1] < edge[2] and edge[1] < last[2] < edge[3]
    if not inside:
        return np.zeros((0, 3)), float(last[0])
    if speed < STANDING:
        return np.zeros((0, 3)), forever
    to_edge = min(
        ((edge[axis + 2] if v > 0 else edge[axis]) - last[1 + axis]) / v
        for axis, v in enumerate(velocity) if v != 0
    )
    free = _free_time(last[1:], velocity, to_edge, walls, radius)
    if free <= 0:
        return np.zeros((0, 3)), forever
    row = np.array([last[0] + sign * free, *(last[1:] + velocity * free)])
    return row[None], float(row[0]) if free == to_edge else forever


def _free_time(
    place: np.ndarray, velocity: np.ndarray, longest: float, walls: np.ndarray, radius: float
) -> float:
    """How long a disc may move on before it would touch a wall [s], at most `longest`."""
    if not len(walls):
        return longest
    a, b = walls[:, :2], walls[:, 2:]
    # walls already touched where the recording ends (people brush along them) bar only crossing
    apart = geometry.point_to_segment(place, a, b)
    keep = np.minimum(radius, 0.5 * apart)
    low, high = 0.0, longest

    def clear(time: float) -> bool:
        swept = geometry.segment_to_segment(place, place + velocity * time, a, b)
        return bool((swept >= keep).all())

    if clear(longest):
        return longest
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if clear(middle) else (low, middle)
    return low
