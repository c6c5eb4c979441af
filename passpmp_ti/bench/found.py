"""What a benchmark found: rows for people, ratios for the comparison with the last result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passpmp_ti.bench.machine import told
from passpmp_ti.viz.report import table

if TYPE_CHECKING:
    from passpmp_ti.sim.scenario import Scenario

Row = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Options:
    """What the command line asks of a benchmark."""

    quick: bool = False
    threads: int | None = None
    """Of the kernels and of all rivals that can have several; None: every core."""
    limit: Path | None = None
    """Folder of the C++ that is compared with."""
    sizes: tuple[int, ...] | None = None
    """States, nodes or capacities; None: the benchmark's own."""
    cycles: int | None = None
    """Of `cycle`, `modes` and `anytime`; None: the benchmark's own number."""
    deadline: float | None = None
    """Of a cycle of `anytime` [s]; None: its own."""
    seed: int = 0
    scenario: Scenario | None = None
    """Driven by `cycle`, `modes` or `anytime` in place of its own scenes."""
    see: Callable[[str], None] = lambda _: None
    """Told what is being measured."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """One benchmark's outcome."""

    title: str
    rows: list[dict[str, Any]]
    """Each row's cells by their heading, which names the unit."""
    ratios: dict[str, float]
    """How many times as fast, or as small, as what stands beside it in this run: more is better."""
    notes: list[str] = field(default_factory=list)
    details: dict[str, Any] = field(default_factory=dict)
    """More figures, for the file alone."""


def document(name: str, found: Found, circumstances: Mapping[str, Any]) -> dict[str, Any]:
    """Everything that is written to a file."""
    return {
        "benchmark": name,
        **circumstances,
        "title": found.title,
        "rows": found.rows,
        "ratios": found.ratios,
        "notes": found.notes,
        **({"details": found.details} if found.details else {}),
    }


def report(result: Mapping[str, Any]) -> str:
    """A result as text: what was measured, on what, the table, the notes."""
    lines = [f"{result['benchmark']}: {result['title']}", told(result), ""]
    if result["rows"]:
        lines += [aligned(result["rows"]), ""]
    return "\n".join([*lines, *result["notes"]]).rstrip()


def aligned(rows: Sequence[Row]) -> str:
    """Rows as a table; a row may lack a column."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    words = [name for name in columns if any(isinstance(row.get(name), str) for row in rows)]
    columns = [*words, *(name for name in columns if name not in words)]
    cells = [columns, *([told_number(row.get(name)) for name in columns] for row in rows)]
    return table(cells, left=len(words))


def told_number(value: object) -> str:
    """A figure as a table shows it."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) else str(value)
