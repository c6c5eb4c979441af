"""Where to wait for the robot."""

from __future__ import annotations

import numpy as np

from passpmp_ti.attack.hunted import Hunted
from passpmp_ti.attack.roadmap import Roadmap, crossed

TRIED = 40  # places of the map that are looked at for one choice


def nearest(roadmap: Roadmap, place: np.ndarray) -> int:
    """The place of the map nearest to a point [2]."""
    return int(np.argmin(np.hypot(*(roadmap.places - place).T)))


def away(roadmap: Roadmap, place: np.ndarray, least: float, generator: np.random.Generator) -> int:
    """Any place at least so far [m] from a point; the farthest where there is none."""
    apart = np.hypot(*(roadmap.places - place).T)
    far = np.flatnonzero(apart > least)
    return int(generator.choice(far)) if len(far) else int(np.argmax(apart))


def _ahead_of(robot: Hunted, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """([n] distance to the robot's way, [n] distance to the robot) [m]."""
    way = robot.ways.coast
    apart = places[:, None] - way[None]
    return np.sqrt((apart * apart).sum(axis=2)).min(axis=1), np.hypot(*(places - way[0]).T)


def post(
    roadmap: Roadmap,
    outline: np.ndarray,
    robot: Hunted,
    sensor_range: float,
    generator: np.random.Generator,
) -> int:
    """A place that the robot does not see now, near the way it goes: behind a corner, or out of
    range."""
    here = robot.state[:2]
    some = generator.permutation(len(roadmap.places))[:TRIED]
    places = roadmap.places[some]
    to_way, apart = _ahead_of(robot, places)
    hidden = crossed(here, places, outline) | (apart > sensor_range + 1.0)
    worth = to_way + np.where(hidden, 0.0, 2 * sensor_range)
    best = np.argsort(worth, kind="stable")[:4]
    return int(some[generator.choice(best)])


def beside(
    roadmap: Roadmap, robot: Hunted, sensor_range: float, generator: np.random.Generator
) -> int:
    """A place off the robot's way, from which to cross it."""
    some = generator.permutation(len(roadmap.places))[:TRIED]
    to_way, _ = _ahead_of(robot, roadmap.places[some])
    worth = np.abs(to_way - generator.uniform(0.2, 0.8) * sensor_range)
    return int(some[np.argmin(worth)])


def rim(robot: Hunted, distance: float, generator: np.random.Generator) -> np.ndarray:
    """[2] just beyond what the robot can see, before it rather than behind [m]."""
    bearing = robot.state[2] + generator.normal(0.0, 0.6)
    return robot.state[:2] + distance * np.array([np.cos(bearing), np.sin(bearing)])


def shadow(
    roadmap: Roadmap,
    outline: np.ndarray,
    robot: Hunted,
    places: np.ndarray,
    radius: np.ndarray,
    own: int,
    generator: np.random.Generator,
) -> np.ndarray:
    """[2] a place that will be out of sight in a moment, as near the robot's way as can be [m].

    Behind things that stand, and right behind other movers, seen from where the robot will be.
    """
    soon = robot.ways.coast[min(int(generator.integers(3, 15)), len(robot.ways.coast) - 1)]
    some = generator.permutation(len(roadmap.places))[:TRIED]
    candidates = roadmap.places[some]
    hidden = crossed(soon, candidates, outline)
    others = np.delete(np.arange(len(places)), own)
    gap = places[others] - soon
    apart = np.maximum(np.hypot(*gap.T), 1e-6)
    behind = places[others] + gap / apart[:, None] * (radius[others] + radius[own])[:, None]
    spots = np.concatenate([candidates[hidden], behind])
    if not len(spots):
        return candidates[0]
    to_way, _ = _ahead_of(robot, spots)
    to_me = np.hypot(*(spots - places[own]).T)
    best = np.argsort(to_way + 0.3 * to_me, kind="stable")[:3]
    return spots[int(generator.choice(best))]
