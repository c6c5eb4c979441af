"""Text for terminals: a line of progress while driving, a table at the end."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from passpmp_ti.sim.episode import CycleInfo
    from passpmp_ti.viz.region_map import RegionMap

SPARSE = 5.0
"""Simulated seconds between lines where the output is not a terminal."""

ROWS: tuple[tuple[str, str, str, float, int], ...] = (
    ("time to the goal", "time_to_goal", "s", 1.0, 1),
    ("driven", "distance_driven", "m", 1.0, 1),
    ("mean speed under way", "mean_speed_under_way", "m/s", 1.0, 2),
    ("share of time moving", "share_moving", "%", 100.0, 0),
    ("contacts while moving", "collisions_moving", "", 1.0, 0),
    ("contacts at rest", "collisions_at_rest", "", 1.0, 0),
    ("nearest mover while moving", "nearest_approach_moving", "m", 1.0, 2),
    ("nearest fixed while moving", "nearest_fixed_moving", "m", 1.0, 2),
    ("cycles", "cycles", "", 1.0, 0),
    ("cycle time, median", "cycle_time_median", "ms", 1e3, 1),
    ("cycle time, 99 %", "cycle_time_p99", "ms", 1e3, 1),
)
"""(name, key of the summary, unit, factor, digits)."""


class Progress:
    """Tells how the drive goes: over and over in one line of a terminal, else now and then."""

    def __init__(self, stream: IO[str] | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._terminal = self._stream.isatty()
        self._first: float | None = None
        self._next = 0.0
        self._length = 0

    def see(self, info: CycleInfo) -> None:
        """Tell of one cycle of `simulate`."""
        if self._first is None:
            self._first = info.time
        elapsed = info.time - self._first
        if not self._terminal:
            if elapsed + 1e-9 < self._next:
                return
            self._next = elapsed + SPARSE
        line = progress_line(info, elapsed)
        if self._terminal:
            self._stream.write("\r" + line.ljust(self._length))
            self._length = len(line)
        else:
            self._stream.write(line + "\n")
        self._stream.flush()

    def end(self) -> None:
        """Leave the line."""
        if self._terminal and self._length:
            self._stream.write("\n")
            self._stream.flush()
            self._length = 0


def progress_line(info: CycleInfo, elapsed: float) -> str:
    """One line: time, distance to the goal, speed, decision, contacts."""
    navigator = info.navigator
    goal = navigator.record.goal
    away = math.hypot(goal[0] - info.state[0], goal[1] - info.state[1])
    moving = sum(c.moving for c in info.contacts)
    return (
        f"t {elapsed:6.1f} s   to goal {away:6.1f} m   speed"
        f" {float(navigator.robot.speed(info.state)):6.2f} m/s   {navigator.record.decision:<8}"
        f" contacts moving {moving}, at rest {len(info.contacts) - moving}"
    )


def summary_table(summaries: list[Mapping[str, Any]]) -> str:
    """The summaries of one or several episodes, one column each, aligned, with units."""
    columns = [["seed", *(name for name, *_ in ROWS)]]
    columns.append(["", *(unit for _, _, unit, *_ in ROWS)])
    for summary in summaries:
        told = [_told(summary.get(key), factor, digits) for _, key, _, factor, digits in ROWS]
        columns.append([str(summary["seed"]), *told])
    return table(list(zip(*columns, strict=True)), left=2)


def map_report(found: RegionMap) -> str:
    """The p-safe shares of a map."""
    region = found.region
    shares = (
        ("of the view", found.share_of_view),
        ("within the scan's range", found.share_in_range),
        ("of what the scan saw", found.share_of_seen),
    )
    return (
        f"{found.scenario.name}: p-safe states at {region.speed:g} m/s, heading"
        f" {math.degrees(region.heading):.0f} deg, objects of at most"
        f" {found.scenario.settings.object_speed:g} m/s\n"
        + table([(name, f"{100 * share:.1f}", "%") for name, share in shares])
    )


def cycle_report(found: Mapping[str, Any]) -> str:
    """What `measure_cycle` found, in milliseconds."""
    rows = [["[ms]", "median", "99 %", "worst"]]
    for name, spread in found["seconds"].items():
        label = "scan to trajectory" if name == "total" else f"  {name}"
        rows.append([label, *(f"{1e3 * spread[k]:.2f}" for k in ("median", "p99", "worst"))])
    return (
        f"{found['scenario']}: {found['cycles']} cycles, objects of at most"
        f" {found['object_speed']:g} m/s, {found['particles']} particles, trees of"
        f" {found['tree_nodes_median']:.0f} nodes (most: {found['tree_nodes_most']})\n"
        f"{found['machine']}, {found['cores']} cores, backend {found['backend']},"
        f" Python {found['python']}, Taichi {found['taichi']}, NumPy {found['numpy']}\n\n"
        f"{table(rows)}\n\n"
        f"median / the paper's {1e3 * found['paper_seconds']:.0f} ms (Table VII, another"
        f" machine): {found['share_of_paper']:.2f}"
    )


def table(rows: Iterable[Iterable[str]], left: int = 1) -> str:
    """Rows of cells as aligned text: the first `left` columns to the left, the others right."""
    cells = [list(row) for row in rows]
    widths = [max(len(row[n]) for row in cells) for n in range(len(cells[0]))]
    lines = []
    for row in cells:
        aligned = [
            cell.ljust(width) if n < left else cell.rjust(width)
            for n, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(aligned).rstrip())
    return "\n".join(lines)


def _told(value: float | None, factor: float, digits: int) -> str:
    return "-" if value is None else f"{factor * value:.{digits}f}"
