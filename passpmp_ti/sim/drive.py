"""What the robot really does between two cycles, watched by the judge."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.sim.contacts import Judge
from passpmp_ti.sim.scenario import Scenario
from passpmp_ti.sim.world import World
from passpmp_ti.trajectory import Trajectory

JUDGE_STEP = 0.005
"""Longest step between states that the judge connects by straight lines [s]."""
STORE_STEP = 0.05
"""Time between stored states, at most [s]."""


@dataclass
class Drive:
    """The robot's truth so far, and the judge that watches it."""

    scenario: Scenario
    world: World
    state: np.ndarray
    start_time: float
    distance: float = 0.0
    time_moving: float = 0.0
    times: list[np.ndarray] = field(default_factory=list)
    states: list[np.ndarray] = field(default_factory=list)
    records: list[CycleRecord] = field(default_factory=list)
    update_times: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.executing = Trajectory.resting(self.state, self.start_time)
        self.judge = Judge(self.scenario.robot, self.world.movers, self.world.outline)
        self.times.append(np.array([self.start_time]))
        self.states.append(self.state[None])

    def state_at(self, time: float) -> np.ndarray:
        """[5] where the robot is if it goes on as it does."""
        return self.executing.at(time)

    def note(self, record: CycleRecord, seconds: float) -> None:
        """Keep a cycle's record, without what only its own picture needs."""
        self.records.append(replace(record, model=None, tree=None, particle_leaves=(), chosen=None))
        self.update_times.append(seconds)

    def go_on(self, begin: float, end: float) -> None:
        """Execute what is held from `begin` to `end` [s], under the judge's eyes."""
        count = max(math.ceil((end - begin) / JUDGE_STEP - 1e-6), 1)
        times = np.linspace(begin, end, count + 1)
        self.follow(times, self.executing.sampled(times))

    def follow(self, times: np.ndarray, states: np.ndarray) -> None:
        """Take note of where the robot truly was: states [n, 5] at times [n] [s]."""
        self.judge.see(times, states)
        rest = self.scenario.robot.at_rest(states)
        self.distance += float(np.hypot(*np.diff(states[:, :2], axis=0).T).sum())
        self.time_moving += float((np.diff(times)[~(rest[:-1] & rest[1:])]).sum())
        count = len(times) - 1
        stored = math.ceil(float(times[-1] - times[0]) / STORE_STEP - 1e-6)
        kept = np.unique(np.linspace(0, count, max(stored, 1) + 1).round().astype(int))[1:]
        self.times.append(times[kept])
        self.states.append(states[kept])
