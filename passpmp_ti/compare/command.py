"""`passpmp compare`: its options, and what it prints. Heavy imports stand inside the functions."""

from __future__ import annotations

import argparse
import datetime
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passpmp_ti import door
from passpmp_ti.settings import MODES

if TYPE_CHECKING:
    from passpmp_ti.compare.job import Job, Key, Result
    from passpmp_ti.compare.workers import Workers

EXAMPLE = """passpmp compare crowded corridor_person --episodes 100 --out out/compare
  passpmp compare crowded --object-speed 5 --episodes 20 --workers 4 --no-observer
  passpmp compare eth --episodes 100 --scheduler tcp://10.0.0.1:8786"""
FAILED, INTERRUPTED = 1, 130
"""Exit codes: an episode raised or a worker died, Ctrl-C."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What `compare` takes, but for the changes of the scenarios."""
    add = parser.add_argument
    add("scenarios", nargs="+", metavar="scenario", help="shipped names, or files")
    add(
        "--modes",
        nargs="+",
        metavar="M",
        default=list(MODES),
        help=f"{', '.join(MODES)}; the others are compared with the first (default: all)",
    )
    add("--episodes", type=int, default=20, metavar="N", help="of each mode (default: 20)")
    add("--workers", type=int, metavar="K", help="processes at once (default: one a CPU)")
    add(
        "--out",
        default="out/compare",
        metavar="DIR",
        help="page, numbers and episodes; what it holds is not driven again (default: out/compare)",
    )
    add(
        "--scheduler",
        metavar="ADDRESS",
        help="drive on a Dask cluster; `local` starts one here (needs the extra [cluster])",
    )
    add(
        "--judge-every",
        type=int,
        default=5,
        metavar="N",
        help="judge what is promised in each n-th cycle (default: 5)",
    )
    add(
        "--no-observer",
        action="store_true",
        help="no conservative model beside the planner: faster, and no p-safe share",
    )
    add("--video-seed", type=int, metavar="N", help="of the video (default: the first seed)")
    add("--no-video", action="store_true", help="no video of one seed, side by side")  # fmt: skip


def run(given: argparse.Namespace, changes: Mapping[str, Any]) -> int:
    """Drive what is not driven yet, and write the report; returns the exit code.

    Args:
        given: the parsed command line.
        changes: fields of `Settings` that it changes.
    """
    from passpmp_ti.bench.machine import cores
    from passpmp_ti.compare import table
    from passpmp_ti.compare.comparison import Comparison, carry_out_all, read_all
    from passpmp_ti.compare.film import filmed
    from passpmp_ti.compare.progress import ComparisonProgress
    from passpmp_ti.compare.report import document, write_report
    from passpmp_ti.compare.variant import modes
    from passpmp_ti.compare.workers import LostWorkerError, opened

    count = cores() if given.workers is None else given.workers
    door.whole("compare", "workers", count, least=1)
    comparison = Comparison(
        scenarios=[_placed(s) for s in given.scenarios], variants=modes(given.modes),
        episodes=given.episodes, seed=given.seed, changes=changes,
        object_speed=given.object_speed, observe=not given.no_observer,
        judge_every=given.judge_every,
    )  # fmt: skip
    wanted = given.seed if given.video_seed is None else given.video_seed
    shots = {
        name: comparison.jobs_of(scenario, door.whole("compare", "video_seed", wanted, least=0))
        for name, scenario in zip(comparison.names, comparison.scenarios, strict=True)
    }
    folder = Path(given.out)
    progress = ComparisonProgress(comparison)
    ended_early: BaseException | None = None
    results: Mapping[Key, Result] = {}
    with opened(given.scheduler, count) as workers:
        try:
            results = carry_out_all(comparison, folder, workers, progress.see)
            if not given.no_video:
                progress.end()
                _film_all(shots, workers, folder)
        except (KeyboardInterrupt, LostWorkerError) as cause:
            ended_early = cause
            results = read_all(comparison, folder)
        finally:
            progress.end()
    told = document(
        comparison, results, date=datetime.date.today().isoformat(),
        command=given.command, workers=_told(given.scheduler, count),
    )  # fmt: skip
    videos = {name: filmed(folder, jobs) for name, jobs in shots.items()}
    write_report(folder, told, {n: path.name for n, path in videos.items() if path.exists()})
    print(table.text(told))
    print(f"page: {folder / 'index.html'}")
    if isinstance(ended_early, KeyboardInterrupt):
        print(
            f"passpmp: interrupted; {len(results)} of {len(comparison.jobs())} episodes; the same"
            " command goes on",
            file=sys.stderr,
        )
        return INTERRUPTED
    if ended_early is not None:
        print(f"passpmp: {ended_early}", file=sys.stderr)
        return FAILED
    return FAILED if any(r["error"] for r in results.values()) else 0


def _film_all(shots: Mapping[str, Sequence[Job]], workers: Workers, folder: Path) -> None:
    """Make the videos that are not there yet."""
    from passpmp_ti.compare.film import film, filmed

    for name, jobs in shots.items():
        path = filmed(folder, jobs)
        if path.exists():
            continue
        print(f"video of {name}, seed {jobs[0].seed}", file=sys.stderr)
        try:
            film(jobs, workers, path)
        except RuntimeError as error:  # the numbers are worth their page without it
            print(f"passpmp: no video of {name}: {error}", file=sys.stderr)


def _told(scheduler: str | None, count: int) -> str:
    """What drives the episodes, in words."""
    if scheduler is None:
        return "1 worker" if count == 1 else f"{count} workers"
    from passpmp_ti.compare.workers import LOCAL

    return f"{count} workers of Dask" if scheduler == LOCAL else f"Dask at {scheduler}"


def _placed(scenario: str) -> str:
    """A file by its whole path, as workers elsewhere need it."""
    return str(Path(scenario).resolve()) if Path(scenario).is_file() else scenario
