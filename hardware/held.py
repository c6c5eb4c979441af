"""What an executor holds, and what it does about it. No clock, no process, no socket."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from hardware.admission import judge
from hardware.base import BaseLimits, Odometry, check_fits
from hardware.executor_settings import ExecutorSettings
from hardware.follower import error_of, wheel_speeds
from hardware.messages import Source
from hardware.path import Path, Place, gap
from hardware.status import Reason, State, Verdict
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.trajectory import Trajectory

OWN = (0, 0)
"""Name of a rest that no planner sent."""
MOST_WAITING = 8
"""Trajectories that wait for their start."""
REMEMBERED = 1.0
"""What was followed is known for this long [s]: odometry is never as old."""
CLOCK_SLACK = 0.002
"""[s]; a stamp farther ahead than this is of another clock."""

TAKES = (State.RESTING, State.FOLLOWING, State.CARRYING_ON)
"""States in which it knows where it is and takes trajectories."""


class Order(NamedTuple):
    """What the base is told."""

    right: float
    left: float
    """[m/s]."""
    stop: bool
    """Its own emergency stop too."""


REST = Order(0.0, 0.0, False)


@dataclass(frozen=True, slots=True)
class Leg:
    """A path that is followed from a time on."""

    since: float
    path: Path
    name: tuple[int, int]


class Held:
    """Always holds a motion that ends at rest, and answers every tick with an order.

    Nothing here raises because of what comes in. All times are of one monotonic clock [s].
    """

    def __init__(
        self,
        robot: DifferentialDrive,
        limits: BaseLimits,
        settings: ExecutorSettings,
        now: float,
    ) -> None:
        """
        Raises:
            ValueError: the base cannot do what is planned for the robot, or runs on for too long
                where it is told nothing.
        """
        check_fits(limits, robot)
        settings.check_watchdog(limits, robot)
        self.state = State.STOPPED
        self.reason = Reason.STARTING
        self.error = 0.0
        """How far off its path the robot was, as last seen [m]."""
        self.worst_error = 0.0
        self.order = REST
        self.judged = OWN
        self.verdict = Verdict.NONE
        self.taken = 0
        self.refused = 0
        self._robot, self._limits, self._settings = robot, limits, settings
        self._legs: list[Leg] = []
        self._newest_taken = OWN
        self._beats = {source: -math.inf for source in Source}
        self._odometry: Odometry | None = None
        self._now = now
        self._rest_by = now
        self._settling_since: float | None = None

    @property
    def held(self) -> tuple[int, int]:
        """(session, sequence) of what is followed now."""
        return self._leg(self._now).name if self._legs else OWN

    @property
    def newest(self) -> tuple[int, int]:
        """Of what is followed last of all that was taken."""
        return self._legs[-1].name if self._legs else OWN

    @property
    def last(self) -> tuple[Place, float]:
        """Where and from when on it will rest [s]."""
        if self._legs:
            return self._legs[-1].path.last, self._legs[-1].path.end
        here = self._odometry
        place = Place(0, 0, 0, 0, 0) if here is None else Place(*here[1:4], 0.0, 0.0)
        return place, self._now

    def at(self, time: float) -> Place:
        """Where what is held has the robot at a time: a moment ago, now, or later."""
        return self._leg(time).path.at(time)

    def hear(self, source: Source, of: float, now: float, session: int | None = None) -> None:
        """A sign of life, of the time `of`: what is of the future is of another clock, and what a
        planner says after its successor was followed does not keep that one alive.

        Args:
            source: who lives.
            of: when [s].
            now: when it came [s].
            session: which run of the planner says so; None: the one that is followed.
        """
        stale = session is not None and session < self._newest_taken[0]
        if source is Source.PLANNER and stale:
            return
        if of <= now + CLOCK_SLACK:
            self._beats[source] = max(self._beats[source], of)

    def offer(
        self, trajectory: Trajectory, name: tuple[int, int], sent_at: float, now: float
    ) -> Verdict:
        """Hear a trajectory, and take it or not.

        Args:
            trajectory: verified whole.
            name: (session, sequence): which run of a planner sent it, and its number.
            sent_at: by the sender's clock [s].
            now: when it came [s].
        """
        verdict = self._judge(trajectory, name, sent_at, now)
        if verdict is Verdict.TAKEN:
            path = Path(trajectory)
            # what would have been followed later made way for it
            self._legs = [leg for leg in self._legs if leg.since < path.start]
            self._legs.append(Leg(path.start, path, name))
            self._newest_taken = name
            self.taken += 1
        elif verdict is not Verdict.REPEATED:
            self.refused += 1
        self.judged, self.verdict = name, verdict
        return verdict

    def stop(self) -> None:
        """Stop for good."""
        self._let_go(State.EMERGENCY, Reason.BUTTON)

    def slept(self, now: float) -> None:
        """The machine was asleep: clocks stood still meanwhile and the world did not, so what was
        verified before holds no more."""
        if self.state in TAKES:
            self._give_up(Reason.SLEPT, now)

    def reset(self) -> bool:
        """Forget an emergency stop, if the robot is at rest. Whether it did."""
        if self.state is not State.EMERGENCY or not self._rests(self._odometry):
            return False
        self._let_go(State.STOPPED, self.reason)
        return True

    def step(self, now: float, odometry: Odometry | None) -> Order:
        """One tick: the order from now until the next tick.

        Args:
            now: [s].
            odometry: the newest that there is.
        """
        since_last, self._now = max(now - self._now, 0.0), now
        self._odometry = odometry
        trouble = self._trouble(odometry, now)
        if self.state in TAKES and trouble is not Reason.NONE:
            self._give_up(trouble, now)
        if self.state in TAKES:
            assert odometry is not None
            self.order = self._follow(odometry, now, since_last)
        else:
            self.order = self._brake(since_last, now)
            self._come_to_rest(odometry, now)
        return self.order

    # what comes in ----------------------------------------------------------------------------

    def _judge(
        self, trajectory: Trajectory, name: tuple[int, int], sent_at: float, now: float
    ) -> Verdict:
        s = self._settings
        if name == self._newest_taken:
            return Verdict.REPEATED
        if name < self._newest_taken:
            return Verdict.SUPERSEDED
        # a number that is none compares with nothing: each test asks for what must hold
        if not sent_at <= now + CLOCK_SLACK:
            return Verdict.WRONG_CLOCK
        if not sent_at >= now - s.planner_timeout:
            return Verdict.LATE
        fit = judge(trajectory, self._robot)
        if fit is not Verdict.TAKEN:
            return fit
        if self.state not in TAKES:
            return Verdict.STOPPED
        self.hear(Source.PLANNER, sent_at, now)
        if self._silent(Source.SENSOR, now):
            return Verdict.SENSOR_SILENT
        if trajectory.start < now:
            return Verdict.LATE
        if trajectory.start > now + s.ahead:
            return Verdict.EARLY
        # it replaces what would have begun at the same time, and must join what goes before that
        before = [leg for leg in self._legs if leg.since < trajectory.start] or self._legs[:1]
        ends, start = before[-1].path.at(trajectory.start), Place(*trajectory.states[0].tolist())
        if any(g > j for g, j in zip(gap(ends, start), s.join, strict=True)):
            return Verdict.DOES_NOT_JOIN
        if sum(leg.since > now for leg in self._legs) >= MOST_WAITING:
            return Verdict.FULL
        return Verdict.TAKEN

    def _silent(self, source: Source, now: float) -> bool:
        s = self._settings
        most = s.planner_timeout if source is Source.PLANNER else s.sensor_timeout
        return now - self._beats[source] > most

    def _trouble(self, odometry: Odometry | None, now: float) -> Reason:
        """Why the robot cannot go on with what it holds."""
        if odometry is None:
            return Reason.FEEDBACK_LOST
        if not odometry.whole or odometry.stamp > now + CLOCK_SLACK:
            return Reason.FEEDBACK_BROKEN
        if now - odometry.stamp > self._settings.feedback_timeout:
            return Reason.FEEDBACK_LOST
        if not self._legs:
            return Reason.NONE
        self.error = error_of(odometry, self.at(odometry.stamp), self._robot.overhang)
        if self.state in TAKES:
            self.worst_error = max(self.worst_error, self.error)
        # what it may have moved away since it was measured
        since = max(now - odometry.stamp, 0.0)
        if self.error + self._settings.leaving_speed * since > self._settings.bound:
            return Reason.OFF_ITS_PATH
        over = self._leg(odometry.stamp).path.end + self._settings.rest_late
        if odometry.stamp > over and not self._rests(odometry):
            return Reason.ROLLING
        return Reason.NONE

    # what goes out ----------------------------------------------------------------------------

    def _follow(self, odometry: Odometry, now: float, since_last: float) -> Order:
        leg = self._leg(now)
        self._legs = [
            one
            for one, after in zip(self._legs, [*self._legs[1:], None], strict=True)
            if after is None or after.since > now - REMEMBERED
        ]
        right, left = wheel_speeds(odometry, self.at, now, self._limits, self._settings.follower)
        if not (math.isfinite(right) and math.isfinite(left)):
            self._give_up(Reason.NO_ORDER, now)
            return self._brake(since_last, now)
        silent = [source for source in Source if self._silent(source, now)]
        if now >= leg.path.end:
            self.state, self.reason = State.RESTING, Reason.NONE
        elif silent:
            self.state = State.CARRYING_ON
            self.reason = (
                Reason.PLANNER_SILENT if Source.PLANNER in silent else Reason.SENSOR_SILENT
            )
        else:
            self.state, self.reason = State.FOLLOWING, Reason.NONE
        return Order(right, left, False)

    def _brake(self, since_last: float, now: float) -> Order:
        """Less than the order before by what the base can do, both wheels in proportion: the
        robot then keeps to the circle that it is on. Then the base's own stop too: it stays until
        it is known where the robot stands."""
        right, left, _ = self.order
        fastest = max(abs(right), abs(left))
        less = self._limits.acceleration * since_last
        share = 0.0 if fastest <= less else 1.0 - less / fastest
        stop = self.state is State.EMERGENCY or now >= self._rest_by
        return Order(share * right, share * left, stop)

    def _come_to_rest(self, odometry: Odometry | None, now: float) -> None:
        """After braking the robot stands; once it is known where, that is what is held."""
        if self.state is State.EMERGENCY:
            return
        known = self._trouble(odometry, now) is Reason.NONE
        if self.state is State.BRAKING and now >= self._rest_by:
            self.state = State.STOPPED
        if self.state is not State.STOPPED or not known or not self._rests(odometry):
            self._settling_since = None
            return
        if self._settling_since is None:
            self._settling_since = now
        if now - self._settling_since >= self._settings.settled_after:
            assert odometry is not None
            rest = Path.resting(odometry.x, odometry.y, odometry.theta, odometry.stamp)
            self._legs = [Leg(odometry.stamp, rest, OWN)]
            self.state, self.reason = State.RESTING, Reason.NONE

    def _give_up(self, reason: Reason, now: float) -> None:
        """Brake off what is held."""
        self._let_go(State.BRAKING, reason)
        fastest = max(abs(self.order.right), abs(self.order.left))
        self._rest_by = now + fastest / self._limits.acceleration + self._settings.rest_late

    def _let_go(self, state: State, reason: Reason) -> None:
        self.state, self.reason = state, reason
        self._legs = []
        self._settling_since = None

    def _rests(self, odometry: Odometry | None) -> bool:
        if odometry is None or not odometry.whole:
            return False
        return max(abs(odometry.right), abs(odometry.left)) <= self._settings.rest_speed

    def _leg(self, time: float) -> Leg:
        """The newest that began by then; the oldest known, before all of them."""
        return next((leg for leg in reversed(self._legs) if leg.since <= time), self._legs[0])
