"""How long the held motion could be kept on: the decision time of eq. 20."""

from __future__ import annotations

import math

import numpy as np

from passpmp_ti.grid.body import to_poses, to_states
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.planner.tree import follow
from passpmp_ti.trajectory import Trajectory

COAST = 4.0
"""How far ahead the decision time looks [s]."""
COAST_PACE = 0.1
UNCHANGED = np.zeros(3, dtype=np.float32)
"""The control that keeps a robot's speed and steering."""


def decision_time(model: FutureModel, held: Trajectory, stamp: float, start: float) -> float:
    """delta_d [s]: from `stamp` until the held motion, kept on without braking, is first ICS^b.

    Args:
        model: W(t_k).
        held: what is executed from `start` on.
        stamp: t_k [s].
        start: t_{k+1} [s].
    """
    settings, robot = model.settings, model.robot
    turn = float(held.times[held.brakes_from])
    ahead = np.arange(start, turn, COAST_PACE)
    states = held.sampled(ahead) if len(ahead) else np.zeros((0, 5))
    last = held.at(max(turn, start))
    if bool(robot.at_rest(last)):
        times = ahead
    else:
        pace = max(settings.steps_of(COAST_PACE), 1)
        steps = pace * round(COAST / COAST_PACE)
        pose = to_poses(last[None], model.window.anchor)[0]
        coasting = follow(model, pose, [(UNCHANGED, steps)])[::pace]
        coast_times = max(turn, start) + settings.time_step * pace * np.arange(len(coasting))
        states = np.concatenate([states, to_states(coasting, model.window.anchor)])
        times = np.concatenate([ahead, coast_times])
    if not len(times):
        return math.inf
    unsafe = ~model.passively_safe(states, times)
    return float(times[np.argmax(unsafe)] - stamp) if unsafe.any() else math.inf
