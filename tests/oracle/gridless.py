"""The model itself, without a grid: which states it calls p-safe."""

from __future__ import annotations

import numpy as np

from oracle import exact
from passpmp_verify.gridless import Gridless

STEP = 0.02
"""Between the moments of a braking path that are asked [s]."""


def gridless(case):
    """What the scans of a case prove, in closed form, as it is believed."""
    s, (x, y, theta) = case.settings, case.position
    body = [(x + o * np.cos(theta), y + o * np.sin(theta), r) for o, r in case.robot.discs]
    return Gridless(
        case.scans, body, (x, y, s.clear_radius) if s.clear_radius > 0 else None,
        object_width=s.object_width, range_noise=s.range_noise, object_speed=s.object_speed,
        blind_speed=s.blind_speed, stamp_error=s.stamp_error, static_map=case.static_map,
        map_tolerance=s.map_tolerance, localisation_error=s.localisation_error,
        object_radius=s.object_radius,
    )  # fmt: skip


def safe(case, states, times, step=STEP):
    """[n] bool: one braking control leads to rest before the model lets anything touch the robot.

    Only the margins that the settings declare count: tracking and localisation.
    """
    model, robot, settings = gridless(case), case.robot, case.settings
    radius = robot.disc_radius + settings.tracking_error + 2 * settings.localisation_error
    result = np.zeros(len(states), dtype=bool)
    for control in robot.braking:
        left = np.flatnonzero(~result)
        if not len(left):
            break
        rest = exact.rest_time(robot, states[left], control)
        t, poses = exact.braking_path(robot, states[left], control, step)
        centres = exact.disc_centres(robot, poses)
        going = np.ones(len(left), dtype=bool)
        # in slices of time: most states are lost early, and need no more asking
        for some in np.array_split(np.arange(len(t)), max(len(t) // 10, 1)):
            moving = going[:, None] & (t[None, some] < rest[:, None])
            n, k = np.nonzero(moving)
            when = times[left][n] + t[some][k]
            for d in range(centres.shape[2]):
                free = model.free(centres[n, some[k], d], radius, when)
                going[n[~free]] = False
        result[left[going]] = True
    return result
