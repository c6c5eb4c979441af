"""Many trials of a benchmark: driven in processes, kept on disk, gone on with after a stop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from passpmp_ti.benchmark.course import Course
from passpmp_ti.compare.job import Key, Result, rehearse_once, told_of
from passpmp_ti.compare.ledger import Ledger
from passpmp_ti.compare.workers import Workers
from passpmp_ti.sim.contacts import Contact
from passpmp_ti.sim.episode import Episode, simulate
from passpmp_ti.sim.scenario import Scenario


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One episode of a benchmark."""

    benchmark: str
    """Its name on the command line."""
    world: int
    variant: str
    """How the robot is equipped."""
    trial: int
    """The seed: of the range finder's errors, of the planner, of when the robot sets out."""

    @property
    def key(self) -> Key:
        """What tells it from the others in a ledger."""
        return (f"{self.benchmark}-{self.world}", self.variant, self.trial)


@dataclass(frozen=True, kw_only=True)
class Named:
    """A variant, as the line of progress wants it."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """Every trial that is wanted: all of the first trials before any second one."""

    benchmark: str
    worlds: Sequence[int]
    trials: int
    names: Sequence[str]
    """Of the variants."""
    conditions: Mapping[str, Any]
    """What decides what becomes of a trial, in plain JSON."""

    @property
    def variants(self) -> list[Named]:
        """The variants, in their order."""
        return [Named(name=name) for name in self.names]

    def jobs(self) -> list[Trial]:
        """Every trial, in the order in which they are begun."""
        return [
            Trial(benchmark=self.benchmark, world=world, variant=name, trial=trial)
            for trial in range(self.trials)
            for world in self.worlds
            for name in self.names
        ]


def carry_out_all(
    campaign: Campaign,
    drive: Callable[[Trial], Result],
    folder: Path,
    workers: Workers,
    on_result: Callable[[Mapping[Key, Result]], None],
) -> None:
    """Drive what a folder does not hold yet.

    Args:
        campaign: what is wanted.
        drive: one trial, in a worker.
        folder: see `Ledger`.
        workers: do it.
        on_result: shown all results so far after each trial.

    Raises:
        ValueError: the folder holds trials of other conditions.
        KeyboardInterrupt: Ctrl-C; what is finished is written.
    """
    ledger = Ledger(folder, campaign.conditions)
    ledger.fill(campaign.jobs(), partial(workers.each, drive), on_result)


def read_all(campaign: Campaign, folder: Path) -> list[Result]:
    """The wanted trials that a folder holds, in the campaign's order."""
    ledger = Ledger(folder, campaign.conditions)
    ledger.close()
    return [ledger.results[t.key] for t in campaign.jobs() if t.key in ledger.results]


def carry_out(trial: Trial, scenario_of: Callable[[Trial], Scenario]) -> Result:
    """Drive one trial in this process. An error is a result too.

    Args:
        trial: which.
        scenario_of: what it is driven in.
    """
    return told_of(trial.key, lambda: _driven(scenario_of(trial), trial.trial))


def _driven(scenario: Scenario, seed: int) -> dict[str, Any]:
    rehearse_once(scenario.robot, scenario.settings)
    course = Course(scenario.start[:2], scenario.goals[-1])
    episode = simulate(scenario, seed=seed, on_cycle=course.see)
    if episode.interrupted:
        raise KeyboardInterrupt  # half a trial is none
    return {
        "outcome": outcome_of(episode, course),
        "timings": {"cycles_us": [round(1e6 * s) for s in episode.update_times[1:]]},
    }


def outcome_of(episode: Episode, course: Course) -> dict[str, Any]:
    """One trial in numbers, SI units; contacts after the arrival are none of the trial's."""
    until = episode.times[-1] if course.arrived is None else course.arrived
    contacts = [c for c in episode.contacts if c.start < until]
    summary = episode.summary()
    return {
        **course.told(),
        "reached_goal": course.arrived is not None,
        "collisions_moving": sum(c.moving for c in contacts),
        "collisions_at_rest": sum(not c.moving for c in contacts),
        "contacts_moving": [_told(c, episode.start_time) for c in contacts if c.moving],
        "share_moving": summary["share_moving"],
        "broken_premises": summary["broken_premises"],
        "lost_scans": summary["lost_scans"],
        "duration": float(until - episode.start_time),
    }


def _told(contact: Contact, start: float) -> dict[str, Any]:
    """A contact while moving, for whoever asks why."""
    return {
        "after": contact.start - start,
        "mover": contact.mover,
        "place": list(contact.place),
        "robot_speed": contact.robot_speed,
        "mover_speed": contact.mover_speed,
        "moving_at_start": contact.moving_at_start,
    }
