"""What an executor says that the robot follows, judged before it is believed."""

from __future__ import annotations

import numpy as np

from passpmp_ti.robots import Robot
from passpmp_ti.trajectory import Trajectory


def trouble_with(given: object, robot: Robot) -> str:
    """Why this cannot be what the robot follows; empty where it can.

    Only what a navigator may have answered: states [m, 5] within the robot's limits, times that
    increase, the last state at rest. Whether its way is clear is asked by every later model.
    """
    if not isinstance(given, Trajectory):
        return f"the robot is said to follow no Trajectory but {type(given).__name__}"
    times, states = np.asarray(given.times), np.asarray(given.states)
    if states.ndim != 2 or states.shape[1] != 5 or times.shape != states.shape[:1]:
        return f"the robot is said to follow states of shape {states.shape} at {times.shape} times"
    if not len(times) or not 0 <= given.brakes_from < len(times):
        return "the robot is said to follow a trajectory without its end"
    if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        return "the robot is said to follow times that do not increase"
    try:
        robot.check_states("following", states)
    except ValueError as error:
        return f"the robot is said to follow what it cannot: {error}"
    if not robot.at_rest(states[-1]):
        return "the robot is said to follow a trajectory that does not end at rest"
    return ""
