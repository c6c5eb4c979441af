"""The planner's end of the way to the executor."""

from __future__ import annotations

import math
import select
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hardware.base import Odometry
from hardware.executor import ADDRESS
from hardware.follower import moved_on
from hardware.held import OWN, TAKES
from hardware.letterbox import Letterbox
from hardware.messages import (
    MOST_ODOMETRY,
    Ask,
    Beat,
    Body,
    Message,
    MessageError,
    Offer,
    Source,
    decode,
)
from hardware.status import Status
from passpmp_ti.trajectory import Trajectory

REMEMBERED = 64
"""Trajectories that were sent and may be followed still."""
LATELY = 0.5
"""A status is believed for this long [s]; a planner polls in every cycle."""
LONGEST_GUESS = 0.1
"""The robot's state is told for times at most this long after the newest odometry [s], where nobody
says less: what its wheels may do otherwise meanwhile has to be in a margin."""


class PlannerLink:
    """Sends trajectories, and hears what became of them. Nothing that the executor does raises.

        with PlannerLink(directory, track=robot.track) as link:
            while driving:
                link.poll(timeout=0.02)
                if link.ready:
                    state = link.state_at(scan.stamp)
                    trajectory = navigator.update(scan, state, following=link.following)
                    link.beat(scan.stamp)
                    link.offer(trajectory)

    `following` is one of the very objects that were offered, so that the planner knows it again.
    """

    def __init__(
        self,
        directory: Path,
        *,
        track: float,
        guess: float = LONGEST_GUESS,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """
        Args:
            directory: of the executor's sockets.
            track: distance between the driven wheels [m].
            guess: a state is told for times at most this long after the newest odometry [s], and
                an odometry is known here no later than this after its time.
            clock: seconds that never go back, the same for all processes.
        """
        self.status: Status | None = None
        """The newest that came."""
        self._clock = clock
        self._track, self._guess = track, guess
        self._executor = directory / ADDRESS
        self._session = time.monotonic_ns()
        self._box = Letterbox(directory / f"planner-{self._session:x}")
        self._sequence = 0
        self._offered: dict[int, Trajectory] = {}
        self._odometry: deque[Odometry] = deque(maxlen=4 * MOST_ODOMETRY)
        self._resting: tuple[tuple[float, ...], Trajectory] | None = None

    def __enter__(self) -> PlannerLink:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def session(self) -> int:
        """Names this run of the planner; a later one has a greater number."""
        return self._session

    @property
    def ready(self) -> bool:
        """Whether the robot's motion is known: it stands, or follows what came from here."""
        return self.following is not None

    @property
    def following(self) -> Trajectory | None:
        """What the robot will have followed last of all that the executor has taken.

        None: nothing was heard of it lately, or it brakes, or moves by what another planner sent.
        Then there is nothing to plan from; it comes to rest by itself.
        """
        status = self.status
        if status is None or status.state not in TAKES:
            return None
        if self._clock() - status.stamp > LATELY:
            return None
        session, sequence = status.newest
        if session == self._session and sequence in self._offered:
            return self._offered[sequence]
        if status.newest != OWN and status.stamp < status.rests_from:
            return None
        place = (*status.rests, status.rests_from)
        if self._resting is None or self._resting[0] != place:
            state = np.array([*status.rests, 0.0, 0.0])
            self._resting = (place, Trajectory.resting(state, status.rests_from))
        return self._resting[1]

    def offer(self, trajectory: Trajectory) -> bool:
        """Send a trajectory, unless the executor holds it already. Whether it was sent.

        Raises:
            ValueError: it has more states than a message may hold.
        """
        if trajectory is self.following:
            return False
        sent = self._say(Offer(trajectory))
        self._offered[self._sequence] = trajectory
        for old in list(self._offered)[:-REMEMBERED]:
            del self._offered[old]
        return sent

    def beat(self, scan_stamp: float | None = None) -> None:
        """Say that the planner lives, and of when the newest scan is [s]; None: there was none."""
        self._say(Beat(Source.PLANNER, self._clock()))
        if scan_stamp is not None:
            self._say(Beat(Source.SENSOR, scan_stamp))

    def poll(self, timeout: float = 0.0) -> Status | None:
        """Ask for the status, and wait for an answer up to `timeout` [s].

        Returns:
            An answer to this or an earlier question, not seen before; None: none came.
        """
        asked = self._clock()
        self._say(Ask())
        heard = self._collect()
        while heard is None or heard.stamp < asked:
            left = asked + timeout - self._clock()
            if left <= 0.0:
                break
            select.select([self._box], [], [], left)
            heard = self._collect() or heard
        return heard

    def state_at(self, time: float) -> np.ndarray | None:
        """[5] the robot's state (x, y, theta, v_r, v_l) at a time, as measured.

        Between two odometries it is on the straight line; after the newest it goes on as it does.

        Returns:
            None where nothing is known of that time.
        """
        known = self._odometry
        if not known or not known[0].stamp <= time <= known[-1].stamp + self._guess:
            return None
        after = next((n for n, o in enumerate(known) if o.stamp > time), None)
        if after is None:
            return np.array(moved_on(known[-1], time, self._track)[1:])
        a, b = known[after - 1], known[after]
        share = (time - a.stamp) / (b.stamp - a.stamp)
        change = np.subtract(b[1:], a[1:])
        change[2] = math.remainder(change[2], math.tau)
        return np.array(a[1:]) + share * change

    def state_between(self, time: float) -> np.ndarray | None:
        """As `state_at`, of a time that is over, without a guess: wheels slip, and what they tell
        of the way since the newest odometry may be wrong by more than any margin holds.

        Waits for the odometry after that time for as long as one is on its way at the most.

        Returns:
            [5]; None where none came from after it, or nothing is known from before.
        """
        while not self._known_until(time):
            left = time + self._guess - self._clock()
            self.poll(timeout=max(left, 0.0))
            if left <= 0.0:
                break
        return self.state_at(time) if self._known_until(time) else None

    def _known_until(self, time: float) -> bool:
        return bool(self._odometry) and self._odometry[-1].stamp >= time

    def close(self) -> None:
        """Nothing is sent or heard any more."""
        self._box.close()

    def _say(self, body: Body) -> bool:
        self._sequence += 1
        message = Message(self._session, self._sequence, self._clock(), body)
        return self._box.post(self._executor, message.encode())

    def _collect(self) -> Status | None:
        newest = None
        for data, _ in self._box.collect():
            try:
                message = decode(data)
            except MessageError:
                continue
            if isinstance(message.body, Status) and message.session == self._session:
                newest = message.body
                known = self._odometry[-1].stamp if self._odometry else -math.inf
                self._odometry.extend(o for o in newest.odometry if o.whole and o.stamp > known)
        if newest is not None:
            self.status = newest
        return newest
