"""Drive shipped scenarios over many seeds and report what happened, metres beside every zero.

python benchmarks/scenarios.py crowded --seeds 20 --object-speed 10
python benchmarks/scenarios.py eth --seeds 20 --set object_speed=2.2 --json eth-2.2.json
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import statistics
import sys
from pathlib import Path


def drive(job: tuple[str, float | None, dict, int]) -> dict:
    """One episode in a process of its own: (scenario, bound, settings, seed) -> summary."""
    import passpmp_ti as pti

    name, object_speed, settings, seed = job
    pti.init("cpu", threads=1)
    scenario = pti.load_scenario(name)
    if object_speed is not None:
        scenario = scenario.changed(object_speed=object_speed)
    episode = pti.simulate(scenario, seed=seed, settings=settings or None)
    return dict(episode.summary())


def table_row(rows: list[dict]) -> dict:
    """What a campaign comes to."""
    reached = [r for r in rows if r["reached_goal"]]
    times = [r["time_to_goal"] for r in reached]
    moving = sum(r["duration"] * r["share_moving"] for r in rows)
    metres = sum(r["distance_driven"] for r in rows)
    return {
        "episodes": len(rows),
        "reached": len(reached),
        "time_to_goal_median": statistics.median(times) if times else None,
        "time_to_goal_worst": max(times) if times else None,
        "mean_speed": metres / sum(r["duration"] for r in rows),
        "mean_speed_under_way": metres / moving if moving else 0.0,
        "contacts_moving": sum(r["collisions_moving"] for r in rows),
        "contacts_moving_beyond_bound": sum(r["collisions_moving_beyond_bound"] for r in rows),
        "contacts_at_rest": sum(r["collisions_at_rest"] for r in rows),
        "contacts_fixed": sum(r["collisions_fixed"] for r in rows),
        "metres": metres,
        "seconds_moving": moving,
        "cycles": sum(r["cycles"] for r in rows),
        "held_unclear": sum(r.get("held_unclear", 0) for r in rows),
        "broken_premises": sum(r["broken_premises"] for r in rows),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenario")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--object-speed", type=float, help="bound, and movers slowed to it [m/s]")
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE")
    parser.add_argument("--workers", type=int, default=multiprocessing.cpu_count())
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    settings = {}
    for item in options.set:
        field, _, value = item.partition("=")
        settings[field] = json.loads(value)
    jobs = [
        (options.scenario, options.object_speed, settings, seed) for seed in range(options.seeds)
    ]
    # spawn: Taichi's threads do not survive a fork
    with multiprocessing.get_context("spawn").Pool(options.workers) as pool:
        rows = []
        for row in pool.imap(drive, jobs):
            rows.append(row)
            print(f"\r{len(rows)}/{len(jobs)} episodes", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    result = table_row(rows)
    for key, value in result.items():
        print(f"{key:30s} {value:.3f}" if isinstance(value, float) else f"{key:30s} {value}")
    if options.json:
        options.json.write_text(
            json.dumps({"scenario": options.scenario, "object_speed": options.object_speed,
                        "settings": settings, **result, "rows": rows}, indent=1)
        )  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
