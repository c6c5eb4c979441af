"""Which detection is which track's."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from passpmp_ti.settings import Settings
from passpmp_ti.tracking.detections import Detections
from passpmp_ti.tracking.imm import Bank
from passpmp_ti.tracking.ledger import Ledger
from passpmp_ti.tracking.segments import longest

GATE = 13.8
"""Squared Mahalanobis distance beyond which nothing is assigned: 99.9 % of two dimensions."""
TIE = 1e-9
FORBIDDEN = 1e6
MOMENT = 0.3
"""Who was met no longer ago than this is looked for as far as he can have gone [s]."""
SLACK = 0.1
"""Pieces of a body may stick out of the disc where it is expected by this much [object widths]."""


def pieces(
    found: Detections, place: np.ndarray, radius: np.ndarray, settings: Settings
) -> np.ndarray:
    """[d] labels, equal for the pieces of one body.

    A post in front of somebody parts him in two. What lies altogether in the disc where a track is
    expected is a piece of it; where several tracks claim it, the oldest has it.

    Args:
        found: the detections.
        place: [N, 2] where tracks are expected [m].
        radius: [N] of them [m].
        settings: object_width.
    """
    label = np.arange(found.count)
    if not found.count or not len(place):
        return label
    inside = found.reach(place) <= radius + SLACK * settings.object_width
    return np.where(inside.any(axis=1), -1 - np.argmax(inside, axis=1), label)


def assigned(
    found: Detections, bank: Bank, ledger: Ledger, stamp: float, settings: Settings
) -> tuple[np.ndarray, np.ndarray]:
    """[d] the track of each detection, -1: none; [d] bool: its filters have to begin anew.

    First by what the filters expect. Then a track that was met a moment ago may have what nobody
    else has and it can have reached, at the bound on speeds: somebody who turned on the spot, or
    who is half hidden and was taken for thinner than he is.

    Args:
        found: the detections.
        bank: filters, predicted to `stamp`.
        ledger: what else is known of the tracks.
        stamp: absolute [s].
        settings: object_speed, object_width, object_radius, cell.
    """
    centre, deviation, _ = found.placed()
    mean, covariance = (part[:, :2] for part in bank.combined())
    covariance = covariance[..., :2]
    since = stamp - ledger.last_seen
    gone = settings.object_speed * since
    farthest = ledger.radius + longest(settings) + gone
    track = matched(mean, covariance, centre, deviation, farthest)
    anew = np.zeros(found.count, dtype=bool)
    free = np.setdiff1d(np.flatnonzero(since <= MOMENT), track)
    loose = np.flatnonzero(track < 0)
    if not len(free) or not len(loose):
        return track, anew
    reach = gone[free] + np.fmax(ledger.body[free] - 0.5 * settings.object_width, 0.0)
    reach += 3.0 * found.noise
    disc = np.eye(2) * (reach**2 / GATE)[:, None, None]
    second = matched(ledger.last_centre[free], disc, centre[loose], deviation[loose], reach)
    loose, taken = loose[second >= 0], free[second[second >= 0]]
    track[loose] = taken
    told = np.full(found.count, np.nan)
    told[loose] = ledger.body[taken]
    centre, deviation, _ = found.placed(told)
    S = _spread(covariance[taken], deviation[loose])
    anew[loose] = _distance(S, centre[loose] - mean[taken]) > GATE
    return track, anew


def matched(
    mean: np.ndarray,
    covariance: np.ndarray,
    centre: np.ndarray,
    deviation: np.ndarray,
    farthest: np.ndarray,
) -> np.ndarray:
    """[M] the place that each detection is taken for, or -1.

    Least sum of squared Mahalanobis distances and logarithms of the gates' volumes, within the
    gates; of equal assignments the one of the lowest numbers.

    Args:
        mean: [N, 2] places [m].
        covariance: [N, 2, 2] of them [m^2].
        centre: [M, 2] of the detections [m].
        deviation: [M] standard deviations of these [m].
        farthest: [N] beyond this distance nothing is taken for it [m].
    """
    n, m = len(mean), len(centre)
    found = np.full(m, -1)
    if not n or not m:
        return found
    S = _spread(covariance[:, None], deviation[None])
    off = centre[None] - mean[:, None]
    distance = _distance(S, off)
    gated = (distance <= GATE) & (np.hypot(off[..., 0], off[..., 1]) <= farthest[:, None])
    volume = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] ** 2
    i, j = np.arange(n)[:, None], np.arange(m)[None]
    # - i j puts crossed pairs in order, i + j takes the lowest where some are left over
    tie = TIE * ((n + m) * (i + j) - i * j)
    cost = np.where(gated, distance + np.log(volume / volume.min()) + tie, FORBIDDEN)
    rows, columns = linear_sum_assignment(cost)
    good = gated[rows, columns]
    found[columns[good]] = rows[good]
    return found


def _spread(covariance: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Covariance of the differences between places and detections [..., 2, 2] [m^2]."""
    return covariance + deviation[..., None, None] ** 2 * np.eye(2)


def _distance(S: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Squared Mahalanobis distance [...] of offsets [..., 2] [m]."""
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] ** 2
    x, y = off[..., 0], off[..., 1]
    return (S[..., 1, 1] * x**2 - 2.0 * S[..., 0, 1] * x * y + S[..., 0, 0] * y**2) / det
