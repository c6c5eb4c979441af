"""What a comparison found, in sentences."""

from __future__ import annotations

from collections.abc import Mapping

from passpmp_ti.compare.rows import percent
from passpmp_ti.compare.summary import Group


def findings(groups: Mapping[str, Group]) -> list[str]:
    """One sentence for every variant but the first: what it buys, and what it costs.

    Args:
        groups: numbers of one scenario by variant, the first first.
    """
    names = list(groups)
    return [_sentence(names[0], groups[names[0]], n, groups[n]) for n in names[1:]]


def _sentence(first: str, before: Group, name: str, now: Group) -> str:
    return f"{name} beside {first}: {_bought(before, now)}; {_paid(before, now)}."


def _bought(before: Group, now: Group) -> str:
    """Time to the goal."""
    goals = f"the goal was reached in {now['reached']} of {now['episodes']} episodes" + (
        "" if now["reached"] == before["reached"] else f" instead of {before['reached']}"
    )
    later = now["later_median"]
    if later is None:
        return goals
    if abs(later) < 0.05:
        told = "as soon"
    else:
        told = f"{abs(later):.1f} s {'later' if later > 0 else 'sooner'}"
        if before["time_median"]:
            told += f" ({percent(abs(later) / before['time_median'], '.0%')})"
    told += f" on the median of {now['pairs']} pairs"
    low, high = now["later_low"], now["later_high"]
    if low is not None and low <= 0 <= high and abs(later) >= 0.05:
        told += ", which chance may explain (95 % interval"
    elif low is not None:
        told += " (95 % interval"
    if low is not None:
        told += f" {low:+.1f} to {high:+.1f} s)"
    return f"{goals}, {told}"


def _paid(before: Group, now: Group) -> str:
    """Contacts, and what a cycle costs."""
    told = (
        f"it touched somebody while moving in {now['contact_episodes']} of {now['episodes']}"
        f" episodes ({percent(now['contact_low'])} to {percent(now['contact_high'])}) instead of"
        f" {before['contact_episodes']} of {before['episodes']}"
        f" ({percent(before['contact_low'])} to {percent(before['contact_high'])})"
    )
    if now["cost_ratio"] is not None:
        told += f"; a cycle takes {now['cost_ratio']:.2f} times as long"
    return told
