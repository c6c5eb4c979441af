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
"""By which a motion may differ from what its wheels do [m, rad], and a wheel's change from what
its acceleration makes of it [m/s]: all of the motion, however short its steps."""
DRIFT = (0.02, 0.02)
"""By which it may differ more in every second [m/s, rad/s]."""


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
    since = times - times[0]
    means = 0.5 * (wheels[1:] + wheels[:-1]) * steps[:, None]
    ways, turns = means.mean(axis=1), (means[:, 0] - means[:, 1]) / robot.track
    middles = 0.5 * (states[1:, 2] + states[:-1, 2])
    aside = np.hypot(
        _strays(states[:, 0], ways * np.cos(middles)), _strays(states[:, 1], ways * np.sin(middles))
    )
    turned = np.abs(_strays(states[:, 2], turns))
    # what is more than the acceleration makes of the time, since any state before
    most = robot.acceleration * SLACK * since[:, None]
    faster, slower = wheels - most, wheels + most
    jumps = np.maximum(
        faster - np.minimum.accumulate(faster), np.maximum.accumulate(slower) - slower
    )
    # an overflow compares with nothing: each test asks for what must hold
    holds = (
        (steps <= LONGEST_STEP).all()
        and (np.abs(wheels) <= limit * SLACK).all()
        and (jumps <= LEEWAY[2]).all()
        and (aside <= LEEWAY[0] + DRIFT[0] * since).all()
        and (turned <= LEEWAY[1] + DRIFT[1] * since).all()
    )
    return Verdict.TAKEN if holds else Verdict.BEYOND_LIMITS


def _strays(values: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """[m] by how much values [m] differ from the first one and the changes [m - 1] since."""
    result: np.ndarray = values - values[0] - np.concatenate([[0.0], np.cumsum(changes)])
    return result
