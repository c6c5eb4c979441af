"""A planner that plans nothing: random motions, each braked to rest, for trying an executor.

    python -m hardware.executor_trials DIRECTORY --seed 1

It keeps its cycle on the monotonic clock, joins what the executor follows, and can be told, through
a socket of its own, to go wrong.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from pathlib import Path

import numpy as np

from hardware.letterbox import Letterbox
from hardware.link import PlannerLink
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.trajectory import Trajectory

TIME_STEP = 0.01
"""Of its motions [s]."""
CYCLE = 0.1
"""[s]."""
ORDERS = "planner-orders"
"""Name of the socket by which it is told to go wrong."""
WRONGS = ("", "nan", "clock", "frozen")


def motion(
    robot: DifferentialDrive,
    state: np.ndarray,
    start: float,
    rng: np.random.Generator,
    *,
    most_pieces: int = 3,
) -> Trajectory:
    """A random motion within the robot's limits, then braking in proportion, to rest.

    Args:
        robot: whose.
        state: [5] where it begins.
        start: when [s].
        rng: decides what it is.
        most_pieces: of constant wheel acceleration, before it brakes.
    """
    wheels = [np.array(state[3:], dtype=np.float64)[None]]
    a, top = robot.acceleration * TIME_STEP, robot.wheel_speed
    for _ in range(int(rng.integers(1, most_pieces + 1))):
        changes = rng.choice([a, 0.0, -a], 2, p=[0.5, 0.3, 0.2])
        count = np.arange(1, int(rng.integers(11, 51)))[:, None]
        wheels.append(np.clip(wheels[-1][-1] + changes * count, -top, top))
    last = wheels[-1][-1]
    steps = math.ceil(np.abs(last).max() / a)
    # zero times a negative number is a zero, too
    braked = last * (np.arange(steps - 1, -1, -1) / max(steps, 1))[:, None] + 0.0
    speeds = np.concatenate([*wheels, braked])
    # the midpoint rule (eq. 23)
    means = 0.5 * (speeds[1:] + speeds[:-1])
    turns = np.concatenate([[0.0], (means[:, 0] - means[:, 1]) / robot.track * TIME_STEP])
    headings = state[2] + np.cumsum(turns)
    middles = headings[1:] - 0.5 * turns[1:]
    ways = np.stack([np.cos(middles), np.sin(middles)]) * means.mean(axis=1) * TIME_STEP
    x, y = np.concatenate([np.zeros((2, 1)), np.cumsum(ways, axis=1)], axis=1)
    states = np.column_stack([state[0] + x, state[1] + y, headings, speeds])
    times = start + TIME_STEP * np.arange(len(states))
    return Trajectory(times, states, len(states) - 1 - steps)


class SteppedClock:
    """A monotonic clock that can be stepped, as none should."""

    def __init__(self) -> None:
        self.step = 0.0
        """[s]."""

    def __call__(self) -> float:
        return time.monotonic() + self.step


class Rover:
    """Drives about through a `PlannerLink`, a motion each cycle."""

    def __init__(
        self,
        link: PlannerLink,
        robot: DifferentialDrive,
        rng: np.random.Generator,
        clock: SteppedClock,
    ) -> None:
        self.wrong = ""
        """How it goes wrong, one of `WRONGS`: "nan": its motions hold a number that is none;
        "clock": its clock is off by seconds or hours; "frozen": the newest scan stays the same."""
        self._link, self._robot, self._rng, self._clock = link, robot, rng, clock
        self._scan = -math.inf

    def cycle(self) -> None:
        """One cycle, now."""
        self._link.poll(timeout=0.5 * CYCLE)
        if self.wrong != "clock":
            self._clock.step = 0.0
        elif not self._clock.step:
            size = 10.0 ** self._rng.uniform(0.0, 4.0)
            self._clock.step = float(self._rng.choice([-1.0, 1.0])) * size
        now = self._clock()
        if self.wrong != "frozen":
            self._scan = now
        self._link.beat(self._scan)
        following = self._link.following
        if following is None:
            return
        start = now + CYCLE
        planned = motion(self._robot, following.at(start), start, self._rng)
        if self.wrong == "nan":
            row, column = self._rng.integers(len(planned.states)), self._rng.integers(5)
            planned.states[row, column] = math.nan
        self._link.offer(planned)


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Drive an executor about at random.",
        epilog="example: python -m hardware.executor_trials /run/passpmp --seed 1",
    )
    parser.add_argument("directory", type=Path, help="of the executor's sockets")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--wheel-speed", type=float, default=1.5, help="[m/s]")
    given = parser.parse_args()
    robot = DifferentialDrive(wheel_speed=given.wheel_speed)
    orders = Letterbox(given.directory / ORDERS)
    clock = SteppedClock()
    with PlannerLink(given.directory, track=robot.track, clock=clock) as link:
        rover = Rover(link, robot, np.random.default_rng(given.seed), clock)
        due, parent = time.monotonic(), os.getppid()
        while os.getppid() == parent:
            for order, _ in orders.collect():
                rover.wrong = order.decode()
            rover.cycle()
            # a cycle that was slept through is not made up for
            due = max(due + CYCLE, time.monotonic() - CYCLE)
            time.sleep(max(due - time.monotonic(), 0.0))


if __name__ == "__main__":
    main()
