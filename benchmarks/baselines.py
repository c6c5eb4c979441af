"""Drive scenarios with each planner and compare what became of it.

python benchmarks/baselines.py --seeds 20
python benchmarks/baselines.py --scenarios crowded --planners iss dwa --seeds 3 --no-write
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import statistics
import sys
from pathlib import Path

PLANNERS = ("passpmp-pso", "passpmp", "iss", "dwa", "mppi", "viability")
SCENARIOS = ("crowded", "u_shape", "corridor_person", "narrow_passage", "simple")
PATROL = Path(__file__).parents[1] / "examples" / "patrol.yaml"
RESULTS = Path(__file__).parent / "results" / "baselines.json"
PAGE = Path(__file__).parents[1] / "docs" / "baselines.md"
BEGIN, END = "<!-- benchmarks/baselines.py -->\n", "<!-- end -->\n"


def drive(job: tuple[str, str, int, float | None]) -> dict:
    """One episode: (scenario, planner, seed, its longest [s]) -> summary, or why none can be."""
    from dataclasses import replace

    import passpmp_ti as pti
    from passpmp_ti.sim.planners import planner_for

    name, planner, seed, duration = job
    pti.init("cpu", threads=1)
    scenario = pti.load_scenario(name)
    if duration is not None:
        scenario = replace(scenario, duration=min(duration, scenario.duration))
    told = {"scenario": Path(name).stem, "planner": planner, "seed": seed}
    try:
        made = planner_for(planner, scenario, seed)
    except ValueError as refused:
        return {**told, "refused": str(refused)}
    episode = pti.simulate(scenario, seed=seed, planner=made)
    return {**episode.summary(), **told}


def table(rows: list[dict]) -> str:
    """Markdown, a line for each scenario and planner."""
    lines = [
        "| scenario | planner | goals | contacts while moving | at rest"
        " | time to goal, median [s] | metres driven | cycle, median [ms] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    groups: dict[tuple[str, str], list[dict]] = {}
    for row in rows:
        groups.setdefault((row["scenario"], row["planner"]), []).append(row)
    for (scenario, planner), found in groups.items():
        if "refused" in found[0]:
            lines.append(f"| {scenario} | {planner} | its future is not known | | | | | |")
            continue
        times = [r["time_to_goal"] for r in found if r["reached_goal"]]
        cells = (
            scenario,
            planner,
            f"{len(times)} of {len(found)}",
            sum(r["collisions_moving"] for r in found),
            sum(r["collisions_at_rest"] for r in found),
            f"{statistics.median(times):.1f}" if times else "-",
            f"{sum(r['distance_driven'] for r in found):.0f}",
            f"{1e3 * statistics.median(r['cycle_time_median'] for r in found):.1f}",
        )
        lines.append("| " + " | ".join(str(cell) for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def write(rows: list[dict], note: str) -> None:
    """Keep the results, and put the table into the page."""
    RESULTS.write_text(json.dumps({"note": note, "rows": rows}, indent=1) + "\n")
    page = PAGE.read_text()
    before, _, rest = page.partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before}{BEGIN}\n{table(rows)}\n{note}\n\n{END}{after}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenarios", nargs="+", default=[*SCENARIOS, str(PATROL)])
    parser.add_argument("--planners", nargs="+", default=PLANNERS, choices=PLANNERS)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--duration", type=float, help="longest episode [s]")
    parser.add_argument("--workers", type=int, default=multiprocessing.cpu_count())
    parser.add_argument("--no-write", action="store_true", help="only print the table")
    options = parser.parse_args()
    jobs = [
        (scenario, planner, seed, options.duration)
        for scenario in options.scenarios
        for planner in options.planners
        for seed in range(options.seeds)
    ]
    # spawn: Taichi's threads do not survive a fork
    with multiprocessing.get_context("spawn").Pool(options.workers) as pool:
        rows = []
        for row in pool.imap(drive, jobs):
            rows.append(row)
            print(f"\r{len(rows)}/{len(jobs)} episodes", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    print(table(rows))
    if not options.no_write:
        longest = "the scenario's own" if options.duration is None else f"{options.duration:g} s"
        write(rows, f"Seeds 0 to {options.seeds - 1}; longest episode: {longest}.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
