"""Where faults are tried: shipped scenarios, made small enough for many cycles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from passpmp_ti.faults.movers import SteppedMovers, Together, places_for
from passpmp_ti.sim.geometry import edges
from passpmp_ti.sim.scenario import Scenario, load_scenario
from passpmp_ti.sim.sources import NobodyMoves
from passpmp_ti.sim.world import World

LAPS = 50
"""How often the robot is sent there and back: an episode ends with its faults, not at a goal."""


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A shipped scenario, with coarser sensors and smaller trees."""

    scenario: str
    object_speed: float
    """Bound of everything that moves [m/s]."""
    cell: float
    range_max: float
    beams: int
    """Of each range finder."""
    hunters: int
    hunter_radius: float
    keep_out: float
    """No hunter begins nearer to the robot [m]."""
    back: tuple[float, float]
    """The goal on the way back [m]."""
    boxes: tuple[tuple[float, float, float, float], ...] = ()
    """(x low, y low, x high, y high) [m]: what stands in place of the scenario's things, inside a
    fence along `bounds`. Few beams prove nothing of thin walls."""
    bounds: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def load(self) -> Scenario:
        """The scenario."""
        found = load_scenario(self.scenario)
        small = dict(cell=self.cell, capacity=150, optimizer="exhaustive", guide="euclidean")
        found = found.changed(small, object_speed=self.object_speed)
        lidars = tuple(
            replace(lidar, range_max=self.range_max, beams=self.beams) for lidar in found.lidars
        )
        goals = (*found.goals, self.back) * LAPS
        if not self.boxes:
            return replace(found, lidars=lidars, goals=goals)
        return replace(
            found, lidars=lidars, goals=goals, bounds=self.bounds, movers=NobodyMoves(),
            polygons=tuple(_corners(box) for box in self.boxes), walls=edges(_corners(self.bounds)),
        )  # fmt: skip


HALL = ((3.0, -2.6, 4.0, -1.6), (6.0, 1.5, 7.5, 2.5), (9.0, -2.5, 9.8, -1.5), (4.5, 2.8, 6.0, 3.6))
"""Boxes in a hall for the wheelchair."""

GROUNDS: dict[str, tuple[Ground, ...]] = {
    "car": (
        Ground(
            scenario="crowded", object_speed=4.0, cell=0.5,
            range_max=40.0, beams=360, hunters=2, hunter_radius=1.0, keep_out=35.0,
            back=(20.0, 90.0),
        ),
        Ground(
            scenario="simple", object_speed=6.0, cell=0.5,
            range_max=40.0, beams=360, hunters=3, hunter_radius=1.5, keep_out=35.0,
            back=(25.0, 90.0),
        ),
    ),
    "wheelchair": (
        Ground(
            scenario="corridor_person", object_speed=0.8, cell=0.06,
            range_max=6.0, beams=361, hunters=2, hunter_radius=0.25, keep_out=4.0,
            back=(0.0, 0.0), boxes=HALL, bounds=(-2.0, -4.0, 14.0, 4.0),
        ),
        Ground(
            scenario="corridor_person", object_speed=0.4, cell=0.06,
            range_max=4.0, beams=271, hunters=3, hunter_radius=0.3, keep_out=4.0,
            back=(0.0, 0.0), boxes=HALL[1:3], bounds=(-2.0, -3.0, 14.0, 3.0),
        ),
    ),
}  # fmt: skip
"""By robot."""


def peopled(
    scenario: Scenario, ground: Ground, seed: int, rng: np.random.Generator
) -> tuple[World, World, SteppedMovers, np.ndarray, float]:
    """(the world with movers and hunters, what stands, the hunters, the robot's state, time)."""
    world, state, time = scenario.build(seed)
    still = scenario.still_world()
    places = places_for(
        still, ground.hunters, 2 * ground.hunter_radius, (state[:2], ground.keep_out), rng
    )
    radius = np.full(ground.hunters, ground.hunter_radius)
    hunters = SteppedMovers(places, radius, ground.object_speed, time)
    both = Together([world.movers, hunters])
    return World(world.bounds, world.polygons, world.segments, both), still, hunters, state, time


def _corners(box: tuple[float, float, float, float]) -> np.ndarray:
    """[4, 2] corners of (x low, y low, x high, y high) [m]."""
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
