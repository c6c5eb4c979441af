"""What the robot truly does while its poses and its clock may be wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from passpmp_ti.robots import Robot
from passpmp_ti.trajectory import Trajectory

JOIN = (5e-3, 0.01, 0.02)
"""How far apart what was followed and what follows may be where they join [m, rad, m/s]."""


@dataclass(frozen=True, slots=True)
class Frame:
    """Wrong poses and stamps: told = turned(true) + (x, y), told time = true time + shift."""

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0
    shift: float = 0.0

    def told(self, states: np.ndarray) -> np.ndarray:
        """States or poses [..., >= 3] as they are told."""
        return self._moved(states, self.turn, (self.x, self.y))

    def true(self, states: np.ndarray) -> np.ndarray:
        """States [..., >= 3] as they are."""
        c, s = math.cos(self.turn), math.sin(self.turn)
        x, y = -self.x, -self.y
        return self._moved(states, -self.turn, (c * x + s * y, -s * x + c * y))

    def _moved(self, states: np.ndarray, turn: float, by: tuple[float, float]) -> np.ndarray:
        if turn == 0.0 and by == (0.0, 0.0):
            return states
        moved = np.array(states, dtype=np.float64)
        c, s = math.cos(turn), math.sin(turn)
        moved[..., 0] = c * states[..., 0] - s * states[..., 1] + by[0]
        moved[..., 1] = s * states[..., 0] + c * states[..., 1] + by[1]
        moved[..., 2] += turn
        return moved


class Executor:
    """Follows answers: by its own steady clock, by its wheels, and only from their start.

    It takes an answer as an order about the robot's own motion: the place and the time that the
    planner was told are laid onto where and when the robot truly was. So a pose or a clock that
    jumps does not make the robot jump. What comes after its own start is not taken: the robot is
    not there any more.
    """

    def __init__(self, robot: Robot, state: np.ndarray, time: float) -> None:
        self._robot = robot
        self.answer: Trajectory | None = None
        """The planner's answer that is followed; None before the first."""
        self._past = [(-math.inf, Trajectory.resting(state, time))]
        self._next: tuple[Trajectory, Trajectory] | None = None
        self.dropped = 0
        """Answers that came too late."""
        self.breaks = 0
        """Answers that did not begin where the robot was when they did: not taken."""

    @property
    def true_path(self) -> Trajectory:
        """What is followed now, in true places and times."""
        return self._past[-1][1]

    def at(self, time: float) -> np.ndarray:
        """[5] the true state at `time` [s], now or before."""
        followed = next(path for since, path in reversed(self._past) if since <= time)
        return followed.at(time)

    def offer(self, answer: Trajectory, frame: Frame, arrives: float) -> None:
        """Hear an answer that comes at `arrives` [s] and was made of what `frame` told."""
        if answer is self.answer:
            self._next = None
            return
        path = Trajectory(answer.times - frame.shift, frame.true(answer.states), answer.brakes_from)
        rests = len(path.times) == 1
        if path.start < arrives - 1e-6 and not rests:
            self.dropped += 1
            return
        self._next = (answer, path)

    def switch(self, begin: float, end: float) -> float | None:
        """Time in [begin, end] [s] at which the next answer takes over; None: it does not."""
        if self._next is None:
            return None
        time = max(self._next[1].start, begin)
        return time if time <= end + 1e-9 else None

    def take(self, time: float) -> None:
        """Follow the next answer from `time` [s] on, if it begins where the robot is then."""
        assert self._next is not None
        before, after = self.true_path.at(time), self._next[1].at(time)
        apart = math.dist(before[:2], after[:2])
        turn = abs(math.remainder(before[2] - after[2], 2 * math.pi))
        speed = abs(float(self._robot.speed(before) - self._robot.speed(after)))
        if self.answer is not None and (apart > JOIN[0] or turn > JOIN[1] or speed > JOIN[2]):
            self.breaks += 1
            self._next = None
            return
        self.answer, path = self._next
        self._past = [self._past[0], *self._past[1:][-60:], (time, path)]
        self._next = None
