"""The border of what several views prove together, cut to what is really border, and its sources.

A view's border is made of arcs, at its wedges' far ends, and of steps along its beams, where the
wedges on either side reach differently far. Whoever comes into the proven region crosses it. A
piece is no border of the whole where another view keeps movers out: it proves the place empty, or
the place is before the surface that shuts one of its wedges. A view never speaks for its own
border, nor for another's where both run together: what is kept out is so by `keeper.EPS` or more.

Pieces are halved until they are kept out whole, or certainly not at all, or no longer than twice
`SMALLEST`. What is left in doubt then counts as border: more border than there is is safe.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from passpmp_verify.keeper import INSIDE, UNSURE, Field, Keeper
from passpmp_verify.pieces import Pieces, joined
from passpmp_verify.view import SHUT, UNCOVERED, View

SMALLEST = 5e-4
"""Half the length of the smallest pieces [m]."""


def own_border(view: View) -> Pieces:
    """All arcs and steps of one view: whatever is not proven lies behind them."""
    low, reach, before = view.bearings, view.reach, np.roll(view.reach, 1)
    near, far = np.minimum(reach, before), np.maximum(reach, before)
    return joined(
        [
            _pieces(view, low, low + view.angles, reach, reach, reach > 0),
            _pieces(view, low, low, near, far, far > near),
        ]
    )


def own_sources(view: View) -> tuple[Pieces, np.ndarray]:
    """The arcs and steps that let somebody through, and which of them are of bearings that no
    beam covers.

    A shut wedge is free of movers up to the surface that shuts it, so a step beside one goes up to
    that surface.
    """
    low, side, other = view.bearings, view.side, np.roll(view.side, 1)
    kept = np.where(side == SHUT, view.ranges, view.reach)
    before = np.where(other == SHUT, view.ranges, np.roll(view.reach, 1))
    near, far = np.minimum(kept, before), np.maximum(kept, before)
    reach = view.reach
    arc = (side != SHUT) & (reach > 0)
    step = ((side != SHUT) | (other != SHUT)) & (far > near)
    uncovered = (side == UNCOVERED) | (other == UNCOVERED)
    if not view.is_scan:
        uncovered = np.ones(len(side), dtype=bool)
    pieces = joined(
        [
            _pieces(view, low, low + view.angles, reach, reach, arc),
            _pieces(view, low, low, near, far, step),
        ]
    )
    return pieces, np.concatenate([uncovered[arc], uncovered[step]])


def _pieces(
    view: View,
    low: np.ndarray,
    high: np.ndarray,
    from_: np.ndarray,
    to: np.ndarray,
    chosen: np.ndarray,
) -> Pieces:
    count = int(chosen.sum())
    return Pieces(
        np.full(count, view.x), np.full(count, view.y), low[chosen], high[chosen], from_[chosen],
        to[chosen],
    )  # fmt: skip


def left_of(pieces: Pieces, keepers: Sequence[Keeper]) -> Pieces:
    """The parts of pieces that no keeper keeps out."""
    left = pieces
    for keeper in keepers:
        left = cut(left, keeper.judge)[0]
    return left


def cut(
    pieces: Pieces, judge: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> tuple[Pieces, Pieces]:
    """(the parts that are not INSIDE for certain, the others)."""
    out, kept = [], []
    while len(pieces):
        half = pieces.half
        verdict = judge(pieces.middle, half)
        unsure = (verdict == UNSURE) & (half > SMALLEST)
        kept.append(pieces.take(verdict == INSIDE))
        out.append(pieces.take((verdict != INSIDE) & ~unsure))
        pieces = pieces.take(unsure).halves()
    return joined(out), joined(kept)


def border(views: Sequence[View]) -> Pieces:
    """The border of all that the views prove empty."""
    keepers = [Keeper(view, None) for view in views]
    return joined(
        [left_of(own_border(view), [k for k in keepers if k.view is not view]) for view in views]
    )


def sources(views: Sequence[View], tolerance: float, blind_apart: bool) -> tuple[Pieces, Pieces]:
    """The parts of the border that let movers through: (all others, those of bearings that no scan
    covers).

    Args:
        tolerance: how much two views of one surface may differ [m].
        blind_apart: what comes out of never-covered bearings has its own bound of speed.
    """
    keepers = [Keeper(view, tolerance) for view in views]
    fields = [Field(view) for view in views if view.is_scan]
    seen, blind = [], []
    for view in views:
        pieces, uncovered = own_sources(view)
        others = [k for k in keepers if k.view is not view]
        if blind_apart:
            seen.append(left_of(pieces.take(~uncovered), others))
            apart = left_of(pieces.take(uncovered), others)
            # the edge of a scan's own field is not in it
            for field in (f for f in fields if f.view is not view):
                apart, covered = cut(apart, field.judge)
                seen.append(covered)
            blind.append(apart)
        else:
            seen.append(left_of(pieces, others))
    return joined(seen), joined(blind)
