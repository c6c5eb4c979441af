"""Where on a page the plot, its axes, the title and the panel lie."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

TITLE = 46
LEFT, BOTTOM, EDGE = 62, 50, 16
SIDE, BELOW = 276, 232
"""Width of a panel at the side and height of one below the plot [px]."""
WIDE = 1.5
"""Scenes at least this much wider than high have their panel below."""
TICK_GAP = 65  # least pixels between ticks


@dataclass(frozen=True, slots=True)
class Layout:
    """Rectangles (x, y, width, height) on the page [px], y downwards."""

    page: tuple[int, int]
    """(width, height), both even: video codecs ask for it."""
    plot: tuple[int, int, int, int]
    panel: tuple[int, int, int, int]
    scale: float
    """Pixels a metre."""
    panel_below: bool


def lay_out(bounds: tuple[float, float, float, float], size: tuple[int, int]) -> Layout:
    """Fit a scene into a page no larger than `size`.

    Args:
        bounds: (x low, y low, x high, y high) of the scene [m].
        size: greatest (width, height) of the page [px].
    """
    across, up = bounds[2] - bounds[0], bounds[3] - bounds[1]
    below = across >= WIDE * up
    side = EDGE if below else SIDE
    foot = BELOW if below else 0
    room = (size[0] - LEFT - side, size[1] - TITLE - BOTTOM - foot)
    scale = min(room[0] / across, room[1] / up)
    width, height = round(across * scale), round(up * scale)
    page = (_even(LEFT + width + side), _even(TITLE + height + BOTTOM + foot))
    plot = (LEFT, TITLE, width, height)
    if below:
        panel = (LEFT, TITLE + height + BOTTOM, width, foot)
    else:
        panel = (LEFT + width + 24, TITLE, side - 40, height)
    return Layout(page, plot, panel, scale, below)


def ticks(low: float, high: float, pixels: float) -> np.ndarray:
    """Round numbers between `low` and `high`, so that their labels have room."""
    wanted = (high - low) * TICK_GAP / max(pixels, 1.0)
    power = 10.0 ** math.floor(math.log10(wanted))
    step = next(power * m for m in (1, 2, 5, 10) if power * m >= wanted * 0.999)
    return np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step


def _even(n: int) -> int:
    return n + n % 2
