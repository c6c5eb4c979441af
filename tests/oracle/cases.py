"""Random claims: what is believed of a world, for whom, and how wrong it may be."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from oracle import exact
from oracle.hidden import smallest_radius
from oracle.worlds import map_of, random_mounts, random_scans, random_world
from passpmp_ti import (
    CarLike,
    DifferentialDrive,
    FutureModel,
    Settings,
    StaticMap,
    cover_rectangle,
)

CHAIR = DifferentialDrive()
LONG_CHAIR = DifferentialDrive(discs=cover_rectangle(0.7, 0.3, 0.6, 2))
CAR = CarLike(discs=cover_rectangle(3.2, 0.8, 1.7, 3))


@dataclass(frozen=True)
class Case:
    """A world, what was seen of it, and for whom. Scans and position are what is believed."""

    robot: object
    settings: Settings
    world: exact.World
    scans: list
    position: tuple
    static_map: StaticMap | None = None
    error: tuple = (0.0, 0.0)
    """From true poses at the scan to the believed ones [m]."""
    late: float = 0.0
    """How much older the scan is than its stamp says [s]."""
    boxes_rush: bool = False
    """Nothing declares the boxes static: they may attack."""
    blockers: exact.World = field(init=False)
    """What no attacker passes through."""

    def __post_init__(self):
        blockers = exact.world_of([] if self.boxes_rush else self.world.boxes)
        object.__setattr__(self, "blockers", blockers)

    @property
    def true_scans(self):
        """The scans at their true poses."""
        if not any(self.error):
            return self.scans
        return [
            replace(s, pose=(s.pose[0] - self.error[0], s.pose[1] - self.error[1], s.pose[2]))
            for s in self.scans
        ]

    @property
    def true_position(self):
        x, y, theta = self.position
        return (x - self.error[0], y - self.error[1], theta)

    @property
    def body(self):
        """[D, 3] the robot's discs at the scan, where they truly were."""
        centres = exact.disc_centres(self.robot, np.array(self.true_position))
        radii = np.full(len(centres), self.robot.disc_radius)
        return np.concatenate([centres, radii[:, None]], axis=1)

    def age(self, times):
        """[n] true age of the scan at absolute times [s]."""
        return np.asarray(times) - self.scans[0].stamp + self.late

    def model(self, previous=None):
        return FutureModel.from_scan(
            self.scans, self.robot, self.settings, previous, self.static_map,
            position=self.position,
        )  # fmt: skip

    def true_states(self, states, generator):
        """States as far from those believed as poses and tracking allow."""
        far = self.settings.localisation_error + self.settings.tracking_error
        away = generator.uniform(-np.pi, np.pi, len(states))
        if any(self.error):
            # both errors add up where they point apart
            half = generator.random(len(states)) < 0.5
            away[half] = np.arctan2(-self.error[1], -self.error[0])
        moved = states.copy()
        moved[:, 0] += far * np.cos(away)
        moved[:, 1] += far * np.sin(away)
        return moved


def random_case(generator, *, plain=False):
    """One world and its scans: lost beams, noise, labels, a map or neither, blind bearings.

    Args:
        plain: without a map, declared clearings or errors of poses and stamps.
    """
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
    if not plain:
        settings = _with_errors(settings, generator, scale)
    position = (*map(float, generator.uniform(-30, 30, 2)), float(generator.uniform(-np.pi, np.pi)))
    world = random_world(generator, position, robot, settings, scale)
    declared = ("label", "map", "nothing")[
        generator.choice(3, p=(0.7, 0, 0.3) if plain else (0.45, 0.3, 0.25))
    ]
    mounts, fov = random_mounts(generator)
    if not plain and mounts == [0.0] and fov < 6 and generator.random() < 0.7:
        settings = _with_a_clearing(settings, generator, world, position, robot, scale)
    static_map = None
    if declared == "map":
        resolution = 0.05 * scale**0.5
        most = 0.5 * (settings.object_width - 3 * resolution)
        settings = settings.changed(map_tolerance=float(generator.uniform(0.2, 0.99)) * most)
        static_map = map_of(world, resolution)
    # a sparse sensor on a map: one beam may meet somebody who leans on a wall
    beams = [360, 540, 720, 1440] + ([90, 180] if declared == "map" else [])
    scans = random_scans(
        generator, world, position, settings, scale, robot, mounts=mounts, fov=fov,
        beams=int(generator.choice(beams)), labelled=declared == "label",
    )  # fmt: skip
    # what no sensor covers may be slower, and a box may reach from there into what one does
    one_bound = settings.unseen_speed == settings.object_speed
    size = smallest_radius(settings) <= 0.5 * settings.object_width
    rush = declared == "nothing" and size and one_bound
    case = Case(robot, settings, world, scans, position, static_map, boxes_rush=rush)
    return believed(case, generator)


def believed(case, generator):
    """A case of true scans and poses, as it is believed: wrong by what its settings declare."""
    settings, error = case.settings, np.zeros(2)
    if settings.localisation_error > 0:
        way = generator.uniform(-np.pi, np.pi)
        error = settings.localisation_error * np.array([np.cos(way), np.sin(way)])

    def moved(pose):
        return (float(pose[0] + error[0]), float(pose[1] + error[1]), pose[2])

    return replace(
        case,
        scans=[replace(scan, pose=moved(scan.pose)) for scan in case.scans],
        position=moved(case.position),
        error=tuple(error),
        late=settings.stamp_error * float(generator.choice([1.0, 0.5])),
    )


def _with_errors(settings, generator, scale):
    """Some of the errors that settings may declare, each in about a third of the cases."""
    far = 0.05 * scale**0.5
    drawn = {
        "localisation_error": float(generator.uniform(0.2, 1.5)) * far,
        "tracking_error": float(generator.uniform(0.2, 2.0)) * far,
        "stamp_error": float(generator.uniform(0.01, 0.15)),
        "object_radius": float(generator.uniform(0.2, 1.5)) * settings.object_width,
    }
    chosen = {name: value for name, value in drawn.items() if generator.random() < 0.35}
    return settings.changed(**chosen)


def _with_a_clearing(settings, generator, world, position, robot, scale):
    """Bearings that no sensor covers have a bound of their own, and the start is empty."""
    middle = np.array(position[:2])
    room = exact.box_distance(middle[None], world)[0]
    for x, y, radius in world.discs:
        room = min(room, float(np.hypot(x - middle[0], y - middle[1])) - radius)
    clear = min(robot.radius + scale * float(generator.uniform(0.1, 1.5)), room)
    slow = float(generator.choice([0.0, 0.0, 0.3])) * settings.object_speed
    return settings.changed(blind_speed=slow, clear_radius=clear)


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
