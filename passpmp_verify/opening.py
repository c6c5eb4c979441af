"""Where something that moves can have been, if it is made of discs of at least a radius rho.

At the scan each of its discs overlapped nothing that is proven empty. So its points were in the
opened region: all that the discs of radius rho cover which fit beside what is proven. The rest of
what is not proven are slivers. A mover comes into the proven region out of the opened one, or
through a sliver: then it passed that sliver's mouth, where the opened region touches it.

The regions are made of small squares, and every doubt makes the opened one larger: a square is
proven empty if all of it is; it holds a disc's centre if some point of it may, and it is of the
opened region if some point of it may be in such a disc. The way of a mover is followed backwards,
from the border into the slivers, up to the first squares of the opened region.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from passpmp_verify.distance import distance_to
from passpmp_verify.pieces import Pieces, joined, points_as_pieces, split
from passpmp_verify.raster import Raster, grown, raster_about, seen_squares
from passpmp_verify.view import View

FINENESS = 20
"""Squares are so many times smaller than a disc's radius, where the raster can hold them all."""
COARSEST = 4
"""With fewer to a radius it is not worth asking: then every sliver may hide somebody."""
ROUNDING = 1e-9
"""What lengths in squares may be off by."""


@dataclass(frozen=True, slots=True, eq=False)
class Origins:
    """What movers passed on their way into the proven region, all of them."""

    border: Pieces
    """Where they come straight out of the opened region."""
    mouths: Pieces
    """Centres of the squares in which they came into a sliver."""
    half: float
    """No point of such a square is farther from its centre than this [m]."""

    def distance_to(self, points: np.ndarray) -> np.ndarray:
        """[n] distance from points [n, 2] to the nearest of them, or less [m]."""
        to_mouth = np.maximum(distance_to(points, self.mouths) - self.half, 0.0)
        return np.minimum(distance_to(points, self.border), to_mouth)


class Opening:
    """The opened region, and the slivers beside it.

    Args:
        views: of one instant.
        pieces: all of their border, and all that lets movers through.
        radius: of the discs that movers are made of [m], > 0.
    """

    def __init__(self, views: Sequence[View], pieces: Pieces, radius: float) -> None:
        self._raster: Raster | None = None
        if not len(pieces):
            return
        raster = raster_about(pieces, radius, radius / FINENESS)
        if raster.side * COARSEST > radius:
            return
        self._raster = raster
        reach = radius / raster.side
        seen = seen_squares(views, raster)
        # each point of a square is this near to one of a proven square: no disc's centre is in it
        beside = _widths(lambda k: k, reach - ROUNDING)
        # two squares hold points this near to each other
        across = _widths(lambda k: max(k - 1, 0), reach + ROUNDING)
        self._opened = grown(~grown(seen, beside), across) & ~seen
        self._sliver = ~self._opened & ~seen
        # a short piece of border lies in the square of its middle or in one beside it
        self._near_opened = grown(self._opened, (1, 1))

    def origins(self, sources: Pieces) -> Origins:
        """What everybody passed who comes through the `sources` [m]."""
        raster, nowhere = self._raster, joined([])
        if raster is None or not len(sources):
            return Origins(sources, nowhere, 0.0)
        short, parent = split(sources, 0.5 * raster.side)
        square = raster.flat(short.middle)
        straight = self._near_opened.ravel()[square]
        # the sources themselves, where they are straight from end to end: fewer pieces
        whole = np.ones(len(sources), dtype=bool)
        whole[parent[~straight]] = False
        border = joined([sources.take(whole), short.take(straight & ~whole[parent])])
        leaky = self._leaky(np.unique(square))
        j, i = np.nonzero(grown(leaky, (1, 1)) & self._opened)
        return Origins(border, points_as_pieces(raster.centres(j, i)), raster.half)

    def _leaky(self, square: np.ndarray) -> np.ndarray:
        """Squares of slivers that are joined to one of these, or to a square beside it."""
        count, sliver = len(self._sliver), self._sliver.ravel()
        around = (count * np.array([[-1], [0], [1]]) + [-1, 0, 1]).ravel()
        leaky = np.zeros(sliver.shape, dtype=bool)
        wave = square
        while len(wave):
            beside = (wave[:, None] + around).ravel()
            wave = np.unique(beside[sliver[beside] & ~leaky[beside]])
            leaky[wave] = True
        return leaky.reshape(self._sliver.shape)


def _widths(gap: Callable[[int], float], reach: float) -> list[int]:
    """For each row the farthest column with hypot(gap(row), gap(column)) <= reach."""
    widths: list[int] = []
    for row in range(math.ceil(reach) + 2):
        column = -1
        while math.hypot(gap(row), gap(column + 1)) <= reach:
            column += 1
        if column < 0:
            break
        widths.append(column)
    return widths
