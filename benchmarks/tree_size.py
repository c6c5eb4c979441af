"""What large trees buy: cost of the plan, the swarm's gap, and escapes from traps, by size.

python benchmarks/tree_size.py plans out/plans      # from fixed situations, 13 to 1e6 nodes
python benchmarks/tree_size.py traps out/traps      # whole drives; both go on where they stopped
python benchmarks/tree_size.py plans out/plans --only-plot
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import math
import statistics
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import passpmp_ti as pti
from passpmp_ti.bench.kept import kept
from passpmp_ti.bench.machine import circumstances
from passpmp_ti.bench.quality import RULES, by_size, filled_by
from passpmp_ti.bench.situations import Situation, situations_of
from passpmp_ti.planner.tree import TreeGrower
from passpmp_ti.settings import Settings
from passpmp_ti.sim.episode import CycleInfo
from passpmp_ti.sim.scenario import Scenario
from passpmp_ti.viz.chart import COLOURS, Chart, Line, chart_page, write_png

SIZES = (13, 40, 120, 400, 1_200, 4_000, 12_000, 40_000, 120_000, 400_000, 1_000_000)
FILLED = 120_000
"""Nodes of the trees from which the rules of filling are told, for sizes of a tenth at most."""
SEARCHES = 5
GIVEN_UP = 6.0
"""A robot that stood for this long in a trap is taken to stay [s]."""
RESULTS = Path(__file__).parent / "results"
PICTURES = Path(__file__).parents[1] / "docs" / "images"


@dataclass(frozen=True)
class Course:
    """A scenario, its robot and bound, and how often a situation is taken on the way [s]."""

    scenario: str
    robot: str
    object_speed: float | None
    every: float


COURSES = (
    Course("crowded", "car", 10.0, 2.0),
    Course("eth", "wheelchair", 2.2, 0.7),
    Course("u_shape", "car", None, 0.9),
)
PRIMITIVES: dict[str, dict[str, tuple[float, ...]]] = {
    "car": {
        "4 levels": (0.5, 1.0, 1.5),
        "5 levels": (0.4, 0.6, 0.8, 1.2),
        "6 levels": (0.3, 0.4, 0.5, 0.8, 1.0),
        "7 levels": (0.2, 0.3, 0.4, 0.5, 0.6, 1.0),
        "6 levels, 6 s": (0.5, 1.0, 1.5, 1.5, 1.5),
    },
    "wheelchair": {
        "4 levels": (0.4, 0.6, 1.0),
        "5 levels": (0.3, 0.4, 0.5, 0.8),
        "6 levels": (0.2, 0.3, 0.4, 0.5, 0.6),
        "7 levels": (0.2, 0.2, 0.3, 0.4, 0.4, 0.5),
        "6 levels, 4 s": (0.4, 0.6, 1.0, 1.0, 1.0),
    },
}
"""Durations after the first, which lasts one cycle [s]. The first of each robot is its default; all
but the last come to the same length."""

LEVELS = ("4 levels", "5 levels", "6 levels", "7 levels", "longer")
"""Of both robots: `longer` is the last of each."""
NODE_TICKS = [(10.0, "10"), (100.0, "100"), (1e3, "1e3"), (1e4, "1e4"), (1e5, "1e5"), (1e6, "1e6")]

TRAPS = ("u_shape", "deep_u", "nested_u", "spiral")
GUIDES = ("safe_time", "euclidean")
TREES = (
    (13, "4 levels"), (40, "4 levels"), (240, "4 levels"), (1_200, "4 levels"),
    (4_000, "4 levels"), (1_200, "5 levels"), (20_000, "5 levels"), (120_000, "6 levels"),
)  # fmt: skip
"""(capacity, primitives) of the trees that are driven with."""
PAPERS_TREES = (*TREES[:5], TREES[6])
"""Those of them that are driven with the paper's guide too."""


class GivenUp(KeyboardInterrupt):
    """Ends an episode early, with what was done so far, as Ctrl-C does."""


class Patience:
    """Watches a drive and gives it up once the robot stood too long."""

    def __init__(self) -> None:
        self._moved: float | None = None

    def __call__(self, info: CycleInfo) -> None:
        if self._moved is None or not info.navigator.robot.at_rest(info.state):
            self._moved = info.time
        if info.time - self._moved > GIVEN_UP:
            raise GivenUp


def escape(trap: str, guide: str, capacity: int, levels: str, seed: int) -> dict[str, Any]:
    """One drive into a trap, and perhaps out of it."""
    settings = {"guide": guide, "capacity": capacity, "primitives": PRIMITIVES["car"][levels]}
    scenario = replace(pti.load_scenario(trap), duration=60.0)
    episode = pti.simulate(scenario, seed=seed, settings=settings, on_cycle=Patience())
    nodes = [r.tree_nodes for r in episode.records if r.tree_nodes]
    return {**episode.summary(), "tree_nodes_median": statistics.median(nodes or [0])}


def measured(situation: Situation, settings: Settings) -> dict[str, Any]:
    """Trees of every size from one situation, and what other rules would have filled them with."""
    whole = situation.grow(TreeGrower(situation.robot, settings.changed(capacity=FILLED)))
    sizes = [size for size in SIZES if size <= FILLED // 10]
    return {
        "here": situation.here,
        "sizes": by_size(situation, settings, SIZES, SEARCHES),
        "rules": {rule: filled_by(whole, situation.robot, settings, sizes, rule) for rule in RULES},
    }


@dataclass
class Drive:
    """One drive along a course; it is driven when its situations are first asked for."""

    course: Course
    seed: int
    most: int

    @functools.cached_property
    def scenario(self) -> Scenario:
        scenario = pti.load_scenario(self.course.scenario)
        if self.course.object_speed is None:
            return scenario
        return scenario.changed(object_speed=self.course.object_speed)

    @functools.cached_property
    def situations(self) -> list[Situation]:
        return situations_of(self.scenario, self.course.every, self.most, self.seed)

    def asked(self, n: int, levels: str) -> dict[str, Any]:
        """What is measured in the n-th situation, ready for JSON."""
        return {
            "scenario": self.course.scenario, "seed": self.seed, "situation": n, "levels": levels,
            "object_speed": self.scenario.settings.object_speed,
            "primitives": PRIMITIVES[self.course.robot][levels],
        }  # fmt: skip

    def measured(self, n: int, levels: str) -> dict[str, Any]:
        """See `measured`; no sizes where the drive was over before."""
        if n >= len(self.situations):
            return {"sizes": []}
        primitives = PRIMITIVES[self.course.robot][levels]
        return measured(self.situations[n], self.scenario.settings.changed(primitives=primitives))


def plans(options: argparse.Namespace) -> None:
    """Cost of plans by the size of the tree, from situations of recorded drives."""
    found: list[dict[str, Any]] = []
    began = time.monotonic()
    for course in COURSES:
        for seed in range(options.seeds):
            drive = Drive(course, seed, options.situations)
            for n in range(options.situations):
                for levels in PRIMITIVES[course.robot]:
                    name = f"{course.scenario}-{seed}-{n}-{levels.replace(' ', '_')}"
                    if options.only_plot and not (options.folder / f"{name}.json").exists():
                        continue
                    measure = functools.partial(drive.measured, n, levels)
                    row = kept(options.folder, name, drive.asked(n, levels), measure)
                    if row["sizes"]:
                        found.append(row)
                seconds = time.monotonic() - began
                print(f"{course.scenario} {seed}: {n + 1} of {options.situations} situations"
                      f" ({seconds:.0f} s)", file=sys.stderr, flush=True)  # fmt: skip
    rows = [
        row
        for course in COURSES
        for levels in LEVELS
        for row in rows_of(found, course.scenario, levels)
    ]
    print(plan_table(rows))
    print()
    print(swarm_table(rows, "u_shape", LEVELS[:4]))
    print(f"\n{rule_table(found)}\n\n{notes(found)}")
    write_png(PICTURES / "tree-size.png", plan_charts(rows))
    (RESULTS / "tree-size-plans.json").write_text(
        json.dumps({"sizes": SIZES, **circumstances(1), "rows": rows}, indent=1) + "\n"
    )


def rows_of(found: Sequence[dict[str, Any]], scenario: str, levels: str) -> list[dict[str, Any]]:
    """Medians over the situations of a scenario, one row a size."""
    longer = levels == "longer"
    own = [
        f for f in found
        if f["scenario"] == scenario and ("," in f["levels"] if longer else f["levels"] == levels)
    ]  # fmt: skip
    least = {key(f): min(row["best"] for row in f["sizes"]) for f in own}
    if not longer:
        # all trees of one length are measured by the best plan of any of them
        for f in found:
            if "," not in f["levels"] and key(f) in least:
                best = min(row["best"] for row in f["sizes"])
                least[key(f)] = min(least[key(f)], best)
    rows = []
    for k, size in enumerate(SIZES):
        at = [(f, f["sizes"][k]) for f in own]
        if not at:
            break
        misses = [cost - row["best"] for _, row in at for cost in row["swarm"]]
        gains = [
            (f["here"] - row["best"]) / (f["here"] - least[key(f)])
            for f, row in at
            if f["here"] - least[key(f)] > 0.05
        ]
        shares = [
            (cost - row["best"]) / (row["median_leaf"] - row["best"])
            for _, row in at
            for cost in row["swarm"]
            if row["median_leaf"] > row["best"]
        ]
        middle = statistics.median
        rows.append(
            {
                "scenario": scenario, "levels": levels, "capacity": size, "situations": len(at),
                "nodes": middle(row["nodes"] for _, row in at),
                "depth": middle(row["depth"] for _, row in at),
                "cut": sum(not row["whole"] for _, row in at),
                "relative_cost": middle(row["best"] / least[key(f)] for f, row in at),
                "excess": middle(row["best"] - least[key(f)] for f, row in at),
                "excess_mean": statistics.mean(row["best"] - least[key(f)] for f, row in at),
                "gain": middle(gains) if gains else None,
                "tree_ms": 1e3 * middle(row["tree"] for _, row in at),
                "tree_ms_worst": 1e3 * max(row["tree"] for _, row in at),
                "scan_ms": 1e3 * middle(row["scan"] for _, row in at),
                "search_ms": 1e3 * middle(row["search"] for _, row in at),
                "swarm_missed": float(np.mean([m > 1e-6 for m in misses])),
                "swarm_excess_mean": float(np.mean(misses)),
                "swarm_excess_p95": float(np.quantile(misses, 0.95)),
                "swarm_share_mean": float(np.mean(shares)) if shares else 0.0,
                **{
                    f"{rule}_excess_mean": statistics.mean(
                        f["rules"][rule][k] - least[key(f)] for f, _ in at
                    )
                    for rule in RULES
                    if size <= FILLED // 10
                },
            }
        )  # fmt: skip
    return rows


def key(found: dict[str, Any]) -> tuple[str, int, int]:
    """Which situation it is."""
    return found["scenario"], found["seed"], found["situation"]


def plan_table(rows: list[dict[str, Any]]) -> str:
    """What plans cost more than the best one known: a line a size, a column a kind of tree."""
    lines = [f"| scenario | nodes, at most | {' | '.join(LEVELS)} |", "|---" * 7 + "|"]
    for course in COURSES:
        for size in SIZES:
            cells = []
            for levels in LEVELS:
                r = row_at(rows, course.scenario, levels, size)
                whole = r is None or (r["cut"] == 0 and r["nodes"] < 0.5 * size)
                cells.append("" if r is None or whole else f"{r['excess_mean']:.3f}")
            if any(cells):
                lines.append(f"| `{course.scenario}` | {size:,} | {' | '.join(cells)} |")
        ends = [row_at(rows, course.scenario, levels, SIZES[-1]) for levels in LEVELS]
        told = (f"{r['excess_mean']:.3f} ({r['nodes']:,.0f} nodes)" if r else "" for r in ends)
        lines.append(f"| `{course.scenario}` | more | {' | '.join(told)} |")
    return "\n".join(lines)


def swarm_table(rows: list[dict[str, Any]], scenario: str, kinds: Sequence[str]) -> str:
    """The swarm beside a look at all leaves, and what each step takes: a line a size."""
    lines = [
        "| tree | nodes, at most | nodes | depth | cost, relative | tree [ms] | all leaves [ms] |"
        " swarm [ms] | swarm missed [%] | swarm's excess, mean / 95 % [s] |",
        "|---" * 10 + "|",
    ]
    for levels in kinds:
        for size in SIZES:
            r = row_at(rows, scenario, levels, size)
            if r is None or (r["cut"] == 0 and r["nodes"] < 0.3 * size):
                continue
            lines.append(
                f"| {levels} | {size:,} | {r['nodes']:,.0f} | {r['depth']:g} |"
                f" {r['relative_cost']:.3f} | {r['tree_ms']:.1f} | {r['scan_ms']:.1f} |"
                f" {r['search_ms']:.1f} | {100 * r['swarm_missed']:.0f} |"
                f" {r['swarm_excess_mean']:.3f} / {r['swarm_excess_p95']:.3f} |"
            )
    return "\n".join(lines)


def rule_table(found: Sequence[dict[str, Any]]) -> str:
    """What other rules change in the trees that were cut, beside the order of the nodes."""
    sizes = [size for size in SIZES if size <= FILLED // 10]
    lines = [
        "| rule | scenario | trees | mean change [s] | better by more than 1 ms | worse |"
        " from / to [s] |",
        "|---" * 7 + "|",
    ]
    for rule in RULES[1:]:
        for course in COURSES:
            changes = [
                f["rules"][rule][k] - f["rules"]["order"][k]
                for f in found
                for k in range(len(sizes))
                if f["scenario"] == course.scenario and not f["sizes"][k]["whole"]
            ]
            better, worse = (sum(s * c > 1e-3 for c in changes) for s in (-1, 1))
            lines.append(
                f"| {rule} | `{course.scenario}` | {len(changes)} | {np.mean(changes):+.4f} |"
                f" {better} | {worse} | {min(changes):+.2f} / {max(changes):+.2f} |"
            )
    return "\n".join(lines)


def notes(found: Sequence[dict[str, Any]]) -> str:
    """How often a larger tree had a worse plan, and how often the swarm missed in small trees."""
    steps = [
        after["best"] - before["best"]
        for f in found
        for before, after in itertools.pairwise(f["sizes"])
    ]
    small = [
        cost > row["best"] + 1e-6
        for f in found
        for row in f["sizes"]
        for cost in row["swarm"]
        if row["capacity"] <= 1_200
    ]
    return (
        f"steps to a larger size: {len(steps)}, worse by more than 1 ms: "
        f"{sum(s > 1e-3 for s in steps)}, by at most {max(steps):.3f} s\n"
        f"searches in trees of at most 1,200: {len(small)}, missed: {sum(small)}"
    )


def row_at(
    rows: list[dict[str, Any]], scenario: str, levels: str, size: int
) -> dict[str, Any] | None:
    """The row of a scenario, a kind of tree and a size."""
    wanted = (scenario, levels, size)
    return next((r for r in rows if (r["scenario"], r["levels"], r["capacity"]) == wanted), None)


def plan_charts(rows: list[dict[str, Any]]) -> np.ndarray:
    """Above what plans cost more than the best one known, below what the swarm adds to that."""
    charts = []
    for title, field in (
        ("best plan, excess [s]", "excess_mean"),
        ("the swarm's on top [s]", "swarm_excess_mean"),
    ):
        for course in COURSES:
            drawn = []
            for colour, levels in zip(COLOURS, LEVELS[:-1], strict=False):
                own = [r for r in rows if (r["scenario"], r["levels"]) == (course.scenario, levels)]
                # beyond the size of whole trees nothing changes
                cut = sum(r["cut"] > 0 for r in own)
                points = [(float(r["capacity"]), r[field]) for r in own[: cut + 1]]
                drawn.append(Line(label=levels, colour=colour, points=points))
            most = 1.05 * max([0.01, *(y for line in drawn for _, y in line.points)])
            charts.append(
                Chart(
                    title=f"{course.scenario}: {title}", x_label="nodes, at most", lines=drawn,
                    x_ticks=NODE_TICKS, y_most=most,
                )
            )  # fmt: skip
    return chart_page(charts, 3, (400, 340))


def trap_charts(rows: list[dict[str, Any]]) -> np.ndarray:
    """Goals reached and times to the goal with the default guide."""
    charts = []
    along = [tree for tree in TREES if tree != (1_200, "5 levels")]
    for title in ("goals reached [%]", "time to goal, median [s]"):
        drawn = []
        for colour, trap in zip(COLOURS, TRAPS, strict=False):
            points, spread = [], []
            for capacity, levels in along:
                wanted = (trap, GUIDES[0], capacity, levels)
                for r in rows:
                    if (r["trap"], r["guide"], r["capacity"], r["levels"]) != wanted:
                        continue
                    timed, times = title.startswith("time"), r["times"] or [math.nan]
                    share = 100 * r["escapes"] / r["runs"]
                    middle = statistics.median(times)
                    points.append((float(capacity), middle if timed else share))
                    spread.append((times[0], times[-1]) if timed else (math.nan, math.nan))
            drawn.append(Line(label=trap, colour=colour, points=points, spread=spread))
        tops = [y for line in drawn for _, y in (*line.points, *line.spread) if math.isfinite(y)]
        charts.append(
            Chart(
                title=title, x_label="nodes, at most", lines=drawn,
                x_ticks=[*NODE_TICKS[:-1], (2e5, "")], y_most=1.05 * max([*tops, 1.0]),
            )
        )  # fmt: skip
    return chart_page(charts, 2, (600, 380))


def traps(options: argparse.Namespace) -> None:
    """Escapes and times to the goal by the size of the tree."""
    found: dict[tuple[str, str, int, str], list[dict[str, Any]]] = {}
    jobs = [
        (seed, guide, trap, capacity, levels)
        for seed in range(options.seeds)
        for guide in GUIDES
        for trap in TRAPS
        for capacity, levels in TREES
        if guide == "safe_time" or (capacity, levels) in PAPERS_TREES
    ]
    # what takes longest comes last, so that a study that is stopped has the rest
    jobs.sort(key=lambda job: job[3] > 20_000)
    began = time.monotonic()
    for done, (seed, guide, trap, capacity, levels) in enumerate(jobs, 1):
        name = f"{trap}-{guide}-{capacity}-{levels[0]}-{seed}"
        new = not options.only_plot and options.guide in (None, guide)
        if not new and not (options.folder / f"{name}.json").exists():
            continue
        asked = {
            "trap": trap, "guide": guide, "capacity": capacity, "levels": levels, "seed": seed,
        }  # fmt: skip
        job = (trap, guide, capacity, levels, seed)
        row = kept(options.folder, name, asked, lambda job=job: escape(*job))
        found.setdefault((trap, guide, capacity, levels), []).append(row)
        print(f"{done}/{len(jobs)} {name}: {row['time_to_goal']}, moving contacts"
              f" {row['collisions_moving']} ({time.monotonic() - began:.0f} s)",
              file=sys.stderr, flush=True)  # fmt: skip
    rows = []
    for guide in GUIDES:
        for trap in TRAPS:
            for capacity, levels in TREES:
                runs = found.get((trap, guide, capacity, levels))
                if not runs:
                    continue
                times = sorted(r["time_to_goal"] for r in runs if r["reached_goal"])
                rows.append(
                    {
                        "trap": trap, "guide": guide, "capacity": capacity, "levels": levels,
                        "runs": len(runs), "escapes": len(times), "times": times,
                        "time_median": statistics.median(times) if times else None,
                        "nodes": statistics.median(r["tree_nodes_median"] for r in runs),
                        "contacts_moving": sum(r["collisions_moving"] for r in runs),
                        "metres": sum(r["distance_driven"] for r in runs),
                    }
                )  # fmt: skip
    print(trap_table(rows))
    write_png(PICTURES / "tree-size-traps.png", trap_charts(rows))
    (RESULTS / "tree-size-traps.json").write_text(
        json.dumps({**circumstances(1), "rows": rows}, indent=1) + "\n"
    )


def trap_table(rows: list[dict[str, Any]]) -> str:
    """One line a trap and guide, one column a tree: escapes, and the median time to the goal."""
    heads = [f"{capacity:,}, {levels}" for capacity, levels in TREES]
    lines = [f"| trap | guide | {' | '.join(heads)} |", "|---" * (2 + len(heads)) + "|"]
    cells = {(r["guide"], r["trap"], r["capacity"], r["levels"]): r for r in rows}
    for guide in GUIDES:
        for trap in TRAPS:
            told = []
            for tree in TREES:
                r = cells.get((guide, trap, *tree))
                took = f", {r['time_median']:.1f} s" if r and r["escapes"] else ""
                told.append(f"{r['escapes']} / {r['runs']}{took}" if r else "")
            lines.append(f"| `{trap}` | `{guide}` | {' | '.join(told)} |")
    runs, contacts = (sum(r[field] for r in rows) for field in ("runs", "contacts_moving"))
    metres = sum(r["metres"] for r in rows)
    lines.append(f"\n{runs} runs, {metres:.0f} m, contacts while moving: {contacts}")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("plans", "traps"))
    parser.add_argument("folder", type=Path, help="where each run's JSON is kept")
    parser.add_argument("--seeds", type=int, help="drives; 1 for plans, 3 for traps")
    parser.add_argument("--situations", type=int, default=12, help="taken of each drive")
    parser.add_argument("--guide", choices=GUIDES, help="traps: new runs with it alone")
    parser.add_argument("--only-plot", action="store_true", help="no new runs")
    options = parser.parse_args()
    options.seeds = options.seeds or {"plans": 1, "traps": 3}[options.what]
    pti.init("cpu", threads=1)
    (plans if options.what == "plans" else traps)(options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
