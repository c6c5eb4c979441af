"""Random worlds about a robot, and what its lidars see of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from oracle import exact
from oracle.hidden import smallest_radius
from passpmp_ti import StaticMap


def random_world(generator, position, robot, settings, scale):
    """Boxes and discs about a robot, none smaller than declared, none on the robot; some discs
    lean on a box."""
    middle, width = np.array(position[:2]), settings.object_width
    keep = robot.radius + 0.02
    boxes, discs = [], []
    for _ in range(generator.integers(1, 6)):
        sides = width + generator.exponential(1.0, 2) * scale * (0.2, 1.5)
        at = middle + scale * generator.uniform(-6, 6, 2)
        one = exact.box(*at, *sides, generator.uniform(0, np.pi))
        if exact.box_distance(middle[None], exact.world_of([one]))[0] > keep:
            boxes.append(one)
    for _ in range(generator.integers(0, 7)):
        radius = smallest_radius(settings) * (
            1 + generator.choice([0, 1]) * generator.exponential(1)
        )
        at = middle + scale * generator.uniform(-5, 5, 2)
        if boxes and generator.random() < 0.5:
            edge = generator.choice(exact.world_of(boxes).edges)
            along = edge[1] - edge[0]
            outward = np.array([along[1], -along[0]]) / np.linalg.norm(along)
            at = edge[0] + generator.random() * along + (radius + 1e-6) * outward
        solid = exact.box_distance(at[None], exact.world_of(boxes))[0] >= radius
        if solid and np.linalg.norm(at - middle) > radius + keep:
            discs.append((*at, radius))
    return exact.world_of(boxes, discs)


def map_of(world, resolution):
    """The boxes' outlines as a map."""
    if not len(world.boxes):
        return StaticMap(np.zeros((2, 2), dtype=bool), resolution)
    return StaticMap.from_segments(world.edges.reshape(-1, 4), resolution)


def random_mounts(generator):
    """(bearings of the lidars, field of view): all the way round, or 270 degrees of one or two."""
    if generator.random() < 0.6:
        return [0.0], 2 * np.pi
    return ([0.0, np.pi] if generator.random() < 0.7 else [0.0]), 1.5 * np.pi


def random_scans(
    generator, world, position, settings, scale, robot, stamp=None, *, mounts=(0.0,),
    fov=2 * np.pi, beams=720, labelled=True,
):  # fmt: skip
    """What lidars on a robot see of a world from where it truly is."""
    stamp = float(generator.uniform(0, 1000)) if stamp is None else stamp
    range_max = scale * float(generator.choice([4.0, 6.0, 8.0]))
    scans = []
    for mount in mounts:
        heading = position[2] + mount
        ahead = 0.0 if fov > 6 else 0.5 * robot.disc_radius
        pose = (
            position[0] + ahead * np.cos(heading),
            position[1] + ahead * np.sin(heading),
            heading,
        )
        scan = exact.sweep(world, pose, beams, fov, range_max, stamp, labelled=labelled)
        scans.append(marred(generator, scan, settings.range_noise))
    return scans


def marred(generator, scan, noise):
    """The scan with errors within `noise` and, at times, lost beams."""
    ranges = scan.ranges + generator.uniform(-noise, noise, len(scan.ranges))
    if generator.random() < 0.25:
        ranges[generator.random(len(ranges)) < 0.05] = np.nan
    if generator.random() < 0.25:
        start = generator.integers(len(ranges))
        ranges[(start + np.arange(generator.integers(1, 25))) % len(ranges)] = np.nan
    return replace(scan, ranges=ranges)
