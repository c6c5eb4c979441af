"""What came of DynaBARN, by class and sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from passpmp_ti.bench.machine import machine
from passpmp_ti.benchmark.dynabarn_worlds import BOUNDS, LONGEST, class_of
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


def moving(outcome: Mapping[str, Any]) -> bool:
    """Whether anything touched the moving robot: its rectangle, or the discs that cover it."""
    return bool(outcome["touched_moving"] or outcome["collisions_moving"])


def at_rest(outcome: Mapping[str, Any]) -> bool:
    """Whether anything ran into the standing robot."""
    return bool(outcome["touched_at_rest"] or outcome["collisions_at_rest"])


def document(
    results: Sequence[dict[str, Any]],
    sensors: Sequence[str],
    *,
    wanted: int,
    date: str,
    command: str,
) -> dict[str, Any]:
    """All that the page tells, in plain JSON.

    Args:
        results: of the trials that were driven.
        sensors: in the order in which they are told.
        wanted: trials in all.
        date: of the run.
        command: that ran it.
    """
    groups = {
        one: {
            class_: _group(
                [r for r in results if r["variant"] == one and class_of(_world(r)) == class_]
            )
            for class_ in BOUNDS
        }
        for one in sensors
    }
    worlds = sorted({_world(r) for r in results})
    return {
        "benchmark": "dynabarn",
        "date": date,
        "command": command,
        "machine": machine(),
        "commits": sorted({r["timings"]["commit"] for r in results}),
        "trials_done": len(results),
        "trials_wanted": wanted,
        "groups": groups,
        "cycle_ms": cycle_times(results),
        "seconds_a_trial": median(r["timings"]["seconds"] for r in results),
        "worlds": [
            _line(world, one, own)
            for world in worlds
            for one in sensors
            if (own := [r for r in results if r["variant"] == one and _world(r) == world])
        ],
        "picture": None,
    }


def _world(result: Mapping[str, Any]) -> int:
    return int(result["scenario"].rpartition("-")[2])


def _group(results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    outcomes = [r["outcome"] for r in results]
    count = len(outcomes)
    times = [o["took"] for o in outcomes if o["arrived"]]
    hours = sum(o["share_moving"] * o["duration"] for o in outcomes) / 3600
    return {
        "trials": count,
        "arrived": share(sum(bool(o["arrived"]) for o in outcomes), count),
        "clean": share(
            sum(bool(o["arrived"]) and not moving(o) and not at_rest(o) for o in outcomes), count
        ),
        "moving": share(sum(map(moving, outcomes)), count),
        "at_rest": share(sum(map(at_rest, outcomes)), count),
        "time": float(np.mean(times)) if times else None,
        "metres": sum(o["distance"] for o in outcomes),
        "hours_moving": hours,
        "nearest": min((o["nearest"] for o in outcomes), default=None),
        "fastest_turn": max((o["fastest_turn"] for o in outcomes), default=None),
        "broken_premises": sum(o["broken_premises"] for o in outcomes),
        "lost_scans": sum(o["lost_scans"] for o in outcomes),
    }


def _line(world: int, sensors: str, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    outcomes = [r["outcome"] for r in results]
    return {
        "world": world,
        "class": class_of(world),
        "sensors": sensors,
        "trials": len(outcomes),
        "arrived": sum(bool(o["arrived"]) for o in outcomes),
        "moving": sum(map(moving, outcomes)),
        "at_rest": sum(map(at_rest, outcomes)),
        "took": median(o["took"] for o in outcomes),
        "nearest": min(o["nearest"] for o in outcomes),
        "distance": median(o["distance"] for o in outcomes),
        "contacts_moving": [c for o in outcomes for c in o["contacts_moving"]],
    }


def page(told_: Mapping[str, Any]) -> str:
    """The page as markdown."""
    head = (
        "sensors, class", "bound [m/s]", "trials", "contact while moving", "arrived",
        "arrived untouched", "run into at rest", "time [s]", "driven [m]", "nearest [m]",
    )  # fmt: skip
    rows = [
        (
            f"{one}, {class_}", f"{BOUNDS[class_]:g}", str(group["trials"]),
            told_share(group["moving"]), told_share(group["arrived"]), told_share(group["clean"]),
            told_share(group["at_rest"]), told(group["time"], 1), f"{group['metres']:.0f}",
            told(group["nearest"], 3),
        )
        for one, classes in told_["groups"].items()
        for class_, group in classes.items()
        if group["trials"]
    ]  # fmt: skip
    parts = [
        "# DynaBARN\n",
        f"{told_['trials_done']} of {told_['trials_wanted']} trials, {told_['date']}. Trials in"
        " which it happened, with exact 95 % intervals (Clopper-Pearson). Arrived: within 1 m of"
        f" the goal in {LONGEST:g} s. Untouched: and nothing touched the robot, moving or not."
        " Time: mean of those that arrived. Nearest: the rectangle to anything, while it moved.\n",
        markdown(head, rows),
        _conditions(told_),
    ]
    if told_["picture"]:
        parts.append(f"![A world under way]({told_['picture']})\n")
    columns = (
        "world", "class", "sensors", "trials", "arrived", "contact moving", "run into at rest",
        "time [s]", "driven [m]", "nearest [m]",
    )  # fmt: skip
    lines = [
        (
            str(w["world"]), w["class"], w["sensors"], str(w["trials"]), str(w["arrived"]),
            str(w["moving"]), str(w["at_rest"]), told(w["took"], 1), told(w["distance"], 1),
            told(w["nearest"], 3),
        )
        for w in told_["worlds"]
    ]  # fmt: skip
    parts += ["## World by world\n", markdown(columns, lines)]
    return "\n".join([*parts, f"    {told_['command']}\n"])


def _conditions(told_: Mapping[str, Any]) -> str:
    groups = [g for classes in told_["groups"].values() for g in classes.values() if g["trials"]]
    text = (
        "**A kinematic re-simulation, not Gazebo.** Cylinders go straight from keyframe to"
        " keyframe, react to nobody and pass through each other and through the walls, as"
        " published. They come in from outside through the border; they do not stand there the next"
        " moment.\n\n"
        f"The robot: {LENGTH:g} x {WIDTH:g} m, judged as that rectangle and as the"
        f" {len(JACKAL.discs)} discs that cover it; {JACKAL.top_speed:g} m/s,"
        f" {JACKAL.top_turn_rate:g} rad/s, wheels {JACKAL.acceleration:g} m/s^2. No map, no labels:"
        " every surface may move, the walls too, since cylinders come through them.\n\n"
        "`front`: 270 degrees, as published. Whoever is behind is assumed to stand, and in this"
        " arena nobody does: what comes from behind is not covered by the guarantee."
        " `all-round`: a second range finder looks backwards, and the guarantee is whole.\n\n"
        f"Cycles in which a scan broke a premise: {sum(g['broken_premises'] for g in groups)};"
        f" scans that were not believed: {sum(g['lost_scans'] for g in groups)}.\n"
    )
    return text + told_cost(told_)
