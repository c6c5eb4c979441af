"""A robot that stands and follows what it sees: the tracker beside the simulated truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from passpmp_ti.bench.reliability import touch_chance
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.grid.view import views_of
from passpmp_ti.kernels.beams import MOVABLE
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.world import World
from passpmp_ti.tracking import Forecast, Sighting, Tracks

CLOSE = 3.0
"""A track farther than this from a mover's centre is not taken for it [object widths]."""


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Where the robot stands, and what it sees with."""

    world: World
    lidars: tuple[Lidar, ...]
    settings: Settings
    place: tuple[float, float, float]
    """(x, y, theta) [m, m, rad]."""
    static_map: StaticMap | None = None

    def sightings(self, stamp: float, generator: np.random.Generator) -> list[Sighting]:
        """What is seen at `stamp` [s], labelled as the planner labels it."""
        scans = [x.scan(self.world, np.array(self.place), stamp, generator) for x in self.lidars]
        return sightings_of(scans, self.settings, self.static_map)


def sightings_of(
    scans: list[Scan], settings: Settings, static_map: StaticMap | None = None
) -> list[Sighting]:
    """Scans of one instant, without the returns that a label or the map explains."""
    anchor = scans[0].pose[:2]
    views = views_of(scans, (), settings, anchor, [s.range_max for s in scans], static_map)
    return [
        Sighting.of(scan, views.met[v, : len(scan.ranges)] == MOVABLE)
        for v, scan in enumerate(scans)
    ]


def matches(tracks: Tracks, world: World, settings: Settings) -> np.ndarray:
    """[N] the mover that each track is taken for, -1: none; at most one track a mover."""
    found = np.full(len(tracks), -1)
    present = np.flatnonzero(world.movers.present(tracks.stamp))
    if not len(tracks) or not len(present):
        return found
    truth = world.movers.at(tracks.stamp)[present]
    apart = np.hypot(*np.moveaxis(tracks.positions[:, None] - truth[None], -1, 0))
    near = apart <= CLOSE * settings.object_width
    # those that are not seen come last: a ghost takes no mover from its own track
    rows, columns = linear_sum_assignment(np.where(near, apart + ~tracks.seen[:, None] * 10, 1e6))
    good = near[rows, columns]
    found[rows[good]] = present[columns[good]]
    return found


@dataclass
class Tally:
    """Errors of a tracker against the truth, summed over cycles."""

    position: list[np.ndarray] = field(default_factory=list)
    speed: list[np.ndarray] = field(default_factory=list)
    movers_seen: int = 0
    movers_followed: int = 0
    switches: int = 0
    returns: int = 0
    explained: int = 0
    seconds: list[float] = field(default_factory=list)
    tracks: list[int] = field(default_factory=list)
    _known: dict[int, int] = field(default_factory=dict)

    GROWN_UP = 1.0
    """Velocities of younger tracks are not judged [s]."""

    def count(self, tracks: Tracks, sightings: list[Sighting], seconds: float) -> None:
        """Take a cycle down; no truth is needed."""
        self.seconds.append(seconds)
        self.tracks.append(len(tracks))
        for sighting, owner in zip(sightings, tracks.owner, strict=True):
            self.returns += int(sighting.movable.sum())
            self.explained += int((owner[sighting.movable] >= 0).sum())

    def judge(self, tracks: Tracks, sightings: list[Sighting], scene: Scene) -> None:
        """Compare a cycle with the truth."""
        movers, stamp = scene.world.movers, tracks.stamp
        mine = matches(tracks, scene.world, scene.settings)
        own = np.flatnonzero((mine >= 0) & tracks.seen)
        truth = movers.positions(np.array([stamp - 0.05, stamp]))
        velocity = (truth[1] - truth[0]) / 0.05
        self.position.append(np.hypot(*(tracks.positions[own] - truth[1, mine[own]]).T))
        old = own[tracks.age[own] >= self.GROWN_UP]
        self.speed.append(np.hypot(*(tracks.velocities[old] - velocity[mine[old]]).T))
        for n in own:
            known = self._known.get(int(mine[n]))
            self.switches += known is not None and known != int(tracks.ids[n])
            self._known[int(mine[n])] = int(tracks.ids[n])
        seen = _in_view(sightings, truth[1], movers.radius + scene.settings.range_noise + 0.02)
        self.movers_seen += int(seen.sum())
        self.movers_followed += int(seen[mine[own]].sum())


def _in_view(sightings: list[Sighting], centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """[M] bool: movers with three returns or more."""
    count = np.zeros(len(centre), dtype=int)
    for s in sightings:
        bearing, r = s.bearings[s.movable], s.ranges[s.movable]
        points = np.array(s.origin) + r[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], 1)
        apart = np.hypot(*np.moveaxis(points[:, None] - centre[None], -1, 0))
        count += (apart <= radius).sum(axis=0)
    return count >= 3


@dataclass(frozen=True, slots=True)
class Promises:
    """Chances of a touch, and what came of them."""

    horizon: np.ndarray
    """[Q] [s]."""
    chance: np.ndarray
    """[Q]."""
    touched: np.ndarray
    """[Q] bool."""
    tracks: int
    """Track predictions that they were asked of."""


def promises(
    forecast: Forecast,
    truth: np.ndarray,
    known: np.ndarray,
    radius: np.ndarray,
    stamp: float,
    places: int,
    generator: np.random.Generator,
) -> Iterator[Promises]:
    """Ask a forecast at each of its times about discs at random places.

    The discs are 0.1 to 3 m large and lie about where they would just touch the object in one of
    the mixture's means, off by its spread, so that chances from 0 to 1 come up at every horizon.
    The truth has no part in the draw.

    Args:
        forecast: of N tracks at L times.
        truth: [L, N, 2] where each track's mover was then [m].
        known: [L, N] bool: the truth is recorded.
        radius: [N] of the movers [m].
        stamp: when the forecast was made [s].
        places: discs a track and time.
        generator: draws them.
    """
    count, kinds = forecast.weight.shape
    for step, time in enumerate(forecast.times):
        n = np.repeat(np.flatnonzero(known[step]), places)
        chosen = generator.uniform(size=len(n))[:, None] > np.cumsum(forecast.weight[n], axis=1)
        kind = np.minimum(chosen.sum(axis=1), kinds - 1)
        mean = forecast.mean[:, :, step, :2]
        covariance = forecast.covariance[:, :, step, :2, :2]
        wide = np.sqrt(np.linalg.eigvalsh(covariance[n, kind])[:, 1])
        disc = np.exp(generator.uniform(np.log(0.1), np.log(3.0), len(n)))
        apart = disc + forecast.radius[n] + 1.5 * wide * generator.normal(size=len(n))
        way = generator.uniform(0.0, 2 * np.pi, len(n))
        place = mean[n, kind] + apart[:, None] * np.stack([np.cos(way), np.sin(way)], axis=1)
        chance = touch_chance(
            forecast.weight[n], mean[n], covariance[n], place, disc + forecast.radius[n]
        )
        touched = np.hypot(*(truth[step, n] - place).T) < disc + radius[n]
        ahead = np.full(len(n), time - stamp)
        yield Promises(ahead, chance, touched, int(known[step].sum()))
