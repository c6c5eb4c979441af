"""Fenced places with boxes and walls in them, drawn at random."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.sim import geometry
from passpmp_ti.sim.world import Bounds, World

TRIES = 4000


@dataclass(frozen=True, kw_only=True)
class Scale:
    """How large things are, for one kind of robot [m]."""

    side: tuple[float, float]
    """Least and greatest side of the fenced square."""
    box: tuple[float, float]
    """Least and greatest side of a box."""
    wall: tuple[float, float]
    """Least and greatest length of a wall."""
    things: tuple[int, int]
    """Fewest and most boxes and walls."""
    gap: float
    """Least room between two of them, and to the fence."""
    goal_room: float
    """Least room between a goal and what stands."""
    goals: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Arena:
    """A fenced square, what stands in it, a start and places to drive to."""

    bounds: Bounds
    polygons: tuple[np.ndarray, ...]
    """Rectangles: no corner is sharper than a right angle."""
    fence: np.ndarray
    """[4, 4] [m]."""
    start: tuple[float, float, float]
    goals: tuple[tuple[float, float], ...]

    @property
    def world(self) -> World:
        """What stands, without movers."""
        return World(self.bounds, self.polygons, self.fence)


def rectangle(x: float, y: float, length: float, width: float, heading: float) -> np.ndarray:
    """[4, 2] corners about (x, y) [m]."""
    corners = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array([length, width])
    c, s = np.cos(heading), np.sin(heading)
    return corners @ np.array([[c, s], [-s, c]]) + np.array([x, y])


def draw_arena(
    scale: Scale, object_width: float, clear_radius: float, generator: np.random.Generator
) -> Arena:
    """Draw a place.

    Args:
        scale: how large things are.
        object_width: nothing that stands is narrower [m].
        clear_radius: nothing stands nearer to the start [m].
        generator: where randomness comes from.

    Raises:
        ValueError: no room for the start or the goals.
    """
    side = float(generator.uniform(*scale.side))
    corners = np.array([[0, 0], [side, 0], [side, side], [0, side]], dtype=np.float64)
    fence = geometry.edges(corners)
    polygons: list[np.ndarray] = []
    wanted = int(generator.integers(scale.things[0], scale.things[1] + 1))
    for _ in range(20 * wanted):
        if len(polygons) == wanted:
            break
        thing = _thing(scale, object_width, side, generator)
        outlines = [fence, *(geometry.edges(p) for p in polygons)]
        if _clear_of(thing, np.concatenate(outlines), scale.gap, side, polygons):
            polygons.append(thing)
    bounds = (0.0, 0.0, side, side)
    still = World(bounds, tuple(polygons), fence)
    start_room = max(scale.goal_room, clear_radius + 0.1)
    places = _places(still, side, scale.goal_room, scale.goals, generator)
    start = _places(still, side, start_room, 1, generator)[0]
    heading = float(generator.uniform(-np.pi, np.pi))
    return Arena(
        bounds=bounds,
        polygons=tuple(polygons),
        fence=fence,
        start=(float(start[0]), float(start[1]), heading),
        goals=tuple((float(x), float(y)) for x, y in places),
    )


def _thing(
    scale: Scale, object_width: float, side: float, generator: np.random.Generator
) -> np.ndarray:
    x, y = generator.uniform(0, side, 2)
    heading = generator.uniform(0, np.pi) if generator.uniform() < 0.5 else 0.0
    if generator.uniform() < 0.3:
        length, width = generator.uniform(*scale.wall), object_width
        heading += 0.5 * np.pi * int(generator.integers(2))
    else:
        length, width = generator.uniform(*scale.box, 2)
    return rectangle(x, y, length, width, heading)


def _clear_of(
    thing: np.ndarray, outline: np.ndarray, gap: float, side: float, others: list[np.ndarray]
) -> bool:
    own = geometry.edges(thing)
    apart = geometry.segment_to_segment(
        own[:, None, :2], own[:, None, 2:], outline[None, :, :2], outline[None, :, 2:]
    )
    middle = thing.mean(axis=0)[None]
    inside = any(geometry.inside_polygon(middle, other)[0] for other in others)
    inside |= any(geometry.inside_polygon(other.mean(axis=0)[None], thing)[0] for other in others)
    within = bool(((thing > 0) & (thing < side)).all())
    return within and not inside and bool(apart.min() > gap)


def _places(
    still: World, side: float, room: float, count: int, generator: np.random.Generator
) -> np.ndarray:
    """[count, 2] places with room about them, each far from the one before [m]."""
    drawn = generator.uniform(0, side, (TRIES, 2))
    drawn = drawn[still.clearance(drawn) > room]
    if not len(drawn):
        raise ValueError(f"draw_arena: no place with {room:g} m of room in {side:g} m")
    chosen = [drawn[0]]
    for place in drawn[1:]:
        if len(chosen) == count:
            break
        if np.hypot(*(place - chosen[-1])) > 0.35 * side:
            chosen.append(place)
    return np.array(chosen)
