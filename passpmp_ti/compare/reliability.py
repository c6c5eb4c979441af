"""Risk promised against risk met, in bins of what was promised."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from passpmp_ti.compare.intervals import share_interval

DECADES = 6
"""The bins reach down to 10^-6; what promises less, but not nothing, is in one of its own."""
EDGES = tuple(10 ** (-DECADES + n / 2) for n in range(2 * DECADES + 1))
"""Of the bins: half a decade each. An edge belongs to the bin below it."""


def reliability(pairs: Iterable[tuple[float, int]]) -> dict[str, Any]:
    """What became of promises.

    Args:
        pairs: (chance promised, 1 if it came to a contact) of each trajectory judged.

    Returns:
        judged: how many; expected: the sum of the promises; met: how many came to a contact; bins:
        those that hold anything, each with low and high (its edges; both 0: nothing promised),
        count, promised (mean), met, share, and the 95 % interval share_low, share_high. Intervals
        take judgements as independent. Those of one episode are not: the truth is less certain.
    """
    found = np.array(sorted(pairs), dtype=np.float64).reshape(-1, 2)
    promised, met = found[:, 0], found[:, 1]
    # 0: promised nothing; 1: less than the first edge; then the bins
    number = np.where(promised <= 0, 0, 1 + np.searchsorted(EDGES, promised, side="left"))
    bins = []
    for n in np.unique(number):
        own = number == n
        count, touched = int(own.sum()), int(met[own].sum())
        low, high = share_interval(touched, count)
        bins.append({
            "low": 0.0 if n <= 1 else EDGES[n - 2],
            "high": 0.0 if n == 0 else EDGES[min(n - 1, len(EDGES) - 1)],
            "count": count,
            "promised": math.fsum(promised[own]) / count,
            "met": touched,
            "share": touched / count,
            "share_low": low,
            "share_high": high,
        })  # fmt: skip
    return {
        "judged": len(found),
        "expected": math.fsum(promised),
        "met": int(met.sum()),
        "bins": bins,
    }
