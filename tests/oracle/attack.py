"""Random claims, and attackers that try to break them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oracle import exact
from passpmp_ti import CarLike, DifferentialDrive, FutureModel, Scan, Settings, cover_rectangle

CHAIR = DifferentialDrive()
LONG_CHAIR = DifferentialDrive(discs=cover_rectangle(0.7, 0.3, 0.6, 2))
CAR = CarLike(discs=cover_rectangle(3.2, 0.8, 1.7, 3))
COARSE = 0.04
"""Time between samples at the first look; what is near then is looked at every 5 ms."""
FINE = 0.005


@dataclass(frozen=True)
class Case:
    """A world, what was seen of it, and for whom."""

    robot: object
    settings: Settings
    world: exact.World
    scans: list
    position: tuple

    @property
    def body(self):
        """[D, 3] the robot's discs at the scan."""
        centres = exact.disc_centres(self.robot, np.array(self.position))
        radii = np.full(len(centres), self.robot.disc_radius)
        return np.concatenate([centres, radii[:, None]], axis=1)

    def model(self, previous=None):
        return FutureModel.from_scan(
            self.scans, self.robot, self.settings, previous, position=self.position
        )


def random_case(generator):
    """One world and its scans: lost beams, noise, labels or none, blind bearings."""
    if generator.random() < 0.3:
        robot, scale = CAR, 5.0
        settings = Settings.for_robot(
            robot, object_speed=float(generator.choice([0.0, 3.0, 10.0, 20.0])), cell=0.25
        )
    else:
        robot, scale = (CHAIR, LONG_CHAIR)[generator.integers(2)], 1.0
        settings = Settings.for_robot(
            robot, object_speed=float(generator.choice([0.0, 0.5, 1.0, 2.0]))
        )
    noise = 0.02 if generator.random() < 0.3 else 0.0
    settings = settings.changed(range_noise=noise, stamp_error=0.0)
    x, y = generator.uniform(-30, 30, 2)
    position = (float(x), float(y), float(generator.uniform(-np.pi, np.pi)))
    world = random_world(generator, position, robot, settings.object_width, scale)
    scans = random_scans(generator, world, position, settings, scale, robot)
    return Case(robot, settings, world, scans, position)


def random_world(generator, position, robot, width, scale):
    """Boxes and discs about a robot, none narrower than `width`, none on the robot."""
    middle = np.array(position[:2])
    keep = robot.radius + 0.02
    boxes, discs = [], []
    for _ in range(generator.integers(1, 6)):
        sides = width + generator.exponential(1.0, 2) * scale * (0.2, 1.5)
        at = middle + scale * generator.uniform(-6, 6, 2)
        one = exact.box(*at, *sides, generator.uniform(0, np.pi))
        if exact.box_distance(middle[None], exact.world_of([one]))[0] > keep:
            boxes.append(one)
    for _ in range(generator.integers(0, 7)):
        radius = 0.5 * width * (1 + generator.exponential(0.5))
        at = middle + scale * generator.uniform(-5, 5, 2)
        if np.linalg.norm(at - middle) > radius + keep:
            discs.append((*at, radius))
    return exact.world_of(boxes, discs)


def random_scans(generator, world, position, settings, scale, robot, stamp=None):
    """A lidar all the way round, or a front and a rear one of 270 degrees."""
    stamp = float(generator.uniform(0, 1000)) if stamp is None else stamp
    range_max = scale * float(generator.choice([4.0, 6.0, 8.0]))
    beams = int(generator.choice([360, 540, 720, 1440]))
    labelled = generator.random() < 0.7
    if generator.random() < 0.6:
        mounts, fov = [0.0], 2 * np.pi
    elif generator.random() < 0.7:
        mounts, fov = [0.0, np.pi], 1.5 * np.pi
    else:
        mounts, fov = [0.0], 1.5 * np.pi
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
    return Scan(
        ranges,
        scan.angle_min,
        scan.angle_increment,
        scan.range_max,
        scan.pose,
        scan.stamp,
        scan.moving,
    )


def random_states(case, count, generator):
    """(states [n, 5], times [n]): anywhere about the robot, slow ones more often than fast ones."""
    robot, reach = case.robot, 0.6 * max(s.range_max for s in case.scans)
    states = np.empty((count, 5))
    distance = reach * generator.random(count) ** 0.7
    bearing = generator.uniform(-np.pi, np.pi, count)
    states[:, 0] = case.position[0] + distance * np.cos(bearing)
    states[:, 1] = case.position[1] + distance * np.sin(bearing)
    states[:, 2] = generator.uniform(-np.pi, np.pi, count)
    share = generator.uniform(-1, 1, (count, 2)) * generator.random((count, 1))
    if robot.kind == exact.CAR:
        states[:, 3] = share[:, 0] * np.where(share[:, 0] > 0, robot.v_max, robot.v_reverse)
        states[:, 4] = generator.uniform(-1, 1, count) * robot.xi_max
    else:
        states[:, 3:5] = share * robot.wheel_speed
    times = case.scans[0].stamp + generator.exponential(0.5, count)
    return states, times


def breaks(case, states, times, control, attackers, step=FINE):
    """[n] bool: braking by `control`, while the robot moves, a box or an attacker can touch it."""
    if not len(states):
        return np.zeros(0, dtype=bool)
    robot, bound = case.robot, case.settings.object_speed
    rest = exact.rest_time(robot, states, control)
    t, poses = exact.braking_path(robot, states, control, step)
    moving = t[None] < rest[:, None]
    centres = exact.disc_centres(robot, poses)
    elapsed = times[:, None] + t[None] - case.scans[0].stamp
    radius = robot.disc_radius
    broken = np.zeros(len(states), dtype=bool)
    if len(case.world.boxes):
        flat = centres[moving].reshape(-1, 2)
        which = np.repeat(np.nonzero(moving)[0], centres.shape[2])
        broken[which[exact.box_distance(flat, case.world) < radius]] = True
    c, rho = attackers
    if not len(c):
        return broken
    stride = max(round(COARSE / step), 1)
    slack = robot.top_speed + robot.top_turn_rate * max(abs(o) for o, _ in robot.discs) + bound
    slack *= stride * step
    for n in np.flatnonzero(~broken & (rest > 0)):
        last = int(moving[n].sum())
        ahead = centres[n, :last:stride]
        apart = np.linalg.norm(ahead[:, :, None] - c, axis=-1).min(axis=1) - rho - radius
        close = (apart <= bound * elapsed[n, :last:stride, None] + slack).any(axis=0)
        if close.any():
            points = centres[n, :last].reshape(-1, 2)
            when = np.repeat(elapsed[n, :last], centres.shape[2])
            # the nearest first: one attacker is enough
            order = np.flatnonzero(close)[np.argsort(apart.min(axis=0)[close])]
            for some in np.split(order, [3, 20]):
                broken[n] = (
                    broken[n]
                    or exact.reaches(
                        points, when, (c[some], rho[some]), radius, bound, case.world
                    ).any()
                )
    return broken
