"""Axes of a drawing: from numbers to places, with ticks that are round."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from passpmp_ti.compare.svg import Drawing, Point
from passpmp_ti.viz.layout import ticks


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One axis."""

    low: float
    high: float
    label: str
    log: bool = False
    percent: bool = False
    """Numbers are shares, told as per cents."""

    def share(self, value: float) -> float:
        """Where a number lies between the ends, 0 to 1 and clipped to that."""
        if self.log:
            floor = min(self.low, self.high)
            value, low, high = (math.log(max(v, floor)) for v in (value, self.low, self.high))
        else:
            low, high = self.low, self.high
        return min(max((value - low) / (high - low), 0.0), 1.0)

    def ticks(self, pixels: float) -> list[tuple[float, str]]:
        """(number, words)."""
        if self.log:
            decades = range(
                math.ceil(math.log10(self.low) - 1e-9), math.floor(math.log10(self.high) + 1e-9) + 1
            )
            return [(10.0**n, _power(n)) for n in decades]
        told = [float(t) for t in ticks(self.low, self.high, pixels)]
        return [(t, f"{100 * t:g} %" if self.percent else f"{t:g}") for t in told]


@dataclass(frozen=True, slots=True)
class Axes:
    """Two axes about a rectangle (left, top, right, bottom) [px] of a drawing."""

    x: Axis
    y: Axis | None
    """None: rows with names."""
    frame: tuple[float, float, float, float]

    def at(self, x: float, y: float) -> Point:
        """The place of (x, y)."""
        return self.across(x), self.up(y)

    def across(self, x: float) -> float:
        """[px]"""
        left, _, right, _ = self.frame
        return left + self.x.share(x) * (right - left)

    def up(self, y: float) -> float:
        """[px]"""
        assert self.y is not None
        _, top, _, bottom = self.frame
        return bottom - self.y.share(y) * (bottom - top)

    def draw(self, drawing: Drawing) -> None:
        """Grid, ticks and labels."""
        left, top, right, bottom = self.frame
        for value, words in self.x.ticks(right - left):
            x = self.across(value)
            drawing.line([(x, top), (x, bottom)], "grid")
            drawing.words((x, bottom + 18), words, "tick", "middle")
        drawing.words((0.5 * (left + right), bottom + 38), self.x.label, "label", "middle")
        if self.y is None:
            return
        for value, words in self.y.ticks(bottom - top):
            y = self.up(value)
            drawing.line([(left, y), (right, y)], "grid")
            drawing.words((left - 8, y + 4), words, "tick", "end")
        drawing.words((left - 8, top - 12), self.y.label, "label", "start")


def legend(drawing: Drawing, at: Point, names: Sequence[str], right: float) -> None:
    """Marks and names of the variants, in rows that begin at x and end before `right`, the last of
    them at y."""
    x, row, places = at[0], 0, []
    for name in names:
        wide = 26 + 7.2 * len(name)
        if x + wide > right and x > at[0]:
            x, row = at[0], row + 1
        places.append((x, row))
        x += wide
    for n, (name, (x, of)) in enumerate(zip(names, places, strict=True)):
        y = at[1] - 15 * (row - of)
        drawing.mark((x, y - 4), n, f"mark v{n % 6}")
        drawing.words((x + 11, y), name, "tick")


def _power(n: int) -> str:
    """10^n in words."""
    if -2 <= n <= 2:
        return f"{10.0**n:g}"
    return "10" + "".join("⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".index(c)] for c in str(n))
