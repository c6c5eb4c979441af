"""A robot that stands short of its goal though it could drive: it backs out, and tries again.

Where every way on is unsafe and every other way costs more, standing looks best, and goes on doing
so: nothing that the robot does not see from there will ever change it. So a place where it stood
for too long costs more and more, until leaving is worth it; what was raised sinks again while the
robot is away, each time more slowly where it stalls there again.

Not part of the guarantee: a wrong guide costs time, never safety.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

REACH = 5.0
"""How far about a stall's place it costs more, in radii of the robot's body: far enough to look
round what it stood beside."""
SINK = 0.5
"""A hill that was left is gone after this share of the patience, and as much more for each time
that the robot stalled there."""
RISE = 4.0
"""Each second of standing more, the flank of a hill is steeper by this many times what a way costs
in the open; beside corners ways cost up to `1 / guide.SLOWEST_SHARE` times as much."""


@dataclass(frozen=True, slots=True)
class Hill:
    """What is added to the cost to go about a place: a cone."""

    place: tuple[float, float]
    """(x, y) of its top [m]."""
    reach: float
    """Radius of its foot [m]."""
    height: float
    """At its top [s]."""


class Stall:
    """Watches whether a robot gets on.

    Args:
        robot: its body tells what counts as the same place.
        settings: `patience`, and the cruise speed.
    """

    def __init__(self, robot: Robot, settings: Settings) -> None:
        self._patience = settings.patience
        self._near = robot.radius
        self._reach = REACH * robot.radius
        self._steeper = RISE / (settings.cruise_speed or robot.top_speed)
        self.forget()

    def forget(self) -> None:
        """Places or times of before mean nothing any more, or there is another goal."""
        self._here: tuple[float, float] | None = None  # it has been about here
        self._since = 0.0  # since then
        self._hill: Hill | None = None  # as high as it was when it was left
        self._left = 0.0  # stamp of that
        self._times = 0  # how often the robot stalled there
        self._raising = False
        self.stuck = False
        """Whether it did not leave for another patience."""

    def look(self, stamp: float, x: float, y: float) -> Hill | None:
        """Where the robot is short of its goal, once a cycle.

        Args:
            stamp: of the cycle [s].
            x, y: of the robot [m].

        Returns:
            What is to be added to the cost to go now; None: nothing.
        """
        if self._patience is None:
            return None
        if self._here is None or math.dist(self._here, (x, y)) > self._near:
            self._here, self._since, self._raising = (x, y), stamp, False
        over = stamp - self._since - self._patience
        self.stuck = over > self._patience
        if over > 0.0:
            self._raise(stamp, over, self._here)
        return self._sunk(stamp)

    def _raise(self, stamp: float, over: float, here: tuple[float, float]) -> None:
        known = self._hill is not None and math.dist(self._hill.place, here) <= self._reach
        if not self._raising:
            self._times = self._times + 1 if known else 1
            self._raising = True
        self._hill = Hill(here, self._reach, self._steeper * over * self._reach)
        self._left = stamp

    def _sunk(self, stamp: float) -> Hill | None:
        if self._hill is None or self._patience is None:
            return None
        gone = (stamp - self._left) / (SINK * self._patience * self._times)
        if gone >= 1.0:
            return None
        return Hill(self._hill.place, self._hill.reach, (1.0 - gone) * self._hill.height)
