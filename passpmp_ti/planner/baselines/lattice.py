"""A robot reduced to a few moves of one duration, for the viability kernel.

Speeds are whole multiples of one level, and at the end of a move the wheels stand straight (a car)
or run alike (others). Between two levels the robot accelerates evenly; a turn is steered into in
the first half of a move and out of in the second. So each move is one that the robot really drives:
what is reduced is the choice, not the dynamics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from passpmp_ti.planner.baselines.motion import Motion
from passpmp_ti.robots import CAR, FREE, Control
from passpmp_ti.trajectory import Trajectory

LEVELS = (-1, 0, 1, 2)
"""Speeds [levels]."""
STANDING = LEVELS.index(0)
HEADINGS = 24
LOOKS = 8
"""Places along a move at which it is looked at."""
CELL_SHARE = 0.5
"""Of the way of a move at level 1: the side of a cell."""


@dataclass(frozen=True, slots=True)
class Move:
    """From one speed to the next, straight on or turning."""

    before: int
    """Index into `LEVELS`."""
    after: int
    turn: int
    """1 left, 0 straight on, -1 right, for a robot that drives forwards."""
    controls: tuple[Control, ...]
    """One for each half."""


class Lattice:
    """The moves of one robot.

    Args:
        motion: of the robot.
        half: time steps of half a move.
    """

    def __init__(self, motion: Motion, half: int) -> None:
        self.motion = motion
        self.half = half
        robot = motion.robot
        self.duration = 2 * half * motion.settings.time_step
        """Of a move [s]."""
        rate = robot.deceleration
        # two levels below the top speed, and one in reverse, each reached with half the brakes
        low, high = motion.limits()
        self.level = min(0.5 * rate * self.duration, 0.4 * high[0], 0.8 * -low[0] or math.inf)
        """Speed of level 1 [m/s]."""
        self.cell = CELL_SHARE * self.level * self.duration
        """Side of a cell [m]."""
        self.moves = self._moves(low[0] < 0)
        paths = [self._path(move) for move in self.moves]
        self.looks = np.stack([path[0] for path in paths])
        """[U, LOOKS, 2] places along each move from (0, 0) with heading 0, at the middles of equal
        times [m]."""
        self.ends = np.stack([path[1] for path in paths])
        """[U, 3] pose after each move."""

    def _moves(self, reverses: bool) -> list[Move]:
        found = []
        for before in range(len(LEVELS)):
            # keeping its speed comes first: it wins ties
            for after in (before, before + 1, before - 1):
                if not 0 <= after < len(LEVELS):
                    continue
                for turn in (0, 1, -1):
                    backwards = LEVELS[before] < 0 or LEVELS[after] < 0
                    standing = LEVELS[before] == LEVELS[after] == 0
                    if backwards and not reverses:
                        continue
                    if standing and turn and self.motion.robot.kind == CAR:
                        continue  # it would only steer where it stands
                    controls = self._controls(LEVELS[after] - LEVELS[before], turn)
                    found.append(Move(before, after, turn, controls))
        return found

    def _controls(self, levels: int, turn: int) -> tuple[Control, ...]:
        robot, time = self.motion.robot, self.duration
        along = levels * self.level / time
        if robot.kind == CAR:
            _, high = self.motion.limits()
            rate = turn * min(self.motion.rates[1], 2 * high[1] / time)
            return (FREE, along, rate), (FREE, along, -rate)
        # what is left of the brakes, and of the top speed in the middle
        spare = min(0.5 * robot.deceleration, 2 * (robot.top_speed - 2 * self.level) / time)
        across = turn * spare
        return (FREE, along + across, along - across), (FREE, along - across, along + across)

    def speeds(self, level: int) -> np.ndarray:
        """[2] the last two numbers of a state at a level, given by its index."""
        speed = LEVELS[level] * self.level
        return np.array([speed, 0.0 if self.motion.robot.kind == CAR else speed])

    def drive(self, state: np.ndarray, start: float, move: Move) -> Trajectory:
        """A move from a state [5] at `start`, then braking to rest."""
        begin = np.concatenate([state[:3], self.speeds(move.before)])
        path = self.motion.by_controls(
            begin, start, list(move.controls), [self.half] * len(move.controls)
        )
        end = 2 * self.half
        if LEVELS[move.after] == 0:
            # sums of f32 leave a trace of speed, and braking it off another step
            states = path.states[: end + 1].copy()
            states[-1, 3:] = 0.0
            return Trajectory(path.times[: end + 1], states, end)
        return path

    def _path(self, move: Move) -> tuple[np.ndarray, np.ndarray]:
        driven = self.drive(np.zeros(5), 0.0, move)
        middles = (np.arange(LOOKS) + 0.5) * self.duration / LOOKS
        return driven.sampled(middles)[:, :2], driven.at(self.duration)[:3]
