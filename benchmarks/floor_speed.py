"""How the length of a cycle becomes speed on the floor: drives at cycles of 2.4 to 0.05 s.

python benchmarks/floor_speed.py out/floor                 # goes on where it was stopped
python benchmarks/floor_speed.py out/floor --only-plot     # from what is there
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scenarios import table_row

import passpmp_ti as pti
from passpmp_ti.bench.kept import kept
from passpmp_ti.bench.machine import circumstances
from passpmp_ti.viz.chart import COLOURS, Chart, Line, chart_page, write_png

CYCLES = (2.4, 1.0, 0.4, 0.2, 0.1, 0.05)
TIME_STEP = 0.01
"""Divides every cycle and every primitive [s]."""
RESULT = Path(__file__).parent / "results" / "floor-speed.json"
PICTURE = Path(__file__).parents[1] / "docs" / "images" / "floor-speed.png"


@dataclass(frozen=True)
class Case:
    """A scenario with a bound on the speed of objects [m/s]; None: its own."""

    key: str
    label: str
    scenario: str
    object_speed: float | None


CASES = (
    Case("eth-2.2", "eth, bound 2.2 m/s", "eth", 2.2),
    Case("eth", "eth, its own bound, 4.59 m/s", "eth", None),
    Case("crowded-10", "crowded, bound 10 m/s", "crowded", 10.0),
    Case("crowded-20", "crowded, bound 20 m/s", "crowded", 20.0),
)


def drive(case: Case, cycle: float, seed: int) -> dict[str, Any]:
    """One episode, in simulated time: the planner always answers within its cycle."""
    scenario = pti.load_scenario(case.scenario)
    if case.object_speed is not None:
        scenario = scenario.changed(object_speed=case.object_speed)
    settings = {"cycle": cycle, "time_step": TIME_STEP}
    return dict(pti.simulate(scenario, seed=seed, settings=settings).summary())


def row_of(case: Case, cycle: float, runs: list[dict[str, Any]]) -> dict[str, Any]:
    """What the seeds of one cycle came to."""
    speeds = [run["mean_speed"] for run in runs]
    return {
        "case": case.key, "cycle": cycle, **table_row(runs),
        "speed_least": min(speeds), "speed_median": statistics.median(speeds),
        "speed_most": max(speeds),
        "times_to_goal": sorted(r["time_to_goal"] for r in runs if r["reached_goal"]),
    }  # fmt: skip


def table(rows: list[dict[str, Any]]) -> str:
    """The rows as Markdown."""
    lines = [
        "| case | cycle [s] | reached | time to goal, median / worst [s] | mean speed, all"
        " (least to most) [m/s] | contacts while moving | at rest | driven [m] | cycles |",
        "|---" * 9 + "|",
    ]
    for r in rows:
        times = "- / -"
        if r["reached"]:
            times = f"{r['time_to_goal_median']:.1f} / {r['time_to_goal_worst']:.1f}"
        lines.append(
            f"| {r['case']} | {r['cycle']:g} | {r['reached']} / {r['episodes']} | {times} |"
            f" {r['mean_speed']:.2f} ({r['speed_least']:.2f} to {r['speed_most']:.2f}) |"
            f" {r['contacts_moving']} | {r['contacts_at_rest']} | {r['metres']:.0f} |"
            f" {r['cycles']} |"
        )
    return "\n".join(lines)


def plot(rows: list[dict[str, Any]]) -> np.ndarray:
    """Speed, goals reached and time to goal over the cycle: the car above, the wheelchair below."""
    charts = []
    ticks = [(cycle, f"{cycle:g}") for cycle in sorted(CYCLES)]
    for robot, scenario in (("car", "crowded"), ("wheelchair", "eth")):
        lines = [
            (case.label, COLOURS[n], [r for r in rows if r["case"] == case.key])
            for n, case in enumerate(CASES)
            if case.scenario == scenario
        ]
        for title, field in (
            (f"{robot}: mean speed [m/s]", "mean_speed"),
            ("goals reached [%]", "share"),
            ("time to goal, median [s]", "time_to_goal_median"),
        ):
            drawn = []
            for label, colour, own in lines:
                points, spread = [], []
                for r in own:
                    told = {**r, "share": 100 * r["reached"] / r["episodes"]}[field]
                    points.append((r["cycle"], math.nan if told is None else told))
                    spread.append(_spread(r, field))
                drawn.append(Line(label=label, colour=colour, points=points, spread=spread))
            tops = [y for line in drawn for _, y in line.points if math.isfinite(y)]
            tops += [y for line in drawn for _, y in line.spread if math.isfinite(y)]
            charts.append(
                Chart(title=title, x_label="cycle [s]", x_ticks=ticks, lines=drawn,
                      y_most=1.05 * max([*tops, 0.01]))
            )  # fmt: skip
    return chart_page(charts, 3, (400, 340))


def _spread(row: dict[str, Any], field: str) -> tuple[float, float]:
    if field == "mean_speed":
        return row["speed_least"], row["speed_most"]
    if field == "time_to_goal_median" and row["times_to_goal"]:
        return row["times_to_goal"][0], row["times_to_goal"][-1]
    return math.nan, math.nan


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where each run's JSON is kept")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only-plot", action="store_true", help="no new runs")
    parser.add_argument(
        "--case", action="append", choices=[case.key for case in CASES], help="new runs of it alone"
    )
    options = parser.parse_args()
    pti.init("cpu", threads=1)
    began, done = time.monotonic(), 0
    runs: dict[tuple[str, float], list[dict[str, Any]]] = {}
    jobs = [(s, case, c) for s in range(options.seeds) for case in CASES for c in CYCLES]
    for seed, case, cycle in jobs:
        name = f"{case.key}-{cycle:g}-{seed}"
        done += 1
        new = not options.only_plot and (not options.case or case.key in options.case)
        if not new and not (options.folder / f"{name}.json").exists():
            continue
        asked = {"case": case.key, "cycle": cycle, "seed": seed, "time_step": TIME_STEP}
        row = kept(options.folder, name, asked, lambda c=case, t=cycle, s=seed: drive(c, t, s))
        runs.setdefault((case.key, cycle), []).append(row)
        print(f"{done}/{len(jobs)} {name}: {row['mean_speed']:.2f} m/s, time to goal"
              f" {row['time_to_goal']}, moving contacts {row['collisions_moving']}"
              f" ({time.monotonic() - began:.0f} s)", file=sys.stderr, flush=True)  # fmt: skip
    rows = [
        row_of(case, cycle, runs[case.key, cycle])
        for case in CASES
        for cycle in CYCLES
        if (case.key, cycle) in runs
    ]
    print(table(rows))
    RESULT.write_text(
        json.dumps({"time_step": TIME_STEP, **circumstances(1), "rows": rows}, indent=1) + "\n"
    )
    write_png(PICTURE, plot(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
