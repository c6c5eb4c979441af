"""Committed results, and how a run stands against them: by ratios, never by seconds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from passpmp_ti.bench.found import told_number
from passpmp_ti.bench.machine import CODE
from passpmp_ti.viz.report import table

RESULTS = CODE / "benchmarks" / "results"
"""Where the committed results lie."""
WORSE = 0.75
"""A ratio below this share of the committed one is marked."""


def result_file(folder: Path, name: str, backend: str) -> Path:
    """Where a benchmark's committed result lies."""
    return folder / f"{name}-{backend}.json"


def read(path: Path) -> dict[str, Any] | None:
    """A written result; None: there is none."""
    if not path.is_file():
        return None
    try:
        result = json.loads(path.read_text())
        dict(result["ratios"])
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is no result of a benchmark ({error}); write it anew") from error
    return dict(result)


def write(path: Path, content: object) -> None:
    """`content` as JSON that a person can read."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n")


def worse(now: Mapping[str, float], then: Mapping[str, float]) -> list[str]:
    """Names of the ratios that fell by more than a quarter."""
    return [name for name, ratio in now.items() if name in then and ratio < WORSE * then[name]]


def comparison(now: Mapping[str, Any], then: Mapping[str, Any] | None) -> str:
    """Every ratio beside the committed one."""
    if not now["ratios"]:
        return "no ratios"
    before = then["ratios"] if then else {}
    fallen = worse(now["ratios"], before)
    rows = [["ratio (more is better)", "now", "then", "change", ""]]
    for name, ratio in now["ratios"].items():
        old = before.get(name)
        change = "-" if not old else f"{100 * (ratio / old - 1):+.0f} %"
        rows.append(
            [
                name,
                told_number(float(ratio)),
                told_number(old),
                change,
                "WORSE" if name in fallen else "",
            ]
        )
    if then is None:
        against = "no committed result for this backend yet"
    else:
        against = f"then: commit {then.get('commit', 'unknown')}, {then.get('machine', 'unknown')}"
        if then.get("machine") != now.get("machine"):
            against += " (another machine: ratios may differ for that)"
    return f"{table(rows)}\n{against}"
