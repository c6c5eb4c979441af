"""What `passpmp benchmark barn` and `dynabarn` have in common: options, and how they are run."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from passpmp_ti import door

if TYPE_CHECKING:
    from passpmp_ti.benchmark.campaign import Campaign, Trial
    from passpmp_ti.compare.job import Result
    from passpmp_ti.sim.scenario import Scenario

FAILED, INTERRUPTED = 1, 130
"""Exit codes: a trial raised or a worker died, Ctrl-C."""


def add_common(parser: argparse.ArgumentParser, name: str, trials: int) -> None:
    """Worlds, trials, workers, folder, picture.

    Args:
        parser: takes them.
        name: of the benchmark.
        trials: of each world by default.
    """
    add = parser.add_argument
    add(
        "--worlds",
        default="all",
        metavar="W",
        help="numbers, ranges low-high, and /N for every n-th of them: `0,6,12`, `0-50`, `all/5`"
        " (default: all that the data holds)",
    )
    add(
        "--trials", type=int, default=trials, metavar="N", help=f"of each world (default: {trials})"
    )
    add("--workers", type=int, metavar="K", help="processes at once (default: one a CPU)")
    add(
        "--out",
        default=f"out/{name}",
        metavar="DIR",
        help=f"page, numbers and trials; what it holds is not driven again (default: out/{name})",
    )
    add("--picture", type=int, metavar="W", help="world that is drawn (default: the slowest)")
    add("--no-picture", action="store_true", help="draw none")


def chosen_worlds(text: str, known: Sequence[int], owner: str) -> list[int]:
    """The worlds that `--worlds` names, in order.

    Raises:
        ValueError: not such a list, or a world that the data does not hold.
    """
    what, _, stride = text.partition("/")
    step = 1
    if stride:
        if not stride.isdecimal() or int(stride) < 1:
            raise ValueError(f"{owner}.worlds = {text!r}: after / stands a whole number >= 1")
        step = int(stride)
    if what.strip() == "all":
        return list(known)[::step]
    wanted: set[int] = set()
    for part in what.split(","):
        low, _, high = part.strip().partition("-")
        if not low.isdecimal() or not (high or low).isdecimal():
            raise ValueError(
                f"{owner}.worlds = {text!r}: give numbers and ranges, like 0,6,12 or 0-50, or all"
            )
        if not high and int(low) not in known:
            raise ValueError(
                f"{owner}.worlds: world {int(low)} is not among the {len(known)} that the data"
                f" holds, {known[0]} to {known[-1]}; take `all`, or a range: what is missing in a"
                " range is left out"
            )
        wanted |= {n for n in known if int(low) <= n <= int(high or low)}
    if not wanted:
        raise ValueError(f"{owner}.worlds = {text!r}: the data holds none of these worlds")
    return sorted(wanted)[::step]


def drive_all(
    campaign: Campaign, drive: Callable[[Trial], Result], given: argparse.Namespace
) -> tuple[list[Result], int]:
    """Drive what is not driven yet.

    Returns:
        Every result of the campaign so far, and the exit code.
    """
    from passpmp_ti.bench.machine import cores
    from passpmp_ti.benchmark.campaign import carry_out_all, read_all
    from passpmp_ti.compare.progress import ComparisonProgress
    from passpmp_ti.compare.workers import LostWorkerError, opened

    count = cores() if given.workers is None else given.workers
    door.whole(campaign.benchmark, "workers", count, least=1)
    door.whole(campaign.benchmark, "trials", campaign.trials, least=1)
    folder, code = Path(given.out), 0
    progress = ComparisonProgress(campaign)
    with opened(None, count) as workers:
        try:
            carry_out_all(campaign, drive, folder, workers, progress.see)
        except KeyboardInterrupt:
            code = INTERRUPTED
        except LostWorkerError as cause:
            print(f"passpmp: {cause}", file=sys.stderr)
            code = FAILED
        finally:
            progress.end()
    results = read_all(campaign, folder)
    if code == INTERRUPTED:
        print(
            f"passpmp: interrupted; {len(results)} of {len(campaign.jobs())} trials; the same"
            " command goes on",
            file=sys.stderr,
        )
    raised = [r for r in results if r["error"]]
    for result in raised[:3]:
        print(
            f"passpmp: {result['scenario']}, {result['variant']}, trial {result['seed']} raised:\n"
            f"{result['error']}",
            file=sys.stderr,
        )
    return results, code or (FAILED if raised else 0)


def good(results: Iterable[Result]) -> list[Result]:
    """Those that did not raise."""
    return [result for result in results if result["error"] is None]


def draw(scenario: Scenario, seed: int, folder: Path) -> str:
    """Drive a trial once more and draw it; the picture of its middle, beside `folder`."""
    from passpmp_ti import backend
    from passpmp_ti.sim.episode import simulate
    from passpmp_ti.viz.outcome import Outcome

    backend.init("cpu", threads=1)
    with Outcome(folder, scenario.name, f"trial {seed}", video=False) as outcome:
        simulate(scenario, seed=seed, on_cycle=outcome.see)
    snapshots = sorted((folder / "snapshots").glob("t*.png"))
    return f"{folder.name}/snapshots/{snapshots[len(snapshots) // 2].name}"
