"""The judge: contact between discs and what is really there, exact within a step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from passpmp_ti.robots import Robot
from passpmp_ti.sim import geometry
from passpmp_ti.sim.movers import Movers

WALL = -1
"""Stands for the number of a mover where the robot touched something fixed."""

LOOK_BACK = 3.0  # a mover's speed is told for this long before a contact [s]
SPEED_STEP = 0.02  # and measured over this [s]


def closest_approach(p0: np.ndarray, p1: np.ndarray, q0: np.ndarray, q1: np.ndarray) -> np.ndarray:
    """Least distance between two points that each move evenly along a line in the same time.

    Args:
        p0: [..., 2] where the one is as the step begins [m].
        p1: where it is as the step ends.
        q0: where the other is as the step begins.
        q1: where it is as the step ends.

    Returns:
        [...] the distance at the nearest moment, not only at the ends [m].
    """
    apart = p0 - q0
    change = (p1 - q1) - apart
    length2 = (change * change).sum(axis=-1)
    when = -(apart * change).sum(axis=-1) / np.where(length2 > 0, length2, 1.0)
    nearest = apart + np.clip(when, 0.0, 1.0)[..., None] * change
    return np.sqrt((nearest * nearest).sum(axis=-1))


@dataclass(frozen=True, kw_only=True)
class Contact:
    """One touch, from its first moment to its last."""

    mover: int
    """Which mover; -1: something fixed."""
    start: float
    """Step in which it began [s]."""
    end: float
    """Step in which it was last seen [s]."""
    moving: bool
    """Whether anything on the robot moved at any moment of it."""
    moving_at_start: bool
    """Whether it moved when they met."""
    robot_speed: float
    """Greatest |speed| of the robot's reference point during it [m/s]."""
    mover_speed: float
    """The mover's speed when they met [m/s]."""
    mover_top_speed: float
    """Its greatest speed in the three seconds before they met [m/s]."""
    place: tuple[float, float]
    """Where the robot was when they met [m]."""


def disc_centres(robot: Robot, states: np.ndarray) -> np.ndarray:
    """[n, d, 2] centres of the robot's discs at states [n, 5] [m]."""
    offsets = np.array([offset for offset, _ in robot.discs])
    heading = np.stack([np.cos(states[:, 2]), np.sin(states[:, 2])], axis=1)
    return states[:, None, :2] + offsets[:, None] * heading[:, None]


def gaps_to_movers(
    robot: Robot, states: np.ndarray, positions: np.ndarray, radius: np.ndarray
) -> np.ndarray:
    """[n - 1, m] least gap between the robot and each mover in each step [m], < 0 in contact.

    Args:
        robot: whose discs.
        states: [n, 5] at the steps' ends.
        positions: [n, m, 2] the movers' centres then [m].
        radius: [m] [m].
    """
    discs = disc_centres(robot, states)[:, :, None]
    movers = positions[:, None]
    apart = closest_approach(discs[:-1], discs[1:], movers[:-1], movers[1:])
    return apart.min(axis=1) - robot.disc_radius - radius


def gaps_to_walls(robot: Robot, states: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """[n - 1] least gap between the robot and fixed segments [s, 4] in each step [m]."""
    discs = disc_centres(robot, states)
    if not len(segments):
        return np.full(len(states) - 1, np.inf)
    a, b = segments[:, :2], segments[:, 2:]
    apart = geometry.segment_to_segment(discs[:-1, :, None], discs[1:, :, None], a, b)
    return apart.min(axis=(1, 2)) - robot.disc_radius


class Judge:
    """Follows one episode step by step and keeps account of every contact."""

    def __init__(self, robot: Robot, movers: Movers, segments: np.ndarray) -> None:
        self._robot = robot
        self._movers = movers
        self._segments = segments
        self._open: dict[int, Contact] = {}
        self._ended: list[Contact] = []
        self.nearest_mover = np.inf
        """Least gap to a mover while the robot moved [m]."""
        self.nearest_wall = np.inf
        """Least gap to something fixed while the robot moved [m]."""

    @property
    def contacts(self) -> list[Contact]:
        """Every contact so far, by its start."""
        return sorted([*self._ended, *self._open.values()], key=lambda c: (c.start, c.mover))

    def see(self, times: np.ndarray, states: np.ndarray) -> None:
        """Judge the steps between successive times [n] [s] and states [n, 5]."""
        movers, robot = self._movers, self._robot
        here = movers.present(float(times[0])) | movers.present(float(times[-1]))
        numbers = np.flatnonzero(here)
        positions = movers.positions(times)[:, numbers]
        gaps = gaps_to_movers(robot, states, positions, movers.radius[numbers])
        wall_gaps = gaps_to_walls(robot, states, self._near_segments(states))
        rest = robot.at_rest(states)
        moving = ~(rest[:-1] & rest[1:])
        speed = np.abs(robot.speed(states))
        if moving.any():
            self.nearest_wall = min(self.nearest_wall, float(wall_gaps[moving].min()))
            if len(numbers):
                self.nearest_mover = min(self.nearest_mover, float(gaps[moving].min()))
        touching = np.flatnonzero((gaps <= 0).any(axis=0))
        columns = {int(numbers[n]): gaps[:, n] <= 0 for n in touching}
        if (wall_gaps <= 0).any():
            columns[WALL] = wall_gaps <= 0
        for step in range(len(times) - 1):
            met = {n for n, column in columns.items() if column[step]}
            for n in [n for n in self._open if n not in met]:
                self._ended.append(self._open.pop(n))
            for n in sorted(met):
                fastest = float(speed[step : step + 2].max())
                self._touch(n, times[step : step + 2], states[step], bool(moving[step]), fastest)

    def _touch(
        self, mover: int, times: np.ndarray, state: np.ndarray, moving: bool, speed: float
    ) -> None:
        known = self._open.get(mover)
        if known:
            self._open[mover] = replace(
                known,
                end=float(times[1]),
                moving=known.moving or moving,
                robot_speed=max(known.robot_speed, speed),
            )
            return
        at_contact, top = self._speeds(mover, float(times[1]))
        self._open[mover] = Contact(
            mover=mover,
            start=float(times[0]),
            end=float(times[1]),
            moving=moving,
            moving_at_start=moving,
            robot_speed=speed,
            mover_speed=at_contact,
            mover_top_speed=top,
            place=(float(state[0]), float(state[1])),
        )

    def _speeds(self, mover: int, time: float) -> tuple[float, float]:
        """The mover's speed now, and its greatest in the seconds before [m/s]."""
        if mover == WALL:
            return 0.0, 0.0
        times = np.linspace(time - LOOK_BACK, time, round(LOOK_BACK / SPEED_STEP) + 1)
        path = self._movers.positions(times)[:, mover]
        speeds = np.hypot(*np.diff(path, axis=0).T) / np.diff(times)
        return float(speeds[-1]), float(speeds.max())

    def _near_segments(self, states: np.ndarray) -> np.ndarray:
        """The fixed segments that the robot could touch, or is nearest to, in these steps."""
        if len(self._segments) < 200:
            return self._segments
        reach = self._robot.radius + 2.0
        low, high = states[:, :2].min(axis=0) - reach, states[:, :2].max(axis=0) + reach
        first, second = self._segments[:, :2], self._segments[:, 2:]
        near = ((np.minimum(first, second) <= high) & (np.maximum(first, second) >= low)).all(
            axis=1
        )
        return self._segments[near]
