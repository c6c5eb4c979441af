"""Small squares of the plane: which of them are proven empty, and growing sets of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from passpmp_verify.keeper import INSIDE, UNSURE, Keeper
from passpmp_verify.pieces import Pieces
from passpmp_verify.view import View

BLOCK = 64
"""Squares along the side of a block that is first judged as a whole; a power of 4."""
MOST = 2048
"""Squares along each side of the plane, and at most one block more."""


@dataclass(frozen=True, slots=True)
class Raster:
    """`count` x `count` squares; sets of them are [count, count] bool, indexed [j, i]."""

    x: float
    y: float
    """The corner of square [0, 0] [m]."""
    side: float
    """[m]"""
    count: int

    @property
    def half(self) -> float:
        """No point of a square is farther from its centre than this [m]."""
        return self.side / math.sqrt(2)

    def centres(self, j: np.ndarray, i: np.ndarray, size: int = 1) -> np.ndarray:
        """[n, 2] centres of blocks of `size` x `size` squares [m]."""
        step = size * self.side
        return np.stack([self.x + (i + 0.5) * step, self.y + (j + 0.5) * step], axis=1)

    def flat(self, points: np.ndarray) -> np.ndarray:
        """[n] the square that holds each point [n, 2], as j count + i."""
        i = np.floor((points[:, 0] - self.x) / self.side).astype(np.int64)
        j = np.floor((points[:, 1] - self.y) / self.side).astype(np.int64)
        return j * self.count + i


def raster_about(pieces: Pieces, room: float, side: float) -> Raster:
    """Squares of `side` [m] over all pieces, and `room` [m] and two squares more all round; larger
    squares where there would be too many."""
    middle, half = pieces.middle, pieces.half[:, None]
    low, high = (middle - half).min(axis=0), (middle + half).max(axis=0)
    span = float((high - low).max()) + 2 * room
    side = max(side, span / (MOST - 6))
    pad = room + 3 * side
    count = BLOCK * math.ceil((span + 6 * side) / side / BLOCK)
    return Raster(float(low[0]) - pad, float(low[1]) - pad, side, count)


def seen_squares(views: Sequence[View], raster: Raster) -> np.ndarray:
    """Squares that one view proves empty, all of each."""
    seen = np.zeros((raster.count, raster.count), dtype=bool)
    quarters_j, quarters_i = np.indices((4, 4)).reshape(2, 16)
    for view in views:
        keeper, size = Keeper(view, None), BLOCK
        j, i = np.indices((raster.count // BLOCK,) * 2).reshape(2, -1)
        while size:
            radius = np.full(len(j), size * raster.half)
            verdict = keeper.judge(raster.centres(j, i, size), radius)
            inside, unsure = verdict == INSIDE, verdict == UNSURE
            along = raster.count // size
            seen.reshape(along, size, along, size)[j[inside], :, i[inside], :] = True
            j = (4 * j[unsure, None] + quarters_j).ravel()
            i = (4 * i[unsure, None] + quarters_i).ravel()
            size //= 4
    return seen


def grown(squares: np.ndarray, widths: Sequence[int]) -> np.ndarray:
    """All squares that are, from one of `squares`, k rows and at most widths[k] columns away.

    Args:
        squares: none nearer to an edge than the widths, or all of those.
        widths: falling with k.
    """
    count = squares.shape[1]
    # one number whose bits are the squares, row after row: shifting it moves them all
    packed = np.packbits(squares, bitorder="little").tobytes()
    bits = int.from_bytes(packed, "little")
    wide, result, width = bits, 0, 0
    for k in reversed(range(len(widths))):
        for step in range(width + 1, widths[k] + 1):
            wide |= bits << step | bits >> step
        width = widths[k]
        result |= wide << k * count | wide >> k * count
    result &= (1 << 8 * len(packed)) - 1
    unpacked = np.frombuffer(result.to_bytes(len(packed), "little"), dtype=np.uint8)
    return np.unpackbits(unpacked, bitorder="little").view(bool).reshape(squares.shape)
