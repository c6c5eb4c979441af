"""A planner's link that goes wrong when it is told to, for trying the chain."""

from __future__ import annotations

import math
import time
from pathlib import Path

from hardware.letterbox import Letterbox
from hardware.link import PlannerLink
from hardware.status import Status
from passpmp_ti.trajectory import Trajectory

ORDERS = "planner-orders"
"""Name of the socket by which a planner is told to go wrong."""
NAN, CLOCK = "nan", "clock"
"""Orders: trajectories with a number that is none; "clock 100": a clock that is off by so many
seconds. Any other: go right."""


class WrongLink(PlannerLink):
    """Says what is wrong, or at the wrong time."""

    def __init__(self, directory: Path, *, track: float, guess: float, orders: Path) -> None:
        """
        Args:
            directory: of the executor's sockets.
            track: distance between the driven wheels [m].
            guess: a state is told for times at most this long after the newest odometry [s].
            orders: where it is told how to go wrong.
        """
        self._nan, self._step = False, 0.0
        self._orders = Letterbox(orders)
        super().__init__(directory, track=track, guess=guess, clock=self._now)

    def poll(self, timeout: float = 0.0) -> Status | None:
        # whatever is wrong, every cycle asks how it goes
        for order, _ in self._orders.collect():
            what, _, by = order.decode().partition(" ")
            self._nan, self._step = what == NAN, float(by) if what == CLOCK else 0.0
        return super().poll(timeout)

    def offer(self, trajectory: Trajectory) -> bool:
        if self._nan:
            states = trajectory.states.copy()
            states[len(states) // 2, 3] = math.nan
            trajectory = Trajectory(trajectory.times, states, trajectory.brakes_from)
        return super().offer(trajectory)

    def beat(self, scan_stamp: float | None = None) -> None:
        super().beat(None if scan_stamp is None else scan_stamp + self._step)

    def close(self) -> None:
        super().close()
        self._orders.close()

    def _now(self) -> float:
        return time.monotonic() + self._step
