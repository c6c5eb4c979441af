"""From when to when places come to be reached, at several scales; see kernels/spans.py."""

from __future__ import annotations

import math

import numpy as np

from passpmp_ti import device
from passpmp_ti.kernels.spans import LEVELS, lay_spans


def span_begins(size: int) -> list[int]:
    """Where each level of a square window's spans begins, and their end."""
    begins = [0]
    for level in range(LEVELS):
        begins.append(begins[-1] + math.ceil(size / (2 << level)) ** 2)
    return begins


def spans_of(ticks: device.Array, counts: device.Array, size: int) -> device.Array:
    """[F] uint32 spans of a window of `size` cells a side.

    Args:
        ticks: [size, size] uint16 arrival times.
        counts: as the check's kernels read it.
        size: cells along each side.
    """
    length = span_begins(size)[-1]
    pooled = device.empty((length,), np.uint32)
    spans = device.empty((length,), np.uint32)
    lay_spans(ticks, counts, device.share(), pooled, spans)
    return spans
