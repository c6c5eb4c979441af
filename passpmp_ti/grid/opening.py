"""Hidden places that no object fits into: the hidden region opened by a disc.

An object whose every point lies in a disc of radius rho inside it can only be where such a disc
fits: no nearer to anything proven empty than rho with its centre. What those discs cover is the
opened region; the rest of the hidden region, its slivers, holds no mover at the scan. A mover that
is seen later came out of the opened region, and through the border of the seen region: either where
the two touch, or through a sliver, and then out of the opened region where it meets that sliver.

Standing things may be thinner: a sliver still counts as not seen, it only emits nothing.
"""

from __future__ import annotations

import math

import numpy as np

from passpmp_ti.grid.distance import distance_between_cells, distance_to_zeros
from passpmp_ti.kernels.beams import SLACK
from passpmp_ti.kernels.visibility import BLIND_SOURCES, SOURCES, STANDING_SOURCES

ALL_ROUND = np.ones((3, 3), dtype=bool)


def opened_sources(seen: np.ndarray, marks: np.ndarray, cell: float, radius: float) -> np.ndarray:
    """Marks whose sources are only what objects of at least `radius` can come out of.

    Args:
        seen: [J, I] uint8, 1: all of the cell proven empty.
        marks: [5, J, I] uint8, 0 marks.
        cell: side of a cell [m].
        radius: every object is made of discs of at least this radius [m].

    Returns:
        [5, J, I] uint8; only the sources differ. What comes out of a sliver is marked where it
        entered it, which a wall may hide from where it comes out: neither set of sources is nearer
        than the other everywhere, and what arrives must have come by both.
    """
    from scipy import ndimage  # only here: it takes long to import, and few ask for openings

    marks = marks.copy()
    opened = opened_region(seen, cell, radius)
    sliver, count = ndimage.label((seen == 0) & ~opened, ALL_ROUND)
    # a border lies along the edges of the cells that it bounds: look one cell around
    touching = _grown(opened)
    for kind in (SOURCES, BLIND_SOURCES):
        marked = marks[kind] == 0
        if not marked.any():
            continue
        leaky = np.zeros(count + 1, dtype=bool)
        leaky[np.unique(sliver[_grown(marked)])] = True
        leaky[0] = False
        mouths = opened & _grown(leaky[sliver])
        marks[kind] = ~((marked & touching) | mouths)
    marks[STANDING_SOURCES] |= ~touching
    return marks


def opened_region(seen: np.ndarray, cell: float, radius: float) -> np.ndarray:
    """[J, I] bool: cells that a disc of `radius` which overlaps nothing seen may reach into.

    Too large rather than too small; beyond the grid everything is hidden.
    """
    pad = math.ceil(radius / cell) + 2
    hidden = np.pad(seen == 0, pad, constant_values=True).astype(np.uint8)
    # From any point of a cell another cell is no farther than the two centres are: along each axis
    # the point may be half a side farther, and the cell begins half a side nearer. 1e-3: rounding.
    to_seen = distance_to_zeros(hidden) + 1e-3
    holds_no_centre = (to_seen * cell + SLACK < radius).astype(np.uint8)
    reach = distance_between_cells(holds_no_centre) - 1e-3
    return (reach * cell <= radius + SLACK)[pad:-pad, pad:-pad]


def _grown(mask: np.ndarray) -> np.ndarray:
    """`mask` and its eight neighbours."""
    rows = mask.copy()
    rows[1:] |= mask[:-1]
    rows[:-1] |= mask[1:]
    grown = rows.copy()
    grown[:, 1:] |= rows[:, :-1]
    grown[:, :-1] |= rows[:, 1:]
    return grown
