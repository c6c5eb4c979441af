"""Text that can be read: OpenCV 5's outline fonts, or its stroke fonts where it is older."""

from __future__ import annotations

import functools
from typing import Any

import cv2
import numpy as np

from passpmp_ti.viz.palette import Colour

BODY, HEADING = 400, 600
"""Weights."""
STROKE_SIZE = 30.0  # pixels from line to line of the stroke font at scale 1
PLAIN = str.maketrans({"·": "-", "≤": "<", "ᵇ": "b", "–": "-"})


@functools.cache
def _face() -> Any:
    return cv2.FontFace("sans") if hasattr(cv2, "FontFace") else None


def _plain(text: str) -> str:
    """The stroke fonts know ASCII only."""
    return text.translate(PLAIN).encode("ascii", "replace").decode()


@functools.lru_cache(maxsize=4096)
def width(text: str, size: int, weight: int = BODY) -> int:
    """Width of a line of text of `size` pixels [px]."""
    face = _face()
    if face is None:
        scale = size / STROKE_SIZE
        return int(cv2.getTextSize(_plain(text), cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0][0])
    return int(cv2.getTextSize((0, 0), text, (0, 0), face, size, weight)[2])


def draw(
    image: np.ndarray,
    text: str,
    at: tuple[float, float],
    colour: Colour,
    size: int,
    *,
    weight: int = BODY,
    align: float = 0.0,
) -> None:
    """Write a line of text.

    Args:
        image: [H, W, 3] uint8, changed in place.
        text: one line.
        at: (x, y) of the baseline [px].
        colour: of the letters.
        size: height of a line [px].
        weight: `BODY` or `HEADING`.
        align: 0: `at` is where the text begins; 0.5: its middle; 1: its end.
    """
    x = round(at[0] - align * width(text, size, weight))
    y = round(at[1])
    face = _face()
    if face is None:
        thickness = 2 if weight >= HEADING else 1
        cv2.putText(
            image,
            _plain(text),
            (x, y),
            cv2.FONT_HERSHEY_SIMPLEX,
            size / STROKE_SIZE,
            colour,
            thickness,
            cv2.LINE_AA,
        )
    else:
        cv2.putText(image, text, (x, y), colour, face, size, weight)
