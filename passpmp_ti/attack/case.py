"""One attack, drawn whole from its kind, robot and seed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from passpmp_ti import door
from passpmp_ti.attack import band
from passpmp_ti.attack.arena import Arena, Scale, draw_arena
from passpmp_ti.attack.errors import POSES, RANGES, STAMPS, TRACKING, Errors
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.robots import CarLike, DifferentialDrive, Robot, cover_rectangle
from passpmp_ti.settings import Settings
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.scenario import Scenario

ROBOTS = ("car", "wheelchair")
HUNTERS = {
    "intercept": (band.INTERCEPT,),
    "ambush": (band.AMBUSH,),
    "rim": (band.RIM,),
    "cut-in": (band.CUT_IN,),
    "crowd": (band.CROWD,),
    "shadow": (band.SHADOW, band.SHADOW, band.WALK),
    "mixed": (band.INTERCEPT, band.AMBUSH, band.RIM, band.CUT_IN, band.SHADOW, band.WALK),
}
"""Of whom each kind of attack is made."""
WALKERS = "walkers"
KINDS = (*HUNTERS, WALKERS)

SCALES = {
    "car": Scale(
        side=(90.0, 130.0), box=(3.0, 12.0), wall=(8.0, 30.0), things=(2, 7), gap=10.0,
        goal_room=7.0, goals=40,
    ),
    "wheelchair": Scale(
        side=(16.0, 24.0), box=(0.6, 2.5), wall=(1.5, 6.0), things=(2, 8), gap=2.2,
        goal_room=1.2, goals=40,
    ),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Case:
    """Names an attack; everything in it follows."""

    robot: str
    kind: str
    seed: int
    duration: float = 45.0
    """Of the episode [s]."""
    cheat_speed: float = 1.0
    """Movers are this many times as fast as declared: above 1 the harness must find contacts."""
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `Settings` that are not drawn."""

    def __post_init__(self) -> None:
        door.choice("Case", "robot", self.robot, ROBOTS)
        door.choice("Case", "kind", self.kind, KINDS)
        door.whole("Case", "seed", self.seed, least=0)
        door.finite("Case", "duration", self.duration, above=0.0, unit="s")
        door.finite("Case", "cheat_speed", self.cheat_speed, above=0.0)

    def generator(self, purpose: int) -> np.random.Generator:
        """Random numbers of this case; each purpose has its own."""
        return np.random.default_rng(
            [self.seed, ROBOTS.index(self.robot), KINDS.index(self.kind), purpose]
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Attack:
    """What a case is made of."""

    case: Case
    scenario: Scenario
    """Without the movers, who are steered while it runs."""
    arena: Arena
    errors: Errors
    covered: str
    """"all", or "front": some bearings are never covered."""
    kinds: np.ndarray
    """[m] of each mover, see `band`."""
    radius: np.ndarray
    """[m] [m]."""
    speed: np.ndarray
    """[m] greatest speed of each [m/s]; the bound, times `Case.cheat_speed`."""
    keep_out: float
    """Nobody begins nearer to the robot [m]."""


def draw(case: Case) -> Attack:
    """Draw the attack that a case names.

    Raises:
        ValueError: a setting that is none.
    """
    generator = case.generator(0)
    car = case.robot == "car"
    robot = _robot(car, generator)
    covered = "front" if generator.uniform() < 0.15 else "all"
    errors = _errors(generator)
    labels = "none" if generator.uniform() < 0.15 else "sensor"
    lidars = _lidars(car, robot, covered, labels, generator)
    bound = float(generator.uniform(2.0, 8.0) if car else generator.uniform(0.4, 1.2))
    clear_radius = 0.0 if covered == "all" else (12.0 if car else 2.5)
    least = float(generator.uniform(0.4, 1.0) if car else generator.uniform(0.2, 0.3))
    told: dict[str, Any] = dict(
        object_speed=bound,
        object_radius=least if generator.uniform() < 0.4 else 0.0,
        capacity=400,
        particles=20,
        iterations=20,
        cell=0.25 if car else 0.06,
        cycle=0.1 if car else 0.06,
        clear_radius=clear_radius,
        blind_speed=None if covered == "all" else 0.0,
        tracking_error=0.0 if errors.tracking == "none" else (0.15 if car else 0.03),
        localisation_error=0.0 if errors.poses == "none" else (0.1 if car else 0.02),
        range_noise=0.0 if errors.ranges == "none" else (0.1 if car else 0.03),
        stamp_error=0.0 if errors.stamps == "none" else (0.02 if car else 0.01),
    )
    settings = Settings.for_robot(robot, **{**told, **case.changes})
    width = _least_width(settings)
    arena = draw_arena(SCALES[case.robot], width, settings.clear_radius, generator)
    mapped = labels == "none" and generator.uniform() < 0.5
    scenario = Scenario(
        name=f"attack {case.kind}",
        robot=robot,
        settings=settings,
        lidars=lidars,
        bounds=arena.bounds,
        polygons=arena.polygons,
        walls=arena.fence,
        start=arena.start,
        goals=arena.goals,
        duration=case.duration,
        static_map=StaticMap.from_segments(arena.world.outline) if mapped else None,
    )
    kinds, radius, speed = _movers(case, car, settings, generator)
    return Attack(
        case=case,
        scenario=scenario,
        arena=arena,
        errors=errors,
        covered=covered,
        kinds=kinds,
        radius=radius,
        speed=speed,
        keep_out=max(settings.clear_radius, 3.0 * robot.radius) + 0.1,
    )


def _least_width(settings: Settings) -> float:
    """Nothing is narrower [m]: by the declared width, and by the smallest object where told."""
    return max(settings.object_width, 2 * settings.object_radius)


def _robot(car: bool, generator: np.random.Generator) -> Robot:
    long = generator.uniform() < 0.2
    if car:
        discs = cover_rectangle(3.2, 0.8, 1.8, 3) if long else ((0.0, 1.5),)
        return CarLike(discs=discs)
    discs = cover_rectangle(0.5, 0.3, 0.6, 2) if long else ((0.0, 0.4),)
    return DifferentialDrive(discs=discs, wheel_speed=2.0)


def _errors(generator: np.random.Generator) -> Errors:
    """Half of the cases have each error, so that some have none and some have all."""

    def one(kinds: tuple[str, ...]) -> str:
        return str(generator.choice(kinds[1:])) if generator.uniform() < 0.5 else kinds[0]

    return Errors(ranges=one(RANGES), poses=one(POSES), tracking=one(TRACKING), stamps=one(STAMPS))


def _lidars(
    car: bool, robot: Robot, covered: str, labels: str, generator: np.random.Generator
) -> tuple[Lidar, ...]:
    reach = 40.0 if car else 7.0
    wide = math.radians(270)
    if covered == "front":
        forward = 1.0 if car else 0.3
        return (
            Lidar(range_max=reach, beams=541 if car else 361, field_of_view=wide,
                  mount=(forward, 0, 0), labels=labels),
        )  # fmt: skip
    if car or generator.uniform() < 0.3:
        return (Lidar(range_max=reach, beams=720 if car else 480, labels=labels),)
    # their sectors must cross well inside the body, or a sliver beside it is never seen
    out = 0.3 if len(robot.discs) == 1 else 0.2
    return tuple(
        Lidar(range_max=reach, beams=361, field_of_view=wide, mount=mount, labels=labels)
        for mount in ((out, 0.0, 0.0), (-out, 0.0, math.pi))
    )


def _movers(
    case: Case, car: bool, settings: Settings, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(kinds, radii [m], speeds [m/s]) of the movers."""
    if case.kind == WALKERS:
        count = int(generator.integers(4, 11))
        kinds = np.full(count, band.WALK)
    else:
        few, many = (6, 11) if case.kind == "crowd" else (2, 8)
        count = int(generator.integers(few, many))
        kinds = generator.choice(np.array(HUNTERS[case.kind]), count)
    least = 0.5 * _least_width(settings)
    radius = least * generator.uniform(1.0, 3.0 if car else 1.75, count)
    radius[generator.uniform(size=count) < 0.3] = least
    share = np.where(generator.uniform(size=count) < 0.7, 1.0, generator.uniform(0.5, 1.0, count))
    walking = kinds == band.WALK
    share[walking] = generator.uniform(0.3, 0.9, int(walking.sum()))
    speed = share * settings.object_speed * case.cheat_speed
    return kinds, radius, speed
