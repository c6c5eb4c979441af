"""The risk that a motion takes, and how much of it is allowed: eqs. 9 to 12."""

from __future__ import annotations

import math

import numpy as np

from passpmp_ti.grid.model import FutureModel
from passpmp_ti.kernels.weighing import SHORTEST
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory


def allowed_risk(settings: Settings, duration: float) -> float:
    """Greatest chance of a contact while moving that a plan of `duration` [s] to rest may have."""
    return min(settings.allowed_risk, settings.allowed_risk_rate * max(duration, SHORTEST))


def safety_weight(settings: Settings, risk: float, duration: float) -> float:
    """w_ps of a plan (eqs. 8 and 9): infinite where its risk is more than is allowed.

    As printed, w_ps is the risk, and every riskless plan costs nothing, whatever the goal; nothing
    is refused for its risk then. Here it is 1 / (1 - P).
    """
    if settings.mode != "probabilistic":
        return 1.0
    if settings.risk == "paper":
        return risk
    return math.inf if risk > allowed_risk(settings, duration) else 1 / (1 - risk)


def risk_of(model: FutureModel, trajectory: Trajectory, since: float) -> float:
    """Greatest chance of a contact while moving along a trajectory from `since` [s] on, followed to
    rest: what `CycleRecord.risk` promises."""
    settings = model.settings
    if settings.mode == "conservative" or since >= trajectory.end:
        return 0.0
    if settings.mode == "hybrid":
        # that any of them leaves its tube anywhere (Boole)
        return min(1.0, (1 - settings.confidence) * len(model.tracks or ()))
    later = trajectory.times > since + 1e-9
    times = trajectory.times[later]
    return model.motion_risk(
        np.concatenate([trajectory.at(since)[None], trajectory.states[later]]),
        np.concatenate([[since], times]),
    )
