"""`passpmp benchmark dynabarn`: an arena that cylinders cross, contacts while moving counted."""

from __future__ import annotations

import argparse
import datetime
import json
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passpmp_ti import door
from passpmp_ti.benchmark.options import add_common, chosen_worlds, draw, drive_all, good

if TYPE_CHECKING:
    from passpmp_ti.benchmark.campaign import Trial
    from passpmp_ti.benchmark.dynabarn_worlds import Crossing
    from passpmp_ti.compare.job import Result
    from passpmp_ti.settings import Settings
    from passpmp_ti.sim.scenario import Scenario

EXAMPLE = """passpmp benchmark dynabarn --worlds all/5 --trials 1
  passpmp benchmark dynabarn --sensors all-round --worlds 40-59"""
NAME = "dynabarn"
TRIALS = 3
FRONT, ALL_ROUND = "front", "all-round"
SENSORS = {
    FRONT: "270 degrees, as published; what is behind is assumed to stand",
    ALL_ROUND: "a second range finder looks backwards, so that the guarantee is whole",
}
MOVER_WIDTH = 0.8
"""Objects are assumed no narrower [m]; the cylinders are 1 m across."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What `benchmark dynabarn` takes."""
    add_common(parser, NAME, TRIALS)
    parser.add_argument(
        "--sensors",
        nargs="+",
        metavar="S",
        default=list(SENSORS),
        help=f"{'; '.join(f'{name}: {what}' for name, what in SENSORS.items())} (default: both)",
    )


def settings(class_: str, sensors: str) -> Settings:
    """How the Jackal is driven among cylinders of a class.

    Args:
        class_: "easy", "medium" or "hard": its bound is what is assumed of objects.
        sensors: `FRONT` or `ALL_ROUND`.
    """
    from passpmp_ti.benchmark.dynabarn_worlds import BOUNDS
    from passpmp_ti.benchmark.jackal import JACKAL, front_lidar
    from passpmp_ti.settings import Settings

    return Settings.for_robot(
        JACKAL,
        object_speed=BOUNDS[class_],
        object_width=MOVER_WIDTH,
        range_noise=front_lidar().greatest_error,
        blind_speed=0.0 if sensors == FRONT else None,
        clear_radius=0.6,
        cell=0.06,
        window=320,
        cycle=0.1,
        primitives=(0.2, 0.4, 0.6),
        capacity=3000,
        particles=100,
        cruise_speed=JACKAL.top_speed,
        guide_movers=True,
        goal_tolerance=0.9,
    )


def scenario_of(world: int, crossings: tuple[Crossing, ...], sensors: str) -> Scenario:
    """One world, as a scenario."""
    from passpmp_ti.benchmark.dynabarn_worlds import (
        BORDER,
        BOUNDS,
        GOAL,
        LONGEST,
        START,
        CrossingSource,
        class_of,
        walls,
    )
    from passpmp_ti.benchmark.jackal import JACKAL, front_lidar, rear_lidar
    from passpmp_ti.sim.scenario import Scenario

    class_ = class_of(world)
    edge = BORDER + 1.0
    return Scenario(
        name=f"{NAME}-{world}",
        description=f"DynaBARN, {class_}: cylinders of at most {BOUNDS[class_]:g} m/s",
        robot=JACKAL,
        settings=settings(class_, sensors),
        lidars=(front_lidar(),) if sensors == FRONT else (front_lidar(), rear_lidar()),
        bounds=(-edge, -edge, edge + 1.0, edge),
        polygons=walls(),
        movers=CrossingSource(crossings=crossings, top_speed=BOUNDS[class_]),
        start=START,
        goals=(GOAL,),
        duration=LONGEST,
    )


@cache
def worlds() -> dict[int, tuple[Crossing, ...]]:
    """All worlds, read once a process."""
    from passpmp_ti.benchmark.dynabarn_worlds import read_worlds

    return read_worlds()


def drive(trial: Trial) -> Result:
    """Drive one trial, in a worker."""
    from passpmp_ti.benchmark.campaign import carry_out

    return carry_out(trial, lambda t: scenario_of(t.world, worlds()[t.world], t.variant))


def run(given: argparse.Namespace) -> int:
    """Drive what is not driven yet, write the page; returns the exit code."""
    from passpmp_ti.benchmark.barn import plain
    from passpmp_ti.benchmark.campaign import Campaign
    from passpmp_ti.benchmark.dynabarn_page import document, page
    from passpmp_ti.benchmark.dynabarn_worlds import BOUNDS
    from passpmp_ti.benchmark.jackal import JACKAL

    known = worlds()
    chosen = chosen_worlds(given.worlds, list(known), NAME)
    sensors = tuple(dict.fromkeys(given.sensors))
    for one in sensors:
        door.choice(NAME, "sensors", one, tuple(SENSORS))
    campaign = Campaign(
        benchmark=NAME, worlds=chosen, trials=given.trials, names=sensors,
        conditions={
            "benchmark": NAME,
            "settings": {s: {c: plain(settings(c, s)) for c in BOUNDS} for s in SENSORS},
            "robot": plain(JACKAL),
        },
    )  # fmt: skip
    results, code = drive_all(campaign, drive, given)
    told: dict[str, Any] = document(
        good(results), sensors, wanted=len(campaign.jobs()),
        date=datetime.date.today().isoformat(), command=given.command,
    )  # fmt: skip
    folder = Path(given.out)
    if told["worlds"] and not given.no_picture:
        world = chosen[-1] if given.picture is None else given.picture
        if world not in known:
            raise ValueError(f"{NAME}.picture: the data holds no world {world}")
        scenario = scenario_of(world, known[world], sensors[-1])
        told["picture"] = draw(scenario, 0, folder / f"world-{world}")
    text = page(told)
    (folder / f"{NAME}.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    (folder / f"{NAME}.md").write_text(text, encoding="utf-8")
    print(text.partition("## World by world")[0].strip())
    print(f"page: {folder / f'{NAME}.md'}")
    return code
