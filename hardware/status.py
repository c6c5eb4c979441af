"""What an executor says of itself."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from hardware.base import Odometry


class State(IntEnum):
    """What it does."""

    STOPPED = 0
    """Stands, and takes nothing until it knows where."""
    RESTING = 1
    """Stands at the end of what it holds."""
    FOLLOWING = 2
    """Follows what it holds."""
    CARRYING_ON = 3
    """Follows what it holds to its end; planner or sensor are silent."""
    BRAKING = 4
    """Brakes off what it holds, as hard as it can."""
    EMERGENCY = 5
    """Was told to stop for good."""


class Reason(IntEnum):
    """Why it does that."""

    NONE = 0
    STARTING = 1
    PLANNER_SILENT = 2
    SENSOR_SILENT = 3
    FEEDBACK_LOST = 4
    FEEDBACK_BROKEN = 5
    OFF_ITS_PATH = 6
    NO_ORDER = 7
    """The follower came to a number that is none."""
    ROLLING = 8
    """It should be at rest, and its wheels turn."""
    BUTTON = 9
    SLEPT = 10
    """The machine was put to sleep, and woke."""


class Verdict(IntEnum):
    """What became of a trajectory that was sent."""

    NONE = 0
    TAKEN = 1
    REPEATED = 2
    """It was taken before."""
    SUPERSEDED = 3
    """A newer one, or one of a newer planner, was taken before."""
    LATE = 4
    EARLY = 5
    """Its start is farther ahead than any plan's."""
    WRONG_CLOCK = 6
    """It was sent later than now."""
    NOT_WHOLE = 7
    """Numbers that are none, times that do not increase, or no rest at the end."""
    BEYOND_LIMITS = 8
    """The robot cannot do that."""
    DOES_NOT_JOIN = 9
    """It does not start where the robot will be."""
    STOPPED = 10
    """The robot brakes, or does not know where it stands."""
    SENSOR_SILENT = 11
    FULL = 12
    """Too many wait for their start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """An executor, as it tells of itself at one instant."""

    stamp: float
    """[s], on the monotonic clock that all of this machine's processes share."""
    state: State
    reason: Reason
    held: tuple[int, int]
    """(session, sequence) of what is followed now; (0, 0): rest, by the executor's own."""
    newest: tuple[int, int]
    """Of what is followed last of all that was taken."""
    rests: tuple[float, float, float]
    """Where that ends (x, y, theta) [m, m, rad]."""
    rests_from: float
    """[s]."""
    judged: tuple[int, int]
    """(session, sequence) of the newest trajectory that came."""
    verdict: Verdict
    error: float
    """How far off its path the robot was, as last seen [m]."""
    worst_error: float
    """The greatest that ever was while it followed or rested [m]."""
    right: float
    left: float
    """What the wheels were told last [m/s]."""
    taken: int
    refused: int
    garbled: int
    """Messages that could not be read."""
    overruns: int
    """Periods that began more than one period late."""
    odometry: tuple[Odometry, ...]
    """The latest ones, the newest last."""
