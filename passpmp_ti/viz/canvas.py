"""A page with a plot in world metres: y upwards, drawing clipped to the plot."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from passpmp_ti.viz import palette, text
from passpmp_ti.viz.layout import Layout, lay_out, ticks
from passpmp_ti.viz.palette import Colour

SHIFT = 4  # OpenCV draws at 1/16 pixel
HATCH_GAP = 11
LABEL = 14
TITLE_SIZE = 19


class Canvas:
    """Draws a scene; points are [n, 2] in metres, widths of lines in pixels."""

    def __init__(self, bounds: tuple[float, float, float, float],
                 size: tuple[int, int] = (1280, 1024)) -> None:
        """Lay out an empty page.

        Args:
            bounds: (x low, y low, x high, y high) of the scene [m].
            size: greatest (width, height) of the page [px].
        """
        self.bounds = bounds
        self.layout: Layout = lay_out(bounds, size)
        x, y, w, h = self.layout.plot
        self.page = np.full((*self.layout.page[::-1], 3), palette.PAGE, dtype=np.uint8)
        self.plot = np.full((h, w, 3), palette.FLOOR, dtype=np.uint8)
        self._hatch = _hatched(h, w, palette.UNSEEN, palette.UNSEEN_HATCH)
        self._draw_axes()

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """[..., 2] where world points [..., 2] lie in the plot [px], not rounded."""
        given = np.asarray(points, dtype=np.float64)
        low = np.array(self.bounds[:2])
        at = (given - low) * self.layout.scale
        at[..., 1] = self.plot.shape[0] - at[..., 1]
        return at - 0.5

    def image(self) -> np.ndarray:
        """[H, W, 3] uint8 (red, green, blue): a copy of the page as it is now."""
        x, y, w, h = self.layout.plot
        whole = self.page.copy()
        whole[y : y + h, x : x + w] = self.plot
        cv2.rectangle(whole, (x - 1, y - 1), (x + w, y + h), palette.MUTED, 1)
        return whole

    def clear(self) -> None:
        """Empty the plot."""
        self.plot[:] = palette.FLOOR

    def title(self, heading: str, detail: str = "") -> None:
        """Write the line above the plot."""
        x, y, _, _ = self.layout.plot
        text.draw(self.page, heading, (x, y - 16), palette.INK, TITLE_SIZE, weight=text.HEADING)
        after = x + text.width(heading, TITLE_SIZE, text.HEADING) + 14
        text.draw(self.page, detail, (after, y - 16), palette.MUTED, LABEL + 1)

    def fill(self, polygon: np.ndarray, colour: Colour) -> None:
        """Fill a polygon [n, 2]."""
        cv2.fillPoly(self.plot, [self._fixed(polygon)], colour, cv2.LINE_AA, SHIFT)

    def line(self, points: np.ndarray, colour: Colour, width: int = 1) -> None:
        """Draw one polyline [n, 2]."""
        self.lines([points], colour, width)

    def lines(self, polylines: Sequence[np.ndarray], colour: Colour, width: int = 1,
              *, closed: bool = False) -> None:
        """Draw polylines, each [n, 2]."""
        fixed = [self._fixed(p) for p in polylines if len(p)]
        if fixed:
            cv2.polylines(self.plot, fixed, closed, colour, width, cv2.LINE_AA, SHIFT)

    def disc(self, centre: np.ndarray, radius: float, colour: Colour,
             *, width: int = -1) -> None:
        """A disc of `radius` metres; with `width` > 0 only its rim."""
        self._circle(centre, radius * self.layout.scale, colour, width)

    def dot(self, centre: np.ndarray, pixels: float, colour: Colour) -> None:
        """A dot of a radius in pixels."""
        self._circle(centre, pixels, colour, -1)

    def star(self, centre: np.ndarray, pixels: float, colour: Colour) -> None:
        """A five-pointed star with a white rim; `pixels` from its middle to its points."""
        turns = np.pi / 2 + np.arange(10) * np.pi / 5
        for length, ink in ((pixels + 3.5, palette.FLOOR), (pixels, colour)):
            radii = np.where(np.arange(10) % 2 == 0, length, 0.45 * length)
            rays = radii[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
            self.fill(np.asarray(centre) + rays / self.layout.scale, ink)

    def region(self, inside: np.ndarray, origin: tuple[float, float], cell: float,
               colour: Colour) -> None:
        """Paint the cells of a grid.

        Args:
            inside: [J, I] bool, rows upwards.
            origin: world position of the outer corner of cell [0, 0] [m].
            cell: side of a cell [m].
            colour: of the paint.
        """
        layer = np.full_like(self.plot, colour)
        cv2.copyTo(layer, self.sampled(inside, origin, cell), self.plot)

    def shade(self, mask: np.ndarray) -> None:
        """Hatch the pixels of a mask [h, w] uint8 that are 255: the sign for what is not seen."""
        cv2.copyTo(self._hatch, mask, self.plot)

    def sampled(self, inside: np.ndarray, origin: tuple[float, float], cell: float) -> np.ndarray:
        """[h, w] uint8, 255 at the plot's pixels within the cells; outside the grid 0."""
        step = cell * self.layout.scale
        first = self.pixels(np.array(origin) + 0.5 * cell)
        to_plot = np.array([[step, 0.0, first[0]], [0.0, -step, first[1]]])
        h, w = self.plot.shape[:2]
        grey = np.where(inside, np.uint8(255), np.uint8(0))
        smooth = cv2.warpAffine(grey, to_plot, (w, h), flags=cv2.INTER_LINEAR)
        return cv2.threshold(smooth, 127, 255, cv2.THRESH_BINARY)[1]

    def _circle(self, centre: np.ndarray, pixels: float, colour: Colour, width: int) -> None:
        x, y = self._fixed(np.asarray(centre, dtype=np.float64)[None])[0, 0]
        radius = max(1, round(pixels * 2**SHIFT))
        cv2.circle(self.plot, (int(x), int(y)), radius, colour, width, cv2.LINE_AA, SHIFT)

    def _fixed(self, points: np.ndarray) -> np.ndarray:
        # far beyond the plot OpenCV's fixed point would overflow
        at = np.clip(self.pixels(points), -30_000, 30_000)
        return np.round(at * 2**SHIFT).astype(np.int32).reshape(-1, 1, 2)

    def _draw_axes(self) -> None:
        x, y, w, h = self.layout.plot
        low_x, low_y, high_x, high_y = self.bounds
        for value in ticks(low_x, high_x, w):
            at = x + (value - low_x) * self.layout.scale
            cv2.line(self.page, (round(at), y + h), (round(at), y + h + 5), palette.MUTED, 1)
            text.draw(self.page, f"{value:g}", (at, y + h + 20), palette.MUTED, LABEL, align=0.5)
        for value in ticks(low_y, high_y, h):
            at = y + h - (value - low_y) * self.layout.scale
            cv2.line(self.page, (x - 6, round(at)), (x - 1, round(at)), palette.MUTED, 1)
            text.draw(self.page, f"{value:g}", (x - 10, at + 5), palette.MUTED, LABEL, align=1.0)
        text.draw(self.page, "x [m]", (x + w / 2, y + h + 40), palette.INK, LABEL, align=0.5)
        text.draw(self.page, "y [m]", (10, y - 10), palette.INK, LABEL)


def _hatched(height: int, width: int, ground: Colour, line: Colour) -> np.ndarray:
    sheet = np.full((height, width, 3), ground, dtype=np.uint8)
    for offset in range(-height, width, HATCH_GAP):
        cv2.line(sheet, (offset, height), (offset + height, 0), line, 1, cv2.LINE_AA)
    return sheet
