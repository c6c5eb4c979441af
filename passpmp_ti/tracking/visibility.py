"""Whether a place where somebody should be is seen to be empty."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from passpmp_ti.tracking.sighting import Sighting

CORE = 0.5
"""Beams that pass a disc's centre nearer than this are asked [radii]."""


def seen_empty(centre: np.ndarray, radius: np.ndarray, sightings: Sequence[Sighting]) -> np.ndarray:
    """[N] share of the beams through the middle of each disc that went past its centre.

    0 where no beam passes there: out of the field, beyond the range, hidden behind something
    nearer, or on lost beams. Of several sensors the one that sees most decides.

    Args:
        centre: [N, 2] [m].
        radius: [N] [m].
        sightings: of one instant.
    """
    share = np.zeros(len(centre))
    for sighting in sightings:
        off = centre - np.array(sighting.origin)
        distance = np.hypot(off[:, 0], off[:, 1])
        half = np.arcsin(np.minimum(CORE * radius / np.maximum(distance, 1e-9), 1.0))
        turn = sighting.bearings[None] - np.arctan2(off[:, 1], off[:, 0])[:, None]
        through = np.abs((turn + np.pi) % (2 * np.pi) - np.pi) <= half[:, None]
        reach = np.where(sighting.lost, 0.0, np.minimum(sighting.ranges, sighting.range_max))
        past = through & (reach[None] > distance[:, None])
        count = through.sum(axis=1)
        share = np.maximum(share, past.sum(axis=1) / np.maximum(count, 1))
    return share
