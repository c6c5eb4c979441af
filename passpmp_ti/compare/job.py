"""One episode of a comparison: what it is made of, and what is told of it."""

from __future__ import annotations

import time as clock
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any

from passpmp_ti import backend
from passpmp_ti.bench.machine import commit, processor
from passpmp_ti.compare.observer import Observer
from passpmp_ti.compare.promise import Promises
from passpmp_ti.compare.variant import Variant
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.planner.rehearsal import rehearse
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings
from passpmp_ti.sim.episode import CycleInfo, Episode, simulate
from passpmp_ti.sim.scenario import Scenario, load_scenario

Result = dict[str, Any]
"""One line of a ledger."""
Key = tuple[str, str, int]
"""(scenario, variant, seed)."""

ONE_AT_A_TIME = Lock()
"""Kernels share buffers: two episodes in two threads of one process would mix them up."""
REHEARSED: set[tuple[type[Robot], str]] = set()
"""Robots and modes whose kernels this process has compiled."""
LEFT_OUT = ("scenario", "mode", "seed", "interrupted")
"""Entries of an episode's summary that a result has elsewhere."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """An episode, drawn whole from what stands here."""

    scenario: str
    """A shipped name, or the path of a file as the worker sees it."""
    variant: Variant
    seed: int
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `Settings`, for all variants."""
    object_speed: float | None = None
    """Bound on the speed of objects [m/s]; None: the scenario's."""
    observe: bool = True
    judge_every: int = 5
    """[cycles]"""

    def loaded(self) -> Scenario:
        """The scenario as this variant meets it.

        Raises:
            ValueError: an unknown scenario, or settings that make no sense.
        """
        return load_scenario(self.scenario).changed(
            {**self.changes, **self.variant.changes}, object_speed=self.object_speed
        )

    @property
    def key(self) -> Key:
        """What tells it from the other jobs of a comparison."""
        return (Path(self.scenario).stem, self.variant.name, self.seed)


def key_of(found: Result) -> Key:
    """The key of the job that found it."""
    return (found["scenario"], found["variant"], found["seed"])


def carry_out(job: Job) -> Result:
    """Drive one episode in this process; what comes of it depends on the job alone, but for
    `timings`. An error is a result too."""
    return told_of(job.key, lambda: _drive(job))


def told_of(key: Key, drive: Callable[[], Mapping[str, Any]]) -> Result:
    """A ledger's line of one episode, an error among them.

    Args:
        key: tells it from the others.
        drive: drives it, and tells the rest; `timings` is what a clock decides.
    """
    with ONE_AT_A_TIME:
        backend.init("cpu", threads=1)
        began = clock.perf_counter()
        scenario, variant, seed = key
        told: Result = {"scenario": scenario, "variant": variant, "seed": seed, "error": None}
        try:
            told |= drive()
        except Exception:
            told |= {"error": traceback.format_exc(), "timings": {}}
        told["timings"] |= {
            "machine": processor(), "commit": commit(), "seconds": clock.perf_counter() - began
        }  # fmt: skip
        return told


def rehearse_once(robot: Robot, settings: Settings) -> None:
    """Compile what cycles need, once a process: else the first episodes would seem slow."""
    kernels = (type(robot), settings.mode)  # all else are numbers, which kernels are told
    if kernels not in REHEARSED:
        rehearse(Navigator, robot, settings)
        REHEARSED.add(kernels)


def _drive(job: Job) -> Result:
    scenario = job.loaded()
    rehearse_once(scenario.robot, scenario.settings)
    promises = Promises(job.judge_every)
    observer = Observer() if job.observe else None
    watchers: list[Callable[[CycleInfo], None]] = [promises.see]
    if observer is not None:
        watchers.append(observer.see)

    def see(info: CycleInfo) -> None:
        for watcher in watchers:
            watcher(info)

    episode = simulate(scenario, seed=job.seed, on_cycle=see)
    if episode.interrupted:
        raise KeyboardInterrupt  # half an episode is none
    return {
        "outcome": _outcome(episode),
        "observed": None if observer is None else observer.counts(),
        "promised": promises.promised,
        "met": promises.met,
        "timings": {"cycles_us": [round(1e6 * s) for s in episode.update_times]},
    }


def _outcome(episode: Episode) -> dict[str, Any]:
    """The episode's summary without what a clock decides."""
    return {
        name: value
        for name, value in episode.summary().items()
        if name not in LEFT_OUT and not name.startswith("cycle_time")
    } | {"time_moving": episode.time_moving}
