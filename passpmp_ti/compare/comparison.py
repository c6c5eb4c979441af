"""A comparison: which variants drive which worlds, and how it is carried out."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from passpmp_ti import door
from passpmp_ti.compare.job import Job, Key, Result, carry_out
from passpmp_ti.compare.ledger import Ledger
from passpmp_ti.compare.variant import Variant
from passpmp_ti.compare.workers import Workers
from passpmp_ti.sim.scenario import SHIPPED, Scenario, load_scenario


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What is wanted. Every variant drives the same seeds, so the same worlds."""

    scenarios: Sequence[str]
    """Shipped names, or paths of files."""
    variants: Sequence[Variant]
    """The others are compared with the first."""
    episodes: int
    """Per scenario and variant."""
    seed: int = 0
    """Of the first episode; the others count on."""
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `Settings`, for all variants."""
    object_speed: float | None = None
    """Bound on the speed of objects [m/s]; None: the scenario's."""
    observe: bool = True
    """Keep a conservative model beside every planner, for the p-safe share."""
    judge_every: int = 5
    """Of so many cycles one has its promise judged."""

    def __post_init__(self) -> None:
        name = "compare"
        door.whole(name, "episodes", self.episodes, least=1)
        door.whole(name, "seed", self.seed, least=0)
        door.whole(name, "judge_every", self.judge_every, least=1)
        for field_ in ("scenarios", "variants"):
            given = getattr(self, field_)
            names = [v.name if isinstance(v, Variant) else Path(v).stem for v in given]
            twice = sorted({n for n in names if names.count(n) > 1})
            if not names:
                raise ValueError(f"compare.{field_} is empty; name one at least")
            if twice:
                raise ValueError(
                    f"compare.{field_} holds {twice[0]!r} twice; each is named once, since results"
                    " are told apart by it"
                )
        for scenario in self.scenarios:
            for job in self.jobs_of(scenario, self.seed):
                job.loaded()  # refuses what makes no sense, before anything is driven

    @property
    def names(self) -> tuple[str, ...]:
        """Of the scenarios."""
        return tuple(Path(scenario).stem for scenario in self.scenarios)

    @property
    def seeds(self) -> range:
        """Of the episodes."""
        return range(self.seed, self.seed + self.episodes)

    def scenario(self, reference: str) -> Scenario:
        """One of the scenarios as all variants meet it."""
        return load_scenario(reference).changed(self.changes, object_speed=self.object_speed)

    def jobs(self) -> list[Job]:
        """Every episode, seed by seed: what is stopped has as many of each variant."""
        return [
            job
            for seed in self.seeds
            for scenario in self.scenarios
            for job in self.jobs_of(scenario, seed)
        ]

    def jobs_of(self, scenario: str, seed: int) -> list[Job]:
        """One episode of each variant, in the same world."""
        return [
            Job(
                scenario=scenario, variant=variant, seed=seed, changes=self.changes,
                object_speed=self.object_speed, observe=self.observe,
                judge_every=self.judge_every,
            )
            for variant in self.variants
        ]  # fmt: skip

    def conditions(self) -> dict[str, Any]:
        """What decides what becomes of an episode, but for scenario, variant and seed."""
        return {
            "scenarios": {
                name: _digest(scenario)
                for name, scenario in zip(self.names, self.scenarios, strict=True)
            },
            "variants": {v.name: _plain(v.changes) for v in self.variants},
            "changes": _plain(self.changes),
            "object_speed": self.object_speed,
            "observe": self.observe,
            "judge_every": self.judge_every,
        }


def carry_out_all(
    comparison: Comparison,
    folder: Path,
    workers: Workers,
    on_result: Callable[[Mapping[Key, Result]], None],
) -> dict[Key, Result]:
    """Drive what is not driven yet.

    Args:
        comparison: what is wanted.
        folder: holds what is done; see `Ledger`.
        workers: do it.
        on_result: shown all results so far, those of earlier runs too, after each episode.

    Returns:
        The results of every wanted episode, in the order of `Comparison.jobs`.

    Raises:
        ValueError: the folder holds episodes of other conditions.
        KeyboardInterrupt: Ctrl-C; what is finished is written.
    """
    ledger = Ledger(folder, comparison.conditions())
    ledger.fill(comparison.jobs(), partial(workers.each, carry_out), on_result)
    return chosen(comparison, ledger.results)


def read_all(comparison: Comparison, folder: Path) -> dict[Key, Result]:
    """The results of the wanted episodes that a folder holds."""
    ledger = Ledger(folder, comparison.conditions())
    ledger.close()
    return chosen(comparison, ledger.results)


def chosen(comparison: Comparison, results: Mapping[Key, Result]) -> dict[Key, Result]:
    """Those of a comparison, in its order, whatever order they ended in."""
    return {job.key: results[job.key] for job in comparison.jobs() if job.key in results}


def _digest(scenario: str) -> str:
    """Of a scenario's file: a name alone does not tell that it was edited."""
    path = Path(scenario)
    if not path.is_file():
        path = SHIPPED / f"{scenario}.yaml"
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def _plain(changes: Mapping[str, Any]) -> dict[str, Any]:
    """As JSON gives it back."""
    return {k: list(v) if isinstance(v, tuple) else v for k, v in sorted(changes.items())}
