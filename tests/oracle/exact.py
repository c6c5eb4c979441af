"""Worlds, scans, attackers and motions in closed form or by fine integration.

Attackers are discs. Along a bearing, a beam that is free up to `r` forbids a disc's centre an
interval that begins at the sensor; so the nearest centre that no beam contradicts has a closed
form, and the attackers that are hardest to exclude can be listed instead of searched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti import Scan

CAR = 0
BRAKE_IN_PROPORTION = 2


@dataclass(frozen=True)
class World:
    """Right-angled boxes that stay and discs that may move."""

    boxes: np.ndarray
    """[K, 4, 2] corners [m]."""
    discs: np.ndarray
    """[M, 3] x, y, radius [m]."""

    @property
    def edges(self) -> np.ndarray:
        """[4 K, 2, 2] ends of every box's sides [m]."""
        return np.stack([self.boxes, np.roll(self.boxes, -1, axis=1)], axis=2).reshape(-1, 2, 2)


def box(x, y, length, width, yaw=0.0):
    """[4, 2] corners of a right-angled box about (x, y)."""
    c, s = np.cos(yaw), np.sin(yaw)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length / 2, width / 2]
    return corners @ np.array([[c, s], [-s, c]]) + [x, y]


def world_of(boxes=(), discs=()):
    """A world of lists."""
    return World(np.array(boxes).reshape(-1, 4, 2), np.array(discs, dtype=float).reshape(-1, 3))


def cast(world, sensor, bearings, range_max):
    """(ranges [n], static [n]): the first surface along each bearing; inf beyond range_max."""
    origin = np.asarray(sensor, dtype=float)
    d = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    nearest = np.full(len(bearings), np.inf)
    static = np.zeros(len(bearings), dtype=bool)
    for p, q in world.edges:
        e, w = q - p, p - origin
        cross = d[:, 0] * e[1] - d[:, 1] * e[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (w[0] * e[1] - w[1] * e[0]) / cross
            share = (w[0] * d[:, 1] - w[1] * d[:, 0]) / cross
        hit = (along > 0) & (share >= 0) & (share <= 1) & (along < nearest)
        nearest[hit], static[hit] = along[hit], True
    for x, y, radius in world.discs:
        w = np.array([x, y]) - origin
        foot = d @ w
        under = radius**2 - (w @ w - foot**2)
        along = foot - np.sqrt(np.maximum(under, 0))
        hit = (under >= 0) & (along > 0) & (along < nearest)
        nearest[hit], static[hit] = along[hit], False
    beyond = nearest >= range_max
    nearest[beyond], static[beyond] = np.inf, False
    return nearest, static


def sweep(world, pose, beams, fov, range_max, stamp=0.0, *, labelled=True):
    """An exact scan of `world`; `fov` of 2 pi goes all the way round."""
    full = abs(fov - 2 * np.pi) < 1e-9
    increment = fov / (beams if full else beams - 1)
    angle_min = -np.pi if full else -fov / 2
    bearings = pose[2] + angle_min + increment * np.arange(beams)
    ranges, static = cast(world, pose[:2], bearings, range_max)
    return Scan(ranges, angle_min, increment, range_max, pose, stamp, ~static if labelled else None)


def point_to_edges(points, edges):
    """[N, K] distances from points [N, 2] to segments [K, 2, 2]."""
    p, q = edges[:, 0], edges[:, 1]
    e = q - p
    w = points[:, None] - p
    share = np.clip((w * e).sum(-1) / (e * e).sum(-1), 0, 1)
    return np.linalg.norm(w - share[..., None] * e, axis=-1)


def inside_boxes(points, boxes):
    """[N] bool: inside any box."""
    result = np.zeros(len(points), dtype=bool)
    for corners in boxes:
        centre = corners.mean(axis=0)
        u, v = (corners[0] - corners[1]) / 2, (corners[1] - corners[2]) / 2
        w = points - centre
        result |= (np.abs(w @ u) <= u @ u) & (np.abs(w @ v) <= v @ v)
    return result


def box_distance(points, world):
    """[N] distance to the nearest box [m]; 0 inside, infinite where there is none."""
    if not len(world.boxes):
        return np.full(len(points), np.inf)
    distance = point_to_edges(points, world.edges).min(axis=1)
    return np.where(inside_boxes(points, world.boxes), 0.0, distance)


def sweep_blocked(start, end, radius, world):
    """[N] bool: a disc that goes straight from `start` to `end` crosses a box on its way."""
    if not len(world.boxes) or not len(start):
        return np.zeros(len(start), dtype=bool)
    edges = world.edges
    p, e = edges[:, 0], edges[:, 1] - edges[:, 0]
    d = end - start
    w = p - start[:, None]
    cross = d[:, None, 0] * e[:, 1] - d[:, None, 1] * e[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (w[..., 0] * e[:, 1] - w[..., 1] * e[:, 0]) / cross
        share = (w[..., 0] * d[:, None, 1] - w[..., 1] * d[:, None, 0]) / cross
    meets = ((along >= 0) & (along <= 1) & (share >= 0) & (share <= 1)).any(axis=1)
    near = np.minimum(point_to_edges(start, edges), point_to_edges(end, edges)).min(axis=1)
    length = np.maximum((d * d).sum(-1), 1e-12)
    for corners in world.boxes:
        for corner in corners:
            w = corner - start
            t = np.clip((w * d).sum(-1) / length, 0, 1)
            near = np.minimum(near, np.linalg.norm(w - t[:, None] * d, axis=-1))
    return meets | (near < radius - 1e-9) | inside_boxes(end, world.boxes)


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


def hidden_discs(scans, world, body, settings, count, generator):
    """Discs that may be where no beam saw them: (centres [A, 2], radii [A]).

    Most of them are the nearest that their bearing allows; the others are tucked behind.

    Args:
        body: [D, 3] x, y, radius of the robot's discs at the scan.
    """
    each = count // len(scans) + 1
    centres, radii = [], []
    for scan in scans:
        radius = (
            0.5
            * settings.object_width
            * np.where(generator.random(each) < 0.7, 1.0, 1 + 3 * generator.random(each))
        )
        bearing = generator.uniform(-np.pi, np.pi, each)
        between = generator.random(each) < 0.5
        steps = generator.integers(0, len(scan.ranges), each) + 0.5
        bearing[between] = scan.bearings[0] + scan.angle_increment * steps[between]
        s = nearest_hidden(scan, bearing, radius, settings.range_noise) + 1e-9
        s = s + np.where(generator.random(each) < 0.7, 0.0, generator.exponential(1.0, each))
        direction = np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
        at = np.array(scan.pose[:2]) + s[:, None] * direction
        # out of the wall that its bearing ends at, to the far side
        for _ in range(6):
            stuck = box_distance(at, world) < radius
            at[stuck] += direction[stuck] * 0.5 * radius[stuck, None]
        centres.append(at)
        radii.append(radius)
    c, rho = np.concatenate(centres), np.concatenate(radii)
    return keep_possible(scans, world, body, settings, c, rho)


def keep_possible(scans, world, body, settings, c, rho):
    """Those discs that contradict no beam and overlap neither a box nor the robot."""
    ok = box_distance(c, world) >= rho
    for x, y, r in body:
        ok &= np.hypot(c[:, 0] - x, c[:, 1] - y) >= rho + r
    c, rho = c[ok], rho[ok]
    for scan in scans:
        ok = consistent(scan, c, rho, settings.range_noise)
        c, rho = c[ok], rho[ok]
    return c, rho


# motion ---------------------------------------------------------------------------------------


def rates(robot, state, inputs):
    """Right-hand side of eq. 22 (car) or eq. 23 (differential drive); state [..., 5]."""
    a, b = inputs
    theta = state[..., 2]
    if robot.kind == CAR:
        v, turn = state[..., 3], state[..., 3] * np.tan(state[..., 4]) / robot.wheelbase
    else:
        v = 0.5 * (state[..., 3] + state[..., 4])
        turn = (state[..., 3] - state[..., 4]) / robot.track
    one = np.ones_like(v)
    return np.stack([v * np.cos(theta), v * np.sin(theta), turn, a * one, b * one], axis=-1)


def rk4(robot, state, inputs, duration, step):
    """The state after `duration` [s] under constant inputs, without any limit."""
    count = round(duration / step)
    y = np.array(state, dtype=np.float64)
    for _ in range(count):
        k1 = rates(robot, y, inputs)
        k2 = rates(robot, y + 0.5 * step * k1, inputs)
        k3 = rates(robot, y + 0.5 * step * k2, inputs)
        k4 = rates(robot, y + step * k3, inputs)
        y = y + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return y


def inputs_while_braking(robot, states, control, t):
    """(first, second) of each state's last two numbers at times t [T]: [N, T] each."""
    kind, first, second = control
    a0, b0 = states[:, 3:4], states[:, 4:5]
    t = t[None]
    if robot.kind == CAR:
        return np.sign(a0) * np.maximum(np.abs(a0) - first * t, 0), np.clip(
            b0 + second * t, -robot.xi_max, robot.xi_max
        )
    if int(kind) == BRAKE_IN_PROPORTION:
        fastest = np.maximum(np.abs(a0), np.abs(b0))
        share = np.maximum(1 - first * t / np.maximum(fastest, 1e-300), 0)
        return a0 * share, b0 * share
    return (
        np.sign(a0) * np.maximum(np.abs(a0) - first * t, 0),
        np.sign(b0) * np.maximum(np.abs(b0) - second * t, 0),
    )


def rest_time(robot, states, control):
    """[N] time that braking by `control` takes to rest [s]."""
    kind, first, second = control
    a, b = np.abs(states[:, 3]), np.abs(states[:, 4])
    if robot.kind == CAR:
        return a / first
    if int(kind) == BRAKE_IN_PROPORTION:
        return np.maximum(a, b) / first
    return np.maximum(a / first, b / second)


def braking_path(robot, states, control, step=1e-3):
    """(t [T], poses [N, T, 3]) while braking; inputs are known functions of time, so the fourth-
    order Runge-Kutta step is Simpson's rule, and the whole path is a running sum.
    """
    longest = float(rest_time(robot, states, control).max(initial=0.0))
    # a grid of quarter steps: headings at the halves, positions at the wholes
    count = int(np.ceil(longest / step)) + 1
    t = 0.25 * step * np.arange(4 * count + 1)
    a, b = inputs_while_braking(robot, states, control, t)
    if robot.kind == CAR:
        v, turn = a, a * np.tan(b) / robot.wheelbase
    else:
        v, turn = 0.5 * (a + b), (a - b) / robot.track
    theta = states[:, 2:3] + _running(turn, 0.5 * step)
    v = v[:, ::2]
    x = states[:, 0:1] + _running(v * np.cos(theta), step)
    y = states[:, 1:2] + _running(v * np.sin(theta), step)
    return t[::4], np.stack([x, y, theta[:, ::2]], axis=-1)


def _running(f, step):
    """Running integral at every second sample of f [N, 2 m + 1], by Simpson's rule."""
    pieces = step / 6 * (f[:, 0:-1:2] + 4 * f[:, 1::2] + f[:, 2::2])
    return np.concatenate([np.zeros((len(f), 1)), np.cumsum(pieces, axis=1)], axis=1)


def disc_centres(robot, poses):
    """[..., D, 2] centres of the body's discs; poses [..., 3]."""
    offsets = np.array([offset for offset, _ in robot.discs])
    x = poses[..., 0, None] + offsets * np.cos(poses[..., 2, None])
    y = poses[..., 1, None] + offsets * np.sin(poses[..., 2, None])
    return np.stack([x, y], axis=-1)


# attacks --------------------------------------------------------------------------------------


def reaches(points, elapsed, attackers, radius, bound, world):
    """[N] bool: an attacker can touch a disc at `points` [N, 2], `elapsed` [N] s after the scan.

    Straight ways only: an attacker whose way a box blocks does not count.
    """
    c, rho = attackers
    if not len(c) or not len(points):
        return np.zeros(len(points), dtype=bool)
    apart = np.linalg.norm(points[:, None] - c[None], axis=-1)
    n, k = np.nonzero(apart - rho - radius <= bound * elapsed[:, None])
    gap = np.maximum(apart[n, k], 1e-12)
    share = np.clip((gap - rho[k] - radius) / gap, 0, 1)
    end = c[k] + share[:, None] * (points[n] - c[k])
    free = ~sweep_blocked(c[k], end, rho[k], world)
    result = np.zeros(len(points), dtype=bool)
    result[n[free]] = True
    return result
