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


def midpoint_path(robot, states, control, time_step):
    """[N, L, 5] states while braking, by the midpoint rule, until all are at rest."""
    longest = float(rest_time(robot, states, control).max(initial=0.0))
    count = int(np.ceil(longest / time_step - 1e-6))
    t = 0.5 * time_step * np.arange(2 * count + 1)
    a, b = inputs_while_braking(robot, states, control, t)
    mean_a = 0.5 * (a[:, 0:-1:2] + a[:, 2::2])
    if robot.kind == CAR:
        way = mean_a * time_step
        turn = way * np.tan(b[:, 1::2]) / robot.wheelbase
    else:
        mean_b = 0.5 * (b[:, 0:-1:2] + b[:, 2::2])
        way = 0.5 * (mean_a + mean_b) * time_step
        turn = (mean_a - mean_b) * time_step / robot.track
    path = np.empty((len(states), count + 1, 5))
    path[:, :, 2] = states[:, 2:3] + np.pad(np.cumsum(turn, axis=1), ((0, 0), (1, 0)))
    middle = path[:, :-1, 2] + 0.5 * turn
    for column, direction in ((0, np.cos(middle)), (1, np.sin(middle))):
        gone = np.cumsum(way * direction, axis=1)
        path[:, :, column] = states[:, column, None] + np.pad(gone, ((0, 0), (1, 0)))
    path[:, :, 3], path[:, :, 4] = a[:, ::2], b[:, ::2]
    return path


def room(scan, points):
    """[N] distance from each point to the nearest that the scan did not see to be empty [m];
    0 where the point itself was not."""
    r = np.minimum(np.where(scan.lost, 0.0, scan.ranges), scan.range_max)
    r = np.minimum(r, np.roll(r, -1))  # between two beams: up to the nearer return
    first, step = scan.bearings[0], scan.angle_increment
    low = first + step * np.arange(len(r))
    corners = []
    for bearing in (low, low + 0.5 * step, low + step):
        corners.append(np.stack([r * np.cos(bearing), r * np.sin(bearing)], axis=1))
    border = np.stack(corners, axis=1).reshape(-1, 2) + np.array(scan.pose[:2])
    edges = np.stack([border, np.roll(border, -1, axis=0)], axis=1)
    edges = edges[np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) > 1e-9]
    distance = point_to_edges(points, edges).min(axis=1)
    w = points - np.array(scan.pose[:2])
    wedge = ((np.arctan2(w[:, 1], w[:, 0]) - first) % (2 * np.pi) / step).astype(int) % len(r)
    return np.where(np.linalg.norm(w, axis=1) < r[wedge], distance, 0.0)
