"""What a comparison leaves in its folder: numbers, a table and a page."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from passpmp_ti.bench.machine import machine
from passpmp_ti.compare import page, table
from passpmp_ti.compare.comparison import Comparison
from passpmp_ti.compare.findings import findings
from passpmp_ti.compare.job import Key, Result
from passpmp_ti.compare.summary import summarise

Document = dict[str, Any]


def document(
    comparison: Comparison, results: Mapping[Key, Result], *, date: str, command: str, workers: str
) -> Document:
    """All that is told of a comparison, in plain JSON.

    Args:
        comparison: what was wanted.
        results: what there is of it.
        date: of the report.
        command: that makes it again.
        workers: what drove the episodes, in words.
    """
    variants = [v.name for v in comparison.variants]
    told = summarise(comparison.names, variants, results)
    scenarios = {}
    for name, reference in zip(comparison.names, comparison.scenarios, strict=True):
        scenario = comparison.scenario(reference)
        scenarios[name] = {
            "description": scenario.description,
            "duration": scenario.duration,
            "object_speed": scenario.settings.object_speed,
            "variants": told[name],
            "findings": findings(told[name]),
        }
    timings = [r["timings"] for r in results.values()]
    return {
        "date": date,
        "command": command,
        "workers": workers,
        "machine": machine(),
        "machines": sorted({t["machine"] for t in timings}),
        "commits": sorted({t["commit"] for t in timings}),
        "episodes_wanted": len(comparison.jobs()),
        "episodes_done": len(results),
        "conditions": comparison.conditions(),
        "variants": variants,
        "scenarios": scenarios,
    }


def write_report(folder: Path, told: Document, videos: Mapping[str, str]) -> None:
    """Write `summary.json`, `summary.md` and `index.html`.

    Args:
        folder: where to.
        told: see `document`.
        videos: by scenario, a file of the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in (
        ("summary.json", json.dumps(told, indent=2) + "\n"),
        ("summary.md", table.markdown(told)),
        ("index.html", page.html(told, videos)),
    ):
        (folder / name).write_text(text, encoding="utf-8")
