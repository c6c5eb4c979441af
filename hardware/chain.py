"""From scans to trajectories, cycle by cycle: what runs between range finders and executor, on a
robot and on the twin."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from hardware.link import PlannerLink
from hardware.merge import Pairing, read_together
from hardware.scip_client import ScipClient
from hardware.scip_receiver import Pose
from hardware.sleep import Sleep, Slept, asleep
from hardware.status import State
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.scan import Scan

NOWHERE: Pose = (math.nan, math.nan, math.nan)
"""A range finder's pose at a time of which nothing is known; no scan is made of it."""
WAIT = 0.25
"""For scans that are due [s]."""
ASK = 0.02
"""For the executor's answer [s]."""


class Sent(NamedTuple):
    """A trajectory that was sent to the executor; times on the monotonic clock [s]."""

    stamp: float
    """Of the scans that it was planned on."""
    arrived: float
    """When they were there."""
    at: float
    """When it was sent."""
    start: float
    """When it begins."""


class Round(NamedTuple):
    """What one cycle came to."""

    scans: tuple[Scan, ...] | None
    """None: none came in time."""
    took: float | None
    """From the scans' arrival to the planner's answer, sent [s]; None: there was nothing to plan
    from: no scan, no pose, or a robot that brakes."""
    sent: Sent | None
    """None: nothing new."""


class Planning:
    """From scans of one instant to a trajectory at the executor, whoever brings the scans."""

    def __init__(self, navigator: Navigator, slept: Callable[[], Slept] = asleep) -> None:
        """
        Args:
            navigator: plans.
            slept: tells for how long the machine has slept.
        """
        self._navigator = navigator
        self._sleep = Sleep(slept)
        self.slept = False
        """Whether the machine was asleep since: memory speaks of the world before that, by a clock
        that stood still, so nothing more is planned."""

    def round(
        self,
        link: PlannerLink,
        scans: tuple[Scan, ...] | None,
        state: np.ndarray | None,
        arrived: float,
    ) -> Round:
        """Plan a cycle, and send what was planned.

        Args:
            link: to the executor.
            scans: of one instant; None: there are none.
            state: [5] the robot's then; None: nobody knows.
            arrived: when the scans were there [s].
        """
        self.slept = self.slept or self._sleep.woke()
        if scans is None or state is None or not link.ready or self.slept:
            return Round(scans, None, None)
        answer = self._navigator.update(scans, state, following=link.following)
        self.slept = self._sleep.woke()
        if self.slept:
            return Round(scans, None, None)
        stamp = scans[0].stamp
        link.beat(stamp)
        sent = None
        if link.offer(answer):
            sent = Sent(stamp, arrived, time.monotonic(), answer.start)
        return Round(scans, time.monotonic() - arrived, sent)


class PlannerLoop:
    """Range finders, planner and the way to the executor; each `round` is a cycle."""

    def __init__(
        self,
        navigator: Navigator,
        link: PlannerLink,
        clients: Sequence[ScipClient],
        *,
        cycle: float,
        apart: float,
        slept: Callable[[], Slept] = asleep,
    ) -> None:
        """
        Args:
            navigator: plans.
            link: to the executor.
            clients: of the range finders, with poses by `poser`.
            cycle: of the planner [s].
            apart: stamps of scans of one instant differ by this at the most [s].
            slept: tells for how long the machine has slept.
        """
        self._link, self._clients = link, clients
        self._pairing = Pairing(len(clients), apart=apart)
        self._cycle = cycle
        self._due = time.monotonic()
        self._planning = Planning(navigator, slept)

    @property
    def slept(self) -> bool:
        """As `Planning.slept`."""
        return self._planning.slept

    def round(self) -> Round:
        """Wait until a cycle is due, plan it, and send what was planned."""
        scans, arrived = self._scans()
        self._due = max(self._due + self._cycle, time.monotonic() - self._cycle)
        self._link.poll(timeout=ASK)
        state = None if scans is None else known_state(self._link, scans[0].stamp)
        return self._planning.round(self._link, scans, state, arrived)

    def _scans(self) -> tuple[tuple[Scan, ...] | None, float]:
        """The first scans of one instant that come after a cycle is due, and when; those before are
        read and passed over, as the sockets hold few."""
        until = max(self._due, time.monotonic())
        while (left := until - time.monotonic()) > 0:
            read_together(self._clients, self._pairing, left)
            self._link.poll()
        return read_together(self._clients, self._pairing, WAIT), time.monotonic()


def known_state(link: PlannerLink, when: float) -> np.ndarray | None:
    """[5] the robot's state at a time [s]; None where nobody knows. Its wheels stand where the
    executor says that it rests: what they seem to turn then is noise."""
    state, status = link.state_at(when), link.status
    if state is not None and status is not None and status.state is State.RESTING:
        state[3:] = 0.0
    return state


def poser(link: PlannerLink, of_robot: Callable[[np.ndarray], Pose]) -> Callable[[float], Pose]:
    """Where a range finder is, from where the executor says that the robot is.

    Args:
        link: to the executor.
        of_robot: the sensor's pose for a robot's state.
    """

    def pose_at(when: float) -> Pose:
        state = link.state_between(when)
        return NOWHERE if state is None else of_robot(state)

    return pose_at
