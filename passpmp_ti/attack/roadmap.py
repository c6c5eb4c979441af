"""Ways for discs about things that stand: places, and which can be reached from which."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from passpmp_ti.sim import geometry
from passpmp_ti.sim.world import World

NEIGHBOURS = 10
NOWHERE = -9999  # what scipy writes where there is no way


def crossed(eye: np.ndarray, places: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """[n] bool: something fixed stands between a point [2] and places [n, 2]."""
    if not len(outline):
        return np.zeros(len(places), dtype=bool)
    a, b = outline[None, :, :2], outline[None, :, 2:]
    p, q = eye[None, None], places[:, None]
    side = geometry.cross(b - a, p - a) * geometry.cross(b - a, q - a)
    other = geometry.cross(q - p, a - p) * geometry.cross(q - p, b - p)
    return ((side < 0) & (other < 0)).any(axis=1)


class Roadmap:
    """Places drawn at random, some beside each corner, joined where a disc can go straight."""

    def __init__(
        self, world: World, radius: float, count: int, generator: np.random.Generator
    ) -> None:
        """Lay places for discs of `radius` [m] or less.

        Raises:
            ValueError: a world without room for such a disc.
        """
        self._outline = world.outline
        self._radius = radius
        low, high = np.array(world.bounds[:2]), np.array(world.bounds[2:])
        drawn = [generator.uniform(low, high, (count, 2))]
        for polygon in world.polygons:
            outward = polygon - polygon.mean(axis=0)
            outward /= np.linalg.norm(outward, axis=1)[:, None]
            drawn.append(polygon + (1.6 * radius) * outward)
        places = np.concatenate(drawn)
        inside = ((places > low + radius) & (places < high - radius)).all(axis=1)
        places = places[inside]
        self.places = places[world.clearance(places) > 1.05 * radius]
        if not len(self.places):
            raise ValueError(f"Roadmap: no room for a disc of radius {radius:g} m in this world")
        self.apart, self._before = self._join()

    def _join(self) -> tuple[np.ndarray, np.ndarray]:
        """([n, n] lengths of ways, [n, n] the place before the last on each)."""
        count = len(self.places)
        apart = np.hypot(*(self.places[:, None] - self.places[None]).transpose(2, 0, 1))
        nearest = np.argsort(apart, axis=1, kind="stable")[:, 1 : NEIGHBOURS + 1]
        first = np.repeat(np.arange(count), nearest.shape[1])
        second = nearest.ravel()
        free = self.clear(self.places[first], self.places[second])
        first, second = first[free], second[free]
        graph = coo_array((apart[first, second], (first, second)), shape=(count, count))
        lengths, before = dijkstra(graph.tocsr(), directed=False, return_predecessors=True)
        return lengths, before

    def clear(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """[n] bool: a disc can go straight from begin [n, 2] to end [n, 2]."""
        if not len(self._outline):
            return np.ones(len(begin), dtype=bool)
        gap = geometry.segment_to_segment(
            begin[:, None], end[:, None], self._outline[None, :, :2], self._outline[None, :, 2:]
        )
        return np.asarray((gap > self._radius).all(axis=1))

    def way(self, place: np.ndarray, goal: int) -> list[np.ndarray]:
        """Points to go through from a place [2] to the place numbered `goal`; last the goal."""
        end = self.places[goal]
        if self.clear(place[None], end[None])[0]:
            return [end]
        near = np.argsort(np.hypot(*(self.places - place).T), kind="stable")[:8]
        open_ = near[self.clear(np.repeat(place[None], len(near), axis=0), self.places[near])]
        first = int(open_[np.argmin(self.apart[goal, open_])]) if len(open_) else int(near[0])
        numbers = [first]
        while numbers[-1] != goal and self._before[goal, numbers[-1]] != NOWHERE:
            numbers.append(int(self._before[goal, numbers[-1]]))
        return [self.places[n] for n in numbers]
