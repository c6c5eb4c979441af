"""What a cycle is given, judged before anything is made of it: scans, the state, the clock."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from passpmp_ti.planner.place import allowed_gap, only_fits_now
from passpmp_ti.robots import Robot
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

LATEST = 5.0
"""[s] A stamp older by more than this is no late scan but another clock, and one newer by more no
pause, unless the robot is where its plan ends."""
SETTLE = 1.0
"""[s] that another clock must have run on before it is believed."""
LONGEST_STAMP = 1e11
"""[s] Beyond this single milliseconds are lost in a float."""
FARTHEST = 1000.0
"""[m] A robot that is farther from its plan is not believed; single precision ends there too."""
MOST_TURNS = 1e4
"""[rad] A heading beyond this is none."""
MOUNT_SLACK = 1e-3
"""[m] between how a sensor sits now and at first, beyond the declared errors."""
MOUNT_TURN_SLACK = 0.02
"""The same for its bearing [rad]."""

FIELD_SLACK = 1e-3
"""[rad] by which a field of view may be narrower than at first."""

Mount = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Heard:
    """What can be planned with, or why nothing can."""

    scans: tuple[Scan, ...] = ()
    state: np.ndarray | None = None
    """[5]; None where there is trouble."""
    stamp: float = math.nan
    """t_k [s]; nan without a scan."""
    trouble: str = ""
    """Why nothing can be planned; empty where it can."""
    anew: str = ""
    """Why all that was known has to be forgotten, the robot being at rest; mostly empty."""


def scans_in(given: object) -> tuple[tuple[Scan, ...], str]:
    """(the scans, what is wrong with them): a scan, several, or nothing at all."""
    if isinstance(given, Scan):
        return (given,), ""
    if given is None:
        return (), "no scan at all"
    if not isinstance(given, Iterable):
        return (), f"no scan but {type(given).__name__}"
    scans = tuple(given)
    strangers = [type(s).__name__ for s in scans if not isinstance(s, Scan)]
    if strangers:
        return (), f"no scan but {strangers[0]}"
    if not scans:
        return (), "no scan at all"
    stamp = scans[0].stamp
    if any(abs(s.stamp - stamp) > 1e-6 for s in scans):
        return scans, "scans of different instants"
    if abs(stamp) > LONGEST_STAMP:
        return scans, f"a scan of {stamp:.3g} s: no clock says that"
    return scans, ""


def standing(scan: object, state: object, robot: Robot) -> Trajectory:
    """Standing where the first cycle finds the robot, from its scan's stamp on.

    Raises:
        ValueError: no scan, or a robot that is not at rest.
    """
    scans, trouble = scans_in(scan)
    if trouble and not (scans and math.isfinite(scans[0].stamp)):
        raise ValueError(
            f"Navigator.update: {trouble}; the first cycle needs a scan, without one there is"
            f" no time to start from; the robot is at {state!r}"
        )
    given = robot.check_states("Navigator.update", np.asarray(state)[None])[0]
    if not robot.at_rest(given):
        raise ValueError(
            "Navigator.update: the first cycle needs a robot at rest, nothing is planned yet"
            f" that could stop it; got {given!r}"
        )
    return Trajectory.resting(given, scans[0].stamp)


def state_in(given: object) -> np.ndarray | None:
    """The state [5], or None where it is none."""
    try:
        state = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if state.shape != (5,) or not np.isfinite(state).all() or abs(state[2]) > MOST_TURNS:
        return None
    return state


class Intake:
    """Remembers how the sensors sit on the robot, and what the clock has said so far.

    A sensor whose pose does not fit the robot's would teach the memory a shifted world, so how
    each sensor sits is learnt in the first cycle and asked in every later one.

    A scan that is older than the last is not used. What comes after it may be the old clock again
    or one that was put back and has caught up; memory by a clock that was put back would promise
    too much. So after such a scan the clock is believed where only it explains the robot's place
    on its plan; else the robot goes on to rest, and memory is dropped there. A clock that is off
    by more than `LATEST` and runs on is believed once the robot is sure to be at rest.
    """

    def __init__(self, robot: Robot, settings: Settings) -> None:
        self._robot = robot
        self._allowed = allowed_gap(robot, settings)
        # the first and today's, a scan's pose and the robot's: four errors; and a scan's pose is of
        # its sweep, which may be older than its stamp
        error, old = settings.localisation_error, settings.stamp_error
        swing = robot.top_turn_rate * robot.radius
        self._mount_slack = (
            MOUNT_SLACK + 4 * error + old * (robot.top_speed + swing),
            MOUNT_TURN_SLACK + 4 * error / robot.radius + old * robot.top_turn_rate,
        )
        self._spare = 0.5 * settings.cycle
        self._mounts: list[Mount] = []
        self._fields: list[tuple[float, float]] = []
        self._blind_apart = settings.unseen_speed < settings.object_speed
        self._last = -math.inf
        self._doubted = False
        self._other: tuple[float, float] | None = None  # (first, newest) stamp of another clock

    def hear(self, given: object, state: object, held: Trajectory) -> Heard:
        """Judge what a cycle is given.

        Args:
            given: one scan or several, or whatever else came.
            state: the robot's [5], or whatever else came.
            held: what the robot follows.
        """
        scans, trouble = scans_in(given)
        stamp = scans[0].stamp if scans else math.nan
        if trouble:
            return Heard(stamp=stamp, trouble=trouble)
        known = state_in(state)
        if known is None:
            return Heard(stamp=stamp, trouble="the robot's state is not known")
        trouble = self._mounting_trouble(scans, known) or self._silence(scans)
        if trouble:
            return Heard(stamp=stamp, trouble=trouble)
        trouble, anew = self._clock(stamp, known, held)
        if trouble:
            return Heard(stamp=stamp, trouble=trouble)
        planned = held.states[-1] if anew else held.at(stamp)
        if math.dist(known[:2], planned[:2]) > FARTHEST:
            return Heard(stamp=stamp, trouble="a place where the robot cannot be")
        return Heard(scans, known, stamp, anew=anew)

    def used(self, heard: Heard) -> None:
        """A model was made of this: it is what later scans are compared with."""
        assert heard.state is not None
        if not self._mounts:
            self._mounts = [_mount(s.pose, heard.state) for s in heard.scans]
            self._fields = [_field(s) for s in heard.scans]
        self._last = heard.stamp
        self._doubted, self._other = False, None

    def _mounting_trouble(self, scans: tuple[Scan, ...], state: np.ndarray) -> str:
        for scan in scans if self._mounts else ():
            found = _mount(scan.pose, state)
            off = [
                (
                    math.dist(found[:2], known[:2]),
                    abs(math.remainder(found[2] - known[2], 2 * math.pi)),
                )
                for known in self._mounts
            ]
            if not any(d <= self._mount_slack[0] and a <= self._mount_slack[1] for d, a in off):
                apart, turn = min(off)
                return (
                    f"the sensor's pose does not fit the robot's: {apart:.2f} m and {turn:.2f} rad"
                    " off where it sits"
                )
        return ""

    def _silence(self, scans: tuple[Scan, ...]) -> str:
        """Whether a sensor says less than at first, where that would pass for a blind sector.

        What comes out of bearings that are never covered has a bound of its own. Bearings that are
        only not covered now have not.
        """
        if not self._blind_apart or not self._fields:
            return ""
        now = [_field(s) for s in scans]
        for low, high in self._fields:
            held = [n for n in now if n[0] <= low + FIELD_SLACK and n[1] >= high - FIELD_SLACK]
            if not held:
                return "a sensor is silent, or sees less than it did"
            now.remove(held[0])
        return ""

    def _clock(self, stamp: float, state: np.ndarray, held: Trajectory) -> tuple[str, str]:
        """(trouble, why to forget) for a scan of `stamp`."""
        behind = self._last - stamp
        if behind == 0.0:
            return f"the scan of {stamp:.3f} s again", ""
        if 0 < behind <= LATEST:
            self._doubted = True
            return f"scan of {stamp:.3f} s is not newer than the one of {self._last:.3f} s", ""
        resting = bool(self._robot.at_rest(state))
        if behind > LATEST or (-behind > LATEST and not self._waits(stamp, state, held)):
            return self._other_clock(stamp, resting, held)
        if self._doubted and not only_fits_now(held, state, stamp, self._allowed, self._spare):
            # by either reading of the clock the held motion has ended then
            if resting and stamp >= held.end - 1e-6:
                return "", "older scans came, and the clock may have been put back"
            return "older scans came before, and the robot's place does not tell the time", ""
        return "", ""

    def _waits(self, stamp: float, state: np.ndarray, held: Trajectory) -> bool:
        """Whether the robot is at rest where its plan ends, as after a long pause."""
        apart = math.dist(state[:2], held.states[-1, :2])
        resting = bool(self._robot.at_rest(state)) and stamp >= held.end - 1e-6
        # before the first model there is no last stamp to be far from
        return math.isinf(self._last) or (resting and apart <= self._allowed[0])

    def _other_clock(self, stamp: float, resting: bool, held: Trajectory) -> tuple[str, str]:
        self._doubted = True
        jump = stamp - self._last
        if self._other is None or stamp < self._other[1] or stamp > self._other[1] + LATEST:
            self._other = (stamp, stamp)
        self._other = (self._other[0], stamp)
        if resting and stamp - self._other[0] >= max(held.end - self._last, SETTLE):
            return "", f"the clock jumped by {jump:.1f} s"
        return f"the clock jumped by {jump:.1f} s", ""


def _field(scan: Scan) -> tuple[float, float]:
    """First and last bearing of a scan in its sensor's frame [rad]."""
    return scan.angle_min, scan.angle_min + (len(scan.ranges) - 1) * scan.angle_increment


def _mount(pose: tuple[float, float, float], state: np.ndarray) -> Mount:
    """A sensor's pose seen from the robot's [m, m, rad]."""
    dx, dy = pose[0] - state[0], pose[1] - state[1]
    c, s = math.cos(state[2]), math.sin(state[2])
    return (c * dx + s * dy, -s * dx + c * dy, pose[2] - float(state[2]))
