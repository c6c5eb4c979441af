"""Where a view keeps movers out, and which bearings it covers; asked about discs."""

from __future__ import annotations

import math

import numpy as np

from passpmp_verify.view import SHUT, TAU, View

INSIDE, OUTSIDE, UNSURE = 1, -1, 0
"""All of a disc, none of it, or not known."""
EPS = 1e-6
"""[m] and [rad]: two borders nearer than this are one."""


class Extremes:
    """Least and greatest of a ring of numbers over any run of it."""

    def __init__(self, ring: np.ndarray) -> None:
        self._n = len(ring)
        self._least, self._most = [ring], [ring]
        step = 1
        while 2 * step <= self._n:
            low, high = self._least[-1], self._most[-1]
            self._least.append(np.minimum(low, np.roll(low, -step)))
            self._most.append(np.maximum(high, np.roll(high, -step)))
            step *= 2
        self._tables = np.array(self._least), np.array(self._most)

    def over(self, first: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(least, greatest) of `count` numbers from `first` on."""
        level = np.log2(count).astype(int)
        last = (first + count - (1 << level)) % self._n
        low, high = self._tables
        return (
            np.minimum(low[level, first], low[level, last]),
            np.maximum(high[level, first], high[level, last]),
        )


class Keeper:
    """Tells where a view keeps movers out.

    Args:
        tolerance: how far behind a shutting surface, as this view saw it, another view's border
            may seem to be [m]. None: shut wedges are not asked, only what is proven empty counts.
    """

    def __init__(self, view: View, tolerance: float | None) -> None:
        self.view = view
        self._tolerance = tolerance
        self._reach = Extremes(view.reach)
        shut = view.side == SHUT if tolerance is not None else np.zeros(len(view.side), bool)
        self._shut = shut
        # behind a chord by no more than the tolerance
        ends = np.linalg.norm(view.chord - (view.x, view.y), axis=2).max(axis=1)
        self._farthest = Extremes(np.where(shut, ends + (tolerance or 0.0), view.reach))

    def judge(self, points: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """[n] INSIDE: all of a disc about each point is kept out; OUTSIDE: none of it; UNSURE."""
        view, n = self.view, len(self.view.reach)
        r, turn = view.polar(points)
        half = _span_of(r, radius) + EPS
        first = view.wedge(turn - half)
        count = (view.wedge(turn + half) - first) % n + 1
        count = np.where(half > 0.45 * TAU, n, count)
        first = np.where(half > 0.45 * TAU, 0, first)
        least, _ = self._reach.over(first, count)
        _, most = self._farthest.over(first, count)
        verdict = np.where(most < r - radius, OUTSIDE, UNSURE)
        verdict[least >= r + radius + EPS] = INSIDE
        if self._shut.any():
            near = np.flatnonzero((verdict == UNSURE) & (count <= 2))
            inside = np.ones(len(near), dtype=bool)
            for step in range(2):
                w = (first[near] + np.minimum(step, count[near] - 1)) % n
                kept = view.reach[w] >= r[near] + radius[near] + EPS
                kept |= self._shut[w] & self._before(w, points[near], radius[near])
                inside &= kept
            verdict[near[inside]] = INSIDE
        return verdict

    def _before(self, wedge: np.ndarray, points: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Whether discs are on the sensor's side of the surfaces that shut the wedges."""
        start, end = self.view.chord[wedge, 0], self.view.chord[wedge, 1]
        along = end - start
        length = np.hypot(along[:, 0], along[:, 1])
        w = points - start
        # the sensor lies to the left of the way from start to end
        left = along[:, 0] * w[:, 1] - along[:, 1] * w[:, 0]
        assert self._tolerance is not None
        return left >= (radius - self._tolerance) * length


class Field:
    """Tells which bearings a scan covers."""

    def __init__(self, view: View) -> None:
        self.view = view
        self._span = TAU if view.closed else (len(view.reach) - 1) * view.increment

    def judge(self, points: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """[n] INSIDE: all of a disc about each point is covered; OUTSIDE: none of it; UNSURE."""
        if self.view.closed:
            return np.full(len(points), INSIDE)
        r, turn = self.view.polar(points)
        half = _span_of(r, radius)
        verdict = np.full(len(points), UNSURE)
        verdict[(turn - half > EPS) & (turn + half < self._span - EPS)] = INSIDE
        verdict[(turn - half > self._span - EPS) & (turn + half < TAU + EPS)] = OUTSIDE
        return verdict


def _span_of(r: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Half the angle under which a disc at range r is seen [rad]; pi from inside it."""
    share = np.minimum(radius / np.maximum(r, 1e-12), 1.0)
    return np.where(share < 0.999, np.arcsin(share), math.pi)
