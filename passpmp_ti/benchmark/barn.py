"""`passpmp benchmark barn`: narrow static worlds, scored as the BARN challenge scores them."""

from __future__ import annotations

import argparse
import dataclasses
import datetime
import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passpmp_ti.benchmark.options import add_common, chosen_worlds, draw, drive_all, good

if TYPE_CHECKING:
    from passpmp_ti.benchmark.barn_worlds import BarnWorld
    from passpmp_ti.benchmark.campaign import Trial
    from passpmp_ti.compare.job import Result
    from passpmp_ti.settings import Settings
    from passpmp_ti.sim.scenario import Scenario

EXAMPLE = """passpmp benchmark barn --worlds all/5 --trials 1
  passpmp benchmark barn --worlds 0,6,12 --workers 4 --out out/barn"""
NAME, VARIANT = "barn", "passpmp-pso"
TRIALS = 3
BOUNDS = (-6.0, 1.5, 1.5, 14.5)
"""Of the pictures: the obstacles, and both ends of the way [m]."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What `benchmark barn` takes."""
    add_common(parser, NAME, TRIALS)


def settings() -> Settings:
    """How the Jackal is driven here: nothing moves, nothing is known beforehand."""
    from passpmp_ti.benchmark.jackal import JACKAL, front_lidar
    from passpmp_ti.settings import Settings

    return Settings.for_robot(
        JACKAL,
        object_speed=0.0,
        object_width=0.15,  # the cylinders'
        range_noise=front_lidar().greatest_error,
        clear_radius=0.6,  # the nearest cylinder of any world is 2.1 m from the start
        cell=0.04,
        window=320,
        cycle=0.1,
        primitives=(0.2, 0.3, 0.5),
        capacity=3000,
        particles=100,
        cruise_speed=JACKAL.top_speed,
        guide_movers=False,
        goal_tolerance=0.9,
    )


def scenario_of(world: BarnWorld) -> Scenario:
    """One world, as a scenario: cylinders that stand, all of them unknown."""
    from passpmp_ti.benchmark.barn_worlds import GOAL, LONGEST, START
    from passpmp_ti.benchmark.jackal import JACKAL, front_lidar
    from passpmp_ti.sim.scenario import Scenario
    from passpmp_ti.sim.sources import ScriptSource

    return Scenario(
        name=f"{NAME}-{world.number}",
        description="BARN: cylinders that stand, nothing known beforehand",
        robot=JACKAL,
        settings=settings(),
        lidars=(front_lidar(still=True),),
        bounds=BOUNDS,
        movers=ScriptSource(
            paths=tuple(((0.0, float(x), float(y)),) for x, y in world.cylinders),
            radius=(world.radius,) * len(world.cylinders),
        ),
        start=START,
        goals=(GOAL,),
        duration=LONGEST,
    )


@cache
def worlds() -> dict[int, BarnWorld]:
    """All worlds, read once a process."""
    from passpmp_ti.benchmark.barn_worlds import read_worlds

    return read_worlds()


def drive(trial: Trial) -> Result:
    """Drive one trial, in a worker."""
    from passpmp_ti.benchmark.campaign import carry_out

    return carry_out(trial, lambda t: scenario_of(worlds()[t.world]))


def run(given: argparse.Namespace) -> int:
    """Drive what is not driven yet, write the page; returns the exit code."""
    from passpmp_ti.benchmark.barn_page import document, page
    from passpmp_ti.benchmark.barn_worlds import read_published
    from passpmp_ti.benchmark.campaign import Campaign
    from passpmp_ti.benchmark.jackal import JACKAL

    known = worlds()
    chosen = chosen_worlds(given.worlds, list(known), NAME)
    campaign = Campaign(
        benchmark=NAME, worlds=chosen, trials=given.trials, names=(VARIANT,),
        conditions={"benchmark": NAME, "settings": plain(settings()), "robot": plain(JACKAL)},
    )  # fmt: skip
    results, code = drive_all(campaign, drive, given)
    told = document(
        known, good(results), read_published(), wanted=len(campaign.jobs()),
        date=datetime.date.today().isoformat(), command=given.command,
    )  # fmt: skip
    folder = Path(given.out)
    if told["worlds"] and not given.no_picture:
        world = slowest(told["worlds"]) if given.picture is None else given.picture
        if world not in known:
            raise ValueError(f"{NAME}.picture: the data holds no world {world}")
        told["picture"] = draw(scenario_of(known[world]), 0, folder / f"world-{world}")
    text = page(told)
    (folder / f"{NAME}.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    (folder / f"{NAME}.md").write_text(text, encoding="utf-8")
    print(text.partition("## World by world")[0].strip())
    print(f"page: {folder / f'{NAME}.md'}")
    return code


def plain(value: Any) -> dict[str, Any]:
    """A frozen record as JSON gives it back."""
    found: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(value)))
    return found


def slowest(lines: Sequence[Mapping[str, Any]]) -> int:
    """The world whose trials took longest against its optimal time, a failure longest of all."""
    late = max(lines, key=lambda line: (-line["score"], line["took"] or 0.0, -line["world"]))
    return int(late["world"])
