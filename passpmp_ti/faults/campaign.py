"""Campaigns of faults and of broken premises: many drives, shared among processes."""

from __future__ import annotations

import json
import math
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from passpmp_ti import backend, door
from passpmp_ti.faults.drive import FaultyDrive
from passpmp_ti.faults.grounds import GROUNDS
from passpmp_ti.faults.kinds import KINDS
from passpmp_ti.faults.premises import PREMISES, Noticed, PremiseTrial
from passpmp_ti.faults.tally import Tallies, as_document, merged, total

ROBOTS = tuple(GROUNDS)
BURSTS = 40
"""Faults of one drive."""
TRIALS = 10
"""Broken premises of one job."""

Progress = Callable[[int, int, str], None]
"""Called with (jobs done, jobs in all, how it stands)."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """One drive with faults, or some trials of one premise."""

    robot: str
    ground: int
    seed: int
    kinds: tuple[str, ...] = ()
    premise: str = ""


@dataclass(kw_only=True)
class Found:
    """What a campaign found, by robot."""

    faults: dict[str, Tallies] = field(default_factory=dict)
    premises: dict[str, dict[str, Noticed]] = field(default_factory=dict)
    jobs: int = 0
    """Done."""
    of: int = 0
    """In all."""

    @property
    def failures(self) -> int:
        """Everything that must not have happened."""
        return sum(total(t).failures for t in self.faults.values()) + sum(
            noticed.failures for kinds in self.premises.values() for noticed in kinds.values()
        )

    def take(self, robot: str, tallies: Tallies, noticed: dict[str, Noticed]) -> None:
        """Count what a job found."""
        self.jobs += 1
        if tallies:
            self.faults[robot] = merged([self.faults.get(robot, {}), tallies])
        for premise, one in noticed.items():
            self.premises.setdefault(robot, {}).setdefault(premise, Noticed()).add(one)

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "jobs": self.jobs,
            "of": self.of,
            "failures": self.failures,
            "faults": {robot: as_document(t) for robot, t in sorted(self.faults.items())},
            "premises": {
                robot: {premise: kinds[premise].document() for premise in sorted(kinds)}
                for robot, kinds in sorted(self.premises.items())
            },
        }


def fault_jobs(robots: Sequence[str], times_each: int, seed: int) -> list[Job]:
    """Drives in which each robot meets every kind of fault `times_each` times, in any order."""
    jobs = []
    for number, robot in enumerate(robots):
        rng = np.random.default_rng([seed, number, 3])
        kinds = [str(k) for k in rng.permutation(list(KINDS) * times_each)]
        for k in range(math.ceil(len(kinds) / BURSTS)):
            jobs.append(
                Job(
                    robot=robot, ground=k % len(GROUNDS[robot]), seed=10_000 * seed + k,
                    kinds=tuple(kinds[k * BURSTS : (k + 1) * BURSTS]),
                )
            )  # fmt: skip
    return jobs


def premise_jobs(robots: Sequence[str], times_each: int, seed: int) -> list[Job]:
    """Trials in which each premise is broken about `times_each` times with each robot."""
    return [
        Job(
            robot=robot, ground=k % len(GROUNDS[robot]), premise=premise,
            seed=10_000 * seed + TRIALS * k,
        )
        for robot in robots
        for premise in PREMISES
        for k in range(math.ceil(times_each / TRIALS))
    ]  # fmt: skip


def run_job(job: Job) -> tuple[Job, Tallies, dict[str, Noticed]]:
    """Do one job; what it does depends on nothing but the job."""
    backend.init("cpu", threads=1)
    ground = GROUNDS[job.robot][job.ground]
    if not job.premise:
        return job, FaultyDrive(ground, job.kinds, job.seed).run(), {}
    noticed = Noticed()
    for k in range(TRIALS):
        noticed.add(PremiseTrial(ground, job.premise, job.seed + k).run())
    return job, {}, {job.premise: noticed}


def run_faults(
    robots: Sequence[str] = ROBOTS,
    times_each: int = 1000,
    *,
    premises: bool = False,
    workers: int = 1,
    seed: int = 1,
    out: str | Path | None = None,
    progress: Progress | None = None,
) -> Found:
    """Run a campaign; Ctrl-C ends it early, with what was found so far.

    Args:
        robots: of `ROBOTS`.
        times_each: how often every kind is put in, with each robot.
        premises: break premises instead of putting in faults.
        workers: processes.
        seed: of everything random; the same seed finds the same with any number of workers.
        out: folder for faults.json and faults.md, or premises.json and premises.md.
        progress: called after every job.

    Raises:
        ValueError: an unknown robot, or a number below 1.
    """
    for robot in robots:
        door.choice("run_faults", "robots", robot, ROBOTS)
    times_each = door.whole("run_faults", "times_each", times_each, least=1)
    workers = door.whole("run_faults", "workers", workers, least=1)
    seed = door.whole("run_faults", "seed", seed, least=0)
    make = premise_jobs if premises else fault_jobs
    jobs = make(robots, times_each, seed)
    found = Found(of=len(jobs))
    try:
        for job, tallies, noticed in _done(jobs, workers):
            found.take(job.robot, tallies, noticed)
            if progress is not None:
                progress(found.jobs, found.of, f"{found.failures} failures")
    except KeyboardInterrupt:
        if not found.jobs:
            raise
    if out is not None:
        _write(found, Path(out), "premises" if premises else "faults")
    return found


def _done(jobs: list[Job], workers: int) -> Iterator[tuple[Job, Tallies, dict[str, Noticed]]]:
    if workers == 1:
        yield from map(run_job, jobs)
        return
    # kernels do not survive a fork
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        waiting = [pool.submit(run_job, job) for job in jobs]
        try:
            for done in as_completed(waiting):
                yield done.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _write(found: Found, folder: Path, name: str) -> None:
    from passpmp_ti.faults.report import markdown

    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(found.document(), indent=2) + "\n")
    (folder / f"{name}.md").write_text(markdown(found))
