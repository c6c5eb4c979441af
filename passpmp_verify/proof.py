"""Whether scans prove a path free in continuous time: one scan is enough for each bit of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from passpmp_verify.gridless import RESOLUTION, Gridless
from passpmp_verify.motion import Spans, joined

DEPTH = 10
"""How often a span may be halved before it is given up."""
TOLD = 400
"""Spans among which the first one that fails is looked for."""


@dataclass(frozen=True, slots=True)
class Place:
    """A disc of the body at a moment, and how much room it has."""

    time: float
    """[s]"""
    disc: int
    x: float
    y: float
    """[m]"""
    room: float
    """Radius that is proven free about it [m]; it may be negative."""
    need: float
    """Radius that must be [m]."""

    @property
    def margin(self) -> float:
        """[m]"""
        return self.room - self.need


@dataclass(frozen=True, slots=True)
class Proof:
    """What became of a path."""

    used: tuple[int, ...]
    """Which of the models were needed."""
    least: Place | None
    """Where the margin by which the path was proven is least; None: nothing was proven."""
    failed: Place | None
    """The first place that no model proves free; None: all of the path is proven."""


def prove(spans: Spans, models: Iterable[Gridless]) -> Proof:
    """Prove that nothing can touch the discs of a path.

    Each model proves what it can of what those before it left. A span is proven if the room about
    its middle is greater than what the disc and the cones can move in half of its time; it is
    halved while that is in question.
    """
    used, least, failed = [], None, None
    asked = []
    for index, model in enumerate(models):
        if not len(spans):
            break
        asked.append(model)
        spans, tightest = _left_by(model, spans)
        if tightest is not None:
            used.append(index)
            if least is None or tightest.margin < least.margin:
                least = tightest
    if len(spans):
        failed = _first_of(spans, asked)
    return Proof(tuple(used), least, failed)


def _left_by(model: Gridless, spans: Spans) -> tuple[Spans, Place | None]:
    """(what the model does not prove, the tightest place that it proves)."""
    early = spans.since < model.stamp - 1e-9
    left = [spans.take(early)]
    spans = spans.take(~early)
    least: Place | None = None
    for level in range(DEPTH + 1):
        if not len(spans):
            break
        room = model.room(spans.middle, spans.time)
        spare = room - spans.need
        closing = (spans.pace + model.object_speed) * 0.5 * (spans.until - spans.since)
        proven = spare > closing
        hopeless = spare <= -closing - RESOLUTION
        if level == DEPTH:
            hopeless = ~proven
        if proven.any():
            index = int(np.flatnonzero(proven)[np.argmin(spare[proven])])
            if least is None or spare[index] < least.margin:
                least = _place(spans, index, float(room[index]))
        left.append(spans.take(hopeless))
        spans = spans.take(~proven & ~hopeless).halves()
    return joined(left), least


def _first_of(spans: Spans, models: list[Gridless]) -> Place:
    """The first of the spans that are not proven: of those in whose middle there is no room, if
    there are any; the others are beside them, too near to tell."""
    order = np.argsort(spans.time, kind="stable")
    spans = spans.take(order[:TOLD])
    room = np.full(len(spans), -np.inf)
    for model in models:
        later = spans.since >= model.stamp - 1e-9
        some = spans.take(later)
        room[later] = np.maximum(room[later], model.room(some.middle, some.time))
    index = int(np.argmax(room <= spans.need))
    return _place(spans, index, float(room[index]))


def _place(spans: Spans, index: int, room: float) -> Place:
    x, y = spans.middle[index]
    return Place(
        float(spans.time[index]), int(spans.disc[index]), float(x), float(y), room,
        float(spans.need[index]),
    )  # fmt: skip
