"""One cycle of the tracker: predict, meet, forget."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from passpmp_ti import door
from passpmp_ti.settings import Settings
from passpmp_ti.tracking import imm
from passpmp_ti.tracking.assignment import assign
from passpmp_ti.tracking.detections import Detections, detect
from passpmp_ti.tracking.segments import longest
from passpmp_ti.tracking.sighting import Sighting
from passpmp_ti.tracking.tracks import Tracks
from passpmp_ti.tracking.visibility import seen_empty

COAST = 3.0
"""What was not met for so long is forgotten [s]."""
BIRTH, SURE, GONE = 0.8, 0.97, 0.2
"""Chance that something just met exists; the greatest that is ever said; that of forgetting."""
DETECTS = 0.9
"""Chance that an object in plain view is met."""
ROUND_UP = 1.0 + 1e-9
"""Discs are said to be this much larger, so that no rounding leaves a return outside."""
SHRINK = 2.0
"""Time constant in which a radius that was once seen is forgotten [s]."""


def follow(
    before: Tracks | None, sightings: Sequence[Sighting], stamp: float, settings: Settings
) -> Tracks:
    """Take the sightings of one instant into account.

    Every movable return belongs to a track afterwards, but for those of what is too long to be an
    object. What is met nowhere near a track is a new one at once. A track that is not met is
    predicted on for `COAST` if its place is hidden, and forgotten within a few cycles if the place
    is seen to be empty.

    Args:
        before: after the last cycle; None: nothing is followed yet.
        sightings: of this instant; none: everything coasts.
        stamp: absolute [s]. One that is not later than the last, or much later, starts anew.
        settings: object_speed, object_width, object_radius, range_noise.

    Raises:
        ValueError: a stamp that is not finite.
    """
    stamp = door.finite("follow", "stamp", stamp, unit="s")
    found = detect(sightings, settings)
    speed = settings.object_speed
    old = before if before is not None and 0.0 < stamp - before.stamp <= COAST else None
    if old is None:
        bank = imm.born(np.zeros((0, 2)), np.zeros(0), speed)
        kept = _Kept.of(None)
    else:
        bank = imm.predicted(old.bank, round(stamp - old.stamp, 6), speed)
        kept = _Kept.of(old)

    centre, deviation, body = found.placed()
    mean, covariance = bank.combined()
    farthest = kept.radius + longest(settings) + speed * (stamp - kept.last_seen)
    track = assign(mean[:, :2], covariance[:, :2, :2], centre, deviation, farthest)
    met = np.flatnonzero(track >= 0)
    if len(met):
        told = np.full(found.count, np.nan)
        told[met] = kept.body[track[met]]
        centre, deviation, body = found.placed(told)
        bank = _with(bank, track[met], imm.updated(
            bank.taken(track[met]), centre[met], deviation[met], speed
        ))  # fmt: skip
    track = _absorbed(track, found, bank.combined()[0][:, :2], kept.radius)
    fresh = np.flatnonzero(track < 0)
    track[fresh] = len(bank) + np.arange(len(fresh))
    bank = bank.joined(imm.born(centre[fresh], deviation[fresh], speed))
    next_id = before.next_id if before is not None else 0
    kept = kept.joined(len(fresh), next_id, stamp)
    next_id += len(fresh)
    kept = _met(kept, found, track, centre, deviation, body, stamp, old.stamp if old else stamp)

    unmet = np.flatnonzero(~kept.seen)
    share = seen_empty(bank.combined()[0][unmet, :2], kept.radius[unmet], sightings)
    miss, exists = DETECTS * share, kept.existence[unmet]
    kept.existence[unmet] = exists * (1 - miss) / (1 - exists * miss)
    alive = (kept.existence >= GONE) & (stamp - kept.last_seen <= COAST)
    ids = kept.ids
    owner = tuple(
        _owners(len(s.ranges), beams, ids[track[objects]])
        for s, (beams, objects) in zip(sightings, found.beams, strict=True)
    )
    lost = before is not None and len(before) > 0 and (old is None or not alive.all())
    return kept.tracks(alive, bank, stamp, speed, owner, ended=lost, next_id=next_id)


@dataclass(slots=True)
class _Kept:
    """What is known of each track beside its filters, while the cycle works on it."""

    ids: np.ndarray
    radius: np.ndarray
    body: np.ndarray
    seen: np.ndarray
    born: np.ndarray
    last_seen: np.ndarray
    last_centre: np.ndarray
    last_radius: np.ndarray
    existence: np.ndarray

    @classmethod
    def of(cls, tracks: Tracks | None) -> _Kept:
        if tracks is None:
            none = np.zeros(0)
            flat = np.zeros((0, 2))
            return cls(none.astype(int), none, none, none > 0, none, none, flat, none, none)
        return cls(
            tracks.ids,
            tracks.radius.copy(),
            tracks.body.copy(),
            np.zeros(len(tracks), dtype=bool),
            tracks.born,
            tracks.last_seen.copy(),
            tracks.last_centre.copy(),
            tracks.last_radius.copy(),
            tracks.existence.copy(),
        )

    def joined(self, count: int, next_id: int, stamp: float) -> _Kept:
        """These, and `count` new ones."""
        zero = np.zeros(count)
        return _Kept(
            np.concatenate([self.ids, next_id + np.arange(count)]),
            np.concatenate([self.radius, zero]),
            np.concatenate([self.body, np.full(count, np.nan)]),
            np.concatenate([self.seen, zero > 0]),
            np.concatenate([self.born, zero + stamp]),
            np.concatenate([self.last_seen, zero + stamp]),
            np.concatenate([self.last_centre, np.zeros((count, 2))]),
            np.concatenate([self.last_radius, zero]),
            np.concatenate([self.existence, zero + BIRTH]),
        )

    def tracks(
        self,
        alive: np.ndarray,
        bank: imm.Bank,
        stamp: float,
        speed: float,
        owner: tuple[np.ndarray, ...],
        *,
        ended: bool,
        next_id: int,
    ) -> Tracks:
        """Those that are alive, for good."""
        own = {name: getattr(self, name)[alive] for name in self.__slots__}
        bank = bank.taken(alive)
        for array in (*own.values(), bank.mean, bank.covariance, bank.weight, *owner):
            array.setflags(write=False)
        return Tracks(
            stamp=stamp, speed=speed, bank=bank, owner=owner, ended=ended, next_id=next_id, **own
        )


def _with(bank: imm.Bank, index: np.ndarray, new: imm.Bank) -> imm.Bank:
    """The bank with the tracks of an index replaced."""
    mean, covariance, weight = bank.mean.copy(), bank.covariance.copy(), bank.weight.copy()
    mean[index], covariance[index], weight[index] = new.mean, new.covariance, new.weight
    return imm.Bank(mean, covariance, weight)


def _absorbed(
    track: np.ndarray, found: Detections, place: np.ndarray, radius: np.ndarray
) -> np.ndarray:
    """[M] tracks of the detections; pieces of an object that was met belong to it.

    A post in front of somebody parts him in two. The piece that was assigned tells where he is;
    another piece of which every return lies in his disc is his, too.
    """
    track = track.copy()
    loose, held = np.flatnonzero(track < 0), np.unique(track[track >= 0])
    if not len(loose) or not len(held):
        return track
    for d in loose:
        points = found.points[found.owner == d]
        reach = np.hypot(*(points[None] - place[held][:, None]).T).T.max(axis=1)
        inside = reach <= radius[held]
        if inside.any():
            track[d] = held[int(np.argmin(np.where(inside, reach, np.inf)))]
    return track


def _met(
    kept: _Kept,
    found: Detections,
    track: np.ndarray,
    centre: np.ndarray,
    deviation: np.ndarray,
    body: np.ndarray,
    stamp: float,
    before: float,
) -> _Kept:
    """Take down where each track was met, and how large it seemed."""
    if not len(track):
        return kept
    count = len(kept.ids)
    tracks = np.unique(track)
    # the first detection of a track is the one that it was assigned
    _, chief = np.unique(track, return_index=True)
    kept.seen[tracks] = True
    kept.last_seen[tracks] = stamp
    kept.last_centre[tracks] = centre[chief]
    clear = found.clear()[chief]
    kept.body[tracks[clear]] = body[chief[clear]]
    reach = np.zeros(count)
    owner = track[found.owner]
    np.maximum.at(reach, owner, np.hypot(*(found.points - kept.last_centre[owner]).T))
    kept.last_radius[tracks] = reach[tracks] * ROUND_UP
    # the centre's own error is in the covariance already
    now = np.maximum(kept.last_radius[tracks] - deviation[chief], body[chief])
    # what is seen from side to side is as large as it seems; of the rest memory tells more
    gone = np.where(clear, 1.0, min((stamp - before) / SHRINK, 1.0))
    kept.radius[tracks] = np.maximum(now, kept.radius[tracks] * (1.0 - gone) + now * gone)
    known = kept.existence[tracks]
    kept.existence[tracks] = np.minimum(1.0 - 0.2 * (1.0 - known), SURE)
    return kept


def _owners(beams: int, own: np.ndarray, ids: np.ndarray) -> np.ndarray:
    found = np.full(beams, -1)
    found[own] = ids
    return found
