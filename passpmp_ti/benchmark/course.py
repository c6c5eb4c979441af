"""What a benchmark asks of one drive: when it began, when it arrived, what it touched."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from passpmp_ti.benchmark.jackal import LENGTH, WIDTH
from passpmp_ti.benchmark.rectangle import gaps_to_discs, gaps_to_walls
from passpmp_ti.sim.drive import JUDGE_STEP
from passpmp_ti.sim.episode import CycleInfo

SET_OFF = 0.1
"""The clock starts once the robot has moved so far [m]."""
ARRIVED = 1.0
"""Within this of the goal it has arrived, in both benchmarks [m]."""
NEAR = 2.0
"""Things whose centre is farther away are not measured [m]: the gap is told up to there."""


class Course:
    """Watches one episode at the steps of the simulator's judge, until the robot has arrived.

    The robot is its true rectangle here; the simulator's own judge has the discs that cover it.
    """

    def __init__(self, start: tuple[float, float], goal: tuple[float, float]) -> None:
        self._start = np.array(start)
        self._goal = np.array(goal)
        self.began: float | None = None
        """When the robot had moved `SET_OFF` [s]."""
        self.arrived: float | None = None
        """When it was first within `ARRIVED` of the goal [s]."""
        self.touched_moving = False
        """Whether the rectangle touched anything in a step in which the robot moved."""
        self.touched_at_rest = False
        """The same in a step in which it did not."""
        self.nearest = NEAR
        """Least gap between the rectangle and anything while the robot moved [m]."""
        self.fastest_turn = 0.0
        """[rad/s]"""
        self.distance = 0.0
        """Driven [m]."""

    def see(self, info: CycleInfo) -> None:
        """Follow what is executed until the next cycle."""
        if self.arrived is not None:
            return
        cycle, robot = info.navigator.settings.cycle, info.navigator.robot
        times = info.time + np.linspace(0.0, cycle, math.ceil(cycle / JUDGE_STEP - 1e-6) + 1)
        states = info.executing.sampled(times)
        away = np.hypot(*(states[:, :2] - self._goal).T)
        there = np.flatnonzero(away <= ARRIVED)
        if len(there):
            self.arrived = float(times[there[0]])
            times, states = times[: there[0] + 1], states[: there[0] + 1]
        moved = np.flatnonzero(np.hypot(*(states[:, :2] - self._start).T) >= SET_OFF)
        if self.began is None and len(moved):
            self.began = float(times[moved[0]])
        self.fastest_turn = max(
            self.fastest_turn, float(np.abs(states[:, 3] - states[:, 4]).max() / robot.track)
        )
        if len(times) < 2:
            return
        self.distance += float(np.hypot(*np.diff(states[:, :2], axis=0).T).sum())
        gaps = self._gaps(info, times, states)
        rest = robot.at_rest(states)
        moving = ~(rest[:-1] & rest[1:])
        self.touched_moving |= bool((gaps[moving] <= 0).any())
        self.touched_at_rest |= bool((gaps[~moving] <= 0).any())
        if moving.any():
            self.nearest = min(self.nearest, float(gaps[moving].min()))

    def _gaps(self, info: CycleInfo, times: np.ndarray, states: np.ndarray) -> np.ndarray:
        """[n - 1] least gap to anything in each step [m]."""
        world = info.world
        movers, middle = world.movers, states[len(states) // 2, :2]
        here = movers.present(float(times[0])) | movers.present(float(times[-1]))
        reach = NEAR + movers.radius
        near = here & (np.hypot(*(movers.at(float(times[0])) - middle).T) < reach)
        size = (LENGTH, WIDTH)
        # at the samples, 1 cm apart at most; the simulator's own judge tells them without a gap
        walls = gaps_to_walls(size, states, world.outline)
        gaps = np.minimum(walls[:-1], walls[1:])
        if near.any():
            discs = gaps_to_discs(
                size, states, movers.positions(times)[:, near], movers.radius[near]
            )
            gaps = np.minimum(gaps, discs.min(axis=1))
        return gaps

    def told(self) -> dict[str, Any]:
        """The drive in numbers, SI units; None: it did not come to that."""
        took = None
        if self.began is not None and self.arrived is not None:
            took = self.arrived - self.began
        return {
            "arrived": self.arrived is not None,
            "took": took,
            "touched_moving": self.touched_moving,
            "touched_at_rest": self.touched_at_rest,
            "nearest": self.nearest,
            "fastest_turn": self.fastest_turn,
            "distance": self.distance,
        }
