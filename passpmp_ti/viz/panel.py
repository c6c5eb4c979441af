"""What stands beside the plot: readings of the cycle, and what each colour means."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from passpmp_ti.viz import palette, text
from passpmp_ti.viz.palette import Colour

ROW, SIZE, HEAD = 23, 15, 14
SWATCH = 26
MARGIN = 6  # the ends of thick lines stand out
NOTE_LINES = 3
CLOSE_UP_HEAD = 30
"""Height of the heading of a close-up [px]."""

AREA, HATCH, LINE, DISC, STAR = "area", "hatch", "line", "disc", "star"


@dataclass(frozen=True, slots=True)
class Reading:
    """One value of the moment."""

    name: str
    value: str
    alarm: bool = False
    """Drawn in the colour of contacts."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of the legend."""

    sign: str
    colour: Colour
    label: str
    width: int = 2


def draw(
    page: np.ndarray,
    place: tuple[int, int, int, int],
    below: bool,
    heading: str,
    readings: Sequence[Reading],
    note: str,
    legend: Sequence[Entry],
) -> int:
    """Write readings, a note and the legend into a panel.

    Args:
        page: [H, W, 3] uint8, changed in place.
        place: the panel (x, y, width, height) [px].
        below: the panel lies below the plot: columns side by side.
        heading: above the readings.
        readings: values of the moment.
        note: a sentence, may be empty.
        legend: what each colour means.

    Returns:
        The y at which the panel is free again [px].
    """
    x, y, w, h = place
    page[y : y + h, x - MARGIN : x + w + MARGIN] = palette.PAGE
    if below:
        half = min(w // 2 - 24, 560)
        _readings(page, (x, y, half), heading, readings, note, columns=2)
        _legend(page, (x + w // 2 + 12, y, w // 2 - 12), legend, columns=max(1, w // 2 // 230))
        return y + h
    foot = _readings(page, (x, y, w), heading, readings, note, columns=1)
    return _legend(page, (x, foot, w), legend, columns=1)


def draw_close_up(page: np.ndarray, x: int, y: int, picture: np.ndarray, words: str) -> None:
    """Put a picture [s, s, 3] into a panel at (x, y), under a heading."""
    side = picture.shape[0]
    top = _heading(page, x, y, side, words) + 4
    page[top : top + side, x : x + side] = picture
    cv2.rectangle(page, (x - 1, top - 1), (x + side, top + side), palette.MUTED, 1)


def _heading(page: np.ndarray, x: int, y: int, width: int, words: str) -> int:
    text.draw(page, words, (x, y + 14), palette.MUTED, HEAD, weight=text.HEADING)
    cv2.line(page, (x, y + 22), (x + width, y + 22), palette.RULE, 1)
    return y + 24


def _readings(
    page: np.ndarray,
    place: tuple[int, int, int],
    heading: str,
    readings: Sequence[Reading],
    note: str,
    columns: int,
) -> int:
    x, y, w = place
    top = _heading(page, x, y, w, heading)
    rows = -(-len(readings) // columns)
    column = (w - 28 * (columns - 1)) // columns
    for n, reading in enumerate(readings):
        at_x = x + (n // rows) * (column + 28)
        base = top + (n % rows + 1) * ROW - 6
        text.draw(page, reading.name, (at_x, base), palette.MUTED, SIZE)
        ink = palette.EXECUTED if reading.alarm else palette.INK
        text.draw(
            page, reading.value, (at_x + column, base), ink, SIZE, weight=text.HEADING, align=1.0
        )
    foot = top + rows * ROW + 4
    letters = max(12, w * 2 // SIZE)
    lines = textwrap.wrap(note, letters, max_lines=NOTE_LINES, placeholder=" ...")
    for n, words in enumerate(lines):
        text.draw(page, words, (x, foot + 14 + 19 * n), palette.INK, HEAD)
    return foot + 19 * NOTE_LINES + 8


def _legend(
    page: np.ndarray, place: tuple[int, int, int], legend: Sequence[Entry], columns: int
) -> int:
    x, y, w = place
    top = _heading(page, x, y, w, "Legend")
    rows = -(-len(legend) // columns)
    column = w // columns
    for n, entry in enumerate(legend):
        at_x = x + (n // rows) * column
        middle = top + (n % rows) * ROW + 16
        _swatch(page, at_x, middle, entry)
        text.draw(page, entry.label, (at_x + SWATCH + 10, middle + 5), palette.INK, HEAD)
    return top + rows * ROW + 16


def _swatch(page: np.ndarray, x: int, middle: int, entry: Entry) -> None:
    if entry.sign in (AREA, HATCH):
        box = (x, middle - 8), (x + SWATCH, middle + 7)
        cv2.rectangle(page, *box, entry.colour, -1)
        if entry.sign == HATCH:
            inner = page[middle - 8 : middle + 8, x : x + SWATCH]
            for offset in range(-16, SWATCH, 8):
                cv2.line(
                    inner, (offset, 16), (offset + 16, 0), palette.UNSEEN_HATCH, 1, cv2.LINE_AA
                )
        cv2.rectangle(page, *box, palette.RULE, 1)
    elif entry.sign == LINE:
        cv2.line(page, (x, middle), (x + SWATCH, middle), entry.colour, entry.width, cv2.LINE_AA)
    elif entry.sign == DISC:
        cv2.circle(page, (x + SWATCH // 2, middle), 7, entry.colour, -1, cv2.LINE_AA)
    else:
        turns = -np.pi / 2 + np.arange(10) * np.pi / 5
        radii = np.where(np.arange(10) % 2 == 0, 9.0, 4.0)
        points = np.stack(
            [x + SWATCH / 2 + radii * np.cos(turns), middle + radii * np.sin(turns)], axis=1
        )
        cv2.fillPoly(page, [np.round(points * 16).astype(np.int32)], entry.colour, cv2.LINE_AA, 4)
