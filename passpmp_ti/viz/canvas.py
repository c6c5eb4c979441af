"""A page: a plot of a scene with axes in metres, a title above and room for a panel."""

from __future__ import annotations

import cv2
import numpy as np

from passpmp_ti.viz import palette, text
from passpmp_ti.viz.layout import Layout, lay_out, ticks
from passpmp_ti.viz.plot import Bounds, Plot

LABEL = 14
TITLE_SIZE = 19


class Canvas(Plot):
    """Draws a scene on a page; see `Plot` for what can be drawn."""

    def __init__(self, bounds: Bounds, size: tuple[int, int] = (1280, 1024)) -> None:
        """Lay out an empty page.

        Args:
            bounds: of the scene [m].
            size: greatest (width, height) of the page [px].
        """
        self.layout: Layout = lay_out(bounds, size)
        _, _, w, h = self.layout.plot
        super().__init__(bounds, (w, h))
        self.page = np.full((*self.layout.page[::-1], 3), palette.PAGE, dtype=np.uint8)
        self._draw_axes()

    def image(self) -> np.ndarray:
        """[H, W, 3] uint8 (red, green, blue): a copy of the page as it is now."""
        x, y, w, h = self.layout.plot
        whole = self.page.copy()
        whole[y : y + h, x : x + w] = self.sheet
        cv2.rectangle(whole, (x - 1, y - 1), (x + w, y + h), palette.MUTED, 1)
        return whole

    def title(self, heading: str, detail: str = "") -> None:
        """Write the line above the plot."""
        x, y, _, _ = self.layout.plot
        text.draw(self.page, heading, (x, y - 16), palette.INK, TITLE_SIZE, weight=text.HEADING)
        after = x + text.width(heading, TITLE_SIZE, text.HEADING) + 14
        text.draw(self.page, detail, (after, y - 16), palette.MUTED, LABEL + 1)

    def _draw_axes(self) -> None:
        x, y, w, h = self.layout.plot
        low_x, low_y, high_x, high_y = self.bounds
        for value in ticks(low_x, high_x, w):
            at = x + (value - low_x) * self.scale
            cv2.line(self.page, (round(at), y + h), (round(at), y + h + 5), palette.MUTED, 1)
            text.draw(self.page, f"{value:g}", (at, y + h + 20), palette.MUTED, LABEL, align=0.5)
        for value in ticks(low_y, high_y, h):
            at = y + h - (value - low_y) * self.scale
            cv2.line(self.page, (x - 6, round(at)), (x - 1, round(at)), palette.MUTED, 1)
            text.draw(self.page, f"{value:g}", (x - 10, at + 5), palette.MUTED, LABEL, align=1.0)
        text.draw(self.page, "x [m]", (x + w / 2, y + h + 40), palette.INK, LABEL, align=0.5)
        text.draw(self.page, "y [m]", (10, y - 16), palette.INK, LABEL)
