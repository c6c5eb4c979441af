"""Base, path and follower: what a robot with two driven wheels does with a trajectory."""

import math

import numpy as np
import pytest

from hardware.base import BaseLimits, Odometry, check_fits, twist_of, wheels_of
from hardware.executor_settings import ExecutorSettings
from hardware.executor_trials import motion
from hardware.follower import FollowerSettings, error_of, moved_on, wheel_speeds
from hardware.path import Path, Place, gap
from hardware.simulated_base import BaseNature, SimulatedBase, build
from passpmp_ti.robots import DifferentialDrive, cover_rectangle
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

ROBOT = DifferentialDrive(wheel_speed=2.0)
ROUGH = {"slip": 0.1, "pose_noise": 0.003, "heading_noise": 0.003, "speed_noise": 0.005}
PERIOD = 0.01


class Clock:
    """Seconds that pass when told to."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def a_base(clock, seed=0, acceleration=1.6, **nature):
    nature = BaseNature(limits=BaseLimits(acceleration=acceleration), **nature)
    return SimulatedBase(nature, rng=np.random.default_rng(seed), clock=clock)


def a_motion(seed, start=100.1):
    return motion(ROBOT, np.zeros(5), start, np.random.default_rng(seed), most_pieces=12)


def drive(base, clock, trajectory, settings, beyond=0.3):
    """Follow it; the true errors [m], and the time from its end to rest [s]."""
    path, errors, moving = Path(trajectory), [], clock.now
    while clock.now < path.end + beyond:
        clock.now += PERIOD
        odometry = base.odometry()
        if odometry is not None:
            base.drive(*wheel_speeds(odometry, path.at, clock.now, base.limits, settings))
        truth = base.truth
        errors.append(error_of(truth, path.at(truth.stamp), 0.0))
        if max(abs(truth.right), abs(truth.left)) > 0.02:
            moving = clock.now
    return max(errors), moving - path.end


def worst(seeds, settings=None, **nature):
    """The greatest error and the latest rest of several motions."""
    clocks, settings = [Clock() for _ in seeds], settings or FollowerSettings()
    runs = [
        drive(a_base(clock, seed, **nature), clock, a_motion(seed), settings)
        for seed, clock in zip(seeds, clocks, strict=True)
    ]
    return max(error for error, _ in runs), max(late for _, late in runs)


# the follower ---------------------------------------------------------------------------------


def test_on_wheels_that_answer_as_expected_the_robot_is_where_the_plan_has_it():
    error, late = worst(range(6))
    assert error < 0.006
    assert late <= 0.02


def test_slip_noise_and_a_slower_answer_stay_within_the_bound_and_rest_in_time():
    settings = ExecutorSettings()
    error, late = worst(range(12), lag=0.08, **ROUGH)
    assert error < settings.bound
    assert late <= settings.rest_late


def test_steering_back_needs_more_acceleration_than_was_planned_with():
    seeds = range(8)
    with_reserve, _ = worst(seeds, **ROUGH)
    without, _ = worst(seeds, acceleration=ROBOT.acceleration, **ROUGH)
    assert without > 1.5 * with_reserve


def test_without_feedback_the_error_grows():
    with_feedback, _ = worst(range(6), **ROUGH)
    without, _ = worst(range(6), FollowerSettings(most=0.0), **ROUGH)
    assert without > 2 * with_feedback


def test_without_the_lag_in_its_orders_the_robot_is_behind():
    knowing, _ = worst(range(6))
    ignorant, _ = worst(range(6), FollowerSettings(wheel_lag=0.0))
    assert ignorant > 2 * knowing


def test_the_robot_rests_when_the_plan_does_not_when_it_is_where_it_should_be():
    path = Path(Trajectory.resting(np.zeros(5), 0.0))
    beside = Odometry(1.0, 0.05, 0.05, 0.1, 0.0, 0.0)
    orders = wheel_speeds(beside, path.at, 1.0, BaseLimits(), FollowerSettings())
    assert orders == (0.0, 0.0)


def test_braking_to_rest_orders_no_way_back():
    states = np.zeros((101, 5))
    states[:, 3:] = np.linspace(1.0, 0.0, 101)[:, None]
    times = 0.01 * np.arange(101)
    states[:, 0] = times - 0.5 * times**2
    path = Path(Trajectory(times, states, 0))
    for time in np.arange(0.0, 1.1, 0.01):
        there = Odometry(time, *path.at(time)[:5])
        orders = wheel_speeds(there, path.at, time, BaseLimits(), FollowerSettings())
        assert min(orders) > -1e-3


def test_orders_stay_within_what_the_base_can_do_however_far_off_the_robot_is():
    path = Path(a_motion(1))
    limits = BaseLimits(wheel_speed=0.5)
    for x in (-100.0, 0.0, 100.0):
        off = Odometry(path.start + 0.3, x, -x, 1.0, 0.4, 0.4)
        orders = wheel_speeds(off, path.at, path.start + 0.3, limits, FollowerSettings())
        assert max(map(abs, orders)) <= 0.5


def test_the_error_covers_every_disc_of_the_body():
    rng = np.random.default_rng(0)
    robot = DifferentialDrive(discs=cover_rectangle(0.9, 0.2, 0.6, 3))
    for _ in range(300):
        pose, there = rng.normal(0.0, 1.0, 3), rng.normal(0.0, 1.0, 3)
        error = error_of(Odometry(0.0, *pose, 0.0, 0.0), Place(*there, 0.0, 0.0), robot.overhang)
        for offset, _ in robot.discs:
            centres = [
                np.array([x + offset * math.cos(a), y + offset * math.sin(a)])
                for x, y, a in (pose, there)
            ]
            assert error >= np.linalg.norm(centres[0] - centres[1]) - 1e-12


def test_without_the_swing_of_the_body_the_error_would_miss_a_disc():
    turned = Odometry(0.0, 0.0, 0.0, 0.2, 0.0, 0.0)
    there = Place(0.0, 0.0, 0.0, 0.0, 0.0)
    swing = 2 * 0.6 * math.sin(0.1)
    assert error_of(turned, there, 0.0) < swing <= error_of(turned, there, 0.6)


# margins --------------------------------------------------------------------------------------


def planner(**changes):
    return Settings.for_robot(ROBOT, tracking_error=0.09, stamp_error=0.15).changed(**changes)


def test_a_bound_within_the_planners_margins_is_let_in():
    ExecutorSettings().check_margins(planner(), scan_age=0.03)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"tracking_error": 0.079}, "Settings.tracking_error"),
        ({"tracking_error": 0.08}, "Settings.tracking_error"),  # no room for the reaction
        ({"stamp_error": 0.129}, "Settings.stamp_error"),
        ({"cycle": 0.4}, "planner_timeout"),
    ],
)
def test_a_bound_beyond_the_planners_margins_is_refused(changes, named):
    with pytest.raises(ValueError, match=named):
        ExecutorSettings().check_margins(planner(**changes), scan_age=0.03)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"bound": 0.0}, "bound"),
        ({"period": 0.1}, "period"),
        ({"join": (0.1, 0.0, 0.0)}, "join"),
        ({"join": 3}, "join"),
        ({"feedback_timeout": 0.01}, "feedback_timeout"),
    ],
)
def test_settings_that_make_no_sense_are_refused(changes, named):
    with pytest.raises(ValueError, match=named):
        ExecutorSettings(**changes)


def test_a_base_that_can_do_less_than_is_planned_is_refused():
    check_fits(BaseLimits(), ROBOT)
    for limits in (
        BaseLimits(wheel_speed=1.9),
        BaseLimits(acceleration=1.3),
        BaseLimits(track=0.5),
    ):
        with pytest.raises(ValueError, match="BaseLimits"):
            check_fits(limits, ROBOT)


# paths ----------------------------------------------------------------------------------------


def test_a_path_is_the_trajectory_it_was_made_of():
    trajectory = a_motion(3)
    path = Path(trajectory)
    for time in np.linspace(path.start - 0.5, path.end + 0.5, 400):
        assert np.allclose(path.at(time)[:5], trajectory.at(time), atol=1e-12)


def test_a_path_tells_how_fast_its_wheels_change():
    path = Path(a_motion(3))
    time = path.start + 0.105
    here, there = path.at(time), path.at(time + 0.004)
    assert here.right + 0.004 * here.right_rate == pytest.approx(there.right)
    assert path.at(path.end)[3:] == (0.0, 0.0, 0.0, 0.0)


def test_headings_a_whole_turn_apart_are_the_same():
    a, b = Place(0.0, 0.0, 3.1, 0.0, 0.0), Place(0.0, 0.0, 3.1 - math.tau, 0.0, 0.0)
    assert gap(a, b) == pytest.approx((0.0, 0.0, 0.0))


# the simulated base ---------------------------------------------------------------------------


def test_wheels_and_twist_are_two_ways_to_say_one_thing():
    assert twist_of(*wheels_of(0.7, -0.4, 0.54), 0.54) == pytest.approx((0.7, -0.4))


def test_a_base_that_is_told_nothing_brakes_by_itself():
    clock = Clock()
    base = a_base(clock)
    for _ in range(100):
        base.drive(1.0, 1.0)
        clock.now += PERIOD
    assert base.truth.right == pytest.approx(1.0, abs=0.01)
    clock.now += base.limits.command_timeout - 0.01
    assert base.truth.right == pytest.approx(1.0, abs=0.01)
    clock.now += 0.02 + 1.0 / base.limits.acceleration
    assert base.truth[4:] == (0.0, 0.0)


def test_numbers_that_are_none_do_not_reach_the_wheels():
    clock = Clock()
    base = a_base(clock)
    for bad in (math.nan, math.inf, -math.inf):
        base.drive(bad, 0.5)
        base.drive(0.5, bad)
        clock.now += PERIOD
    assert base.refused == 6
    assert base.truth[1:] == (0.0, 0.0, 0.0, 0.0, 0.0)


def test_a_stop_holds_until_it_is_let_go():
    clock = Clock()
    base = a_base(clock)
    base.stop()
    for _ in range(20):
        base.drive(1.0, 1.0)
        clock.now += PERIOD
    assert base.truth.right == 0.0
    base.reset()
    base.drive(1.0, 1.0)
    clock.now += PERIOD
    assert base.truth.right > 0.0


def test_odometry_is_stamped_when_it_was_measured():
    clock = Clock()
    base = a_base(clock)
    for _ in range(50):
        clock.now += 0.003
        odometry = base.odometry()
        assert odometry is None or 0.0 <= clock.now - odometry.stamp < 0.011


def test_where_a_base_will_be_is_told_by_its_wheels():
    clock = Clock()
    base = a_base(clock, lag=0.002)
    for _ in range(200):
        base.drive(1.0, 0.7)
        clock.now += PERIOD
    before = base.truth
    base.drive(1.0, 0.7)
    clock.now += 0.05
    there = moved_on(before, base.truth.stamp, base.limits.track)
    assert np.allclose(there, base.truth, atol=1e-4)


def test_the_same_seed_gives_the_same_base_whenever_it_is_asked():
    def truth(step):
        clock = Clock()
        base = a_base(clock, seed=5, **ROUGH)
        for n in range(1, 1001):
            clock.now = 100.0 + 0.002 * n + 1e-9
            if n % 100 == 1:
                base.drive(0.01 * (n % 7), 0.3)
            if n % step == 0:
                base.advance()
        return base.truth

    assert truth(1) == truth(20)


def test_a_base_is_built_from_plain_numbers():
    base = build(seed=3, pose=(1.0, 2.0, 0.5), slip=0.1, limits={"acceleration": 2.0})
    assert base.limits.acceleration == 2.0
    assert base.truth[1:4] == (1.0, 2.0, 0.5)
    with pytest.raises(ValueError, match="slip"):
        build(slip=1.5)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -2e9, 1e13])
def test_odometry_that_nobody_can_be_at_is_not_whole(bad):
    assert Odometry(1.0, 999.0, -5.0, 0.3, 0.1, 0.1).whole
    for n in (1, 2):
        values = [1.0, 2.0, 3.0, 0.3, 0.1, 0.1]
        values[n] = bad
        assert not Odometry(*values).whole
