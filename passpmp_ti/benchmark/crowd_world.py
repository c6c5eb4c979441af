"""The world of the crowd benchmark: a route through a crowd, and people behind occluders beside it.

The layout follows the crowd scenario of github.com/tkkim-robot/occlusion-cbf; docs/crowd.md tells
what is theirs and what is ours.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from passpmp_ti import door
from passpmp_ti.benchmark.crowd_movers import Ambush, CrowdMovers, timed
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.settings import Settings
from passpmp_ti.sim import geometry
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.movers import Movers, PathMovers
from passpmp_ti.sim.scenario import Scenario
from passpmp_ti.sim.world import Bounds, World

BOUNDS: Bounds = (0.0, 0.0, 30.0, 30.0)
"""Where the crowd walks [m]."""
VIEW: Bounds = (-2.0, -2.0, 32.0, 32.0)
"""What pictures show: on open ground the robot may leave the square [m]."""
ROUTE = np.array([(2.0, 2.0), (2.0, 28.0), (28.0, 2.0), (28.0, 28.0)])
"""Start and goals [m]."""
DURATION = 300.0
"""An episode's longest [s]."""
RANGE, BEAMS = 10.0, 720

ROBOT = DifferentialDrive(discs=((0.0, 0.25),), wheel_speed=1.0, acceleration=1.35, track=0.4)
"""The published robot's body and speed, on wheels that speed up and slow down as the paper's
wheelchair's do (Sec. 5.2.1) and lie within that body."""

WALKING = (0.3, 1.0)
"""Least and greatest speed of the crowd [m/s]."""
UNDER = 1 - 1e-9
"""Share of a speed that is used: rounding must not exceed it."""
STEPPING = 1.0
"""Speed of those who step out [m/s]."""
RADIUS = (0.28, 0.42)
"""Least and greatest radius of people [m]."""
START_CLEAR = 3.0
"""Nobody's centre is nearer to the robot at the start [m]."""

OCCLUDER = (0.8, 1.0)
"""Least and greatest radius of what people wait behind [m]."""
CORNERS = 24
"""Of the polygon that stands for its disc and lies in it."""
OCCLUDERS = 2
"""A leg of the route, with one person behind each."""
ASIDE = (1.15, 1.75)
"""From the route to an occluder's centre [m]."""
SHARE = (0.15, 0.9)
"""Of a leg: where occluders stand."""
SPACING = 4.0
"""Between occluders' centres, at least [m]."""
BEYOND = (0.2, 1.2)
"""So much farther from the route than the occluder's centre somebody waits [m]."""
NEAR = (2.5, 4.5)
"""Who waits steps out when the robot is as near as this [m]."""
ACROSS = 1.5
"""So far beyond the route goes who crosses it, before he walks on like everybody [m]."""
GAP = 0.05
"""Between people and occluders, at least [m]."""
LOOKS = 0.25
"""Between places on the route from which nobody who waits is seen [m]."""
TRIES = 20_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Corner:
    """An occluder beside the route, and who waits behind it."""

    centre: np.ndarray
    """[2] of the occluder [m]."""
    size: float
    """Its radius [m]."""
    ambush: Ambush

    @property
    def polygon(self) -> np.ndarray:
        """[CORNERS, 2] the occluder."""
        angle = 2 * math.pi * np.arange(CORNERS) / CORNERS
        return self.centre + self.size * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class CrowdSource:
    """A crowd that walks from place to place, and people who wait."""

    count: int
    """Of the crowd, without those who wait."""
    corners: tuple[Corner, ...]
    """Who waits, behind what; where he walks once he has crossed is drawn with the crowd."""

    @property
    def top_speed(self) -> float:
        return max(WALKING[1], STEPPING)

    def draw(
        self,
        still: World,
        start: tuple[float, float, float],
        duration: float,
        seed: int,
        generator: np.random.Generator,
    ) -> tuple[Movers, float]:
        # everybody has a generator of his own: who walks longer changes nobody else's way
        own = generator.spawn(len(self.corners) + self.count)
        ambushes = [
            replace(a, way=stroll(a.way, a.radius, a.speed * duration, self.corners, his))
            for a, his in zip((c.ambush for c in self.corners), own, strict=False)
        ]
        radius, paths = [], []
        for his in own[len(self.corners) :]:
            radius.append(his.uniform(*RADIUS))
            speed = his.uniform(*WALKING) * UNDER
            first = _place(radius[-1], self.corners, his)
            while np.hypot(*(first - start[:2])) < START_CLEAR:
                first = _place(radius[-1], self.corners, his)
            way = stroll(first[None], radius[-1], speed * duration, self.corners, his)
            paths.append(timed(way, speed, 0.0))
        return CrowdMovers(PathMovers(paths, np.array(radius)), ambushes), 0.0

    def paced(self, top_speed: float) -> CrowdSource:
        raise ValueError(
            f"CrowdSource: the crowd's speeds belong to the benchmark and reach {self.top_speed:g}"
            " m/s; to plan with another bound change Settings.object_speed alone"
        )


def stroll(
    way: np.ndarray,
    radius: float,
    length: float,
    corners: Sequence[Corner],
    generator: np.random.Generator,
) -> np.ndarray:
    """[n, 2] a way [k, 2] gone on with by at least `length` [m], straight from place to place, each
    drawn evenly from the arena; one that lies behind an occluder is drawn again.

    Raises:
        ValueError: there is no way on.
    """
    places, left = list(way), length
    while left > 0:
        for _ in range(TRIES):
            to = _place(radius, corners, generator)
            if _gap(places[-1], to, corners) >= radius:
                break
        else:
            raise ValueError(f"no straight way leads on from {places[-1]!r}")
        left -= float(np.hypot(*(to - places[-1])))
        places.append(to)
    return np.array(places)


def _place(radius: float, corners: Sequence[Corner], generator: np.random.Generator) -> np.ndarray:
    """[2] a place in the arena for a disc, clear of the occluders."""
    low, high = np.array(BOUNDS[:2]) + radius, np.array(BOUNDS[2:]) - radius
    for _ in range(TRIES):
        place = generator.uniform(low, high)
        if _gap(place, place, corners) >= radius + GAP:
            return place
    raise ValueError("the arena has no room for somebody")


def _gap(begin: np.ndarray, end: np.ndarray, corners: Sequence[Corner]) -> float:
    """Least distance of a straight way from the occluders [m]."""
    if not corners:
        return math.inf
    centres = np.array([corner.centre for corner in corners])
    sizes = np.array([corner.size for corner in corners])
    return float((geometry.point_to_segment(centres, begin, end) - sizes).min())


def draw_corners(generator: np.random.Generator) -> list[Corner]:
    """Occluders along the route, and people whom nobody on the route sees until they step out.

    Where an occluder of another leg stands in somebody's way across, all are drawn anew.

    Raises:
        ValueError: no room was found, which a route and sizes like ours do not let happen.
    """
    for _ in range(TRIES):
        corners = _drawn_one_by_one(generator)
        ways = [(corner.ambush.way, corner.ambush.radius) for corner in corners]
        if all(_gap(way[0], way[1], corners) >= radius for way, radius in ways):
            return corners
    raise ValueError("no occluders were found that leave everybody a way across the route")


def _drawn_one_by_one(generator: np.random.Generator) -> list[Corner]:
    corners: list[Corner] = []
    for leg in range(len(ROUTE) - 1):
        for _ in range(OCCLUDERS):
            for _ in range(TRIES):
                corner = _draw_corner(leg, generator)
                if corner is not None and all(
                    np.hypot(*(corner.centre - other.centre)) >= SPACING for other in corners
                ):
                    break
            else:
                raise ValueError(f"no room for an occluder along leg {leg} of the route")
            corners.append(corner)
    return corners


def _draw_corner(leg: int, generator: np.random.Generator) -> Corner | None:
    """One that may stand on a leg, if what was drawn is any good."""
    begin, end = ROUTE[leg], ROUTE[leg + 1]
    along = (end - begin) / np.hypot(*(end - begin))
    aside = np.array([-along[1], along[0]]) * generator.choice((-1.0, 1.0))
    share, off = generator.uniform(*SHARE), generator.uniform(*ASIDE)
    size, radius = generator.uniform(*OCCLUDER), generator.uniform(*RADIUS)
    centre = begin + share * (end - begin) + off * aside
    # far enough on for a straight way across that clears the occluder
    ahead = size + radius + GAP + generator.uniform(0.0, 0.3)
    waits = centre + ahead * along + generator.uniform(*BEYOND) * aside
    lateral = float((waits - begin) @ aside)
    ambush = Ambush(
        way=np.array([waits, waits - (lateral + ACROSS) * aside]), radius=radius,
        near=generator.uniform(*NEAR), speed=STEPPING * UNDER,
    )  # fmt: skip
    low, high = np.array(BOUNDS[:2]), np.array(BOUNDS[2:])
    inside = (ambush.way >= low + radius).all() and (ambush.way <= high - radius).all()
    inside &= (centre >= low + size).all() and (centre <= high - size).all()
    corner = Corner(centre=centre, size=size, ambush=ambush)
    return corner if inside and hidden_all_along(corner, leg) else None


def hidden_all_along(corner: Corner, leg: int) -> bool:
    """Whether who waits is behind his occluder, or out of range, at every place of the route up to
    the one where he steps out, which must lie on the leg."""
    looks = way_along(leg)
    apart = np.hypot(*(looks - corner.ambush.way[0]).T)
    before = looks[: int(np.argmax(apart <= corner.ambush.near)) + 1]
    if apart[len(before) - 1] > corner.ambush.near:
        return False
    return bool(hidden(before, corner).all())


def way_along(leg: int) -> np.ndarray:
    """[n, 2] places along the route up to the end of a leg [m]."""
    pieces = []
    for begin, end in pairwise(ROUTE[: leg + 2]):
        count = math.ceil(float(np.hypot(*(end - begin))) / LOOKS)
        pieces.append(begin + (end - begin) * (np.arange(count) / count)[:, None])
    return np.concatenate([*pieces, ROUTE[leg + 1][None]])


def hidden(places: np.ndarray, corner: Corner) -> np.ndarray:
    """[n] whether who waits is wholly out of sight from places [n, 2] [m]."""
    to_him, to_it = corner.ambush.way[0] - places, corner.centre - places
    far, near = np.hypot(*to_him.T), np.hypot(*to_it.T)
    angle = np.abs(np.arctan2(geometry.cross(to_it, to_him), (to_it * to_him).sum(axis=1)))
    # the polygon lies in the disc: what its inner circle hides is hidden
    inner = corner.size * math.cos(math.pi / CORNERS)
    behind = angle + np.arcsin(np.minimum(corner.ambush.radius / far, 1.0)) <= np.arcsin(
        np.minimum(inner / near, 1.0)
    )
    return (behind & (far > near)) | (far > RANGE + corner.ambush.radius)


def crowd(
    count: int, seed: int, *, labels: str = "sensor", walled: bool = False, **changes: Any
) -> Scenario:
    """The scenario of one seed.

    Args:
        count: people in the crowd, without the six who wait.
        seed: places the occluders and those who wait; `simulate` is to be given the same.
        labels: "sensor": the range finder tells that occluders stay; "none": nothing does.
        walled: walls stand about the square; else it is open ground.
        changes: fields of `Settings` to replace.

    Raises:
        ValueError: a bad count, seed or setting.
    """
    door.whole("crowd", "count", count, least=0)
    door.whole("crowd", "seed", seed, least=0)
    corners = draw_corners(np.random.default_rng([seed, 2]))
    begin, way = ROUTE[0], ROUTE[1] - ROUTE[0]
    return Scenario(
        name=f"crowd-{count}",
        description=f"a route among {count} walkers, and six people behind occluders",
        robot=ROBOT,
        settings=settings().changed(**changes),
        lidars=(Lidar(range_max=RANGE, beams=BEAMS, labels=labels),),
        bounds=VIEW,
        polygons=tuple(corner.polygon for corner in corners),
        walls=_border() if walled else np.zeros((0, 4)),
        movers=CrowdSource(count=count, corners=tuple(corners)),
        start=(float(begin[0]), float(begin[1]), math.atan2(way[1], way[0])),
        goals=tuple((float(x), float(y)) for x, y in ROUTE[1:]),
        duration=DURATION,
    )


def _border() -> np.ndarray:
    """[4, 4] walls about the square [m]."""
    low_x, low_y, high_x, high_y = BOUNDS
    return geometry.edges(
        np.array([(low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y)])
    )


def settings() -> Settings:
    """How the robot is driven here."""
    return Settings.for_robot(
        ROBOT,
        object_speed=max(WALKING[1], STEPPING),
        object_width=0.5,  # the narrowest disc is 0.56 m wide
        cell=0.06,
        time_step=0.02,
        # room for the whole last level: plans cut short by a second gain so little by a turn that
        # it is put off from cycle to cycle
        capacity=8000,
        optimizer="exhaustive",
        cruise_speed=ROBOT.top_speed,
        guide_movers=False,
    )
