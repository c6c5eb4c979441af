"""Tables of a benchmark's page, and the shares and spreads in their cells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from passpmp_ti.compare.intervals import share_interval


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table for documents: the first column to the left, the others to the right."""
    lines = [f"| {' | '.join(head)} |", "|---|" + "---:|" * (len(head) - 1)]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)]) + "\n"


def share(times: int, tries: int) -> dict[str, Any]:
    """How often it happened, with the exact 95 % interval."""
    low, high = share_interval(times, tries)
    return {"times": times, "tries": tries, "low": low, "high": high}


def told_share(found: dict[str, Any]) -> str:
    """In per cent, as `97.3 % [95.8, 98.4]`."""
    if not found["tries"]:
        return "-"
    low, high = (f"{100 * found[end]:.1f}" for end in ("low", "high"))
    return f"{100 * found['times'] / found['tries']:.1f} % [{low}, {high}]"


def median(values: Iterable[float | None]) -> float | None:
    """Of those that are there."""
    there = [value for value in values if value is not None]
    return float(np.median(there)) if there else None


def told(value: float | None, digits: int = 2) -> str:
    """A number, or `-` where there is none."""
    return "-" if value is None else f"{value:.{digits}f}"


def cycle_times(results: Iterable[dict[str, Any]]) -> dict[str, float] | None:
    """Median, 99 % and worst of all cycles but the first of each trial [ms]."""
    spent = np.array([us for result in results for us in result["timings"].get("cycles_us", ())])
    if not len(spent):
        return None
    return {
        "median": float(np.median(spent)) / 1e3,
        "p99": float(np.quantile(spent, 0.99)) / 1e3,
        "worst": float(spent.max()) / 1e3,
    }


def told_cost(told_: Mapping[str, Any]) -> str:
    """What a cycle and a trial cost, in a sentence; nothing where nothing was driven."""
    spent, here = told_["cycle_ms"], told_["machine"]
    if not spent:
        return ""
    return (
        f"\nA planning cycle takes {spent['median']:.0f} ms (median; 99 % {spent['p99']:.0f} ms,"
        f" worst {spent['worst']:.0f} ms) of the 100 ms it has, on one thread of"
        f" {here['machine']}; Python {here['python']}, Taichi {here['taichi']}, commit"
        f" {', '.join(told_['commits'])}. A trial takes"
        f" {told(told_['seconds_a_trial'], 1)} s of one process.\n"
    )
