"""Drawings that stand inside a page: lines, marks and words, coloured by the page's style."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

Point = tuple[float, float]
"""(x, y) [px], y downwards."""

MARK = 5.0
"""From the middle of a mark to its rim [px]."""


class Drawing:
    """An SVG picture; `kind` names classes of the page's style sheet."""

    def __init__(self, size: tuple[float, float], title: str) -> None:
        """An empty picture of `size` (width, height) [px]; `title` is read to who cannot see it."""
        self.size = size
        self._title = title
        self._parts: list[str] = []

    def line(self, points: Sequence[Point], kind: str) -> None:
        """A polyline."""
        told = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self._parts.append(f'<polyline class="{kind}" points="{told}"/>')

    def area(self, points: Sequence[Point], kind: str) -> None:
        """A filled polygon."""
        told = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self._parts.append(f'<polygon class="{kind}" points="{told}"/>')

    def mark(self, at: Point, shape: int, kind: str, tip: str = "") -> None:
        """A mark; shapes differ, so that colours need not be told apart.

        Args:
            at: its middle.
            shape: 0: a disc; 1: a square; 2: a triangle; 3: a diamond; and over again.
            kind: classes.
            tip: shown where the pointer rests.
        """
        hint = f"<title>{escape(tip)}</title>" if tip else ""
        x, y = at
        if shape % 4 == 0:
            self._parts.append(
                f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="{MARK}">{hint}</circle>'
            )
            return
        corners, turn = ((4, math.pi / 4), (3, -math.pi / 2), (4, 0.0))[shape % 4 - 1]
        rim = [
            (x + 1.25 * MARK * math.cos(a), y + 1.25 * MARK * math.sin(a))
            for a in (turn + 2 * math.pi * n / corners for n in range(corners))
        ]
        told = " ".join(f"{px:.1f},{py:.1f}" for px, py in rim)
        self._parts.append(f'<polygon class="{kind}" points="{told}">{hint}</polygon>')

    def words(self, at: Point, words: str, kind: str = "", anchor: str = "start") -> None:
        """A line of text; `anchor`: "start", "middle" or "end" stands at `at`."""
        self._parts.append(
            f'<text class="{kind}" x="{at[0]:.1f}" y="{at[1]:.1f}" text-anchor="{anchor}">'
            f"{escape(words)}</text>"
        )

    def svg(self) -> str:
        """The picture as an element."""
        width, height = self.size
        return (
            f'<svg viewBox="0 0 {width:g} {height:g}" role="img"'
            f' aria-label="{escape(self._title)}">' + "".join(self._parts) + "</svg>"
        )
