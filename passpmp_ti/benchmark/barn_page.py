"""What came of BARN, beside what others published."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from passpmp_ti.bench.machine import machine
from passpmp_ti.benchmark.barn_worlds import LONGEST, PUBLISHED, BarnWorld, score
from passpmp_ti.benchmark.jackal import JACKAL, LENGTH, WIDTH
from passpmp_ti.benchmark.tables import (
    cycle_times,
    markdown,
    median,
    share,
    told,
    told_cost,
    told_share,
)

ON_FIFTY = {
    "dwa": (0.850, 0.056, 0.094, 34.1, 0.159),
    "drl_vo": (0.936, 0.064, 0.0, 15.0, 0.372),
    "lics": (0.980, 0.018, 0.002, 7.74, 0.4889),
}
"""Success, collision, timeout, mean time [s], score (2023 rule) over the 50 public worlds x 10
trials: from the teams' files of results, see docs/barn.md."""
OURS = "passpmp-pso (this run)"


def succeeded(outcome: Mapping[str, Any]) -> bool:
    """Arrived in time, and neither the rectangle nor its discs touched anything before."""
    return bool(outcome["arrived"]) and not collided(outcome)


def collided(outcome: Mapping[str, Any]) -> bool:
    """Whether anything was touched: by the true rectangle, or by the discs that cover it."""
    touched = outcome["touched_moving"] or outcome["touched_at_rest"]
    return bool(touched or outcome["collisions_moving"] or outcome["collisions_at_rest"])


def document(
    worlds: Mapping[int, BarnWorld],
    results: Sequence[dict[str, Any]],
    published: Mapping[str, Mapping[int, Mapping[str, float]]],
    *,
    wanted: int,
    date: str,
    command: str,
) -> dict[str, Any]:
    """All that the page tells, in plain JSON.

    Args:
        worlds: by number.
        results: of the trials that were driven.
        published: results of others by planner and world.
        wanted: trials in all.
        date: of the run.
        command: that ran it.
    """
    by_world: dict[int, list[dict[str, Any]]] = {}
    for result in results:
        by_world.setdefault(int(result["scenario"].rpartition("-")[2]), []).append(result)
    lines = [_line(worlds[number], own) for number, own in sorted(by_world.items())]
    common = sorted(set(by_world) & set(next(iter(published.values()))))
    return {
        "benchmark": "barn",
        "date": date,
        "command": command,
        "machine": machine(),
        "commits": sorted({r["timings"]["commit"] for r in results}),
        "trials_done": len(results),
        "trials_wanted": wanted,
        "all": _group(worlds, results),
        "common": {
            "worlds": common,
            "ours": _group(worlds, [r for n in common for r in by_world[n]]),
            "published": {
                planner: {
                    key: _mean(of[n][key] for n in common) for key in ("success", "time", "score")
                }
                for planner, of in published.items()
            },
        },
        "cycle_ms": cycle_times(results),
        "seconds_a_trial": median(r["timings"]["seconds"] for r in results),
        "worlds": lines,
        "picture": None,
    }


def _mean(values: Iterable[float]) -> float | None:
    """Of those that are numbers: a world in which nobody succeeded has no time."""
    there = [value for value in values if np.isfinite(value)]
    return float(np.mean(there)) if there else None


def _group(worlds: Mapping[int, BarnWorld], results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Trials in numbers."""
    outcomes = [r["outcome"] for r in results]
    count = len(outcomes)
    scores = [_score(worlds, r) for r in results]
    times = [o["took"] for o in outcomes if succeeded(o)]
    return {
        "trials": count,
        "success": share(sum(map(succeeded, outcomes)), count),
        "collision": share(sum(map(collided, outcomes)), count),
        "collision_moving": share(
            sum(bool(o["touched_moving"] or o["collisions_moving"]) for o in outcomes), count
        ),
        "timeout": share(sum(not o["arrived"] and not collided(o) for o in outcomes), count),
        "time": float(np.mean(times)) if times else None,
        "score": float(np.mean(scores)) if scores else None,
        "nearest": min((o["nearest"] for o in outcomes), default=None),
        "fastest_turn": max((o["fastest_turn"] for o in outcomes), default=None),
        "slowest": max((o["took"] for o in outcomes if o["took"] is not None), default=None),
    }


def _score(worlds: Mapping[int, BarnWorld], result: Mapping[str, Any]) -> float:
    outcome = result["outcome"]
    number = int(result["scenario"].rpartition("-")[2])
    return score(succeeded(outcome), outcome["took"], worlds[number].optimal_time)


def _line(world: BarnWorld, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    outcomes = [r["outcome"] for r in results]
    return {
        "world": world.number,
        "optimal_time": world.optimal_time,
        "trials": len(outcomes),
        "successes": sum(map(succeeded, outcomes)),
        "collisions": sum(map(collided, outcomes)),
        "took": median(o["took"] for o in outcomes),
        "score": float(
            np.mean([score(succeeded(o), o["took"], world.optimal_time) for o in outcomes])
        ),
        "nearest": min(o["nearest"] for o in outcomes),
        "fastest_turn": max(o["fastest_turn"] for o in outcomes),
        "distance": median(o["distance"] for o in outcomes),
    }


def page(told_: Mapping[str, Any]) -> str:
    """The page as markdown."""
    ours, common = told_["all"], told_["common"]
    head = ("", "worlds", "trials", "success", "collision", "timeout", "time [s]", "score")
    rows = [_row(OURS, len(told_["worlds"]), ours)]
    if common["worlds"]:
        rows.append(_row(f"{OURS}, worlds that they share", len(common["worlds"]), common["ours"]))
        for planner, name in PUBLISHED.items():
            its = common["published"][planner]
            rows.append(
                (
                    f"{name}, the same worlds", str(len(common["worlds"])), "10 each",
                    f"{100 * its['success']:.1f} %", "-", "-", told(its["time"], 1),
                    told(its["score"], 3),
                )
            )  # fmt: skip
    for planner, name in PUBLISHED.items():
        success, collision, timeout, time, its_score = ON_FIFTY[planner]
        rows.append(
            (
                f"{name}, 50 public worlds", "50", "500", f"{100 * success:.1f} %",
                f"{100 * collision:.1f} %", f"{100 * timeout:.1f} %", f"{time:.1f}",
                f"{its_score:.3f}",
            )
        )  # fmt: skip
    parts = [
        "# BARN\n",
        f"{told_['trials_done']} of {told_['trials_wanted']} trials, {told_['date']}."
        " Shares with exact 95 % intervals (Clopper-Pearson). Time: mean of the successes, from"
        " when the robot has moved 0.1 m until it is within 1 m of the goal. Score: the 2023 rule,"
        " at most 0.5.\n",
        markdown(head, rows),
        _conditions(told_),
    ]
    if told_["picture"]:
        parts.append(f"![A world under way]({told_['picture']})\n")
    columns = (
        "world", "OT [s]", "trials", "successes", "collisions", "time [s]", "score",
        "nearest [m]", "fastest turn [rad/s]", "driven [m]",
    )  # fmt: skip
    lines = [
        (
            str(w["world"]), told(w["optimal_time"]), str(w["trials"]), str(w["successes"]),
            str(w["collisions"]), told(w["took"]), told(w["score"], 3), told(w["nearest"], 3),
            told(w["fastest_turn"], 1), told(w["distance"]),
        )
        for w in told_["worlds"]
    ]  # fmt: skip
    parts += ["## World by world\n", markdown(columns, lines)]
    return "\n".join([*parts, f"    {told_['command']}\n"])


def _row(name: str, worlds: int, group: Mapping[str, Any]) -> tuple[str, ...]:
    return (
        name, str(worlds), str(group["trials"]), told_share(group["success"]),
        told_share(group["collision"]), told_share(group["timeout"]), told(group["time"], 1),
        told(group["score"], 4),
    )  # fmt: skip


def _conditions(told_: Mapping[str, Any]) -> str:
    ours = told_["all"]
    text = (
        "**A kinematic re-simulation, not Gazebo.** Geometry, limits, sensor and score are the"
        " benchmark's; contact physics, wheel slip, latency and a base that does not do what it is"
        " told are not in it. The others' figures were made in Gazebo.\n\n"
        f"The robot: {LENGTH:g} x {WIDTH:g} m, judged as that rectangle and as the"
        f" {len(JACKAL.discs)} discs that cover it; {JACKAL.top_speed:g} m/s,"
        f" {JACKAL.top_turn_rate:g} rad/s, wheels {JACKAL.acceleration:g} m/s^2; 720 beams over 270"
        " degrees, 1 mm of noise, no map. Assumed: nothing moves, and the start is clear by 0.6 m."
        f" Trials differ in the noise and in the swarm's draws. A trial ends after {LONGEST:g} s.\n"
    )
    if ours["trials"]:
        text += (
            f"\nNearest to anything, the rectangle, moving: {told(ours['nearest'], 3)} m. Fastest"
            f" turn: {told(ours['fastest_turn'], 1)} rad/s. Slowest arrival:"
            f" {told(ours['slowest'], 1)} s.\n"
        )
    return text + told_cost(told_)
