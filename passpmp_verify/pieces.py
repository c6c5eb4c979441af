"""Pieces of borders: arcs and steps, as seen from a sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

PIECES_FIELDS = ("x", "y", "low", "high", "from_", "to")


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Border pieces about the centres (x, y): bearings `low` to `high` [rad], ranges `from_` to
    `to` [m]; an arc has one range, a step one bearing. All [n]."""

    x: np.ndarray
    y: np.ndarray
    low: np.ndarray
    high: np.ndarray
    from_: np.ndarray
    to: np.ndarray

    def __len__(self) -> int:
        return len(self.x)

    @property
    def middle(self) -> np.ndarray:
        """[n, 2] [m]."""
        r, a = 0.5 * (self.from_ + self.to), 0.5 * (self.low + self.high)
        return np.stack([self.x + r * np.cos(a), self.y + r * np.sin(a)], axis=1)

    @property
    def half(self) -> np.ndarray:
        """[n] no point of a piece is farther from its middle than this [m]."""
        return 0.5 * np.maximum(self.to - self.from_, self.to * (self.high - self.low))

    def take(self, index: np.ndarray) -> Pieces:
        """Some of them."""
        return Pieces(*(getattr(self, f)[index] for f in PIECES_FIELDS))

    def halves(self) -> Pieces:
        """Each cut into two."""
        a, r = 0.5 * (self.low + self.high), 0.5 * (self.from_ + self.to)
        return joined(
            [
                Pieces(self.x, self.y, self.low, a, self.from_, r),
                Pieces(self.x, self.y, a, self.high, r, self.to),
            ]
        )


def joined(parts: Sequence[Pieces]) -> Pieces:
    """All pieces of several."""
    if not parts:
        return Pieces(*(np.zeros(0) for _ in PIECES_FIELDS))
    return Pieces(*(np.concatenate([getattr(p, f) for p in parts]) for f in PIECES_FIELDS))


def split(pieces: Pieces, half: float) -> tuple[Pieces, np.ndarray]:
    """(pieces cut so that `half` [m] is the most of each, [n] of which piece each is a part)."""
    count = np.maximum(np.ceil(pieces.half / half), 1).astype(np.int64)
    parent = np.repeat(np.arange(len(pieces)), count)
    first = np.repeat(np.cumsum(count) - count, count)
    begin = (np.arange(len(parent)) - first) / count[parent]
    end = begin + 1 / count[parent]
    p = pieces.take(parent)
    angle, depth = p.high - p.low, p.to - p.from_
    return Pieces(
        p.x, p.y, p.low + begin * angle, p.low + end * angle, p.from_ + begin * depth,
        p.from_ + end * depth,
    ), parent  # fmt: skip


def points_as_pieces(points: np.ndarray) -> Pieces:
    """Points [n, 2] [m], each as a piece of no length."""
    zero = np.zeros(len(points))
    return Pieces(points[:, 0], points[:, 1], zero, zero, zero, zero)
