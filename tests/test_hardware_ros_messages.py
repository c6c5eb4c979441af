"""What ROS messages mean here, when their stamps are, and where their frames: no ROS is needed."""

import math
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from hardware import ros_messages as ros
from hardware.base import Odometry
from hardware.executor import LATCH
from hardware.executor_process import ExecutorConfig, ExecutorProcess
from hardware.ros_base import REPEAT, ButtonKeeper, RosBase
from hardware.ros_clock import JUMP, RosClock
from hardware.ros_frames import Frames, compose, inverse
from hardware.ros_messages import TOO_NEAR, Untrusted
from hardware.ros_settings import RosSettings
from hardware.ros_show import MOST_STATES, Area, hidden_area, markers, thinned, unsafe_area
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory


def message(tree):
    """A tree as something with attributes."""
    if isinstance(tree, dict):
        return SimpleNamespace(**{name: message(value) for name, value in tree.items()})
    return [message(part) for part in tree] if isinstance(tree, list) else tree


def scan_message(beams, **changes):
    n = len(beams)
    tree = {
        "header": ros.header(100.0, "laser"), "angle_min": -1.0, "angle_max": 1.0,
        "angle_increment": 2.0 / (n - 1), "time_increment": 0.0, "scan_time": 0.0,
        "range_min": 0.05, "range_max": 30.0, "ranges": list(beams), "intensities": [],
    }  # fmt: skip
    return message(tree | changes)


# ranges (REP 117) ---------------------------------------------------------------------------


def test_what_is_no_distance_never_becomes_free_space_but_for_plus_infinity():
    inf, nan = math.inf, math.nan
    given = [2.0, inf, -inf, nan, 0.0, 0.01, -1.0, 31.0, 12.0]
    sweep = ros.sweep_of(scan_message(given), range_max=10.0)
    assert sweep.range_max == 10.0
    scan = sweep.at((0, 0, 0), 0.0)
    # beyond our range_max a return says what +inf says: nothing nearer
    free_to_the_end = [False, True, False, False, False, False, False, False, True]
    assert (scan.ranges >= scan.range_max).tolist() == free_to_the_end
    assert scan.lost.tolist() == [False, False, False, True, True, True, True, True, False]
    assert scan.ranges[0] == 2.0
    assert scan.ranges[2] == TOO_NEAR


def test_no_return_is_free_no_farther_than_the_message_says():
    sweep = ros.sweep_of(scan_message([math.inf, 1.0], range_max=4.0), range_max=10.0)
    assert sweep.range_max == 4.0


def test_numbers_beyond_the_range_are_free_only_where_a_driver_is_known_to_mean_that():
    given = scan_message([31.0, 1.0])
    assert np.isnan(ros.sweep_of(given, range_max=10.0).ranges[0])
    assert ros.sweep_of(given, range_max=10.0, beyond_is_free=True).ranges[0] == math.inf


def test_a_clockwise_scan_is_turned_round():
    given = scan_message([1.0, 2.0, 3.0], angle_min=1.0, angle_max=-1.0, angle_increment=-1.0)
    sweep = ros.sweep_of(given, range_max=10.0)
    assert sweep.ranges.tolist() == [3.0, 2.0, 1.0]
    assert (sweep.angle_min, sweep.angle_increment) == (-1.0, 1.0)


@pytest.mark.parametrize(
    "changes",
    [
        {"angle_increment": 0.0}, {"angle_increment": math.nan}, {"angle_max": 2.5},
        {"range_max": math.nan}, {"range_min": math.nan}, {"ranges": [1.0] * 6},
        {"angle_min": -4.0, "angle_max": 4.0, "angle_increment": 4.0},
    ],
)  # fmt: skip
def test_scans_whose_bearings_are_not_known_are_not_believed(changes):
    with pytest.raises(Untrusted):
        ros.sweep_of(scan_message([1.0, 2.0, 3.0], **changes), range_max=10.0)


def test_a_scan_goes_out_and_comes_back():
    ranges = np.array([1.0, math.inf, math.nan, 0.5, 9.999, 0.001, 10.0])
    scan = Scan(ranges, -1.5, 0.5, 10.0, pose=(0, 0, 0), stamp=0.0)
    tree = ros.laser_scan(scan, 1e9 + 0.25, "laser", lasts=0.018)
    assert tree["ranges"][5] == -math.inf
    back = ros.sweep_of(message(tree), range_max=10.0)
    assert back.stamp == pytest.approx(1e9 + 0.25, abs=1e-6)
    assert back.lasts == pytest.approx(0.018)
    told = back.at((0, 0, 0), 0.0)
    # f32 on the way: half a micrometre at 10 m
    assert told.ranges[[0, 3, 4]] == pytest.approx(ranges[[0, 3, 4]], abs=1e-6)
    assert told.lost.tolist() == scan.lost.tolist()
    assert (told.ranges >= told.range_max).tolist() == (ranges >= 10.0).tolist()
    assert told.ranges[5] == TOO_NEAR


# the rest of the messages --------------------------------------------------------------------


def test_odometry_goes_out_and_comes_back():
    odometry = Odometry(3.0, 1.0, -2.0, 2.5, 0.7, 0.3)
    tree = ros.odometry_message(odometry, 50.0, "odom", "base_link", 0.54)
    back = ros.motion_of(message(tree))
    assert (back.frame, back.child, back.stamp) == ("odom", "base_link", 50.0)
    assert back.odometry(3.0, 0.54) == pytest.approx(odometry)


def test_a_mount_that_leans_is_no_mount_in_the_plane():
    tilted = ros.transforms([("base_link", "laser", (0.3, 0.0, 0.1))], 0.0)
    assert ros.transforms_of(message(tilted)) == [
        ("base_link", "laser", pytest.approx((0.3, 0.0, 0.1)))
    ]
    # on its head: by half a turn about x
    tilted["transforms"][0]["transform"]["rotation"] = {"x": 1.0, "y": 0.0, "z": 0.0, "w": 0.0}
    assert ros.transforms_of(message(tilted)) == []


def test_only_what_is_surely_occupied_stays():
    tree = ros.occupancy_grid(np.array([[True, False], [False, True]]), (1.0, 2.0), 0.5, 0.0, "map")
    tree["data"] = np.array([100, 99, -1, 100])
    frame, found = ros.static_map_of(message(tree))
    assert frame == "map"
    assert found.occupied.tolist() == [[True, False], [False, True]]
    assert found.origin == (1.0, 2.0, 0.0)
    tree["data"] = np.array([100])
    with pytest.raises(Untrusted, match="2 times 2"):
        ros.static_map_of(message(tree))


def test_a_map_that_went_through_float32_tolerates_as_far_as_before():
    known = StaticMap.from_segments(np.array([[0.0, 0.0, 1.0, 0.0]]), resolution=0.05)
    told = message(ros.map_message(known, 0.0, "map"))
    told.info.resolution = float(np.float32(told.info.resolution))
    assert told.info.resolution != known.resolution
    _, back = ros.static_map_of(told)
    for tolerance in (0.05, 0.1):
        assert (back.dilated(tolerance) == known.dilated(tolerance)).all()


def test_frames_are_joined_up_and_down_the_tree():
    frames = Frames()
    frames.hear([("map", "/odom", (1.0, 0.0, math.pi / 2)), ("odom", "base", (2.0, 0.0, 0.0))])
    frames.hear([("base", "laser", (0.5, 0.0, 0.0))])
    assert frames.pose("map", "laser") == pytest.approx((1.0, 2.5, math.pi / 2))
    x, y, theta = frames.pose("laser", "map")
    assert compose((x, y, theta), frames.pose("map", "laser")) == pytest.approx((0, 0, 0), abs=1e-9)
    assert inverse(inverse((1.0, 2.0, 3.0))) == pytest.approx((1.0, 2.0, 3.0))
    assert frames.pose("map", "elsewhere") is None
    frames.hear([("laser", "map", (0.0, 0.0, 0.0))])  # a loop
    assert frames.pose("map", "elsewhere") is None


def test_a_shown_plan_keeps_its_end():
    times = np.arange(200) * 0.01
    states = np.zeros((200, 5))
    states[:, 0] = times
    shown = thinned(Trajectory(times, states, 100))
    assert len(shown.times) == MOST_STATES
    assert shown.times[-1] == times[-1]


def test_the_rim_of_an_area_is_what_borders_on_others():
    cells = np.zeros((5, 5), dtype=bool)
    cells[1:4, 1:4] = True
    rim = Area(cells, (10.0, 20.0), 0.5).rim()
    assert len(rim) == 8
    assert [11.25, 21.25] not in rim.tolist()


def test_messages_of_any_numbers_are_read_or_not_believed():
    rng = np.random.default_rng(5)
    odd = [math.nan, math.inf, -math.inf, 0.0, -0.0, 1e308, -1e308, 1e-308, -1.0, 3.0e38]

    def shaken(tree):
        if isinstance(tree, dict):
            return {k: v if k == "stamp" else shaken(v) for k, v in tree.items()}
        if isinstance(tree, list):
            return [shaken(one) for one in tree]
        if isinstance(tree, (float, int)) and rng.random() < 0.2:
            return odd[rng.integers(len(odd))]
        return tree

    scan = vars(scan_message([1.0, 2.0, 3.0])) | {"header": ros.header(100.0, "laser")}
    here = Odometry(0.0, 1.0, 2.0, 0.5, 0.1, 0.1)
    odometry = ros.odometry_message(here, 1.0, "odom", "base", 0.5)
    goal = ros.pose_stamped((1.0, 2.0, 0.5), 1.0, "map")
    grid = ros.occupancy_grid(np.eye(2, dtype=bool), (1.0, 2.0), 0.5, 0.0, "map")
    links = ros.transforms([("a", "b", (1.0, 2.0, 0.5))], 1.0)
    read = Counter()
    for _ in range(400):
        for tree, reading in (
            (scan, lambda m: ros.sweep_of(m, range_max=10.0).at((0, 0, 0), 0.0)),
            (odometry, ros.motion_of), (goal, ros.place_of), (grid, ros.static_map_of),
            (links, lambda m: Frames().hear(ros.transforms_of(m))),
        ):  # fmt: skip
            try:
                found = reading(message(shaken(tree)))
            except ValueError:  # Untrusted, and what a Scan refuses
                continue
            read[type(found).__name__] += 1
            if isinstance(found, Scan):
                assert not (found.ranges[found.returned] <= 0).any()
    assert min(read.values()) > 20


# stamps --------------------------------------------------------------------------------------


class Clocks:
    """A machine's two clocks; the wall clock is set by hand."""

    def __init__(self):
        self.now, self.ahead = 100.0, 1.7e9

    def made(self, **options):
        return RosClock(wall=lambda: self.now + self.ahead, clock=lambda: self.now, **options)


def test_a_stamp_is_what_our_clock_showed_then():
    clocks = Clocks()
    times = clocks.made()
    clocks.now += 1.0
    assert times.ours(clocks.now + clocks.ahead - 0.05) == pytest.approx(100.95, abs=1e-6)
    assert times.theirs(100.5) == pytest.approx(clocks.ahead + 100.5)


@pytest.mark.parametrize("age", [-0.01, 0.6, math.nan, math.inf, -math.inf])
def test_stamps_of_the_future_and_old_ones_are_not_believed(age):
    clocks = Clocks()
    times = clocks.made(oldest=0.5)
    clocks.now += 10.0
    with pytest.raises(Untrusted):
        times.ours(clocks.now + clocks.ahead - age)


@pytest.mark.parametrize("step", [-3600.0, -0.05, 0.05, 3600.0])
def test_after_the_wall_clock_was_set_nothing_is_believed_until_old_stamps_are_gone(step):
    clocks = Clocks()
    times = clocks.made(oldest=0.5)
    clocks.now += 1.0
    before = clocks.now + clocks.ahead  # a stamp made now, which arrives after the step
    clocks.ahead += step
    clocks.now += 0.1
    with pytest.raises(Untrusted):
        times.ours(before)
    with pytest.raises(Untrusted):
        times.ours(clocks.now + clocks.ahead)
    clocks.now += 1.1
    assert times.ours(clocks.now + clocks.ahead) == pytest.approx(clocks.now)
    assert times.jumps == 1


def test_a_believed_stamp_errs_by_no_more_than_it_says():
    # the smallest step that goes unnoticed, back, while a message is on its way: it looks younger
    clocks = Clocks()
    times = clocks.made(oldest=0.5, skew=0.003)
    clocks.now += 1.0
    made, stamp = clocks.now, clocks.now + clocks.ahead + 0.003  # by a clock that is 3 ms ahead
    clocks.ahead -= 0.9 * JUMP
    clocks.now += 0.05
    told = times.ours(stamp)
    assert told > made
    assert told - made <= times.error
    # it is this sum that keeps the promise: neither part alone holds it
    assert told - made > max(times.skew, JUMP)


def test_a_stamp_of_before_the_clock_first_looked_is_not_believed():
    clocks = Clocks()
    times = clocks.made()
    clocks.now += 0.01
    with pytest.raises(Untrusted):
        times.ours(clocks.now + clocks.ahead - 0.05)


# settings ------------------------------------------------------------------------------------


def test_turning_and_a_heading_that_is_not_known_make_scans_prove_less():
    settings = RosSettings(sweep=0.02, stamped="first", heading_error=0.03)
    beams = 720
    step, low = math.tau / beams / 2, -0.25 * math.tau
    ranges = np.full(beams, 5.0)
    ranges[400:420] = 2.0
    scan = Scan(ranges, low, step, 8.0, pose=(0.0, 0.0, 0.0), stamp=0.0)
    wide = []
    for turning in (0.0, 1.0):
        state = np.array([0.0, 0.0, 0.0, 0.27 * turning, -0.27 * turning])
        told = settings.steadied(scan, state, (0.0, 0.0, 0.0))
        lost = np.flatnonzero(told.lost)
        wide.append((lost[(lost > 50) & (lost < 400)].size) * step)
    assert wide[0] >= 0.03
    # from the sweep's middle to its ends, by the turn rate that the wheels tell
    assert wide[1] - wide[0] >= 0.9 * 0.01


def test_margins_hold_what_clocks_sweeps_and_the_executor_may_be_off():
    settings = RosSettings(sweep=0.02, skew=0.01, scans=("front", "rear"), apart=0.0135)
    made = settings.planner_settings()
    executor = settings.executor_settings()
    assert made.stamp_error == pytest.approx(
        0.02 + 0.01 + JUMP + 0.0135 + executor.rest_late
    )
    assert made.tracking_error >= executor.bound + executor.reaction
    astray = settings.robot.top_speed * (0.02 + 0.01 + JUMP)
    # wheels speed up twice as fast as they brake, from the odometry before until a beam is measured
    guess = 0.02 + 2 * executor.period
    assert settings.guess == pytest.approx(guess)
    unforeseen = settings.limits.acceleration * (guess + 0.02 + 0.01 + JUMP) ** 2
    assert made.localisation_error >= settings.pose_error + astray + unforeseen
    rare = RosSettings(sweep=0.02, skew=0.01, odometry_period=0.1).planner_settings()
    assert rare.localisation_error > made.localisation_error


def test_a_robot_told_to_move_as_none_does_proves_nothing():
    scan = Scan(np.full(100, 3.0), -1.0, 0.02, 10.0, (0.0, 0.0, 0.0), 0.0)
    mad = np.array([0.0, 0.0, 0.0, 1e6, -1e6])
    assert RosSettings().steadied(scan, mad, (0.3, 0.0, 0.0)).lost.all()


@pytest.mark.parametrize("stamped", ["any", "first"])
@pytest.mark.parametrize("told", [0.0, 0.015])
def test_no_beam_is_older_than_promised_or_farther_from_where_its_sensor_is_asked_for(
    stamped, told
):
    # a sweep of 15 ms, whose message tells that or nothing; at 1 m/s
    settings = RosSettings(sweep=0.02, stamped=stamped, robot=DifferentialDrive(wheel_speed=1.0))
    made, lasts = settings.planner_settings(), 0.015
    for begins in (0.0,) if stamped == "first" else (0.0, -0.5 * lasts, -lasts):
        stamp, middle = settings.moments(0.0, told)
        beams = np.array([begins, begins + lasts])
        assert beams.min() >= stamp - settings.scan_age
        moved = np.abs(beams - middle).max() * settings.robot.top_speed
        assert settings.pose_error + moved <= made.localisation_error
    # without the sweep's share the promise would not hold
    assert np.abs(beams - middle).max() > JUMP


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"scan": ["a"]}, "scans"),
        ({"robot": {"wheelspeed": 1.0}}, "wheel_speed"),
        ({"limits": {"wheel_speed": 0.1}}, "wheel_speed"),
        ({"scans": []}, "topics"),
        ({"cycle": 0.01}, "cycle"),
        ({"settings": [1]}, "names and values"),
    ],
)
def test_parameters_that_make_no_sense_are_refused_by_name(given, said):
    with pytest.raises(ValueError, match=said):
        RosSettings.from_parameters(given)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"settings": {"localisation_error": 0.001}}, "localisation_error"),
        ({"settings": {"stamp_error": 0.01}}, "stamp_error"),
        ({"settings": {"tracking_error": 0.01}}, "tracking_error"),
        ({"object_speed": 4.0, "skew": 0.1}, "object_speed"),
    ],
)
def test_margins_that_are_less_than_needed_are_refused(changes, said):
    with pytest.raises(ValueError, match=said):
        RosSettings.from_parameters(changes).planner_settings()


def test_what_a_parameter_server_holds_makes_settings():
    settings = RosSettings.from_parameters(
        {"robot": {"discs": [[0.0, 0.3]], "wheel_speed": 1.0}, "scans": ["a", "b"], "cycle": 0.2}
    )
    assert settings.robot == DifferentialDrive(discs=((0.0, 0.3),), wheel_speed=1.0)
    assert settings.planner_settings().cycle == 0.2


# the base ------------------------------------------------------------------------------------


def ros_base():
    clocks, said, stops = Clocks(), [], []
    base = RosBase(
        RosSettings().limits, said.append, stops.append, times=clocks.made(), child="base_link",
        clock=lambda: clocks.now,
    )  # fmt: skip
    return base, clocks, said, stops


def test_the_base_says_what_it_is_told_and_rests_when_nobody_tells_it_anything():
    base, clocks, said, _ = ros_base()
    base.drive(0.5, 0.5)
    assert said[-1]["linear"]["x"] == 0.5
    clocks.now += base.limits.command_timeout + 0.01
    base.watch()
    assert said[-1] == ros.twist(0.0, 0.0)
    count = len(said)
    clocks.now += REPEAT + 0.001
    base.watch()
    assert len(said) == count + 1


def test_numbers_that_are_none_are_not_said_and_speeds_have_a_limit():
    base, _, said, _ = ros_base()
    base.drive(math.nan, 0.0)
    assert not said
    base.drive(100.0, 100.0)
    assert said[-1]["linear"]["x"] == base.limits.wheel_speed


def test_stopped_or_pressed_it_says_rest_whatever_it_is_told():
    base, clocks, said, stops = ros_base()
    base.stop()
    assert stops == [{"data": False}, {"data": True}]
    base.press(pressed=True)
    base.reset()
    clocks.now += 1.0
    base.drive(1.0, 1.0)
    assert said[-1] == ros.twist(0.0, 0.0)
    base.press(pressed=False)
    base.drive(1.0, 1.0)
    assert said[-1]["linear"]["x"] == 1.0


def test_odometry_that_is_not_to_be_believed_is_as_if_none_had_come():
    base, clocks, _, _ = ros_base()
    clocks.now += 1.0

    def told(stamp, child="base_link"):
        odometry = Odometry(0.0, 1.0, 2.0, 0.5, 0.1, 0.1)
        tree = ros.odometry_message(odometry, stamp, "odom", child, 0.54)
        base.hear(message(tree))

    wall = clocks.now + clocks.ahead
    told(wall + 1.0)
    told(wall - 5.0)
    told(wall, child="camera")
    assert base.odometry() is None
    assert sum(base.refused.values()) == 3
    told(wall)
    first = base.odometry()
    assert first[1:] == pytest.approx((1.0, 2.0, 0.5, 0.1, 0.1))
    told(wall - 0.01)  # came out of order
    assert base.odometry() is first


@pytest.mark.parametrize("name", ["twin", "wheelchair"])
def test_the_shipped_configurations_make_sense(name):
    path = Path(__file__).parents[1] / "launch" / f"{name}.yaml"
    settings = RosSettings.from_parameters(yaml.safe_load(path.read_text()))
    assert settings.planner_settings().deadline < settings.cycle


# the emergency stop ----------------------------------------------------------------------------


def held_until(condition, within=30.0):
    end = time.monotonic() + within
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return condition()


def test_the_emergency_stop_s_topic_stops_an_executor_whenever_that_comes(tmp_path):
    pressed = []
    keeper = ButtonKeeper(tmp_path, pressed.append)
    latch = tmp_path / LATCH
    keeper.hear(SimpleNamespace(data=False))  # lay about before: nobody here has stopped
    keeper.hear(SimpleNamespace(data=True))
    assert pressed == [True]
    config = ExecutorConfig(directory=tmp_path, base="hardware.simulated_base:build", priority=0)
    try:
        # the executor comes later, and is told all the same
        with ExecutorProcess(config):
            assert held_until(latch.exists)
            keeper.hear(SimpleNamespace(data=False))
            assert held_until(lambda: not latch.exists())
            assert held_until(lambda: pressed == [True, False])
            keeper.hear(SimpleNamespace(data=True))
            assert held_until(latch.exists)
    finally:
        keeper.close()


# what is shown ---------------------------------------------------------------------------------


def test_a_coarse_cell_is_shown_hidden_if_any_part_of_it_is():
    robot = DifferentialDrive(wheel_speed=1.0)
    settings = Settings.for_robot(robot, object_speed=0.5)
    ranges = np.full(90, 2.0)
    ranges[:20] = 1.0
    scan = Scan(ranges, -math.pi, math.tau / 90, 3.0, pose=(0.3, 0.1, 0.2), stamp=0.0)
    model = FutureModel.from_scan(scan, robot, settings)
    shown = hidden_area(model, 0.1)
    assert shown.cell >= 0.1
    j, i = np.nonzero(~model.seen & ~(model.ticks > 0))
    coarse = round(shown.cell / model.cell)
    assert shown.cells[j // coarse, i // coarse].all()
    assert not shown.cells.all()
    state = np.array([0.3, 0.1, 0.2, 0.5, 0.5])
    unsafe = unsafe_area(model, state, 0.1, 2.0, 0.1)
    assert 0 < unsafe.cells.mean() < 1
    record = CycleRecord(stamp=0.0, decision="held", chosen=Trajectory.resting(state, 0.1))
    told = markers(record, robot, shown, unsafe, 1.0, "odom")["markers"]
    assert {m["ns"] for m in told} == {"hidden", "icsb", "broken", "goal", "plan", "rest"}
