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
LINGER = 20.0  # those seen standing stand this much longer than was recorded [s]: not for ever, or
# everybody who ever paused, most for seconds, would be a statue all through the recording
PACE = 1.2  # at which they come and go [m/s]
TURN = np.radians(7.5)  # between the headings that they may take [rad]
# Headings that are tried in turn [rad]: straight on first, then the least turn that leads out. A
# recording ends a step or two before a doorway, and the last step seldom aims through it.
TURNS = np.radians([0, *(sign * angle for angle in range(3, 100, 3) for sign in (1, -1))])


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
                found.append(np.column_stack([own[:, 0] / self.clock, own[:, 2], own[:, 3]]))
        return found


def recorded_movers(
    tracks: list[np.ndarray], edge: Bounds, walls: np.ndarray, radius: float = 0.25
) -> PathMovers:
    """People who walk as recorded and come from, and leave by, the edge of the scene.

    Before its first and after its last sample each walks on at its own first or last velocity to
    the edge. Where a wall is in the way, the heading is turned by the least angle that leads out
    (the speed stays). One who stands there has stood, or goes on standing, for twenty seconds and
    walks the shortest way to the edge; one who has no way out stands there all the time.

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
    return PathMovers(paths, np.full(len(paths), radius), born=np.array(born), gone=np.array(gone))


def _extension(
    last: np.ndarray, step: np.ndarray, edge: Bounds, walls: np.ndarray, radius: float
) -> tuple[np.ndarray, float]:
    """Rows t, x, y to add beyond `last`, and the time from which the person is not there."""
    sign = np.sign(step[0])
    velocity = step[1:] / abs(step[0])
    if not (edge[0] < last[1] < edge[2] and edge[1] < last[2] < edge[3]):
        return np.zeros((0, 3)), float(last[0])
    rows = []
    if np.hypot(*velocity) < STANDING:
        rows.append(np.array([last[0] + sign * LINGER, last[1], last[2]]))
        ways = sorted(
            (PACE * np.array([np.cos(a), np.sin(a)]) for a in np.arange(0.0, 2 * np.pi, TURN)),
            key=lambda way: _time_to_edge(last[1:], way, edge),
        )
    else:
        ways = [_turned(velocity, turn) for turn in TURNS]
    begin = rows[-1] if rows else last
    for way in ways:
        time = _time_to_edge(begin[1:], way, edge)
        if _way_is_clear(begin[1:], way, time, walls, radius):
            rows.append(np.array([begin[0] + sign * time, *(begin[1:] + way * time)]))
            return np.array(rows)[:: int(sign)], float(rows[-1][0])
    return np.zeros((0, 3)), sign * np.inf


def _turned(velocity: np.ndarray, turn: float) -> np.ndarray:
    c, s = np.cos(turn), np.sin(turn)
    return np.array([c * velocity[0] - s * velocity[1], s * velocity[0] + c * velocity[1]])


def _time_to_edge(place: np.ndarray, velocity: np.ndarray, edge: Bounds) -> float:
    """How long a point inside the edge takes to it [s]."""
    return min(
        ((edge[axis + 2] if v > 0 else edge[axis]) - place[axis]) / v
        for axis, v in enumerate(velocity)
        if abs(v) > 1e-9
    )


def _way_is_clear(
    place: np.ndarray, velocity: np.ndarray, time: float, walls: np.ndarray, radius: float
) -> bool:
    """Whether a disc may move on for a time [s] without touching a wall."""
    if not len(walls):
        return True
    a, b = walls[:, :2], walls[:, 2:]
    # who brushes along a wall where the recording ends must only not cross it
    keep = np.minimum(radius, 0.5 * geometry.point_to_segment(place, a, b))
    swept = geometry.segment_to_segment(place, place + velocity * time, a, b)
    return bool((swept >= keep).all())
