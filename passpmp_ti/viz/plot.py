"""A sheet to draw on in world metres: y upwards, everything clipped to the sheet."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from passpmp_ti.viz import palette
from passpmp_ti.viz.palette import Colour

SHIFT = 4  # OpenCV draws at 1/16 pixel
HATCH_GAP = 11

Bounds = tuple[float, float, float, float]
"""(x low, y low, x high, y high) [m]."""


class Plot:
    """Draws a scene; points are [n, 2] in metres, widths of lines in pixels."""

    def __init__(self, bounds: Bounds, size: tuple[int, int]) -> None:
        """An empty sheet.

        Args:
            bounds: what it shows [m].
            size: (width, height) [px], of the same proportions.
        """
        self.bounds = bounds
        self.scale = size[0] / (bounds[2] - bounds[0])
        """Pixels a metre."""
        self.sheet = np.full((size[1], size[0], 3), palette.FLOOR, dtype=np.uint8)
        """[h, w, 3] (red, green, blue)."""
        self._hatch = _hatched(size[1], size[0], palette.UNSEEN, palette.UNSEEN_HATCH)

    def move(self, bounds: Bounds) -> None:
        """Show another part of the world on an empty sheet of the same size."""
        self.bounds = bounds
        self.scale = self.sheet.shape[1] / (bounds[2] - bounds[0])
        self.clear()

    def clear(self) -> None:
        """Empty the sheet."""
        self.sheet[:] = palette.FLOOR

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """[..., 2] where world points [..., 2] lie on the sheet [px], not rounded."""
        at = (np.asarray(points, dtype=np.float64) - self.bounds[:2]) * self.scale
        at[..., 1] = self.sheet.shape[0] - at[..., 1]
        return at - 0.5

    def fill(self, polygon: np.ndarray, colour: Colour) -> None:
        """Fill a polygon [n, 2]."""
        cv2.fillPoly(self.sheet, [self._fixed(polygon)], colour, cv2.LINE_AA, SHIFT)

    def line(self, points: np.ndarray, colour: Colour, width: int = 1) -> None:
        """Draw one polyline [n, 2]."""
        if len(points):
            self.lines(np.asarray(points)[None], colour, width)

    def lines(self, polylines: np.ndarray, colour: Colour, width: int = 1) -> None:
        """Draw polylines of equal length, [n, m, 2]."""
        if len(polylines):
            cv2.polylines(
                self.sheet, list(self._fixed(polylines)), False, colour, width, cv2.LINE_AA, SHIFT
            )

    def disc(self, centre: np.ndarray, radius: float, colour: Colour, *, width: int = -1) -> None:
        """A disc of `radius` metres; with `width` > 0 only its rim."""
        self._circle(centre, radius * self.scale, colour, width)

    def dot(self, centre: np.ndarray, pixels: float, colour: Colour) -> None:
        """A dot of a radius in pixels."""
        self._circle(centre, pixels, colour, -1)

    def star(self, centre: np.ndarray, pixels: float, colour: Colour) -> None:
        """A five-pointed star with a white rim; `pixels` from its middle to its points."""
        turns = np.pi / 2 + np.arange(10) * np.pi / 5
        for length, ink in ((pixels + 3.5, palette.FLOOR), (pixels, colour)):
            radii = np.where(np.arange(10) % 2 == 0, length, 0.45 * length)
            rays = radii[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
            self.fill(np.asarray(centre) + rays / self.scale, ink)

    def region(
        self, inside: np.ndarray, origin: tuple[float, float], cell: float, colour: Colour
    ) -> None:
        """Paint the cells of a grid.

        Args:
            inside: [J, I] bool, rows upwards.
            origin: world position of the outer corner of cell [0, 0] [m].
            cell: side of a cell [m].
            colour: of the paint.
        """
        layer = np.full_like(self.sheet, colour)
        cv2.copyTo(layer, self.sampled(inside, origin, cell), self.sheet)

    def shade(self, mask: np.ndarray) -> None:
        """Hatch the pixels of a mask [h, w] uint8 that are 255: the sign for what is not seen."""
        cv2.copyTo(self._hatch, mask, self.sheet)

    def sampled(self, inside: np.ndarray, origin: tuple[float, float], cell: float) -> np.ndarray:
        """[h, w] uint8, 255 at the sheet's pixels within the cells; outside the grid 0."""
        step = cell * self.scale
        first = self.pixels(np.array(origin) + 0.5 * cell)
        to_sheet = np.array([[step, 0.0, first[0]], [0.0, -step, first[1]]])
        h, w = self.sheet.shape[:2]
        grey = np.where(inside, np.uint8(255), np.uint8(0))
        if step > 2.0:
            # rounds off the corners of the cells; narrow enough to leave a single cell standing
            smooth = cv2.warpAffine(grey, to_sheet, (w, h), flags=cv2.INTER_NEAREST)
            smooth = cv2.GaussianBlur(smooth, (0, 0), 0.4 * step)
        else:
            smooth = cv2.warpAffine(grey, to_sheet, (w, h), flags=cv2.INTER_LINEAR)
        return cv2.threshold(smooth, 127, 255, cv2.THRESH_BINARY)[1]

    def _circle(self, centre: np.ndarray, pixels: float, colour: Colour, width: int) -> None:
        x, y = self._fixed(np.asarray(centre, dtype=np.float64))
        radius = max(1, round(pixels * 2**SHIFT))
        cv2.circle(self.sheet, (int(x), int(y)), radius, colour, width, cv2.LINE_AA, SHIFT)

    def _fixed(self, points: np.ndarray | Sequence[float]) -> np.ndarray:
        # far beyond the sheet OpenCV's fixed point would overflow
        at = np.clip(self.pixels(np.asarray(points)), -30_000, 30_000)
        return np.round(at * 2**SHIFT).astype(np.int32)


def _hatched(height: int, width: int, ground: Colour, line: Colour) -> np.ndarray:
    sheet = np.full((height, width, 3), ground, dtype=np.uint8)
    for offset in range(-height, width, HATCH_GAP):
        cv2.line(sheet, (offset, height), (offset + height, 0), line, 1, cv2.LINE_AA)
    return sheet
