"""What came of the crowd: a table by number of walkers, the published figures beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from passpmp_ti.bench.machine import machine
from passpmp_ti.benchmark.crowd_world import DURATION, ROBOT
from passpmp_ti.benchmark.tables import (
    cycle_times,
    markdown,
    median,
    share,
    told,
    told_cost,
    told_share,
)
from passpmp_ti.compare.job import Result

PUBLISHED: Mapping[int, tuple[int, int, int]] = {
    10: (84, 1, 131),
    20: (73, 0, 161),
    30: (69, 0, 186),
}
"""By number of walkers: reached [%], collided [%], mean time [s] of occlusion-cbf's unicycle, on a
set-up like this one."""
WANTED: Mapping[int, tuple[int, int]] = {10: (95, 115), 20: (90, 135), 30: (85, 160)}
"""By number of walkers: reached at least [%], in at most so long on average [s]."""


def document(
    results: Sequence[Result],
    counts: Sequence[int],
    variants: Sequence[str],
    *,
    wanted: int,
    world: Mapping[str, Any],
    date: str,
    command: str,
) -> dict[str, Any]:
    """All that the page tells, in plain JSON.

    Args:
        results: of the trials that were driven.
        counts: of walkers, in the order in which they are told.
        variants: modes and planners, likewise.
        wanted: trials in all.
        world: what `crowd` was told of all of them.
        date: of the run.
        command: that ran it.
    """
    return {
        "benchmark": "crowd",
        "date": date,
        "command": command,
        "world": dict(world),
        "machine": machine(),
        "commits": sorted({r["timings"]["commit"] for r in results}),
        "trials_done": len(results),
        "trials_wanted": wanted,
        "groups": {
            variant: {
                str(count): _group([r for r in results if _is(r, count, variant)])
                for count in counts
            }
            for variant in variants
        },
        "published": {str(count): list(figures) for count, figures in PUBLISHED.items()},
        "wanted": {str(count): list(figures) for count, figures in WANTED.items()},
        "cycle_ms": cycle_times(results),
        "seconds_a_trial": median(r["timings"]["seconds"] for r in results),
        "trials": [
            {key: r[key] for key in ("scenario", "variant", "seed", "outcome")} for r in results
        ],
        "picture": None,
    }


def _is(result: Mapping[str, Any], count: int, variant: str) -> bool:
    return bool(result["scenario"] == f"crowd-{count}" and result["variant"] == variant)


def _group(results: Sequence[Result]) -> dict[str, Any]:
    outcomes = [r["outcome"] for r in results]
    count = len(outcomes)
    times = [o["time_to_goal"] for o in outcomes if o["reached_goal"]]
    near = [o["nearest_approach_moving"] for o in outcomes]
    return {
        "trials": count,
        "reached": share(sum(o["reached_goal"] for o in outcomes), count),
        "moving": share(sum(o["collisions_moving"] > 0 for o in outcomes), count),
        "contacts_moving": sum(o["collisions_moving"] for o in outcomes),
        "at_rest": share(sum(o["collisions_at_rest"] > 0 for o in outcomes), count),
        "contacts_at_rest": sum(o["collisions_at_rest"] for o in outcomes),
        "untouched": share(
            sum(
                o["reached_goal"] and o["collisions_moving"] + o["collisions_at_rest"] == 0
                for o in outcomes
            ),
            count,
        ),
        "mean_time": float(np.mean(times)) if times else None,
        "longest_time": max(times, default=None),
        "metres": sum(o["distance_driven"] for o in outcomes),
        "share_moving": _mean([o["share_moving"] for o in outcomes]),
        "stepped_out": _mean([o["stepped_out"] for o in outcomes]),
        "nearest": min((gap for gap in near if gap is not None), default=None),
        "broken_premises": sum(o["broken_premises"] for o in outcomes),
        "lost_scans": sum(o["lost_scans"] for o in outcomes),
    }


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def page(told_: Mapping[str, Any]) -> str:
    """The page as markdown."""
    parts = [
        "# A route through a crowd\n",
        f"{told_['trials_done']} of {told_['trials_wanted']} trials, {told_['date']}. Trials in"
        " which it happened, with exact 95 % intervals (Clopper-Pearson). Reached: at rest at the"
        f" last goal within {DURATION:g} s. Time: mean of those that reached it. Published:"
        " occlusion-cbf, on a set-up that is like this one but not the same.\n",
    ]
    for variant, groups in told_["groups"].items():
        there = {n: group for n, group in groups.items() if group["trials"]}
        if there:
            parts += [f"## {variant}\n", _outcomes(there), _details(there)]
    parts.append(_conditions(told_))
    if told_["picture"]:
        parts.append(f"![Under way]({told_['picture']})\n")
    parts += [_failures(told_), f"    {told_['command']}\n"]
    return "\n".join(part for part in parts if part)


def _outcomes(groups: Mapping[str, Mapping[str, Any]]) -> str:
    head = (
        "walkers", "trials", "contact while moving", "reached", "time [s]", "wanted",
        "published: reached, collided, time",
    )  # fmt: skip
    return markdown(
        head,
        [
            (
                n, str(g["trials"]), told_share(g["moving"]), told_share(g["reached"]),
                told(g["mean_time"], 1), _wanted(int(n)), _published(int(n)),
            )
            for n, g in groups.items()
        ],
    )  # fmt: skip


def _details(groups: Mapping[str, Mapping[str, Any]]) -> str:
    head = (
        "walkers", "run into at rest", "contacts at rest", "reached untouched", "longest [s]",
        "driven [m]", "moving", "stepped out, of 6", "nearest, moving [m]",
    )  # fmt: skip
    return markdown(
        head,
        [
            (
                n, told_share(g["at_rest"]), str(g["contacts_at_rest"]),
                told_share(g["untouched"]), told(g["longest_time"], 1), told(g["metres"], 0),
                f"{100 * g['share_moving']:.0f} %", told(g["stepped_out"], 1),
                told(g["nearest"], 2),
            )
            for n, g in groups.items()
        ],
    )  # fmt: skip


def _wanted(count: int) -> str:
    if count not in WANTED:
        return "-"
    reached, time = WANTED[count]
    return f"0 contacts, >= {reached} %, <= {time} s"


def _published(count: int) -> str:
    if count not in PUBLISHED:
        return "-"
    reached, collided, time = PUBLISHED[count]
    return f"{reached} %, {collided} %, {time} s"


def _conditions(told_: Mapping[str, Any]) -> str:
    groups = [g for own in told_["groups"].values() for g in own.values() if g["trials"]]
    tells = {
        "sensor": "tells that occluders stay",
        "none": "tells nothing: occluders too may move",
    }[told_["world"]["labels"]]
    ground = "walled" if told_["world"]["walled"] else "open ground, which the robot may leave"
    return (
        f"The robot: a disc of {ROBOT.radius:g} m, two wheels {ROBOT.track:g} m apart,"
        f" {ROBOT.top_speed:g} m/s, {ROBOT.acceleration:g} m/s^2. Its range finder {tells}. The"
        f" square is {ground}. Nobody reacts to the robot, and who walks into it while it stands"
        " walks on through it.\n\n"
        f"Cycles in which a scan broke a premise: {sum(g['broken_premises'] for g in groups)};"
        f" scans that were not believed: {sum(g['lost_scans'] for g in groups)}.\n"
        + told_cost(told_)
    )


def _failures(told_: Mapping[str, Any]) -> str:
    """The trials that did not reach the goal, or were touched while moving."""
    rows = [
        (
            t["scenario"], t["variant"], str(t["seed"]), str(o["collisions_moving"]),
            f"({o['place'][0]:.1f}, {o['place'][1]:.1f})", f"{100 * o['share_moving']:.0f} %",
            str(o["collisions_at_rest"]), told(o["touched_for"], 0),
        )
        for t in told_["trials"]
        if not (o := t["outcome"])["reached_goal"] or o["collisions_moving"]
    ]  # fmt: skip
    if not rows:
        return ""
    head = (
        "not reached, or touched", "variant", "seed", "contacts while moving", "ended at",
        "moving", "contacts at rest", "touched for [s]",
    )  # fmt: skip
    return "## What went wrong\n\n" + markdown(head, rows)
