"""Broken input for what hears ROS and reads recordings and settings; and what it once broke."""

import importlib.util
import math
import random
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from hardware import fuzzed_messages, ros_base, ros_fuzz, ros_planner
from hardware import ros_messages as ros
from hardware.base import FARTHEST
from hardware.broken_trees import as_message, broken_tree
from hardware.config_file import read_config
from hardware.dds import _taken
from hardware.executor_settings import ExecutorSettings
from hardware.fuzzed_files import EXAMPLES, ON_ROBOT
from hardware.fuzzed_listeners import SETTINGS, Planners, StubPort
from hardware.fuzzed_messages import RIGHT
from hardware.margins import deceleration, executor_settings, with_margins
from hardware.ros_frames import MOST_FRAMES, Frames
from hardware.ros_messages import MOST_BEAMS, MOST_LETTERS, OCCUPIED, Untrusted
from hardware.ros_planner import LONGEST_REASON, Planner
from hardware.ros_port import BOOL, GRID, ODOMETRY, POSE, SCAN, TRANSFORMS, TWIST
from hardware.ros_settings import RosSettings, read_parameters
from hardware.ros_twin import RosTwin, RosTwinSettings
from passpmp_ti import door
from passpmp_ti.cli import main
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.settings import Settings

SOME = {
    "reader": 0.5, "planner": 0.2, "base": 0.18, "ros1": 0.03, "dds": 0.03, "recording": 0.004,
    "config": 0.016, "parameters": 0.04,
}  # fmt: skip
TREE = {kind: right(fuzzed_messages.NOW) for kind, right in RIGHT.items()}


def changed(kind, **fields):
    return as_message(TREE[kind] | fields)


# the fuzzer -----------------------------------------------------------------------------------


def test_broken_input_breaks_nothing():
    findings = ros_fuzz.fuzz(3000, random.Random(3), SOME)
    assert findings.failures == []
    assert findings.refused > 600


@pytest.mark.parametrize(
    ("target", "module", "name", "wrong"),
    [
        ("reader", fuzzed_messages, "place_of", lambda message: ("map", message.pose, 0.0)),
        ("reader", fuzzed_messages, "place_of", lambda message: ("map", math.nan, 0.0)),
        ("planner", ros_planner, "place_of", lambda message: ("map", message.pose.position.x, 0)),
        ("base", ros_base, "twist_of", lambda right, left, track: (1e3 * right, left)),
    ],
)
def test_the_fuzzer_notices_what_may_not_be(monkeypatch, target, module, name, wrong):
    monkeypatch.setattr(module, name, wrong)
    assert ros_fuzz.fuzz(200, random.Random(1), {target: 1.0}).failures


def test_a_cycle_that_fails_is_noticed_though_the_planner_survives_it(monkeypatch):
    target = Planners(random.Random(0))
    monkeypatch.setattr(target.planner.navigator, "static_map", object())
    target._tell(["odom", "/tf_static", "map", "scan"])
    monkeypatch.setattr(target.planner, "_map", ("odom", "no map"))
    with pytest.raises(AssertionError, match="a cycle that failed"):
        target._plan(rolls=False, shows=False)


def test_what_is_not_installed_is_left_out(monkeypatch):
    there = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "rosbags" else there(name)
    )
    monkeypatch.setattr(ros_fuzz.ros1, "there", lambda name: False)
    assert {"recording", "ros1"} <= set(ros_fuzz.missing())
    shares = {"recording": 0.5, "base": 0.5}
    assert ros_fuzz.fuzz(10, random.Random(0), shares).inputs == {"base": 5}


def test_the_same_seed_breaks_a_tree_the_same_way_and_leaves_it_as_it_was():
    before = repr(TREE[SCAN])
    told = [repr([broken_tree(TREE[SCAN], random.Random(n)) for n in range(50)]) for _ in "ab"]
    assert told[0] == told[1]
    assert repr(TREE[SCAN]) == before


@pytest.mark.campaign
def test_a_million_broken_inputs():
    findings = ros_fuzz.fuzz(1_000_000, random.Random(0))
    assert findings.failures == []


# messages -------------------------------------------------------------------------------------


@pytest.mark.parametrize("broken", [None, 3, "text", [], SimpleNamespace(), {}])
def test_what_has_not_the_fields_of_its_kind_is_not_believed(broken):
    for read in (ros.motion_of, ros.place_of, ros.static_map_of, ros.stamp_of, ros.frame_of):
        with pytest.raises(Untrusted):
            read(broken)
    with pytest.raises(Untrusted):
        ros.sweep_of(broken, range_max=10.0)
    with pytest.raises(Untrusted):
        ros.wheels_from(broken, 0.5)
    assert ros.transforms_of(broken) == []


def test_of_transforms_only_those_that_are_none_are_left_out():
    message = as_message(TREE[TRANSFORMS])
    message.transforms.insert(1, None)
    message.transforms.append(SimpleNamespace(child_frame_id="laser"))
    assert [child for _, child, _ in ros.transforms_of(message)] == ["laser", "odom"]


def test_only_a_plain_false_does_not_stop():
    assert not ros.stop_of(changed(BOOL, data=False))
    for odd in (True, None, 0, math.nan, np.zeros(3)):
        assert ros.stop_of(changed(BOOL, data=odd))
    assert ros.stop_of(None)


def test_a_scan_of_more_beams_than_can_be_planned_on_in_time_is_not_believed():
    step = math.tau / (MOST_BEAMS + 10)
    for beams, believed in ((MOST_BEAMS, True), (MOST_BEAMS + 1, False)):
        message = changed(
            SCAN, ranges=np.ones(beams), angle_min=0.0, angle_increment=step,
            angle_max=(beams - 1) * step,
        )  # fmt: skip
        if believed:
            assert len(ros.sweep_of(message, range_max=10.0).ranges) == MOST_BEAMS
        else:
            with pytest.raises(Untrusted, match="beams"):
                ros.sweep_of(message, range_max=10.0)
    with pytest.raises(Untrusted, match="beams"):
        ros.sweep_of(changed(SCAN, ranges=np.ones((2, 5))), range_max=10.0)


def test_a_range_finder_that_sees_no_farther_than_nothing_tells_nothing():
    with pytest.raises(Untrusted, match="range"):
        ros.sweep_of(changed(SCAN, range_max=ros.TOO_NEAR), range_max=10.0)


def test_names_of_frames_are_texts_of_some_length():
    for name in ("x" * (MOST_LETTERS + 1), None, 3, b"odom"):
        message = changed(ODOMETRY, child_frame_id=name)
        with pytest.raises(Untrusted, match="name"):
            ros.motion_of(message)
    assert ros.motion_of(changed(ODOMETRY, child_frame_id="x" * MOST_LETTERS))


def test_frames_that_somebody_makes_up_do_not_fill_the_memory_nor_lose_those_that_are_known():
    frames = Frames()
    frames.hear([("base_link", "laser", (0.1, 0.0, 0.0))])
    frames.hear(("odom", f"made_up_{n}", (0.0, 0.0, 0.0)) for n in range(MOST_FRAMES + 100))
    assert len(frames) == MOST_FRAMES
    frames.hear([("base_link", "laser", (0.2, 0.0, 0.0))])
    assert frames.pose("base_link", "laser")[0] == pytest.approx(0.2)


def test_places_beyond_what_floats_tell_apart_are_not_believed():
    for x, believed in ((FARTHEST, True), (1.001 * FARTHEST, False), (1e300, False)):
        odometry = as_message(TREE[ODOMETRY])
        odometry.pose.pose.position.x = x
        goal = as_message(TREE[POSE])
        goal.pose.position.x = x
        for read, message in ((ros.motion_of, odometry), (ros.place_of, goal)):
            if believed:
                read(message)
            else:
                with pytest.raises(Untrusted):
                    read(message)


def test_a_cell_is_occupied_by_its_value_before_any_cast():
    tree = TREE[GRID]
    wraps, rounds = (1 << 16) + OCCUPIED, OCCUPIED + 0.5  # both are 100 in an int16
    data = np.where(np.arange(len(tree["data"])) % 2, wraps, rounds)
    _, known = ros.static_map_of(changed(GRID, data=data))
    assert not known.occupied.any()
    # a list times a number is a longer list, of which there may be more than memory
    info = tree["info"] | {"width": [None], "height": 2**32 - 1}
    with pytest.raises(Untrusted):
        ros.static_map_of(changed(GRID, info=info))


# who listens ----------------------------------------------------------------------------------


def test_messages_that_are_none_are_counted_and_the_planner_goes_on():
    port = StubPort()
    planner = Planner(port, SETTINGS)
    for topic in ("scan", "odom", "map", "/move_base_simple/goal", "/tf", "/tf_static"):
        port.hears[topic](None)
    assert planner.unseen == {"a message without the fields of its kind": 4}


def test_the_frame_that_is_planned_in_is_that_of_the_robots_own_odometry():
    port = StubPort()
    planner = Planner(port, SETTINGS)
    told = TREE[ODOMETRY]
    port.hears["odom"](as_message(told | {"child_frame_id": "camera", "header": {
        "stamp": told["header"]["stamp"], "frame_id": "elsewhere"}}))  # fmt: skip
    assert planner._frame == ""
    port.hears["odom"](as_message(told))
    assert planner._frame == "odom"


def test_a_map_that_is_too_coarse_is_refused_when_it_is_heard():
    port = StubPort()
    planner = Planner(port, SETTINGS)
    coarse = StaticMap(np.ones((4, 4), dtype=bool), 0.25, (0.0, 0.0, 0.0))
    port.hears["map"](as_message(ros.map_message(coarse, fuzzed_messages.NOW, "odom")))
    assert planner._map is None
    assert "map_tolerance" in " ".join(planner.unseen)


def test_a_goal_that_tf_puts_beyond_all_numbers_ends_no_cycle(monkeypatch):
    port = StubPort()
    planner = Planner(port, SETTINGS)
    planner._frame, planner._goal = "odom", ("map", 1.0, 0.0)
    monkeypatch.setattr(planner._frames, "pose", lambda *_: (math.inf, 0.0, 0.0))
    before = planner.navigator.goal
    planner._aim(np.zeros(5))
    assert planner.navigator.goal == before
    assert "beyond all numbers" in " ".join(planner.unseen)


def test_reasons_are_not_longer_than_can_be_shown():
    planner = Planner(StubPort(), SETTINGS)
    planner._count("x" * 10_000)
    assert [len(why) for why in planner.unseen] == [LONGEST_REASON]


def test_the_twin_takes_an_order_that_is_none_for_no_order():
    port = StubPort()
    twin = RosTwin(port, RosTwinSettings(chair="plain"))
    port.hears["cmd_vel"](SimpleNamespace(linear=None))
    assert twin._wanted is None
    port.hears["cmd_vel"](as_message(TREE[TWIST]))
    assert twin._wanted is not None


def test_bytes_that_are_no_message_do_not_make_a_node_of_ros_2_deaf(capsys):
    def take(N):
        raise ValueError("unpack requires a buffer of 4 bytes")

    assert _taken(SimpleNamespace(take=take)) == []
    assert "no message" in capsys.readouterr().err
    assert _taken(SimpleNamespace(take=lambda N: (1, 2))) == [1, 2]


# settings -------------------------------------------------------------------------------------

HUGE = 10**400
"""A whole number that no float holds."""


def test_numbers_that_no_float_holds_are_refused_by_name():
    with pytest.raises(ValueError, match=r"Robot\.speed"):
        door.finite("Robot", "speed", HUGE)
    with pytest.raises(ValueError, match=r"Robot\.discs"):
        door.array("Robot", "discs", [[HUGE, 1.0]], (None, 2))


@pytest.mark.parametrize("step", [1e308, 1e-10, 1e-320])
def test_a_time_step_is_at_least_a_millisecond_and_no_infinity(step):
    # one of 1e-10 s would make ten million steps of a plan's second
    with pytest.raises(ValueError, match="time_step"):
        Settings(time_step=step)


def test_margins_beyond_what_floats_hold_are_refused():
    with pytest.raises(ValueError, match="margins"):
        with_margins(
            Settings(), executor_settings(0.1), cycle=0.1, localisation_error=math.inf,
            range_noise=0.0, scan_age=0.0,
        )  # fmt: skip
    assert deceleration(1e300, 1.0) == math.inf


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"scans": 5}, "scans"),
        ({"scans": ["scan", None]}, r"scans\[1\]"),
        ({"base_frame": None}, "base_frame"),
        ({"frame": 3}, "frame"),
        ({"map": ["map"]}, "map"),
        ({"backend": 3}, "backend"),
        ({"beyond_is_free": "yes"}, "beyond_is_free"),
        ({"directory": 3}, "directory"),
        ({"range_max": HUGE}, "range_max"),
        ({"robot": {"discs": 5}}, "discs"),
        ({"robot": {"discs": [5]}}, "discs"),
        ({"robot": {3: 4}}, "robot"),
        ({"settings": {3: 4}}, "settings"),
        ({"executor": {"follower": 3}}, "follower"),
        ({"executor": {"follower": {"gain": 3}}}, "follower.gain"),
        ({3: 4}, "parameters"),
        ([], "parameters"),
    ],
)
def test_parameters_of_another_type_are_refused_by_name(given, said):
    with pytest.raises(ValueError, match=said):
        RosSettings.from_parameters(given).executor_settings()


def test_all_parameters_that_the_fuzzer_breaks_are_right_before():
    RosSettings.from_parameters(ON_ROBOT).planner_settings()
    with pytest.raises(ValueError, match="follower"):
        ExecutorSettings(follower={"along": 1.0})
    for name in ("scenario", "summary", "object_speed"):
        with pytest.raises(ValueError, match=name):
            RosTwinSettings(**{name: ["corridor"]})


@pytest.mark.parametrize(
    "text", ["!!bool maybe", "!!timestamp never", "!!int x", "{[]: 1}", "2020-99-99", "[" * 1000]
)
def test_yaml_that_has_its_reader_raise_anything_is_refused_by_file(tmp_path, text):
    path = tmp_path / "robot.yaml"
    path.write_text(f"planner: {{cycle: 0.1, object_speed: {text}}}\n")
    with pytest.raises(ValueError, match=r"robot\.yaml"):
        read_config(path)
    with pytest.raises(ValueError, match=r"robot\.yaml"):
        read_parameters(path)


@pytest.mark.parametrize("broken", ["robot: [", "", "\x00", "robot: {discs: !!bool maybe}"])
def test_a_broken_file_of_a_robot_ends_the_command_with_what_is_wrong(tmp_path, capsys, broken):
    path = tmp_path / "robot.yaml"
    path.write_text(broken)
    assert main(["drive", str(path)]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"passpmp: error: {path}")
    assert "Traceback" not in told


def test_a_robot_with_one_thing_wrong_ends_the_command_with_one_line(tmp_path, capsys):
    right = yaml.safe_load((EXAMPLES / "wheelchair.yaml").read_text())
    right["planner"]["cycle"] = HUGE
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump(right))
    assert main(["drive", str(path)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
