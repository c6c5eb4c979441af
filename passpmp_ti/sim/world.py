"""What really is there: things that stay and things that move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from passpmp_ti import door
from passpmp_ti.sim import geometry
from passpmp_ti.sim.movers import Movers, NoMovers

Bounds = tuple[float, float, float, float]
"""(x low, y low, x high, y high) [m]."""


@dataclass(frozen=True, eq=False)
class World:
    """Fixed polygons, loose walls, and moving discs, the truth that no planner sees."""

    bounds: Bounds
    """Where the scene lies [m]; movers drawn at random keep inside, nothing else is held back."""
    polygons: Sequence[np.ndarray] = ()
    """Solid things that stay, each [n, 2] corners [m] in order, n >= 3."""
    segments: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    """[n, 4] walls without thickness that stay: x1, y1, x2, y2 [m]."""
    movers: Movers = field(default_factory=NoMovers)
    outline: np.ndarray = field(init=False)
    """[n, 4] every fixed surface: the polygons' edges, then the loose walls [m]."""

    def __post_init__(self) -> None:
        low_x, low_y, high_x, high_y = door.array("World", "bounds", self.bounds, (4,))
        if not (low_x < high_x and low_y < high_y):
            raise ValueError(
                f"World.bounds must be (x low, y low, x high, y high); got {self.bounds!r}"
            )
        polygons = []
        for n, polygon in enumerate(self.polygons):
            corners = door.array("World", f"polygons[{n}]", polygon, (None, 2))
            if len(corners) < 3:
                raise ValueError(f"World.polygons[{n}] has {len(corners)} corners; 3 make a solid")
            polygons.append(corners)
        segments = door.array("World", "segments", self.segments, (None, 4))
        set_ = object.__setattr__
        set_(self, "polygons", tuple(polygons))
        set_(self, "segments", segments)
        outline = np.concatenate([*(geometry.edges(p) for p in polygons), segments])
        outline.setflags(write=False)
        set_(self, "outline", outline)

    def clearance(self, points: np.ndarray) -> np.ndarray:
        """[n] distance of points [n, 2] to the nearest fixed thing [m]; 0 inside one."""
        points = np.asarray(points, dtype=np.float64)
        apart = np.full(len(points), np.inf)
        if len(self.outline):
            a, b = self.outline[:, :2], self.outline[:, 2:]
            apart = geometry.point_to_segment(points[:, None], a, b).min(axis=1)
        for polygon in self.polygons:
            apart[geometry.inside_polygon(points, polygon)] = 0.0
        return apart

    def holds(self, point: np.ndarray, time: float) -> bool:
        """Whether a point [2] is inside a polygon or a mover at `time` [s]."""
        point = np.asarray(point, dtype=np.float64)
        if any(geometry.inside_polygon(point[None], p)[0] for p in self.polygons):
            return True
        apart = np.hypot(*(self.movers.at(time) - point).T)
        return bool((self.movers.present(time) & (apart < self.movers.radius)).any())
