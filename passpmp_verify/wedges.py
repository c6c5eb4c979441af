"""What one scan proves empty: a wedge between each beam and the next.

Objects are no narrower than `object_width`, and their corners no sharper than a right angle. So
nothing stands in a wedge of angle a nearer than the nearer of its two returns, unless the wedge
has grown wider than an object by then; and what is hit may stick out of the chord between the two
returns by half of it. A wedge is empty up to

    min(nearer return, object_width / a) (cos(a / 2) - sin(a / 2)) - noise.

Its far side is shut if both returns are of surfaces that stay and no object fits between them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from passpmp_verify.static_map import Surfaces
from passpmp_verify.view import (
    LOST,
    MOVABLE,
    NOTHING,
    OPEN,
    SHUT,
    STATIC,
    STATIC_BY_MAP,
    TAU,
    UNCOVERED,
    Scan,
    View,
    view_of_disc,
)

WIDEST = 1.5
"""[rad] A wedge as wide as this proves nothing."""


def view_of_scan(scan: Scan, object_width: float, range_noise: float, surfaces: Surfaces) -> View:
    """What a scan proves.

    Args:
        object_width: no object is narrower [m].
        range_noise: greatest error of a range [m].
        surfaces: what a static map declares to stay.
    """
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    n = len(ranges)
    x, y, theta = scan.pose
    bearing, increment = theta + scan.angle_min, scan.angle_increment
    closing = TAU - (n - 1) * increment
    closed = closing < 1.5 * increment
    with np.errstate(invalid="ignore"):
        lost = ~(ranges > 0)
        returned = (ranges > 0) & (ranges < scan.range_max)
    r = np.where(lost, 0.0, np.minimum(ranges, scan.range_max))
    beams = bearing + increment * np.arange(n)
    ends = np.stack([x + r * np.cos(beams), y + r * np.sin(beams)], axis=1)
    met = np.where(returned, MOVABLE, NOTHING)
    if scan.moving is not None:
        met[returned & ~np.asarray(scan.moving, dtype=bool)] = STATIC
    met[lost] = LOST
    if surfaces.known:
        met = _labelled_by_map(r, met, ends, increment, closed, object_width, surfaces)

    a, b, angle = _neighbours(lost, increment, closed)
    usable = (a >= 0) & (b >= 0) & (angle < WIDEST)
    a, b = np.maximum(a, 0), np.maximum(b, 0)
    near = np.minimum(r[a], r[b])
    limit = np.where(near * angle > object_width, object_width / np.maximum(angle, 1e-12), near)
    share = np.cos(0.5 * angle) - np.sin(0.5 * angle)
    reach = np.where(usable, np.maximum(limit * share - range_noise, 0.0), 0.0)
    side = np.full(n, OPEN)
    static = usable & (met[a] >= STATIC) & (met[b] >= STATIC) & (limit == near)
    if surfaces.known:
        # somebody who leans on a wall may have one return that is taken for it, in a wide wedge
        by_map = (met[a] == STATIC_BY_MAP) | (met[b] == STATIC_BY_MAP)
        widest = object_width - surfaces.slack - range_noise
        static &= ~by_map | (np.maximum(r[a], r[b]) * angle <= widest)
    gap = np.hypot(*(ends[b] - ends[a]).T)
    # the true gap may be wider than it looks by both ranges' noise
    side[static & (gap + 2 * range_noise <= object_width)] = SHUT
    for i in np.flatnonzero(static & (side == OPEN)) if surfaces.known else ():
        if surfaces.hold_line(ends[a[i]], ends[b[i]]):
            side[i] = SHUT
    if not closed:
        reach[-1], side[-1] = 0.0, UNCOVERED
    chord = np.stack([ends[a], ends[b]], axis=1)
    return View(x, y, bearing, increment, r, met, reach, side, chord, closed, True)


def _neighbours(
    lost: np.ndarray, increment: float, closed: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each wedge the beams about it that were not lost, -1 where there is none, and the angle
    between them [rad]."""
    n = len(lost)
    kept = np.flatnonzero(~lost)
    none = np.full(n, -1)
    if not len(kept):
        return none, none, np.full(n, TAU)
    turns = increment * kept
    if closed:
        kept = np.concatenate([kept[-1:], kept, kept[:1]])
        turns = np.concatenate([turns[-1:] - TAU, turns, turns[:1] + TAU])
        order = np.concatenate([[kept[0] - n], kept[1:-1], [kept[-1] + n]])
    else:
        order = kept
    low = np.searchsorted(order, np.arange(n), side="right") - 1
    high = np.searchsorted(order, np.arange(n) + 1, side="left")
    inside = (low >= 0) & (high < len(order))
    low, high = np.maximum(low, 0), np.minimum(high, len(order) - 1)
    return (
        np.where(inside, kept[low], -1),
        np.where(inside, kept[high], -1),
        np.where(inside, turns[high] - turns[low], TAU),
    )


def _labelled_by_map(
    r: np.ndarray,
    met: np.ndarray,
    ends: np.ndarray,
    increment: float,
    closed: bool,
    width: float,
    surfaces: Surfaces,
) -> np.ndarray:
    """What the beams met, with the map's help.

    Somebody who leans on a wall has returns within the map's tolerance of it: a return nearer than
    an object's width to one that cannot be the wall is not taken for the wall either.
    """
    n = len(r)
    on_map = (met == MOVABLE) & surfaces.hold(ends)
    off_map = (met == MOVABLE) & ~on_map
    doubted = np.zeros(n, dtype=bool)
    span = np.minimum(width / (np.maximum(r, 0.1) * increment) + 1, n // 2).astype(int)
    wall = np.flatnonzero(on_map)
    for k in range(1, int(span[wall].max(initial=0)) + 1):
        here = wall[span[wall] >= k]
        for other in (here + k, here - k):
            inside = np.ones(len(here), bool) if closed else (other >= 0) & (other < n)
            one, two = here[inside], other[inside] % n
            apart = np.hypot(*(ends[two] - ends[one]).T)
            doubted[one] |= off_map[two] & (apart < width)
    doubted |= _beside_no_surface(met, on_map, closed)
    result = met.copy()
    result[on_map & ~doubted] = STATIC_BY_MAP
    return result


def _beside_no_surface(met: np.ndarray, on_map: np.ndarray, closed: bool) -> np.ndarray:
    """[n] bool: beams next to one that met nothing or nothing that stays, or to the field's edge.

    The rest of somebody who leans on the wall may be there. Lost beams are passed over.
    """
    told = np.flatnonzero(met != LOST)
    open_end = (met[told] < STATIC) & ~on_map[told]
    before, after = np.roll(open_end, 1), np.roll(open_end, -1)
    if not closed and len(told):
        before[0] = after[-1] = True
    result = np.zeros(len(met), dtype=bool)
    result[told] = before | after
    return result


def views_of(
    scans: Sequence[Scan],
    empty_discs: Sequence[tuple[float, float, float]],
    object_width: float,
    range_noise: float,
    surfaces: Surfaces,
) -> list[View]:
    """Views of one instant: scans, and discs (x, y, radius) that are known to be empty [m]."""
    return [view_of_scan(s, object_width, range_noise, surfaces) for s in scans] + [
        view_of_disc(x, y, radius) for x, y, radius in empty_discs if radius > 0
    ]
