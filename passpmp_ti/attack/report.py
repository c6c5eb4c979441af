"""A campaign in numbers: per robot and kind, with what the zeros are worth."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from passpmp_ti.attack.bounds import rate_bound, share_bound
from passpmp_ti.attack.campaign import Result, failed
from passpmp_ti.attack.case import WALKERS

SUMS = (
    "cycles", "duration", "metres", "seconds_moving", "contacts_moving", "contacts_at_rest",
    "held_unsafe", "held_unsafe_after_broken", "broken_premises", "lost_scans",
    "seconds_computed",
)  # fmt: skip


def summary(results: Iterable[Result]) -> dict[str, Any]:
    """Episodes taken together; SI units, rates per km, per hour of motion and per episode."""
    results = list(results)
    told: dict[str, Any] = {"episodes": len(results)}
    told |= {key: sum(r[key] for r in results) for key in SUMS}
    told["exceptions"] = sum(r["exception"] is not None for r in results)
    told["episodes_failed"] = sum(failed(r) for r in results)
    touched = sum(r["contacts_moving"] > 0 for r in results)
    nearest = [r["nearest_moving"] for r in results if r["nearest_moving"] is not None]
    told["nearest_moving"] = min(nearest) if nearest else None
    told["share_moving"] = told["seconds_moving"] / told["duration"] if told["duration"] else 0.0
    told["top_speed"] = max((r["top_speed"] for r in results), default=0.0)
    contacts = told["contacts_moving"]
    told["bound_per_km"] = _finite(rate_bound(contacts, told["metres"] / 1000))
    told["bound_per_hour_moving"] = _finite(rate_bound(contacts, told["seconds_moving"] / 3600))
    told["bound_per_cycle"] = _finite(rate_bound(contacts, told["cycles"]))
    told["bound_per_episode"] = share_bound(touched, len(results))
    return told


def report(results: Sequence[Result]) -> dict[str, Any]:
    """The whole campaign: for each robot all, hunters, walkers, and each kind."""
    told: dict[str, Any] = {"failed": [_name(r) for r in results if failed(r)], "robots": {}}
    for robot in sorted({r["robot"] for r in results}):
        own = [r for r in results if r["robot"] == robot]
        hunted = [r for r in own if r["kind"] != WALKERS]
        groups = {"all": summary(own)}
        if hunted:
            groups["hunters"] = summary(hunted)
        for kind in sorted({r["kind"] for r in own}):
            groups[kind] = summary(r for r in own if r["kind"] == kind)
        told["robots"][robot] = groups
    return told


COLUMNS = (
    ("episodes", "episodes", "d"),
    ("cycles", "cycles", "d"),
    ("contacts while moving", "contacts_moving", "d"),
    ("held unsafe", "held_unsafe", "d"),
    ("broken premises", "broken_premises", "d"),
    ("exceptions", "exceptions", "d"),
    ("lost scans", "lost_scans", "d"),
    ("contacts at rest", "contacts_at_rest", "d"),
    ("nearest, moving [m]", "nearest_moving", ".3f"),
    ("metres", "metres", ".0f"),
    ("moving [s]", "seconds_moving", ".0f"),
    ("share moving", "share_moving", ".2f"),
    ("top speed [m/s]", "top_speed", ".2f"),
    ("contacts a km <", "bound_per_km", ".3g"),
    ("an hour moving <", "bound_per_hour_moving", ".3g"),
    ("an episode <", "bound_per_episode", ".3g"),
)  # fmt: skip


def markdown(told: dict[str, Any], heading: str) -> str:
    """The report to be read."""
    lines = [f"# {heading}", ""]
    for robot, groups in told["robots"].items():
        lines += [f"## {robot}", "", "| kind | " + " | ".join(c[0] for c in COLUMNS) + " |"]
        lines.append("|---" * (len(COLUMNS) + 1) + "|")
        for kind, group in groups.items():
            cells = [_cell(group[key], form) for _, key, form in COLUMNS]
            lines.append(f"| {kind} | " + " | ".join(cells) + " |")
        lines.append("")
    lines += [
        "The last three columns are one-sided 95 % upper bounds on contacts while moving (exact",
        "Poisson for rates, Clopper-Pearson for episodes). They speak of worlds, errors and movers",
        "drawn as here, no others. A cycle is one decision of the planner; cycles of one episode",
        "are not independent.",
        "",
    ]
    if told["failed"]:
        lines += ["Failed: " + ", ".join(told["failed"]), ""]
    return "\n".join(lines)


def write_report(results: Sequence[Result], folder: Path, heading: str) -> dict[str, Any]:
    """Write `report.json` and `report.md`; returns the report."""
    told = report(results)
    (folder / "report.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    (folder / "report.md").write_text(markdown(told, heading), encoding="utf-8")
    return told


def _name(found: Result) -> str:
    return f"failed-{found['robot']}-{found['kind']}-{found['seed']}.json"


def _cell(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _finite(value: float) -> float | None:
    """JSON knows no infinity."""
    return value if math.isfinite(value) else None
