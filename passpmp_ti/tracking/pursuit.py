"""One cycle of the tracker: predict, meet, forget."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from passpmp_ti import door
from passpmp_ti.settings import Settings
from passpmp_ti.tracking import imm
from passpmp_ti.tracking.assignment import assigned, pieces
from passpmp_ti.tracking.detections import detect
from passpmp_ti.tracking.ledger import COAST, Ledger
from passpmp_ti.tracking.sighting import Sighting
from passpmp_ti.tracking.tracks import Tracks
from passpmp_ti.tracking.visibility import seen_empty


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
    speed = settings.object_speed
    old = before if before is not None and 0.0 < stamp - before.stamp <= COAST else None
    since = stamp - old.stamp if old is not None else 0.0
    ledger = Ledger.of(old)
    bank = imm.born(np.zeros((0, 2)), np.zeros(0), speed)
    if old is not None:
        bank = imm.predicted(old.bank, round(since, 6), speed)

    found = detect(sightings, settings)
    found = found.united(pieces(found, bank.combined()[0][:, :2], ledger.radius, settings))
    track, anew = assigned(found, bank, ledger, stamp, settings)
    known, fresh = np.flatnonzero(track >= 0), np.flatnonzero(track < 0)
    told = np.full(found.count, np.nan)
    told[known] = ledger.body[track[known]]
    centre, deviation, body = found.placed(told)
    met = imm.updated(bank.taken(track[known]), centre[known], deviation[known], speed)
    bank = bank.replaced(track[known], met)
    bank = bank.replaced(track[anew], imm.born(centre[anew], deviation[anew], speed))

    next_id = before.next_id if before is not None else 0
    track[fresh] = len(bank) + np.arange(len(fresh))
    bank = bank.joined(imm.born(centre[fresh], deviation[fresh], speed))
    ledger = ledger.joined(Ledger.opened(next_id + np.arange(len(fresh)), stamp))
    ledger.meet(found, track, centre, deviation, body, stamp, since)
    unmet = np.flatnonzero(~ledger.seen)
    place = bank.combined()[0][unmet, :2]
    ledger.miss(unmet, seen_empty(place, ledger.radius[unmet], sightings))
    alive = ledger.alive(stamp)

    owner = tuple(
        _owners(len(s.ranges), beams, ledger.ids[track[objects]])
        for s, (beams, objects) in zip(sightings, found.beams, strict=True)
    )
    all_before = before is None or (old is not None and alive[: len(before)].all())
    return _frozen(
        Tracks(
            stamp=stamp,
            speed=speed,
            bank=bank.taken(alive),
            owner=owner,
            ended=bool(before is not None and len(before) and (not all_before or anew.any())),
            next_id=next_id + len(fresh),
            **ledger.taken(alive),
        )
    )


def _owners(beams: int, own: np.ndarray, ids: np.ndarray) -> np.ndarray:
    """[beams] the track of each beam's return; -1 where `own` does not name it."""
    found = np.full(beams, -1)
    found[own] = ids
    return found


def _frozen(tracks: Tracks) -> Tracks:
    """The same, its arrays no longer to be written to."""
    bank = tracks.bank
    columns = (getattr(tracks, name) for name in Ledger.__slots__)
    for array in (*columns, bank.mean, bank.covariance, bank.weight, *tracks.owner):
        array.setflags(write=False)
    return tracks
