"""The margins that the checker states: how much room it may want beyond what the truth asks."""

from __future__ import annotations

import numpy as np


def grid_margin(settings):
    """How much nearer than it is the grid may take a thing to be [m].

    The cell asked about and the cell that is marked each stretch a diagonal; half a cell is taken
    off for the samples of the border, and arrival times are rounded by up to two milliseconds.
    """
    cells = 2 * np.sqrt(2) + 0.5
    return cells * settings.cell + 2e-3 * settings.object_speed + 0.01


def stated_margin(case, beams):
    """How much more room than the closed form asks the checker may want [m]: every margin in space,
    the grid, half a wedge's chord for corners, and a time step of the objects."""
    settings, robot = case.settings, case.robot
    chord = case.scans[0].range_max * 2 * np.pi / beams
    late = settings.stamp_error + settings.time_step
    return (
        settings.clearance(robot) - robot.disc_radius
        + grid_margin(settings)
        + 0.5 * chord * (1 + chord) + settings.range_noise
        + late * settings.object_speed
    )  # fmt: skip
