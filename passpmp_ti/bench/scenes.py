"""Two fixed scenes, drawn from seeds, and what a range finder in their middle sees."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from passpmp_ti.robots import CarLike, DifferentialDrive, Robot
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings

BEAMS = 1440
PAPER_RANGE = 80.0
"""The sizes below are for this range [m]; other scenes are drawn in proportion."""
SIDES = 64
"""Of the polygon that stands for a round wall."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Things about the origin, where a robot with a range finder stands."""

    name: str
    robot: Robot
    settings: Settings
    """Of the robot there."""
    size: int
    """Cells along each side of the grid."""
    range_max: float
    """[m]"""
    walls: np.ndarray = field(repr=False)
    """[n, 4] surfaces that stay: x1, y1, x2, y2 [m]."""
    movers: np.ndarray = field(repr=False)
    """[n, 3] discs that may move: x, y, radius [m]."""

    @property
    def cell(self) -> float:
        """Side of a cell [m]."""
        return self.settings.cell

    def scan(self, place: tuple[float, float] = (0.0, 0.0), stamp: float = 0.0) -> Scan:
        """A full sweep from `place`, which is told what stays and what may move."""
        increment = 2 * math.pi / BEAMS
        bearings = increment * np.arange(BEAMS)
        rays = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        still = _to_walls(rays, self.walls - np.tile(place, 2))
        moving = _to_discs(rays, self.movers - np.array([*place, 0.0]))
        ranges = np.minimum(still, moving)
        ranges[ranges >= self.range_max] = np.inf
        return Scan(
            ranges,
            angle_min=0.0,
            angle_increment=increment,
            range_max=self.range_max,
            pose=(*place, 0.0),
            stamp=stamp,
            moving=(moving < still) & np.isfinite(ranges),
        )


def car_scene(name: str) -> Scene:
    """80 m about a car in 640 x 640 cells: "crowded" or "ring"."""
    return _scene(name, CarLike(), 80.0, 640, 0.25, 1.0)


def wheelchair_scene(name: str) -> Scene:
    """10 m about a wheelchair in 400 x 400 cells: "crowded" or "ring"."""
    return _scene(name, DifferentialDrive(), 10.0, 400, 0.05, 0.1)


def _scene(name: str, robot: Robot, range_max: float, size: int, cell: float, pace: float) -> Scene:
    generator = np.random.default_rng(2020)
    scale = range_max / PAPER_RANGE
    if name == "crowded":
        walls, movers, speed = _boxes(generator, 45, scale), _discs(generator, 3, scale), 20.0
    else:
        walls = np.concatenate([_boxes(generator, 8, scale), _round_wall(72.0 * scale)])
        movers, speed = np.zeros((0, 3)), 5.0
    settings = Settings.for_robot(robot, object_speed=speed * pace, cell=cell, window=size)
    return Scene(
        name=name,
        robot=robot,
        settings=settings,
        size=size,
        range_max=range_max,
        walls=walls,
        movers=movers,
    )


def _boxes(generator: np.random.Generator, count: int, scale: float) -> np.ndarray:
    """[4 n, 4] sides of boxes at random places, none at the middle."""
    sides: list[np.ndarray] = []
    while len(sides) < count:
        away = scale * generator.uniform(12.0, 84.0)
        bearing, turn = generator.uniform(0, 2 * math.pi, 2)
        length, width = scale * generator.uniform(2.0, 14.0, 2) / 2
        along = np.array([math.cos(turn), math.sin(turn)])
        across = np.array([-along[1], along[0]])
        middle = away * np.array([math.cos(bearing), math.sin(bearing)])
        corners = np.array(
            [middle + p * length * along + q * width * across
             for p, q in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        )  # fmt: skip
        if np.hypot(*corners.T).min() > 7.0 * scale:
            sides.append(np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1))
    return np.concatenate(sides)


def _discs(generator: np.random.Generator, count: int, scale: float) -> np.ndarray:
    """[n, 3] discs at random places."""
    away = scale * generator.uniform(25.0, 72.0, count)
    bearing = generator.uniform(0, 2 * math.pi, count)
    return np.stack([away * np.cos(bearing), away * np.sin(bearing), np.full(count, scale)], axis=1)


def _round_wall(radius: float) -> np.ndarray:
    """[SIDES, 4] a wall all around."""
    bearing = 2 * math.pi * np.arange(SIDES) / SIDES
    corners = radius * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    return np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1)


def _to_walls(rays: np.ndarray, walls: np.ndarray) -> np.ndarray:
    """[n] distance along each ray [n, 2] from the origin to the nearest wall [m]."""
    start, way = walls[:, :2], walls[:, 2:] - walls[:, :2]
    across = rays[:, None, 0] * way[:, 1] - rays[:, None, 1] * way[:, 0]
    across[across == 0] = 1e-12
    distance = (start[:, 0] * way[:, 1] - start[:, 1] * way[:, 0]) / across
    share = (start[:, 0] * rays[:, None, 1] - start[:, 1] * rays[:, None, 0]) / across
    met = (distance > 0) & (share >= 0) & (share <= 1)
    return np.where(met, distance, np.inf).min(axis=1)


def _to_discs(rays: np.ndarray, discs: np.ndarray) -> np.ndarray:
    """[n] distance along each ray [n, 2] from the origin to the nearest disc [m]."""
    if not len(discs):
        return np.full(len(rays), np.inf)
    along = rays @ discs[:, :2].T
    left = along**2 - (discs[:, :2] ** 2).sum(axis=1) + discs[:, 2] ** 2
    met = (left > 0) & (along > 0)
    return np.where(met, along - np.sqrt(np.maximum(left, 0)), np.inf).min(axis=1)
