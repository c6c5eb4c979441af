"""Discs that come out of hiding and walk round corners, and rooms for them to walk in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import dijkstra

from oracle import exact, hidden
from oracle.cases import CHAIR, Case
from oracle.worlds import marred
from passpmp_ti import Settings

TURNS = np.linspace(0, np.pi / 2, 5)
"""Where a way about a corner is bent [rad]."""


class Walkers(NamedTuple):
    """Discs of one size, all as fast as one another."""

    places: np.ndarray
    """[K, 2] where they stood at the scan, and where they may turn since [m]."""
    walked: np.ndarray
    """[K] how far the nearest of them has to walk there [m]."""
    radius: float
    speed: float


def walkers_of(case, attackers):
    """The smallest of some attackers, by every corner that they can turn at."""
    rho = hidden.smallest_radius(case.settings)
    fast = attackers.speeds == case.settings.object_speed
    starts = attackers.centres[fast & np.isclose(attackers.radii, rho)]
    turns = _turning_places(case.blockers, rho)
    places = np.concatenate([starts, turns])
    p, q = np.triu_indices(len(places), 1)
    # nobody has to turn where another one stood
    wanted = q >= len(starts)
    p, q = p[wanted], q[wanted]
    clear = ~exact.sweep_blocked(places[p], places[q], rho, case.blockers)
    apart = np.zeros((len(places), len(places)))
    apart[p[clear], q[clear]] = np.linalg.norm(places[p[clear]] - places[q[clear]], axis=1)
    walked = np.full(len(places), np.inf)
    if len(starts):
        walked = dijkstra(apart, False, np.arange(len(starts)), min_only=True)
    got = np.isfinite(walked)
    return Walkers(places[got], walked[got], rho, case.settings.object_speed)


def reaches(points, elapsed, walkers, radius, blockers):
    """[N] bool: one of them can touch a disc at `points` [N, 2], `elapsed` [N] s after the scan."""
    apart = np.linalg.norm(points[:, None] - walkers.places, axis=-1)
    touching = np.maximum(apart - walkers.radius - radius, 0)
    n, k = np.nonzero(touching + walkers.walked <= walkers.speed * elapsed[:, None])
    gap = np.maximum(apart[n, k], 1e-12)
    start = walkers.places[k]
    end = start + (touching[n, k] / gap)[:, None] * (points[n] - start)
    free = ~exact.sweep_blocked(start, end, walkers.radius, blockers)
    result = np.zeros(len(points), dtype=bool)
    result[n[free]] = True
    return result


def _turning_places(world, rho):
    """[K, 2] about the corners of boxes, where a disc that turns there may be."""
    found = [np.zeros((0, 2))]
    away = (rho + 1e-6) / np.cos(0.5 * (TURNS[1] - TURNS[0]))
    for corners in world.boxes:
        middle = corners.mean(axis=0)
        for n in range(4):
            out = corners[n] - corners[n - 1]
            first = np.arctan2(out[1], out[0])
            out = corners[n] - corners[(n + 1) % 4]
            turn = np.angle(np.exp(1j * (np.arctan2(out[1], out[0]) - first)))
            at = first + TURNS * np.sign(turn)
            found.append(corners[n] + away * np.stack([np.cos(at), np.sin(at)], axis=1))
        assert exact.inside_boxes(middle[None], world.boxes).all()
    places = np.concatenate(found)
    return places[exact.box_distance(places, world) >= rho]


def corridor_case(generator, **changes):
    """A wheelchair in a corridor with doors and rooms behind, told by labels what stays.

    In some of them a quarter of the bearings is never covered, and what is there stands still.
    """
    half, thick = generator.uniform(0.9, 1.6), float(generator.choice([0.02, 0.1, 0.3]))
    boxes = []
    for side in (-1, 1):
        x = -7.0
        while x < 7.0:
            length = generator.uniform(0.5, 4.0)
            y = side * (half + 0.5 * thick)
            boxes.append((x + 0.5 * length, y, length, thick, 0.0))
            if generator.random() < 0.6:
                deep = generator.uniform(0.8, 3.0)
                y = side * (half + thick + 0.5 * deep)
                boxes.append((x + 0.5 * thick, y, thick, deep, 0.0))
            x += length + generator.uniform(0.5, 1.6)
    if generator.random() < 0.5:
        boxes.append((generator.uniform(1.5, 4), generator.uniform(-0.5, 0.5), 0.4, 0.5, 0.7))
    yaw, at = generator.uniform(-np.pi, np.pi), generator.uniform(-30, 30, 2)
    c, s = np.cos(yaw), np.sin(yaw)
    turned = [
        exact.box(at[0] + c * x - s * y, at[1] + s * x + c * y, *sides, spin + yaw)
        for x, y, *sides, spin in boxes
    ]
    position = (float(at[0]), float(at[1]), float(generator.uniform(-np.pi, np.pi)))
    settings = Settings.for_robot(
        CHAIR, object_speed=float(generator.choice([0.5, 1.0, 2.0])), cones="geodesic",
        range_noise=0.02 if generator.random() < 0.3 else 0.0,
    ).changed(**changes)  # fmt: skip
    world = exact.world_of(turned)
    turn = 2 * np.pi
    if generator.random() < 0.25:
        turn = 1.5 * np.pi
        settings = settings.changed(blind_speed=0.0, clear_radius=0.85)
    scan = exact.sweep(world, position, 1440, turn, 6.0, 10.0)
    return Case(CHAIR, settings, world, [marred(generator, scan, settings.range_noise)], position)
