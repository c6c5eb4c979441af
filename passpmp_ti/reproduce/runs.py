"""Episodes, each driven once however many items look at it, with glimpses kept of the way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from passpmp_ti.scan import Scan
from passpmp_ti.sim.contacts import Contact
from passpmp_ti.sim.episode import CycleInfo, simulate
from passpmp_ti.sim.planners import planner_for
from passpmp_ti.sim.scenario import Scenario, load_scenario
from passpmp_ti.sim.sources import NobodyMoves
from passpmp_ti.sim.world import World

BETWEEN = 0.5
"""Time between two glimpses, at least [s]."""
PATIENCE = 6.0
"""Where nobody moves, a robot that stood for so long is taken to stay [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Glimpse:
    """What one cycle saw and chose, small enough to keep many of."""

    time: float
    """t_k, absolute [s]."""
    state: np.ndarray
    """[5] the robot's then."""
    root: np.ndarray
    """[5] where it is at t_{k+1}: what the cycle planned from."""
    scans: tuple[Scan, ...]
    plan: np.ndarray
    """[m, 2] what is left of the way that was chosen, to rest [m]."""
    reason: str
    """Of the decision, see `CycleRecord`."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One episode."""

    scenario: Scenario
    world: World
    summary: Mapping[str, Any]
    """See `Episode.summary`."""
    trail: np.ndarray
    """[n, 2] where the robot was [m]."""
    times: np.ndarray
    """[n] when [s]."""
    contacts: tuple[Contact, ...]
    glimpses: tuple[Glimpse, ...]
    gave_up: bool
    """It was ended because the robot stood for too long."""

    def trail_until(self, time: float) -> np.ndarray:
        """[n, 2] where the robot has been [m]."""
        return self.trail[self.times <= time + 1e-9]

    def spread(self, count: int) -> list[Glimpse]:
        """Some glimpses at an even pace, the first and the last among them."""
        chosen = np.linspace(0, len(self.glimpses) - 1, min(count, len(self.glimpses)))
        return [self.glimpses[round(k)] for k in chosen]

    def nearest(self, time: float) -> Glimpse:
        """The glimpse nearest to a time after the start [s]."""
        wanted = self.glimpses[0].time + time
        return min(self.glimpses, key=lambda g: abs(g.time - wanted))


@dataclass
class Runs:
    """What was driven so far."""

    _known: dict[str, Run] = field(default_factory=dict)

    def drive(
        self,
        name: str,
        planner: str = "passpmp-pso",
        seed: int = 0,
        *,
        settings: Mapping[str, Any] | None = None,
        object_speed: float | None = None,
        duration: float = math.inf,
        patience: float | None = None,
        between: float = BETWEEN,
        **options: Any,
    ) -> Run:
        """Drive once.

        Args:
            name: of a shipped scenario.
            planner: see `passpmp_ti.planner.baselines.names`.
            seed: of the episode.
            settings: fields of `Settings` to replace.
            object_speed: see `Scenario.changed`.
            duration: at most [s].
            patience: how long the robot may stand before the episode is ended [s]; None: `PATIENCE`
                where nobody moves, else as long as it likes.
            between: time between glimpses [s].
            options: of the planner itself.
        """
        asked = (name, planner, seed, settings, object_speed, duration, patience, between, options)
        if repr(asked) in self._known:
            return self._known[repr(asked)]
        scenario = load_scenario(name).changed(settings, object_speed=object_speed)
        if patience is None:
            patience = PATIENCE if isinstance(scenario.movers, NobodyMoves) else math.inf
        scenario = replace(scenario, duration=min(duration, scenario.duration))
        made = partial(planner_for(planner, scenario, seed), **options)
        watcher = _Watcher(patience, between)
        episode = simulate(scenario, seed=seed, on_cycle=watcher, planner=made)
        if episode.interrupted and not watcher.gave_up:
            raise KeyboardInterrupt
        run = Run(
            scenario, episode.world, episode.summary(), episode.states[:, :2], episode.times,
            episode.contacts, tuple(watcher.glimpses), watcher.gave_up,
        )  # fmt: skip
        self._known[repr(asked)] = run
        return run


class _GivenUp(KeyboardInterrupt):
    """Ends an episode early, with what was done so far, as Ctrl-C does."""


@dataclass
class _Watcher:
    """Keeps glimpses, and ends an episode in which nothing goes on any more."""

    patience: float
    between: float
    glimpses: list[Glimpse] = field(default_factory=list)
    gave_up: bool = False
    _moved: float | None = None

    def __call__(self, info: CycleInfo) -> None:
        if not self.glimpses or info.time - self.glimpses[-1].time > self.between - 1e-6:
            self.glimpses.append(glimpse_of(info))
        if self._moved is None or not info.navigator.robot.at_rest(info.state):
            self._moved = info.time
        if info.time - self._moved > self.patience:
            self.gave_up = True
            raise _GivenUp


def glimpse_of(info: CycleInfo) -> Glimpse:
    """What is kept of a cycle."""
    record = info.navigator.record
    plan = np.zeros((0, 2))
    if record.chosen is not None:
        plan = record.chosen.states[record.chosen.times >= info.time, :2]
    return Glimpse(
        info.time, info.state, info.executing.at(info.time + info.navigator.settings.cycle),
        tuple(info.scans), plan, record.reason,
    )  # fmt: skip
