"""ROS 2's wire: names, types and bytes as ROS 2 has them, and two processes on loopback."""

import dataclasses
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
import yaml

pytest.importorskip(
    "cyclonedds", reason="cyclonedds is not installed: pip install 'passpmp_ti[ros2]'"
)

from hardware import dds_types
from hardware import ros_messages as ros
from hardware.base import Odometry
from hardware.base_link import RemoteBase
from hardware.dds import DdsPort, filled
from hardware.ros_settings import RosSettings
from passpmp_ti.scan import Scan

HOME = Path(__file__).parents[1]
DOMAIN = 77
SCAN = Scan(np.array([1.0, np.inf, np.nan, 0.01]), -1.0, 0.5, 8.0, pose=(0, 0, 0), stamp=0.0)

PEER = """
import json, sys, time
from hardware import ros_messages as ros
from hardware.dds import DdsPort
told = []
with DdsPort() as port:
    say = port.publisher("cmd_vel", "geometry_msgs/Twist")
    def hear(message):
        sweep = ros.sweep_of(message, range_max=10.0)
        told.append([str(r) for r in sweep.ranges])
        say(ros.twist(0.25, -0.5))
    port.subscribe("scan", "sensor_msgs/LaserScan", hear)
    print("ready", flush=True)
    end = time.monotonic() + 20
    while not told and time.monotonic() < end:
        time.sleep(0.01)
    time.sleep(0.5)
print(json.dumps(told[:1]))
"""


def trees():
    """A message of each kind."""
    odometry = Odometry(0.0, 1.0, 2.0, 0.5, 0.2, 0.1)
    grid = ros.occupancy_grid(np.array([[True, False]]), (1.0, 2.0), 0.5, 3.5, "map")
    marker = {"ns": "a", "type": 6, "points": [{"x": 1.0, "y": 2.0, "z": 0.0}],
              "header": ros.header(1.25, "odom"), "color": {"r": 1.0, "a": 0.5}}  # fmt: skip
    status = {"level": 1, "name": "n", "message": "m", "hardware_id": "",
              "values": [{"key": "k", "value": "v"}]}  # fmt: skip
    pose = ros.pose_stamped((1.0, 2.0, 3.0), 4.0, "map")
    return {
        "sensor_msgs/LaserScan": ros.laser_scan(SCAN, 12.5, "laser", lasts=0.01),
        "nav_msgs/Odometry": ros.odometry_message(odometry, 1.0, "odom", "base_link", 0.5),
        "geometry_msgs/Twist": ros.twist(0.5, 0.25),
        "geometry_msgs/PoseStamped": pose,
        "nav_msgs/Path": {"header": ros.header(4.0, "map"), "poses": [pose, pose]},
        "nav_msgs/OccupancyGrid": grid,
        "tf2_msgs/TFMessage": ros.transforms([("a", "b", (1.0, 2.0, 0.5))], 1.0),
        "std_msgs/Bool": {"data": True},
        "diagnostic_msgs/DiagnosticArray": {"header": ros.header(1.0, ""), "status": [status]},
        "visualization_msgs/MarkerArray": {"markers": [marker]},
    }


@pytest.mark.parametrize("kind", sorted(dds_types.KINDS))
def test_bytes_are_those_that_others_make_of_the_same_message(kind):
    pytest.importorskip("rosbags", reason="rosbags is not installed: pip install rosbags")
    from rosbags.typesys import Stores, get_typestore

    from hardware.bags import made

    types, full = get_typestore(Stores.ROS2_HUMBLE), kind.replace("/", "/msg/")
    tree = trees()[kind]
    ours = bytes(filled(dds_types.KINDS[kind](), tree).serialize())
    back = types.deserialize_cdr(ours, full)
    # what is not in the tree is each library's own default
    whole = _tree_of(filled(dds_types.KINDS[kind](), tree))
    theirs = bytes(types.serialize_cdr(made(types, full, whole), full))
    assert ours[4:] == theirs[4:]
    assert type(back).__name__.endswith(kind.rpartition("/")[2])


def _tree_of(message):
    if dataclasses.is_dataclass(message):
        return {f.name: _tree_of(getattr(message, f.name)) for f in dataclasses.fields(message)}
    return [_tree_of(one) for one in message] if isinstance(message, list) else message


def test_every_type_has_ros_2s_name_and_no_field_without_a_type():
    for kind, made in dds_types.KINDS.items():
        package, name = kind.split("/")
        assert made.__idl_typename__ == f"{package}::msg::dds_::{name}_"
        assert set(get_type_hints(made)) >= {f.name for f in dataclasses.fields(made)}


def peer(code, *arguments, env=()):
    return subprocess.Popen(
        [sys.executable, *code, *arguments],
        env={**os.environ, "PYTHONPATH": str(HOME), "ROS_DOMAIN_ID": str(DOMAIN), **dict(env)},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def until(condition, within=30.0):
    end = time.monotonic() + within
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)
    return condition()


def test_a_scan_goes_to_another_process_and_a_command_comes_back():
    heard = []
    other = peer(["-c", PEER])
    try:
        with DdsPort(domain=DOMAIN) as port:
            port.subscribe(
                "cmd_vel", "geometry_msgs/Twist",
                lambda m: heard.append((m.linear.x, m.angular.z)),
            )  # fmt: skip
            say = port.publisher("scan", "sensor_msgs/LaserScan")

            def answered():
                say(ros.laser_scan(SCAN, time.time(), "laser"))
                time.sleep(0.02)
                return bool(heard)

            assert until(answered), other.communicate(timeout=25)
        out, _ = other.communicate(timeout=25)
    finally:
        other.kill()
    assert heard[0] == (0.25, -0.5)
    assert json.loads(out.splitlines()[-1]) == [["1.0", "inf", "nan", "0.001"]]


@pytest.mark.campaign
def test_the_base_is_driven_over_the_wire_and_an_emergency_stop_holds_it(tmp_path):
    config = tmp_path / "base.yaml"
    config.write_text(json.dumps({"directory": str(tmp_path / "sockets")}))
    node = peer(["-m", "hardware.dds_node", "base", "--config", str(config)])
    limits, heard = RosSettings().limits, []
    try:
        assert until((tmp_path / "sockets" / "base").exists)
        base = RemoteBase(tmp_path / "sockets" / "base", limits)
        with DdsPort(domain=DOMAIN) as port:
            odom = port.publisher("odom", "nav_msgs/Odometry")
            button = port.publisher("emergency_stop", "std_msgs/Bool", latched=True)
            port.subscribe("cmd_vel", "geometry_msgs/Twist", lambda m: heard.append(m.linear.x))

            def driven():
                base.drive(0.5, 0.5)
                here = Odometry(0.0, 1.0, 2.0, 0.5, 0.4, 0.4)
                odom(ros.odometry_message(here, time.time(), "odom", "base_link", limits.track))
                time.sleep(0.01)
                return heard[-1:] == [0.5] and base.odometry() is not None

            assert until(driven)
            assert base.odometry()[1:] == pytest.approx((1.0, 2.0, 0.5, 0.4, 0.4))
            button({"data": True})
            assert until(lambda: not driven() and heard[-1] == 0.0)
        base.close()
    finally:
        node.terminate()
        node.wait(10)


@pytest.mark.campaign
def test_the_twin_is_driven_to_a_goal_over_the_wire(tmp_path):
    summary, sockets = tmp_path / "summary.json", tmp_path / "sockets"
    twin, robot = tmp_path / "twin.yaml", tmp_path / "robot.yaml"
    twin.write_text(
        json.dumps({"scenario": "corridor_person", "object_speed": 0.5, "summary": str(summary)})
    )
    shipped = yaml.safe_load((HOME / "launch" / "twin.yaml").read_text())
    robot.write_text(json.dumps({**shipped, "directory": str(sockets)}))
    nodes = [
        peer(["-m", "hardware.dds_node", node, "--config", str(config)])
        for node, config in (("twin", twin), ("base", robot), ("planner", robot))
    ]
    told = {}

    def hear(message):
        for status in message.status:
            told.setdefault(status.name, {}).update({v.key: v.value for v in status.values})

    try:
        with DdsPort(domain=DOMAIN) as port:
            port.subscribe("/diagnostics", "diagnostic_msgs/DiagnosticArray", hear)
            goal = port.publisher("/move_base_simple/goal", "geometry_msgs/PoseStamped")

            def reached():
                goal(ros.pose_stamped((11.8, 0.0, 0.0), time.time(), "odom"))
                time.sleep(0.2)
                return told.get("passpmp planner", {}).get("goal reached") == "True"

            assert until(reached, 150.0), told
    finally:
        for node in reversed(nodes):
            node.terminate()
        for node in nodes:
            node.communicate(timeout=30)
    print(told)
    found = json.loads(summary.read_text())
    assert found["to_goal"] < 0.4
    assert found["collisions_moving"] == 0


def test_a_domain_that_is_none_is_refused_by_name(monkeypatch):
    with pytest.raises(ValueError, match="domain"):
        DdsPort(domain=300)
    monkeypatch.setenv("ROS_DOMAIN_ID", "home")
    with pytest.raises(ValueError, match="ROS_DOMAIN_ID"):
        DdsPort()
