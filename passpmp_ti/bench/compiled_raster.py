"""`reference.arrival_seconds` as loops compiled by Numba, its distance transform among them."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from passpmp_ti.bench.reference import CLEAR, LATEST, MOST_BEAMS
from passpmp_ti.scan import Scan

FAR = 1 << 14

parallel: Any = numba.njit(parallel=True, cache=False)


@parallel
def _see(ranges, stays, cell, seen, lets_out):
    size = seen.shape[0]
    beams = len(ranges)
    apart = 2 * math.pi / beams
    half = cell * math.sqrt(0.5)
    for j in numba.prange(size):
        for i in range(size):
            x = (i + 0.5 - 0.5 * size) * cell
            y = (j + 0.5 - 0.5 * size) * cell
            away = math.sqrt(x * x + y * y)
            beam = math.floor(math.atan2(y, x) / apart + 0.5)
            across = min(int(half / (max(away, 0.1) * apart)) + 1, MOST_BEAMS)
            least, most, all_stay = 1e9, 0.0, True
            for k in range(beam - across, beam + across + 1):
                b = k % beams
                least = min(least, ranges[b])
                most = max(most, ranges[b])
                all_stay = all_stay and stays[b]
            seen[j, i] = away + half <= least or away < CLEAR
            lets_out[j, i] = not all_stay or most > away + half


@parallel
def _find_sources(seen, lets_out, source):
    size = seen.shape[0]
    for j in numba.prange(size):
        for i in range(size):
            beside = False
            if not seen[j, i] and lets_out[j, i]:
                for b in range(max(j - 1, 0), min(j + 2, size)):
                    for a in range(max(i - 1, 0), min(i + 2, size)):
                        beside = beside or seen[b, a]
            source[j, i] = beside


@parallel
def _square_distance(marked, column, square):
    """Squared distance [cells] to the nearest cell that is marked (Felzenszwalb, Huttenlocher)."""
    size = marked.shape[0]
    for i in numba.prange(size):
        away = FAR
        for j in range(size):
            away = 0 if marked[j, i] else min(away + 1, FAR)
            column[j, i] = away
        for j in range(size - 2, -1, -1):
            column[j, i] = min(column[j, i], column[j + 1, i] + 1)
    for j in numba.prange(size):
        hull = np.empty(size, dtype=np.int64)
        start = np.empty(size + 1)
        last = -1
        for q in range(size):
            if column[j, q] >= FAR:
                continue
            own = float(column[j, q]) ** 2 + q * q
            begins = -1e9
            while last >= 0:
                r = hull[last]
                begins = (own - (float(column[j, r]) ** 2 + r * r)) * 0.5 / (q - r)
                if begins > start[last]:
                    break
                last -= 1
            if last < 0:
                begins = -1e9
            last += 1
            hull[last] = q
            start[last] = begins
        k = 0
        for q in range(size):
            if last < 0:
                square[j, q] = 1e9
            else:
                while k < last and start[k + 1] < q:
                    k += 1
                square[j, q] = (q - hull[k]) ** 2 + float(column[j, hull[k]]) ** 2


@parallel
def _arrive(to_unseen, to_source, cell, taken, speed, seconds):
    size = seconds.shape[0]
    for j in numba.prange(size):
        for i in range(size):
            seconds[j, i] = 0.0
            if math.sqrt(to_unseen[j, i]) * cell > taken:
                later = (math.sqrt(to_source[j, i]) * cell - taken) / speed
                seconds[j, i] = min(max(later, 0.0), LATEST)


def arrival_seconds(
    scan: Scan, size: int, cell: float, clearance: float, speed: float
) -> np.ndarray:
    """`reference.arrival_seconds`."""
    ranges = np.minimum(scan.ranges, scan.range_max).astype(np.float32)
    stays = scan.returned & ~np.asarray(scan.moving)
    seen, lets_out, source = (np.empty((size, size), dtype=bool) for _ in range(3))
    _see(ranges, stays, cell, seen, lets_out)
    _find_sources(seen, lets_out, source)
    column = np.empty((size, size), dtype=np.int32)
    to_unseen, to_source = (np.empty((size, size), dtype=np.float32) for _ in range(2))
    _square_distance(~seen, column, to_unseen)
    _square_distance(source, column, to_source)
    seconds = np.empty((size, size), dtype=np.float32)
    _arrive(to_unseen, to_source, cell, cell * math.sqrt(2) + clearance, speed, seconds)
    return seconds
