"""The table of a comparison, as markdown and as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from passpmp_ti.compare.rows import PROMISES, ROWS, Row
from passpmp_ti.compare.summary import Group
from passpmp_ti.viz.report import table


def cells(groups: Mapping[str, Group]) -> list[tuple[Row, list[str]]]:
    """Every row with its cell of each variant."""
    promises = [group["promises"] for group in groups.values()]
    return [(row, [row.told(group) for group in groups.values()]) for row in ROWS] + [
        (row, [row.told(promise) for promise in promises]) for row in PROMISES
    ]


def text(told: Mapping[str, Any]) -> str:
    """For a terminal."""
    parts = []
    for name, scenario in told["scenarios"].items():
        groups = scenario["variants"]
        rows = [["", *groups], *([row.label, *own] for row, own in cells(groups))]
        parts.append("\n".join([f"{name}: {scenario['description']}", table(rows), ""]))
        parts[-1] += "".join(f"{sentence}\n" for sentence in scenario["findings"])
    return "\n".join(parts)


def markdown(told: Mapping[str, Any]) -> str:
    """For documents."""
    lines = []
    for name, scenario in told["scenarios"].items():
        groups = scenario["variants"]
        lines += [f"## {name}", "", f"{scenario['description']}", ""]
        lines += [f"| | {' | '.join(groups)} |", "|---" * (len(groups) + 1) + "|"]
        lines += [f"| {row.label} | {' | '.join(own)} |" for row, own in cells(groups)]
        lines += ["", *(f"{sentence}\n" for sentence in scenario["findings"])]
    lines += [origin(told), "", f"    {told['command']}", ""]
    return "\n".join(lines)


def origin(told: Mapping[str, Any]) -> str:
    """Where the numbers come from, in one line."""
    here = told["machine"]
    machines = ", ".join(told["machines"]) or here["machine"]
    return (
        f"{told['episodes_done']} of {told['episodes_wanted']} episodes, {told['date']}."
        f" {machines}, {told['workers']}; {here['system']}, Python {here['python']},"
        f" Taichi {here['taichi']}, NumPy {here['numpy']}, SciPy {here['scipy']};"
        f" commit {', '.join(told['commits']) or 'unknown'}."
    )
