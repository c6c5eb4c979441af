"""Discs that may be where no beam saw them, the hardest to exclude first.

Along a bearing, a beam that is free up to `r` forbids a disc's centre an interval that begins at
the sensor; so the nearest centre that no beam contradicts has a closed form, and the attackers that
are hardest to exclude can be listed instead of searched.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from oracle import exact


class Attackers(NamedTuple):
    """Discs and how fast each may be."""

    centres: np.ndarray
    """[A, 2] at the scan [m]."""
    radii: np.ndarray
    """[A] [m]."""
    speeds: np.ndarray
    """[A] [m/s]."""

    def chosen(self, index):
        """Those of an index or a mask."""
        return Attackers(self.centres[index], self.radii[index], self.speeds[index])


NOBODY = Attackers(np.zeros((0, 2)), np.zeros(0), np.zeros(0))


def smallest_radius(settings):
    """Of any disc that is an object [m]."""
    return max(0.5 * settings.object_width, settings.object_radius)


def free_to(scan, noise=0.0):
    """[n] distance up to which each beam was free for certain [m]; 0 where it was lost."""
    reached = np.minimum(np.where(scan.lost, 0.0, scan.ranges), scan.range_max)
    return np.maximum(reached - noise, 0.0)


def nearest_hidden(scan, bearing, radius, noise=0.0):
    """[N] least range at which a disc's centre contradicts no beam [m].

    Args:
        scan: exact, or within `noise` of the truth.
        bearing: [N] of the centre in the world [rad].
        radius: [N] of the disc [m].
    """
    r = free_to(scan, noise)
    delta = bearing[:, None] - scan.bearings[None]
    c, s = np.cos(delta), np.abs(np.sin(delta))
    rho = radius[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        tangent = rho / s
        # the disc passes beside the beam, or beyond its end
        beside = np.where(tangent * c <= r, tangent, 0.0)
        under = rho**2 - (r * s) ** 2
        beyond = np.where(under > 0, r * c + np.sqrt(np.maximum(under, 0)), 0.0)
    end = np.where(c > 0, np.maximum(np.where(np.isfinite(beside), beside, 0.0), beyond), 0.0)
    return np.maximum(end.max(axis=1), radius)


def consistent(scan, centres, radius, noise=0.0):
    """[N] bool: discs that change no beam of the scan."""
    w = centres - np.array(scan.pose[:2])
    bearing = np.arctan2(w[:, 1], w[:, 0])
    return np.linalg.norm(w, axis=1) >= nearest_hidden(scan, bearing, radius, noise) - 1e-12


def hidden_discs(case, count, generator):
    """Attackers on a case: as near to the sensor as they may be, tucked behind that, and seen ones.

    Bearings: anywhere, in the middle between two beams, and tangent to the edges of openings, of
    lost beams and of the blind sector. What was seen and may move attacks too.
    """
    scans, settings = case.true_scans, case.settings
    each = count // len(scans) + 1
    centres, radii = [], []
    for scan in scans:
        radius = smallest_radius(settings) * np.where(
            generator.random(each) < 0.7, 1.0, 1 + 3 * generator.random(each)
        )
        bearing = _bearings(scan, radius, settings, generator)
        s = nearest_hidden(scan, bearing, radius, settings.range_noise) + 1e-9
        s = s + np.where(generator.random(each) < 0.7, 0.0, generator.exponential(1.0, each))
        direction = np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
        at = np.array(scan.pose[:2]) + s[:, None] * direction
        # out of what was declared empty, along the bearing
        from_start = at - case.true_position[:2]
        short = settings.clear_radius + radius - np.linalg.norm(from_start, axis=1)
        at += np.where(short > 0, 1.2 * short, 0.0)[:, None] * direction
        # out of the wall that its bearing ends at, to the far side
        for _ in range(6):
            stuck = exact.box_distance(at, case.world) < radius
            at[stuck] += direction[stuck] * 0.5 * radius[stuck, None]
        centres.append(at)
        radii.append(radius)
    c, rho = keep_possible(case, np.concatenate(centres), np.concatenate(radii))
    seen = case.world.discs
    return attackers_of(case, np.concatenate([c, seen[:, :2]]), np.concatenate([rho, seen[:, 2]]))


def attackers_of(case, centres, radii):
    """These discs, each as fast as it may be."""
    bound, blind = case.settings.object_speed, case.settings.unseen_speed
    speeds = np.full(len(centres), bound)
    if blind < bound:
        speeds[~covered(case.true_scans, centres, radii)] = blind
    return Attackers(centres, radii, speeds)


def keep_possible(case, c, rho):
    """Those discs that contradict no beam and overlap neither a box nor the robot, nor what is
    declared empty."""
    ok = exact.box_distance(c, case.world) >= rho
    x, y = case.true_position[:2]
    for bx, by, r in [*case.body, (x, y, case.settings.clear_radius)]:
        ok &= np.hypot(c[:, 0] - bx, c[:, 1] - by) >= rho + r
    c, rho = c[ok], rho[ok]
    for scan in case.true_scans:
        ok = consistent(scan, c, rho, case.settings.range_noise)
        c, rho = c[ok], rho[ok]
    return c, rho


def covered(scans, centres, radii):
    """[N] bool: all of the disc is in bearings that some scan covers."""
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    rim = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = centres[:, None] + 1.03 * radii[:, None, None] * rim
    found = np.zeros(points.shape[:2], dtype=bool)
    for scan in scans:
        w = points - np.array(scan.pose[:2])
        relative = (np.arctan2(w[..., 1], w[..., 0]) - scan.bearings[0]) % (2 * np.pi)
        span = (len(scan.ranges) - 1) * scan.angle_increment
        full = 2 * np.pi - span < 1.5 * scan.angle_increment
        found |= (relative <= span) | full
    return found.all(axis=1)


def _bearings(scan, radius, settings, generator):
    """[N] bearings worth an attack by discs of these radii [rad]."""
    count, n = len(radius), len(scan.ranges)
    bearing = generator.uniform(-np.pi, np.pi, count)
    kind = generator.random(count)
    between = kind < 0.4
    steps = generator.integers(0, n, count) + 0.5
    bearing[between] = scan.bearings[0] + scan.angle_increment * steps[between]
    r = free_to(scan)
    jump = np.flatnonzero(np.abs(np.diff(r, append=r[:1])) > 0.3 * settings.object_width)
    if len(jump):
        edge = generator.choice(jump, count)
        near = np.maximum(np.minimum(r[edge], r[(edge + 1) % n]), radius)
        side = np.where(generator.random(count) < 0.5, 1, -1)
        beam = edge + generator.integers(0, 2, count)
        tangent = np.arcsin(radius / np.hypot(near, radius))
        aimed = scan.bearings[0] + scan.angle_increment * beam
        aimed = aimed + side * tangent * generator.choice([1.0, 1.0, 0.5, 0.0], count)
        at_edge = kind > 0.7
        bearing[at_edge] = aimed[at_edge]
    return bearing
