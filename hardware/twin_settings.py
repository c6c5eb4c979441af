"""How the chair is driven on the twin, and the margins that chair, executor and lidars ask of a
planner for it."""

from __future__ import annotations

from dataclasses import replace

from hardware.chair_lidar import LIDAR_NOISE
from hardware.chair_model import ChairNature
from hardware.executor_settings import ExecutorSettings
from hardware.margins import APART, executor_settings, longest_guess, unforeseen, with_margins
from hardware.scip_settings import ScipSettings
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.settings import Settings
from passpmp_ti.sim.scenario import Scenario
from passpmp_ti.sim.world import World

TOP_SPEED = 1.0
"""Of a wheel [m/s]: what a chair moves in half a sweep grows with it."""
RANGE = 6.0
"""How far the lidars are believed [m]: the guide's grid grows with it, and has a bounded number of
cells. Beyond 5 cm their sides close a passage that the chair fits through."""
CELL = 0.03
"""Side of the grid's cells [m]: finer than for a chair that drives in the open."""
SLIMMEST = 0.2
"""Radius of the slimmest who walks [m], where the scenario has nobody slimmer."""
BOUND = 0.042
"""Off its path the chair stops [m]: it is 22 mm off in an ordinary drive."""
REST_LATE = 0.06
"""It rests this long after its path, or is stopped [s]: 40 ms in an ordinary drive."""
LEAN = 0.005
"""What a chair that leans as it brakes and turns adds to a range [m]."""
FROZEN_AFTER = 1
"""Sweeps that tell the very same distances as those before and are still not believed, from the
first: a lidar has noise."""


def on_chair(scenario: Scenario) -> Scenario:
    """A scenario as the chair drives it.

    Raises:
        ValueError: it drives something else.
    """
    robot = scenario.robot
    if not isinstance(robot, DifferentialDrive):
        raise ValueError(
            f"twin: scenario {scenario.name!r} drives a {type(robot).__name__}; the twin is a"
            " wheelchair: take one with `robot: {type: differential}`"
        )
    return replace(
        scenario,
        robot=replace(robot, wheel_speed=min(robot.wheel_speed, TOP_SPEED)),
        lidars=tuple(replace(d, range_max=min(d.range_max, RANGE)) for d in scenario.lidars),
    )


def scip_settings(port: int, range_max: float) -> ScipSettings:
    """Of one of the twin's lidars, on a port, believed up to `range_max` [m]."""
    return ScipSettings(
        host="127.0.0.1", port=port, range_max=range_max, frozen_after=FROZEN_AFTER
    )


def executor_of(cycle: float) -> ExecutorSettings:
    """The chair's executor, for a planner's cycle [s]."""
    return executor_settings(cycle, bound=BOUND, rest_late=REST_LATE)


def guess_of(cycle: float, nature: ChairNature) -> float:
    """How long after the newest odometry the chair's state may be told [s]."""
    return longest_guess(executor_of(cycle), nature.period)


def unforeseen_of(cycle: float, nature: ChairNature) -> float:
    """What a wheel does otherwise than it did at the newest odometry, for as long as a state is
    told after that [m]: the order that it follows changes no faster."""
    return unforeseen(nature.limits.acceleration, guess_of(cycle, nature))


def settings_of(scenario: Scenario, world: World, cycle: float, nature: ChairNature) -> Settings:
    """The scenario's settings with the margins that chair, executor and lidars ask for.

    What the chair moves and turns in half a sweep, and the error of its heading, is taken from the
    scans themselves (`steady.py`), by what it is at the time: no margin for the greatest is needed.
    """
    slimmest = min([SLIMMEST, *world.movers.radius.tolist()])
    return with_margins(
        scenario.settings.changed(
            cell=CELL, object_radius=slimmest, cruise_speed=scenario.robot.top_speed,
            guide_margin=0.0,  # the passage is as wide as body and margins
        ),
        executor_of(cycle),
        cycle=cycle,
        localisation_error=nature.localisation_error + unforeseen_of(cycle, nature),
        range_noise=3 * LIDAR_NOISE + LEAN,
        scan_age=scip_settings(1, RANGE).stamp_error + APART,
    )
