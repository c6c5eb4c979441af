"""A comparison in numbers: scenario by scenario, variant by variant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from passpmp_ti.compare.intervals import median_interval, share_interval
from passpmp_ti.compare.job import Key, Result
from passpmp_ti.compare.reliability import reliability

Group = dict[str, Any]
"""What is told of one variant in one scenario."""


def summarise(
    names: Sequence[str], variants: Sequence[str], results: Mapping[Key, Result]
) -> dict[str, dict[str, Group]]:
    """Numbers of every scenario and variant, SI units; None where there is nothing to tell.

    Args:
        names: of the scenarios.
        variants: the others are compared with the first.
        results: by (scenario, variant, seed).

    Returns:
        By scenario and variant; `summary_of` says what.
    """
    told: dict[str, dict[str, Group]] = {}
    for name in names:
        own = {
            v: {seed: r for (s, w, seed), r in results.items() if (s, w) == (name, v)}
            for v in variants
        }
        first = own[variants[0]]
        told[name] = {v: summary_of(own[v], None if own[v] is first else first) for v in variants}
    return told


def summary_of(results: Mapping[int, Result], first: Mapping[int, Result] | None = None) -> Group:
    """One variant in one scenario.

    Args:
        results: by seed; those that raised are counted, and left out of everything else.
        first: what it is compared with, by seed; None: it is the first itself.
    """
    good = {seed: r for seed, r in sorted(results.items()) if r["error"] is None}
    count = len(good)
    told: Group = {"episodes": count, "raised": len(results) - count}
    outcomes = [r["outcome"] for r in good.values()]
    touched = sum(o["collisions_moving"] > 0 for o in outcomes)
    arrived = arrivals(good)
    low, high = share_interval(touched, count)
    told |= {
        "contact_episodes": touched,
        "contact_share": _ratio(touched, count),
        "contact_low": low,
        "contact_high": high,
        "contacts": sum(o["collisions_moving"] for o in outcomes),
        "contacts_beyond_bound": sum(o["collisions_moving_beyond_bound"] for o in outcomes),
        "contacts_at_rest": sum(o["collisions_at_rest"] for o in outcomes),
    }
    low, high = share_interval(len(arrived), count)
    quartiles = np.quantile(list(arrived.values()), (0.25, 0.5, 0.75)) if arrived else [None] * 3
    told |= {
        "reached": len(arrived),
        "reached_share": _ratio(len(arrived), count),
        "reached_low": low,
        "reached_high": high,
        "time_q1": _plain(quartiles[0]),
        "time_median": _plain(quartiles[1]),
        "time_q3": _plain(quartiles[2]),
    }
    told |= _against(arrived, {} if first is None else arrivals(first))
    duration = sum(o["duration"] for o in outcomes)
    told |= {
        "mean_speed": _ratio(sum(o["distance_driven"] for o in outcomes), duration),
        "share_moving": _ratio(sum(o["time_moving"] for o in outcomes), duration),
        "broken_premises": sum(o["broken_premises"] for o in outcomes),
    }
    told |= _proven(good)
    told |= _cost(good, first)
    pairs = [p for r in good.values() for p in zip(r["promised"], r["met"], strict=True)]
    return told | {"promises": reliability(pairs), "seeds": _by_seed(good)}


def arrivals(results: Mapping[int, Result]) -> dict[int, float]:
    """Time to the goal [s] of the seeds that reached it."""
    return {
        seed: r["outcome"]["time_to_goal"]
        for seed, r in sorted(results.items())
        if r["error"] is None and r["outcome"]["reached_goal"]
    }


def _against(own: Mapping[int, float], first: Mapping[int, float]) -> Group:
    """How much later than the first, on the seeds on which both reached the goal."""
    later = [own[seed] - first[seed] for seed in sorted(own.keys() & first.keys())]
    interval = median_interval(later)
    return {
        "pairs": len(later),
        "later_median": float(np.median(later)) if later else None,
        "later_low": interval[0] if interval else None,
        "later_high": interval[1] if interval else None,
    }


def _proven(good: Mapping[int, Result]) -> Group:
    """Shares of cycles that the conservative observer proved; None where nobody observed."""
    seen = [r["observed"] for r in good.values() if r["observed"] is not None]
    return {
        "p_safe_share": _ratio(sum(s["proven"] for s in seen), sum(s["cycles"] for s in seen)),
        "p_safe_share_moving": _ratio(
            sum(s["proven_moving"] for s in seen), sum(s["cycles_moving"] for s in seen)
        ),
        "cycles": sum(r["outcome"]["cycles"] for r in good.values()),
    }


def _cost(good: Mapping[int, Result], first: Mapping[int, Result] | None) -> Group:
    """Wall clock time of a cycle [s], of all cycles taken together."""
    median, p99 = _cost_of(good)
    before = median if first is None else _cost_of(first)[0]
    return {
        "cost_median": median,
        "cost_p99": p99,
        "cost_ratio": None if median is None or before is None else median / before,
    }


def _cost_of(results: Mapping[int, Result]) -> tuple[float | None, float | None]:
    # the first cycle of an episode may compile kernels
    warm = [r["timings"]["cycles_us"][1:] for r in results.values() if r["error"] is None]
    cycles = 1e-6 * np.array([us for episode in warm for us in episode])
    if not len(cycles):
        return None, None
    return float(np.median(cycles)), float(np.quantile(cycles, 0.99))


def _by_seed(good: Mapping[int, Result]) -> dict[str, Group]:
    """What became of each episode; seeds are words, as JSON has them."""
    return {
        str(seed): {
            "time_to_goal": r["outcome"]["time_to_goal"],
            "contacts": r["outcome"]["collisions_moving"],
        }
        for seed, r in good.items()
    }


def _ratio(part: float, whole: float) -> float | None:
    return None if not whole else part / whole


def _plain(number: Any) -> float | None:
    return None if number is None else float(number)
