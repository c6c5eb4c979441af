"""Charts of measured figures: lines over an axis, panels side by side, one legend below."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from passpmp_ti.viz import palette, text
from passpmp_ti.viz.palette import Colour

SIZE = 18
"""Height of a line of text [px]."""
LEFT, RIGHT, TOP, BOTTOM = 66, 20, 44, 66
"""Room about a panel's axes [px]."""
LEGEND = 34
"""Height of a row of the legend [px]."""
COLOURS: tuple[Colour, ...] = (
    palette.SAFE, palette.ROBOT, palette.CHOICE, palette.BRAKING, palette.CONTACT, palette.STATIC,
)  # fmt: skip
"""For lines, in order."""
SHIFT = 4  # OpenCV draws at 1/16 pixel


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line of a chart."""

    label: str
    colour: Colour
    points: Sequence[tuple[float, float]]
    """(x, y); a y that is not finite leaves a gap."""
    spread: Sequence[tuple[float, float]] = ()
    """(lowest, highest) y of each point, drawn as a bar; empty: none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """One panel."""

    title: str
    x_label: str
    x_ticks: Sequence[tuple[float, str]]
    lines: Sequence[Line]
    y_most: float
    """Where the y axis ends; it begins at 0."""
    log_x: bool = True


def chart_page(charts: Sequence[Chart], columns: int, panel: tuple[int, int]) -> np.ndarray:
    """Panels row by row on one page, with one legend for the labels of all of them.

    Args:
        charts: the panels.
        columns: panels in a row.
        panel: (width, height) of each, room for its labels included [px].

    Returns:
        [H, W, 3] uint8 (red, green, blue).
    """
    width, height = panel
    rows = math.ceil(len(charts) / columns)
    entries = {line.label: line.colour for chart in charts for line in chart.lines}
    places = _legend_places(list(entries), width * columns)
    legend = LEGEND * (1 + max(row for _, row in places)) if places else 0
    page = np.full((height * rows + legend + 10, width * columns, 3), palette.PAGE, dtype=np.uint8)
    for n, chart in enumerate(charts):
        top, left = n // columns * height, n % columns * width
        _draw(page[top : top + height, left : left + width], chart)
    for (label, colour), (x, row) in zip(entries.items(), places, strict=True):
        y = height * rows + LEGEND * row + 16
        cv2.line(page, (x, y), (x + 34, y), colour, 3, cv2.LINE_AA)
        cv2.circle(page, (x + 17, y), 6, colour, -1, cv2.LINE_AA)
        text.draw(page, label, (x + 44, y + 6), palette.INK, SIZE)
    return page


def write_png(path: Path, image: np.ndarray) -> None:
    """Write [H, W, 3] uint8 (red, green, blue) as small as it goes.

    Raises:
        OSError: it cannot be written there.
    """
    done, data = cv2.imencode(".png", image[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert done
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.tobytes())


def y_ticks(most: float) -> list[float]:
    """Five to eleven even marks from 0 to `most`, at 1, 2 or 5 times a power of ten."""
    if not (math.isfinite(most) and most > 0):
        raise ValueError(f"y_ticks needs a finite end above 0; got {most!r}")
    step = 10.0 ** math.floor(math.log10(most))
    step = next(s for s in (step, step / 2, step / 5, step / 10) if most / s >= 3.999)
    return [k * step for k in range(int(most / step + 1e-9) + 1)]


def _legend_places(labels: Sequence[str], width: int) -> list[tuple[int, int]]:
    """(x, row) of each entry of the legend."""
    places, x, row = [], LEFT, 0
    for label in labels:
        wide = 44 + text.width(label, SIZE) + 28
        if x + wide > width and x > LEFT:
            x, row = LEFT, row + 1
        places.append((x, row))
        x += wide
    return places


def _draw(sheet: np.ndarray, chart: Chart) -> None:
    height, width = sheet.shape[:2]
    low, high = (chart.x_ticks[0][0], chart.x_ticks[-1][0])
    inner = (LEFT, TOP, width - RIGHT, height - BOTTOM)
    cv2.rectangle(sheet, inner[:2], inner[2:], palette.FLOOR, -1)

    def across(x: float) -> float:
        share = (
            math.log(x / low) / math.log(high / low) if chart.log_x else (x - low) / (high - low)
        )
        return inner[0] + 14 + share * (inner[2] - inner[0] - 28)

    def up(y: float) -> float:
        return inner[3] - y / chart.y_most * (inner[3] - inner[1])

    text.draw(sheet, chart.title, (LEFT - 40, 28), palette.INK, SIZE, weight=text.HEADING)
    for y in y_ticks(chart.y_most):
        at = round(up(y))
        cv2.line(sheet, (inner[0], at), (inner[2], at), palette.RULE, 1)
        text.draw(sheet, f"{y:g}", (LEFT - 8, at + 6), palette.MUTED, SIZE, align=1.0)
    for x, label in chart.x_ticks:
        at = round(across(x))
        cv2.line(sheet, (at, inner[3]), (at, inner[3] + 5), palette.MUTED, 1)
        text.draw(sheet, label, (at, inner[3] + 25), palette.MUTED, SIZE, align=0.5)
    middle = 0.5 * (inner[0] + inner[2])
    text.draw(sheet, chart.x_label, (middle, inner[3] + 52), palette.INK, SIZE, align=0.5)
    for line in chart.lines:
        for (x, _), (least, most) in zip(line.points, line.spread, strict=False):
            if math.isfinite(least) and math.isfinite(most):
                ends = [[across(x), up(least)], [across(x), up(most)]]
                _stroke(sheet, ends, line.colour, 2)
        for part in runs_of(line.points):
            ends = [[across(x), up(y)] for x, y in part]
            _stroke(sheet, ends, line.colour, 3)
            for x, y in ends:
                centre = (round(x * 2**SHIFT), round(y * 2**SHIFT))
                cv2.circle(sheet, centre, 6 << SHIFT, line.colour, -1, cv2.LINE_AA, SHIFT)


def runs_of(points: Sequence[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    """The points in pieces without gaps."""
    pieces: list[list[tuple[float, float]]] = [[]]
    for x, y in points:
        if math.isfinite(y):
            pieces[-1].append((x, y))
        elif pieces[-1]:
            pieces.append([])
    return [piece for piece in pieces if piece]


def _stroke(sheet: np.ndarray, ends: Sequence[Sequence[float]], colour: Colour, wide: int) -> None:
    fixed = np.round(np.array(ends) * 2**SHIFT).astype(np.int32)
    cv2.polylines(sheet, [fixed], False, colour, wide, cv2.LINE_AA, SHIFT)
