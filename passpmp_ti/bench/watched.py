"""A robot that stands and follows what it sees: the tracker beside the simulated truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from passpmp_ti.bench.reliability import touch_chance
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.grid.view import labels_of
from passpmp_ti.kernels.beams import MOVABLE
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.world import World
from passpmp_ti.tracking import Forecast, Sighting, Tracks
from passpmp_ti.tracking.ledger import COAST

GROWN_UP = 1.0
"""Velocities of younger tracks are not judged [s]."""
SURFACE = 0.02
"""A return farther outside of a mover than this is not one of it [m]."""


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
    labels = labels_of(scans, settings, anchor, [s.range_max for s in scans], static_map)
    return [
        Sighting.of(scan, met == MOVABLE) for scan, met in zip(scans, labels.met, strict=True)
    ]


@dataclass
class Whose:
    """Which movers each track is about: those whose returns it was last given."""

    known: dict[int, tuple[int, ...]] = field(default_factory=dict)
    """Per id, the movers, that of the most returns first; none: something that stays."""

    def told(self, tracks: Tracks, sightings: list[Sighting], scene: Scene) -> None:
        """Take a cycle's returns into account."""
        movers = scene.world.movers
        present = np.flatnonzero(movers.present(tracks.stamp))
        centre, radius = movers.at(tracks.stamp)[present], movers.radius[present]
        owner = np.concatenate([own[own >= 0] for own in tracks.owner])
        points = np.concatenate(
            [_points(s, own >= 0) for s, own in zip(sightings, tracks.owner, strict=True)]
        )
        outside = np.hypot(*np.moveaxis(points[:, None] - centre[None], -1, 0)) - radius
        for id_ in np.unique(owner):
            hits = (outside[owner == id_] <= scene.settings.range_noise + SURFACE).sum(axis=0)
            order = np.argsort(-hits, kind="stable")
            self.known[int(id_)] = tuple(present[order[hits[order] > 0]].tolist())

    def chief(self, tracks: Tracks) -> np.ndarray:
        """[N] the mover of the most returns; -1: none."""
        found = [self.known.get(int(id_), ()) for id_ in tracks.ids]
        return np.array([movers[0] if movers else -1 for movers in found], dtype=int)

    def all(self, tracks: Tracks) -> np.ndarray:
        """[N, M] all movers of each track; rows are filled up with its first; -1: none."""
        found = [self.known.get(int(id_), ()) or (-1,) for id_ in tracks.ids]
        most = max((len(movers) for movers in found), default=1)
        return np.array([m + m[:1] * (most - len(m)) for m in found], dtype=int).reshape(-1, most)


def _points(sighting: Sighting, beams: np.ndarray) -> np.ndarray:
    """[p, 2] where the returns of some beams lie [m]."""
    bearing, r = sighting.bearings[beams], sighting.ranges[beams]
    way = np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    return np.array(sighting.origin) + r[:, None] * way


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
    _known: dict[int, tuple[int, float]] = field(default_factory=dict)
    """Per mover: the id of its track, and when it was last met [s]."""

    def count(self, tracks: Tracks, sightings: list[Sighting], seconds: float) -> None:
        """Take a cycle down; no truth is needed."""
        self.seconds.append(seconds)
        self.tracks.append(len(tracks))
        for sighting, owner in zip(sightings, tracks.owner, strict=True):
            self.returns += int(sighting.movable.sum())
            self.explained += int((owner[sighting.movable] >= 0).sum())

    def add(self, other: Tally) -> None:
        """Take over what another tally counted."""
        for name in ("position", "speed", "seconds", "tracks"):
            getattr(self, name).extend(getattr(other, name))
        for name in ("movers_seen", "movers_followed", "switches", "returns", "explained"):
            setattr(self, name, getattr(self, name) + getattr(other, name))

    def judge(self, tracks: Tracks, sightings: list[Sighting], scene: Scene, whose: Whose) -> None:
        """Compare a cycle with the truth; `whose` knows of it."""
        movers, stamp = scene.world.movers, tracks.stamp
        mine = whose.chief(tracks)
        own = np.flatnonzero((mine >= 0) & tracks.seen)
        truth = movers.positions(np.array([stamp - 0.05, stamp]))
        velocity = (truth[1] - truth[0]) / 0.05
        self.position.append(np.hypot(*(tracks.positions[own] - truth[1, mine[own]]).T))
        old = own[tracks.age[own] >= GROWN_UP]
        self.speed.append(np.hypot(*(tracks.velocities[old] - velocity[mine[old]]).T))
        for n in own:
            known, met = self._known.get(int(mine[n]), (-1, -np.inf))
            # who was away for longer than a track coasts comes back as somebody else
            self.switches += stamp - met <= COAST and known != int(tracks.ids[n])
            self._known[int(mine[n])] = int(tracks.ids[n]), stamp
        seen = _in_view(sightings, truth[1], movers.radius + scene.settings.range_noise + SURFACE)
        self.movers_seen += int(seen.sum())
        self.movers_followed += int(seen[np.unique(mine[own])].sum())


def _in_view(sightings: list[Sighting], centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """[M] bool: movers with three returns or more."""
    count = np.zeros(len(centre), dtype=int)
    for s in sightings:
        apart = np.hypot(*np.moveaxis(_points(s, s.movable)[:, None] - centre[None], -1, 0))
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
        truth: [L, N, M, 2] where the movers of each track were then [m].
        known: [L, N] bool: the truth is recorded.
        radius: [N, M] of the movers [m].
        stamp: when the forecast was made [s].
        places: discs a track and time.
        generator: draws them.
    """
    kinds = forecast.weight.shape[1]
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
        apart = np.hypot(*np.moveaxis(truth[step, n] - place[:, None], -1, 0))
        touched = (apart < disc[:, None] + radius[n]).any(axis=1)
        ahead = np.full(len(n), time - stamp)
        yield Promises(ahead, chance, touched, int(known[step].sum()))
