"""The margins that a chair, its executor and its range finders ask of a planner, on the twin."""

from __future__ import annotations

import math

from hardware.chair_model import WALL_HALF, ChairNature
from hardware.executor_settings import ExecutorSettings
from hardware.scip_settings import ScipSettings
from hardware.twin_process import LIDAR_NOISE
from passpmp_ti.settings import Settings
from passpmp_ti.sim.scenario import Scenario

APART = 0.0135
"""Stamps of two range finders that are joined differ by this at the most [s]."""
HASTE = 0.02
"""What a cycle needs beside planning, from the scan's stamp to the executor [s]."""
SWEEP_SHIFT = 0.02
"""What the chair moves in half a sweep, at 2 m/s [m]."""


def settings_of(scenario: Scenario, cycle: float, nature: ChairNature) -> Settings:
    """The scenario's settings with the margins that chair, executor and lidars ask for."""
    executor = executor_settings(cycle)
    scan_age = ScipSettings(host="127.0.0.1").stamp_error + APART
    return scenario.settings.changed(
        cycle=cycle,
        deadline=cycle - HASTE,
        # what it moves away between two odometries is not seen
        tracking_error=executor.bound + 0.01,
        localisation_error=math.ceil(100 * (nature.localisation_error + SWEEP_SHIFT)) / 100,
        range_noise=3 * LIDAR_NOISE + WALL_HALF,
        stamp_error=scan_age + executor.rest_late,
    )


def executor_settings(cycle: float) -> ExecutorSettings:
    """Whom it believes for how long: a cycle and a half, and some."""
    patience = 1.5 * cycle + 0.15
    return ExecutorSettings(
        planner_timeout=patience, sensor_timeout=patience, ahead=max(2.0, 2 * cycle)
    )
