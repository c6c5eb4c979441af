"""Discs that go round closed cubic B-splines, each at one speed of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.interpolate import splev, splprep

from passpmp_ti import door

PIECES = 2048  # chords along a spline: 0.3 m of a 600 m round
TRIES = 2000


class SplineMovers:
    """Discs that go round closed cubic B-splines, each at one speed of its own.

    The spline is cut into chords, and arc length is counted along the chords: between any two
    times a disc has moved at most its speed times their difference, whatever the spline does.
    """

    def __init__(
        self,
        control_points: Sequence[np.ndarray],
        radius: np.ndarray,
        speed: np.ndarray,
        phase: np.ndarray,
    ) -> None:
        """Lay closed splines through control points.

        Args:
            control_points: per disc [n, 2] [m], n >= 4; the curve closes by itself.
            radius: [m] [m].
            speed: [m] [m/s], >= 0.
            phase: [m] share of the round at which each disc is at t = 0, in [0, 1).
        """
        count = len(control_points)
        self.radius = door.array("SplineMovers", "radius", radius, (count,))
        self.speed = door.array("SplineMovers", "speed", speed, (count,))
        if (self.speed < 0).any() or (self.radius <= 0).any():
            raise ValueError("SplineMovers: speeds must be >= 0 m/s and radii > 0 m")
        self.top_speed = float(self.speed.max(initial=0.0))
        self.rounds = [closed_spline(points) for points in control_points]
        self._along = [_arc_length(points) for points in self.rounds]
        lengths = np.array([s[-1] for s in self._along])
        self._offset = lengths * np.asarray(phase, dtype=np.float64)

    def positions(self, times: np.ndarray) -> np.ndarray:
        times = np.atleast_1d(np.asarray(times, dtype=np.float64))
        found = np.empty((len(times), len(self.rounds), 2))
        for n, (points, along) in enumerate(zip(self.rounds, self._along, strict=True)):
            s = (self._offset[n] + self.speed[n] * times) % along[-1]
            found[:, n, 0] = np.interp(s, along, points[:, 0])
            found[:, n, 1] = np.interp(s, along, points[:, 1])
        return found

    def at(self, time: float) -> np.ndarray:
        return self.positions(np.array([time]))[0]

    def present(self, time: float) -> np.ndarray:
        return np.ones(len(self.rounds), dtype=bool)


def closed_spline(control_points: np.ndarray, pieces: int = PIECES) -> np.ndarray:
    """[pieces + 1, 2] points of the closed cubic B-spline through control points [n, 2], n >= 4."""
    points = door.array("closed_spline", "control_points", control_points, (None, 2))
    if len(points) < 4:
        raise ValueError(f"closed_spline needs at least 4 control points; got {len(points)}")
    spline, _ = splprep(np.concatenate([points, points[:1]]).T, s=0, per=True, k=3)
    curve = np.stack(splev(np.linspace(0.0, 1.0, pieces + 1), spline), axis=1)
    curve[-1] = curve[0]
    return curve


def draw_spline_movers(
    count: int,
    radius: tuple[float, float],
    speed: tuple[float, float],
    bounds: tuple[float, float, float, float],
    clearance: Callable[[np.ndarray], np.ndarray],
    keep_out: tuple[float, float, float],
    generator: np.random.Generator,
) -> SplineMovers:
    """Draw discs on random closed B-splines that never touch what stays.

    Args:
        count: how many.
        radius: least and greatest radius [m].
        speed: least and greatest speed [m/s].
        bounds: (x low, y low, x high, y high) within which the discs stay [m].
        clearance: points [n, 2] -> distance to the nearest fixed thing [n] [m].
        keep_out: (x, y, distance): no disc reaches nearer at t = 0 [m].
        generator: where randomness comes from.

    Raises:
        ValueError: there is no room for such discs.
    """
    low, high = np.array(bounds[:2]), np.array(bounds[2:])
    radii = generator.uniform(*radius, count)
    speeds = generator.uniform(*speed, count)
    kept: list[np.ndarray] = []
    phases = []
    for n in range(count):
        for _ in range(TRIES):
            points = generator.uniform(low, high, (int(generator.integers(4, 8)), 2))
            phase = float(generator.uniform())
            if _stays_clear(points, phase, float(radii[n]), (low, high), clearance, keep_out):
                break
        else:
            raise ValueError(
                f"no room for mover {n} of radius {radii[n]:.2f} m after {TRIES} tries; use fewer"
                " or smaller movers, wider bounds, or fewer fixed things"
            )
        kept.append(points)
        phases.append(phase)
    return SplineMovers(kept, radii, speeds, np.array(phases))


def _stays_clear(
    control_points: np.ndarray,
    phase: float,
    radius: float,
    bounds: tuple[np.ndarray, np.ndarray],
    clearance: Callable[[np.ndarray], np.ndarray],
    keep_out: tuple[float, float, float],
) -> bool:
    curve = closed_spline(control_points)
    low, high = bounds
    if (curve - radius < low).any() or (curve + radius > high).any():
        return False
    along = _arc_length(curve)
    at_start = [np.interp(phase * along[-1], along, column) for column in curve.T]
    if np.hypot(at_start[0] - keep_out[0], at_start[1] - keep_out[1]) < keep_out[2] + radius:
        return False
    coarse = curve[::16]  # most paths fail somewhere obvious
    if (clearance(coarse) <= radius).any():
        return False
    half_chord = 0.5 * np.diff(along).max()
    return bool((clearance(curve) > radius + half_chord).all())


def _arc_length(points: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
