"""`passpmp benchmark crowd`: a route through a crowd, with people behind occluders beside it."""

from __future__ import annotations

import argparse
import dataclasses
import datetime
import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passpmp_ti import door
from passpmp_ti.settings import MODES

if TYPE_CHECKING:
    from passpmp_ti.benchmark.campaign import Campaign, Trial

EXAMPLE = """passpmp benchmark crowd --counts 10 20 --trials 20 --workers 2
  passpmp benchmark crowd --counts 20 --modes conservative hybrid --planners dwa --out out/modes"""
NAME = "crowd"
COUNTS = (10, 20, 30, 50)
TRIALS = 100


def add_options(parser: argparse.ArgumentParser) -> None:
    """What `benchmark crowd` takes."""
    add = parser.add_argument
    add(
        "--counts",
        type=int,
        nargs="+",
        metavar="N",
        default=list(COUNTS),
        help=f"walkers (default: {' '.join(map(str, COUNTS))})",
    )
    add(
        "--trials",
        type=int,
        default=TRIALS,
        metavar="N",
        help=f"of each, with seeds from 0 (default: {TRIALS})",
    )
    add(
        "--modes",
        nargs="*",
        metavar="M",
        default=["conservative"],
        help=f"{', '.join(MODES)} (default: conservative, which is the one that is judged)",
    )
    add(
        "--planners",
        nargs="+",
        metavar="P",
        default=[],
        help="others that drive the same worlds: passpmp, iss, dwa, mppi; see docs/baselines.md",
    )
    add(
        "--labels",
        default="sensor",
        metavar="L",
        help="`sensor`: the range finder tells that occluders stay (default); `none`: all may move",
    )
    add("--walled", action="store_true", help="walls about the square (default: open ground)")
    add("--workers", type=int, metavar="K", help="processes at once (default: one a CPU)")
    add(
        "--out",
        default=f"out/{NAME}",
        metavar="DIR",
        help=f"page, numbers and trials; what it holds is not driven again (default: out/{NAME})",
    )
    add("--picture", type=int, default=0, metavar="SEED", help="that is drawn (default: 0)")
    add("--video", action="store_true", help="of that seed, too")
    add("--no-picture", action="store_true", help="draw none")


def campaign_of(given: argparse.Namespace) -> Campaign:
    """What is wanted.

    Raises:
        ValueError: an option that makes no sense.
    """
    from passpmp_ti.benchmark.campaign import Campaign
    from passpmp_ti.benchmark.crowd_world import ROBOT, settings
    from passpmp_ti.planner.baselines.names import BASELINES
    from passpmp_ti.sim.lidar import LABELS

    door.whole(NAME, "trials", given.trials, least=1)
    door.whole(NAME, "picture", given.picture, least=0)
    for count in given.counts:
        door.whole(NAME, "counts", count, least=0)
    for mode in given.modes:
        door.choice(NAME, "modes", mode, MODES)
    for planner in given.planners:
        # viability asks for the whole future, which nobody knows here
        door.choice(NAME, "planners", planner, [p for p in BASELINES if p != "viability"])
    door.choice(NAME, "labels", given.labels, LABELS)
    variants = [*given.modes, *given.planners]
    if not variants:
        raise ValueError(f"{NAME}.modes and {NAME}.planners are both empty; name one of them")
    return Campaign(
        benchmark=NAME, worlds=list(dict.fromkeys(given.counts)), trials=given.trials,
        names=list(dict.fromkeys(variants)),
        conditions={
            "benchmark": NAME, "labels": given.labels, "walled": given.walled,
            "settings": plain(settings()), "robot": plain(ROBOT),
        },
    )  # fmt: skip


def plain(value: Any) -> dict[str, Any]:
    """A frozen record as JSON gives it back."""
    found: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(value)))
    return found


def run(given: argparse.Namespace) -> int:
    """Drive what is not driven yet, write the page; returns the exit code."""
    from passpmp_ti.benchmark.campaign import Trial
    from passpmp_ti.benchmark.crowd_page import document, page
    from passpmp_ti.benchmark.crowd_trial import drive
    from passpmp_ti.benchmark.options import drive_all, good

    campaign = campaign_of(given)
    world = {"labels": given.labels, "walled": given.walled}
    results, code = drive_all(campaign, partial(drive, **world), given)
    told = document(
        good(results), campaign.worlds, campaign.names, wanted=len(campaign.jobs()),
        world=world, date=datetime.date.today().isoformat(), command=given.command,
    )  # fmt: skip
    folder = Path(given.out)
    if results and not given.no_picture:
        trial = Trial(
            benchmark=NAME, world=campaign.worlds[0], variant=campaign.names[0],
            trial=given.picture,
        )  # fmt: skip
        told["picture"] = draw(trial, folder, video=given.video, **world)
    text = page(told)
    (folder / f"{NAME}.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    (folder / f"{NAME}.md").write_text(text, encoding="utf-8")
    print(text.strip())
    print(f"page: {folder / f'{NAME}.md'}")
    return code


def draw(trial: Trial, folder: Path, *, video: bool, labels: str, walled: bool) -> str:
    """Drive a trial once more and draw it; the picture of its middle, by its path in `folder`."""
    from passpmp_ti import backend
    from passpmp_ti.benchmark.crowd_trial import noticed, planner_of, scenario_of
    from passpmp_ti.sim.episode import CycleInfo, simulate
    from passpmp_ti.viz.outcome import Outcome

    backend.init("cpu", threads=1)
    scenario, name = scenario_of(trial, labels, walled), "-".join(map(str, trial.key))
    with Outcome(folder / name, scenario.name, f"seed {trial.trial}", video=video) as outcome:

        def see(info: CycleInfo) -> None:
            noticed(info)
            outcome.see(info)

        simulate(scenario, seed=trial.trial, on_cycle=see, planner=planner_of(trial))
    pictures = sorted((folder / name / "snapshots").glob("t*.png"))
    return str(pictures[len(pictures) // 2].relative_to(folder))
