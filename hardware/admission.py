"""Whether a trajectory that was sent is one that this robot can follow to rest."""

from __future__ import annotations

import numpy as np

from hardware.status import Verdict
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.trajectory import Trajectory

LONGEST_STEP = 0.1
"""Between two states [s]: what is in between is not told."""
SLACK = 1.02
"""Single precision, and the planner's midpoint rule, may exceed a limit by a little."""
LEEWAY = (0.01, 0.02, 0.005)
"""By which a step may differ from what its wheels do [m, rad], and a wheel from its limit
[m/s]."""


def judge(trajectory: Trajectory, robot: DifferentialDrive) -> Verdict:
    """TAKEN where it is whole and within the robot's limits.

    That it is safe is the planner's word. What is asked here is what a planner gone wrong would
    send: numbers that are none, a motion without rest, a jump.
    """
    with np.errstate(all="ignore"):  # numbers so great that their differences are none
        return _judge(trajectory, robot)


def _judge(trajectory: Trajectory, robot: DifferentialDrive) -> Verdict:
    times, states = trajectory.times, trajectory.states
    if not (np.isfinite(times).all() and np.isfinite(states).all()) or states[-1, 3:].any():
        return Verdict.NOT_WHOLE
    steps = np.diff(times)
    if (steps <= 0.0).any():
        return Verdict.NOT_WHOLE
    wheels, limit = states[:, 3:], robot.wheel_speed
    changes = np.abs(np.diff(wheels, axis=0))
    means = 0.5 * (wheels[1:] + wheels[:-1])
    ways = np.hypot(*np.diff(states[:, :2], axis=0).T)
    turns = np.diff(states[:, 2])
    turning = (means[:, 0] - means[:, 1]) / robot.track
    # an overflow compares with nothing: each test asks for what must hold
    holds = (
        (steps <= LONGEST_STEP).all()
        and (np.abs(wheels) <= limit * SLACK).all()
        and (changes <= robot.acceleration * SLACK * steps[:, None] + LEEWAY[2]).all()
        and (ways <= np.abs(means.mean(axis=1)) * steps + LEEWAY[0]).all()
        and (np.abs(turns - turning * steps) <= LEEWAY[1]).all()
    )
    return Verdict.TAKEN if holds else Verdict.BEYOND_LIMITS
