"""The margins that a chair, its executor and its range finders ask of a planner, on the twin."""

from __future__ import annotations

from hardware.chair_model import WALL_HALF, ChairNature
from hardware.margins import APART, executor_settings, with_margins
from hardware.scip_settings import ScipSettings
from hardware.twin_process import LIDAR_NOISE
from passpmp_ti.settings import Settings
from passpmp_ti.sim.scenario import Scenario


def settings_of(scenario: Scenario, cycle: float, nature: ChairNature) -> Settings:
    """The scenario's settings with the margins that chair, executor and lidars ask for."""
    return with_margins(
        scenario.settings,
        executor_settings(cycle),
        cycle=cycle,
        localisation_error=nature.localisation_error,
        range_noise=3 * LIDAR_NOISE + WALL_HALF,
        scan_age=ScipSettings(host="127.0.0.1").stamp_error + APART,
        top_speed=scenario.robot.top_speed,
    )
