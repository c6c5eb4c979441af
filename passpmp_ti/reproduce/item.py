"""One thing to reproduce: what is asked, how it is run, what came of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from passpmp_ti.reproduce.runs import Runs

Numbers = dict[str, Any]
"""What a run came to, ready for JSON."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """How much is run."""

    seeds: int = 2
    """Episodes of each kind, seeds 0 to `seeds` - 1."""
    searches: int = 100
    """Searches of a swarm, each with its own random numbers: the paper's 100."""
    longest: float = math.inf
    """No episode is longer [s]."""
    runs: Runs = field(default_factory=Runs)
    """Episodes that were driven already: several items may look at one."""
    see: Callable[[str], None] = lambda _: None
    """Told what is being run."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """Something that is said, by the paper where not told otherwise, and what came of it here."""

    says: str
    ours: str
    holds: bool


@dataclass(frozen=True, kw_only=True)
class Found:
    """What a run came to."""

    numbers: Numbers
    claims: Sequence[Claim]
    figures: Mapping[str, str] = field(default_factory=dict)
    """By caption, an SVG document."""


@dataclass(frozen=True, kw_only=True)
class Item:
    """One table or figure."""

    title: str
    paper: str
    """What the paper shows there, in our words."""
    run: Callable[[Asked], Found]
    tell: Callable[[Numbers], str]
    """Numbers to markdown: tables, ours beside the paper's, and what to make of them."""


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A markdown table."""
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    lines += [f"| {' | '.join(_cell(cell) for cell in row)} |" for row in rows]
    return "\n".join(lines)


def percent(share: float) -> str:
    """A share in words."""
    return f"{100 * share:.1f} %"


def _cell(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) else str(value)
