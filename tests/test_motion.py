"""The integrators against eqs. 22 and 23, solved finely in float64."""

from itertools import pairwise

import numpy as np
import pytest
from oracle import exact

from passpmp_ti import CarLike, DifferentialDrive, Settings
from passpmp_ti.grid.body import Body, to_poses, to_states
from passpmp_ti.kernels.check import trace
from passpmp_ti.robots import BRAKE, BRAKE_IN_PROPORTION, FREE
from passpmp_ti.settings import integration_margin

CAR, CHAIR = CarLike(), DifferentialDrive()
UNTIL_REST = -1


def traced(robot, states, control, time_step, steps):
    """[N, L, 5] states along one control from each of [N, 5]; rows after the end are nan."""
    settings = Settings(time_step=time_step, cycle=time_step, primitives=())
    states = np.atleast_2d(np.asarray(states, dtype=float))
    rows = 2 + (steps if steps > 0 else int(robot.longest_braking / time_step) + 3)
    path = np.full((len(states) * rows, 7), np.nan, dtype=np.float32)
    length = np.zeros(len(states), dtype=np.int32)
    trace(
        robot.kind, Body.of(robot, settings).numbers, to_poses(states, (0.0, 0.0)),
        np.tile(np.array(control, dtype=np.float32), (len(states), 1)),
        np.full(len(states), steps, dtype=np.int32), path, length,
    )  # fmt: skip
    found = to_states(path, (0.0, 0.0)).reshape(len(states), rows, 5)
    for n, last in enumerate(length):
        found[n, last:] = np.nan
    return found[:, : length.max()]


def end_of(path):
    """[N, 5] the last state of each row."""
    last = (~np.isnan(path[..., 0])).sum(axis=1) - 1
    return path[np.arange(len(path)), last]


@pytest.mark.parametrize(
    ("robot", "state", "control"),
    [
        (CAR, [0, 0, 0.3, 8.0, 0.05], (FREE, 2.0, 0.1)),
        (CAR, [0, 0, -1.0, -4.0, 0.2], (FREE, 1.0, -0.15)),
        (CHAIR, [0, 0, 0.2, 1.5, 0.4], (FREE, 0.5, -0.3)),
        (CHAIR, [0, 0, 2.0, -1.0, 1.5], (FREE, 0.3, 0.6)),
    ],
)
def test_the_integrators_are_of_order_two(robot, state, control):
    true = exact.rk4(robot, state, control[1:], 1.6, 1e-4)
    errors = []
    for time_step in (0.2, 0.1, 0.05):
        end = end_of(traced(robot, state, control, time_step, round(1.6 / time_step)))[0]
        errors.append(np.linalg.norm((end - true)[:3]))
    # f32 noise is about 1e-6 here: far below these errors
    assert min(errors) > 2e-5
    orders = [np.log2(coarse / fine) for coarse, fine in pairwise(errors)]
    assert orders == pytest.approx([2.0, 2.0], abs=0.15)


def extreme_states(robot, generator, count=40):
    """States at the robot's limits and between, headings at random."""
    states = np.zeros((count, 5))
    states[:, 2] = generator.uniform(-np.pi, np.pi, count)
    at_limits = generator.random((count, 2)) < 0.5
    share = np.where(
        at_limits, generator.choice([-1, 1], (count, 2)), generator.uniform(-1, 1, (count, 2))
    )
    limits = (robot.v_max, robot.xi_max) if robot.kind == exact.CAR else (robot.wheel_speed,) * 2
    states[:, 3:5] = share * limits
    return states


@pytest.mark.parametrize("time_step", [0.02, 0.04, 0.1])
@pytest.mark.parametrize(
    "robot",
    [CAR, CHAIR, DifferentialDrive(track=0.3, wheel_speed=2.0), CarLike(xi_max=0.9, xi_rate=2.0)],
    ids=["car", "chair", "narrow chair", "agile car"],
)
def test_a_braking_path_stays_within_the_integration_margin(robot, time_step):
    generator = np.random.default_rng(1)
    states = extreme_states(robot, generator)
    states[:, :2] = generator.uniform(-80, 80, (len(states), 2))
    worst = 0.0
    for control in robot.braking:
        path = traced(robot, states, control, time_step, UNTIL_REST)
        _, poses = exact.braking_path(robot, states, control, time_step / 20)
        poses = poses[:, ::20]
        longest = min(path.shape[1], poses.shape[1])
        apart = np.linalg.norm(path[:, :longest, :2] - poses[:, :longest, :2], axis=-1)
        worst = max(worst, float(np.nanmax(apart)))
    print(f"{worst * 1000:.2f} mm of {integration_margin(robot, time_step) * 1000:.2f} mm")
    assert worst < integration_margin(robot, time_step)


@pytest.mark.parametrize("robot", [CAR, CHAIR], ids=["car", "chair"])
def test_braking_ends_at_exactly_zero_within_the_longest_braking_time(robot):
    states = extreme_states(robot, np.random.default_rng(2))
    for control in robot.braking:
        path = traced(robot, states, control, 0.02, UNTIL_REST)
        assert robot.at_rest(end_of(path)).all()
        assert path.shape[1] - 1 <= round(robot.longest_braking / 0.02) + 1


def test_braking_in_proportion_keeps_the_path():
    state = [0.0, 0.0, 0.4, 4.0, 2.5]
    braked = traced(CHAIR, state, (BRAKE_IN_PROPORTION, 1.35, 1.35), 0.02, UNTIL_REST)[0]
    # the circle of the wheels' first speeds: radius = v / turn rate
    radius = 0.5 * (4.0 + 2.5) / ((4.0 - 2.5) / CHAIR.track)
    centre = radius * np.array([-np.sin(0.4), np.cos(0.4)])
    off = np.abs(np.linalg.norm(braked[:, :2] - centre, axis=1) - radius)
    assert off.max() < 2e-3
    moving = braked[braked[:, 3] > 0]
    assert moving[:, 4] / moving[:, 3] == pytest.approx(2.5 / 4.0, rel=1e-4)


def test_braking_each_wheel_at_its_limit_bends_the_path():
    bent = traced(CHAIR, [0, 0, 0, 4.0, 2.0], (BRAKE, 1.35, 1.35), 0.02, UNTIL_REST)[0]
    moving = bent[bent[:, 4] > 0]
    ratio = moving[:, 4] / moving[:, 3]
    assert ratio[-1] < 0.5 * ratio[0]


@pytest.mark.parametrize("speed", [3.0, -3.0])
def test_a_car_that_brakes_to_zero_in_a_primitive_stays_there(speed):
    path = traced(CAR, [0, 0, 0, speed, 0.1], (FREE, -np.sign(speed) * 7.0, 0.0), 0.02, 50)[0]
    assert CAR.at_rest(path[-1])
    stopped = np.flatnonzero(path[:, 3] == 0)[0]
    assert stopped <= 23
    assert (path[stopped:, :2] == path[stopped, :2]).all()


def test_a_car_at_rest_may_leave_either_way():
    for push in (7.0, -7.0):
        path = traced(CAR, [0, 0, 0, 0.0, 0.0], (FREE, push, 0.0), 0.02, 10)[0]
        assert path[-1, 3] == pytest.approx(push * 0.2, rel=1e-5)


@pytest.mark.parametrize("robot", [CAR, CHAIR], ids=["car", "chair"])
def test_backwards_is_forwards_seen_in_a_mirror(robot):
    # a car's steering mirrors in itself; the wheels of a chair change places
    state, back = (
        ([0, 0, 0, 4.0, 0.2], [0, 0, 0, -4.0, 0.2])
        if robot is CAR
        else ([0, 0, 0, 2.0, 1.0], [0, 0, 0, -2.0, -1.0])
    )
    control = robot.braking[0]
    there = traced(robot, state, control, 0.02, UNTIL_REST)[0]
    away = traced(robot, back, control, 0.02, UNTIL_REST)[0]
    assert away[:, 0] == pytest.approx(-there[:, 0], abs=1e-5)
    assert away[:, 1] == pytest.approx(there[:, 1], abs=1e-5)
    assert away[:, 2] == pytest.approx(-there[:, 2], abs=1e-5)


@pytest.mark.parametrize("robot", [CAR, CHAIR], ids=["car", "chair"])
def test_no_control_leaves_the_limits(robot):
    states = extreme_states(robot, np.random.default_rng(3))
    if robot is CAR:
        states[:, 3] = np.clip(states[:, 3], -robot.v_reverse, robot.v_max)
    for control in robot.controls:
        path = traced(robot, states, control, 0.02, 60)
        robot.check_states("path", path.reshape(-1, 5))


def test_the_oracles_two_integrators_agree():
    for robot, state in ((CAR, [0, 0, 0.1, 12.0, 0.1]), (CHAIR, [0, 0, 0.1, 4.0, 3.0])):
        control = robot.braking[1]
        t, poses = exact.braking_path(robot, np.array([state], dtype=float), control, 1e-3)
        until = 1.0  # before either wheel or the steering reaches an end
        inputs = (-control[1], control[2]) if robot is CAR else (-control[1], -control[2])
        if robot is CAR:
            until = 0.5
        end = exact.rk4(robot, state, inputs, until, 1e-3)
        assert poses[0, round(until / 1e-3)] == pytest.approx(end[:3], abs=1e-8)
        assert t[round(until / 1e-3)] == pytest.approx(until)
