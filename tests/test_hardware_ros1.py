"""ROS 1 itself: a real rosmaster on loopback, and nodes in processes of their own.

Skipped where Debian's packages of ROS 1 are not installed. The whole chain, a twin's node driven to
a goal, takes a minute of real time: pytest -m campaign.
"""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from hardware import ros1
from hardware import ros_messages as ros

HOME = Path(__file__).parents[1]
try:
    ros1.load("rospy")
    MISSING = ""
except ValueError as why:
    MISSING = str(why)
pytestmark = pytest.mark.skipif(bool(MISSING), reason=MISSING)

PEER = """
import json, sys, time
from pathlib import Path
from hardware import ros_messages as ros
from hardware.base import BaseLimits, Odometry
from hardware.base_link import RemoteBase
from hardware.ros1 import Ros1Port

def until(condition, within=20.0):
    end = time.monotonic() + within
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)
    return condition()

heard, stops, limits = [], [], BaseLimits()
with Ros1Port("peer") as port:
    odom = port.publisher("odom", "nav_msgs/Odometry")
    button = port.publisher("emergency_stop", "std_msgs/Bool", latched=True)
    def hear(message):
        heard.append(ros.wheels_from(message, limits.track))

    port.subscribe("cmd_vel", "geometry_msgs/Twist", hear)
    port.subscribe("stop", "std_msgs/Bool", lambda m: stops.append(m.data), latched=True)
    base = RemoteBase(Path(sys.argv[1]) / "base", limits)

    def driven(right, left):
        base.drive(right, left)
        here = Odometry(0.0, 1.0, 2.0, 0.5, 0.3, 0.1)
        odom(ros.odometry_message(here, time.time(), "odom", "base_link", limits.track))
        time.sleep(0.01)
        return bool(heard) and abs(heard[-1][0] - right) + abs(heard[-1][1] - left) < 1e-6

    told = {"obeys": until(lambda: driven(0.5, 0.3))}
    told["odometry"] = base.odometry() and list(base.odometry()[1:])
    told["age"] = base.odometry() and time.monotonic() - base.odometry().stamp
    told["rests alone"] = until(lambda: heard[-1] == (0.0, 0.0))
    told["stop said"] = until(lambda: stops[:1] == [False])
    button({"data": True})
    told["pressed"] = until(lambda: not driven(0.5, 0.3) and heard[-1] == (0.0, 0.0))
    time.sleep(0.1)
    told["stays pressed"] = not driven(0.5, 0.3)
    base.stop()
    told["stop said again"] = until(lambda: stops[-1:] == [True])
    base.close()
print(json.dumps(told))
"""


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Ros:
    """A rosmaster on loopback, and what was started beside it."""

    def __init__(self, folder):
        self.folder = folder
        self.port = free_port()
        self.uri = f"http://127.0.0.1:{self.port}"
        self.env = {
            **os.environ, "ROS_MASTER_URI": self.uri, "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(folder), "ROS_LOG_DIR": str(folder / "log"),
            "PYTHONPATH": str(HOME), "PYTHONUNBUFFERED": "1",
            "ROS_PACKAGE_PATH": f"{HOME}:/usr/share", "PASSPMP_PYTHON": sys.executable,
        }  # fmt: skip
        self.running = []
        # of no package of ours: Debian's own Python runs it
        self.start(["/usr/bin/rosmaster", "--core", "-p", str(self.port)])
        self.wait_for_master()

    def start(self, command):
        log = (self.folder / f"log-{len(self.running)}").open("w+")
        self.running.append(
            (subprocess.Popen(command, env=self.env, stdout=log, stderr=log), log)
        )
        return self.running[-1]

    def node(self, module, *arguments):
        return self.start([sys.executable, "-m", module, *arguments])

    def wait_for_master(self):
        end = time.monotonic() + 20
        while time.monotonic() < end:
            with socket.socket() as one:
                if one.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.05)
        pytest.fail(f"rosmaster did not start: {self.told()}")

    def told(self):
        texts = []
        for _, log in self.running:
            log.seek(0)
            texts.append(log.read())
        return "\n".join(texts)

    def close(self):
        for process, log in reversed(self.running):
            process.send_signal(signal.SIGINT)
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            log.close()


@pytest.fixture
def loopback(tmp_path):
    if shutil.which("rosmaster", path="/usr/bin") is None:
        pytest.skip("rosmaster is not installed; on Debian: apt-get install python3-rosmaster")
    started = Ros(tmp_path)
    yield started
    started.close()


def test_messages_are_filled_as_ros_1_has_them():
    grid = ros.occupancy_grid(np.array([[True, False]]), (1.0, 2.0), 0.5, 1e9 + 0.5, "map")
    message = ros1.filled(ros1.message_class("nav_msgs/OccupancyGrid")(), grid)
    assert message.data == [100, 0]
    assert (message.header.stamp.secs, message.header.stamp.nsecs) == (10**9, 500_000_000)
    links = ros.transforms([("a", "b", (1.0, 2.0, 0.0))], 1.0)
    tf = ros1.filled(ros1.message_class("tf2_msgs/TFMessage")(), links)
    assert ros.transforms_of(tf) == [("a", "b", (1.0, 2.0, 0.0))]
    from io import BytesIO

    for made in (message, tf):
        made.serialize(BytesIO())  # every field has its type


def test_the_base_hears_and_is_heard_over_a_real_master(loopback, tmp_path):
    loopback.node("hardware.ros1_base", f"_directory:={tmp_path}")
    peer = subprocess.run(
        [sys.executable, "-c", PEER, str(tmp_path)], env=loopback.env, capture_output=True,
        text=True, timeout=60, check=False,
    )  # fmt: skip
    assert peer.returncode == 0, peer.stderr + loopback.told()
    told = json.loads(peer.stdout.splitlines()[-1])
    assert told.pop("odometry") == pytest.approx([1.0, 2.0, 0.5, 0.3, 0.1])
    assert 0.0 <= told.pop("age") < 10.0
    assert all(told.values()), told


@pytest.mark.campaign
@pytest.mark.parametrize("chair", ["mujoco", "plain"])
def test_roslaunch_drives_the_twin_to_a_goal_and_nothing_touches_it_on_its_way(
    loopback, tmp_path, chair
):
    if chair == "mujoco":
        pytest.importorskip("mujoco", reason="pip install 'passpmp_ti[twin]'")
    summary = tmp_path / "summary.json"
    loopback.start(
        [
            "/usr/bin/roslaunch", "-p", str(loopback.port), "passpmp_ti", "twin.launch",
            "scenario:=corridor_person", f"chair:={chair}", f"summary:={summary}",
            f"directory:={tmp_path / 'sockets'}",
        ]
    )  # fmt: skip
    script = """
import json, sys, time
from hardware import ros_messages as ros
from hardware.ros1 import Ros1Port
told = {}
def hear(message):
    for status in message.status:
        told.setdefault(status.name, {}).update({v.key: v.value for v in status.values})
with Ros1Port("goal") as port:
    goal = port.publisher("/move_base_simple/goal", "geometry_msgs/PoseStamped", latched=True)
    port.subscribe("/diagnostics", "diagnostic_msgs/DiagnosticArray", hear)
    plans, grids = [], []
    port.subscribe("plan", "nav_msgs/Path", lambda m: plans.append(len(m.poses)))
    port.subscribe("icsb", "nav_msgs/OccupancyGrid", lambda m: grids.append(sum(m.data)))
    goal(ros.pose_stamped((11.8, 0.0, 0.0), time.time(), "odom"))
    end = time.monotonic() + 120
    while time.monotonic() < end:
        if told.get("passpmp planner", {}).get("goal reached") == "True":
            break
        time.sleep(0.2)
print(json.dumps({"told": told, "plans": len(plans), "grids": len(grids)}))
"""
    peer = subprocess.run(
        [sys.executable, "-c", script], env=loopback.env, capture_output=True, text=True,
        timeout=170, check=False,
    )  # fmt: skip
    assert peer.returncode == 0, peer.stderr + loopback.told()
    told = json.loads(peer.stdout.splitlines()[-1])
    print(told)
    loopback.running[-1][0].send_signal(signal.SIGINT)
    loopback.running[-1][0].wait(30)
    found = json.loads(summary.read_text())
    assert told["told"]["passpmp planner"]["goal reached"] == "True", told
    assert found["to_goal"] < 0.4
    assert found["collisions_moving"] == 0
    assert told["plans"] > 50
    assert told["grids"] > 5
