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
WRONGS = ("", "nan", "clock")
"""Right; trajectories with a number that is none; a clock that is off."""
STEP = 100.0
"""By so much a clock is off [s]."""


class WrongLink(PlannerLink):
    """Says what is wrong, or at the wrong time."""

    def __init__(self, directory: Path, *, track: float, orders: Path) -> None:
        """
        Args:
            directory: of the executor's sockets.
            track: distance between the driven wheels [m].
            orders: where it is told how to go wrong, one of `WRONGS`.
        """
        self._wrong = ""
        self._orders = Letterbox(orders)
        super().__init__(directory, track=track, clock=self._now)

    def poll(self, timeout: float = 0.0) -> Status | None:
        # whatever is wrong, every cycle asks how it goes
        for order, _ in self._orders.collect():
            self._wrong = order.decode()
        return super().poll(timeout)

    def offer(self, trajectory: Trajectory) -> bool:
        if self._wrong == "nan":
            states = trajectory.states.copy()
            states[len(states) // 2, 3] = math.nan
            trajectory = Trajectory(trajectory.times, states, trajectory.brakes_from)
        return super().offer(trajectory)

    def beat(self, scan_stamp: float | None = None) -> None:
        off = STEP if self._wrong == "clock" else 0.0
        super().beat(None if scan_stamp is None else scan_stamp + off)

    def close(self) -> None:
        super().close()
        self._orders.close()

    def _now(self) -> float:
        return time.monotonic() + (STEP if self._wrong == "clock" else 0.0)
