"""Margins of the robot's own motion are needed: a perfect map of one long wall, and states placed
exactly at its limit. What the scan cannot tell, and the grid's margins, have no part in it.
"""

from dataclasses import replace

import numpy as np
from oracle import exact

import passpmp_ti.settings as settings_module
from passpmp_ti import CarLike, DifferentialDrive, FutureModel, Settings

NEVER = 65535
RADIUS = 0.3


def beside_a_wall(robot, settings):
    """(model, x of the wall, x up to which cells are free): just `settings.clearance` apart."""
    scan = exact.sweep(exact.world_of(), (0.0, 0.0, 0.0), 90, 2 * np.pi, 3.0, 2.0)
    model = FutureModel.from_scan(scan, robot, settings)
    columns = 7 * model.window.size // 8
    ticks = np.zeros(model.shape, dtype=np.uint16)
    ticks[:, :columns] = NEVER
    limit = model.origin[0] + columns * model.cell
    return replace(model, ticks=ticks), limit + settings.clearance(robot), limit


def hits(robot, settings, states, control):
    """How many states are called safe by a braking control with which the robot hits the wall.

    Each state is tried at places a fortieth of a cell apart, about where its path by the midpoint
    rule just meets the limit.
    """
    model, wall, limit = beside_a_wall(robot, settings)
    planned = exact.midpoint_path(robot, states, control, settings.time_step)[:, :, 0].max(axis=1)
    _, poses = exact.braking_path(robot, states, control, settings.time_step / 20)
    true = poses[:, :, 0].max(axis=1)
    count = 0
    first = robot.braking.index(control)
    for beyond in np.linspace(-0.5, 0.5, 41) * model.cell:
        move = limit + beyond - planned
        placed = states.copy()
        placed[:, 0] += move
        safe = model.proving_brakes(placed, np.full(len(states), 2.0))
        count += int(((safe == first) & (true + move + RADIUS > wall)).sum())
    return count


def test_the_way_between_two_looks(monkeypatch):
    # straight away from the wall, from nearer than where it is first looked at
    robot = DifferentialDrive(discs=((0.0, RADIUS),), wheel_speed=1.0, acceleration=4.0, track=50.0)
    settings = Settings(cell=0.2, window=64, object_speed=0.0)
    states = np.zeros((50, 5))
    states[:, 3] = states[:, 4] = np.linspace(-1.0, -0.5, 50)
    control = robot.braking[0]
    assert hits(robot, settings, states, control) == 0
    monkeypatch.setattr(settings_module, "motion_margin", lambda robot, settings: 0.0)
    assert hits(robot, settings, states, control) > 0


def test_the_error_of_the_integrator(monkeypatch):
    # brakes so weak that the moment at which the steering meets its stop matters 40 m later
    robot = CarLike(
        discs=((0.0, RADIUS),), v_max=4.0, v_reverse=4.0, acceleration=0.2, xi_max=0.02,
        xi_rate=1.0, wheelbase=0.5,
    )  # fmt: skip
    settings = Settings(
        cell=0.05, window=1024, object_speed=0.0, time_step=0.04, cycle=0.04, primitives=()
    )
    states = np.zeros((60, 5))
    states[:, 1], states[:, 2] = 10.0, -0.1
    states[:, 3] = 4.0
    states[:, 4] = np.linspace(-0.02, 0.02, 60)
    control = robot.braking[1]
    assert hits(robot, settings, states, control) == 0
    monkeypatch.setattr(settings_module, "integration_margin", lambda robot, step: 0.0)
    assert hits(robot, settings, states, control) > 0
