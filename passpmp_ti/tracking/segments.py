"""Neighbouring returns of one sighting as segments, each the visible side of one thing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from passpmp_ti.settings import Settings
from passpmp_ti.tracking.sighting import Sighting

FLATTEST = math.radians(10.0)
"""lambda of Borges & Aldon 2004, Sec. III-B: no surface is taken to be seen at a flatter angle."""
LONGEST = 5.0
"""What is longer than this many object widths is no object but a wall."""


@dataclass(frozen=True, slots=True)
class Segments:
    """What the returns of one sighting fall into; s counts segments, p returns."""

    beams: np.ndarray
    """[p] beam of each return that belongs to a segment."""
    label: np.ndarray
    """[p] its segment."""
    points: np.ndarray
    """[p, 2] where it lies in the world [m]."""
    first: np.ndarray
    """[s] bearing of the first beam [rad], the clockwise end."""
    span: np.ndarray
    """[s] bearing from the first beam to the last [rad]."""
    nearest: np.ndarray
    """[s] least range [m]."""
    open_first: np.ndarray
    """[s] bool: beyond the first beam the view goes on past the segment: its end is the thing's."""
    open_last: np.ndarray
    """[s] bool: likewise beyond the last beam."""


def longest(settings: Settings) -> float:
    """Greatest length of an object [m]."""
    return LONGEST * max(settings.object_width, 2.0 * settings.object_radius)


def segments_of(sighting: Sighting, settings: Settings) -> Segments:
    """Part the movable returns of a sighting into segments; walls are left out.

    Two returns belong together if no beam between them saw past them, and they are at most

        D = max(width / 2, min(r sin(a) / sin(lambda - a), 2 width)) + 2 noise

    apart, r the nearer range and a the bearing between them: the distance to the next return on a
    surface seen at the flattest angle lambda. At least half an object's width, since the rim of a
    round thing is seen flatter still; at most two widths, so that people far away are not tied to
    the wall behind them.

    Source: Borges & Aldon, Line Extraction in 2D Range Images for Mobile Robotics, 2004.
    """
    width, noise = settings.object_width, settings.range_noise
    n = len(sighting.ranges)
    beams = np.flatnonzero(sighting.movable)
    r, bearing = sighting.ranges[beams], sighting.bearings[beams]
    points = np.array(sighting.origin) + r[:, None] * np.stack(
        [np.cos(bearing), np.sin(bearing)], axis=1
    )
    # from each return to the next one, the last one's next being the first
    following = np.roll(beams, -1)
    steps = (following - beams) % n
    passed = np.cumsum(~sighting.lost)
    between = (np.roll(passed[beams], -1) - passed[beams] - 1) % max(int(passed[-1]), 1)
    angle = steps * sighting.increment
    flat = np.maximum(np.sin(FLATTEST - np.minimum(angle, FLATTEST)), 1e-9)
    adaptive = np.minimum(r, np.roll(r, -1)) * np.sin(np.minimum(angle, FLATTEST)) / flat
    allowed = np.maximum(0.5 * width, np.minimum(adaptive, 2.0 * width)) + 2.0 * noise
    apart = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    parted = (between > 0) | (apart > allowed)
    if len(beams) and not sighting.closed:
        parted[-1] = True
    starts = np.roll(parted, 1)
    label = np.cumsum(starts) - 1
    # returns before the first break go on from the last ones, round the back
    label[label < 0] = max(int(label[-1]), 0) if len(label) else 0
    count = int(label.max()) + 1 if len(label) else 0

    kept, first_of, last_of, nearest = _measured(points, r, label, starts, parted, count, settings)
    renumber = np.full(count + 1, -1)
    renumber[kept] = np.arange(len(kept))
    label = renumber[label]
    mine = label >= 0
    first_beam, last_beam = beams[first_of], beams[last_of]
    return Segments(
        beams=beams[mine],
        label=label[mine],
        points=points[mine],
        first=sighting.bearings[first_beam],
        span=((last_beam - first_beam) % n) * sighting.increment,
        nearest=nearest,
        open_first=_seen_past(sighting, first_beam, -1),
        open_last=_seen_past(sighting, last_beam, 1),
    )


def _measured(
    points: np.ndarray,
    ranges: np.ndarray,
    label: np.ndarray,
    starts: np.ndarray,
    parted: np.ndarray,
    count: int,
    settings: Settings,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Segments short enough to be objects; their first and last returns and least ranges."""
    first_of, last_of = np.zeros(count, dtype=int), np.zeros(count, dtype=int)
    if count:
        # one segment all the way round has neither
        last_of[:] = len(label) - 1
        first_of[label[starts]] = np.flatnonzero(starts)
        last_of[label[parted]] = np.flatnonzero(parted)
    middle = 0.5 * (points[first_of] + points[last_of])
    reach = np.zeros(count)
    np.maximum.at(reach, label, np.hypot(*(points - middle[label]).T))
    nearest = np.full(count, np.inf)
    np.minimum.at(nearest, label, ranges)
    kept = np.flatnonzero(2.0 * reach <= longest(settings) + 2.0 * settings.range_noise)
    return kept, first_of[kept], last_of[kept], nearest[kept]


def _seen_past(sighting: Sighting, beam: np.ndarray, way: int) -> np.ndarray:
    """Whether the beam beside an end looks past it, rather than meeting something nearer."""
    n = len(sighting.ranges)
    beside = beam + way
    inside = (beside >= 0) & (beside < n)
    if sighting.closed:
        inside = np.ones(len(beam), dtype=bool)
    beside = beside % n
    farther = sighting.ranges[beside] > sighting.ranges[beam]
    return inside & ~sighting.lost[beside] & farther
