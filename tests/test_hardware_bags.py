"""Recordings: what is written comes back, from ROS 1 bags and from MCAP, and others read it too."""

import math
import shutil
import subprocess

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed: pip install 'passpmp_ti[bags]'")

from hardware.bags import BagWriter, messages
from hardware.bags_drive import DriveWriter
from hardware.bags_recording import Recording
from hardware.base import Odometry
from hardware.ros_messages import TOO_NEAR, laser_scan, odometry_message, transforms
from passpmp_ti.cli import main
from passpmp_ti.scan import Scan

WALL = 1.7e9
MOUNTS = [(0.3, 0.0, 0.0), (-0.3, 0.0, math.pi)]
RANGES = np.array([1.0, math.inf, math.nan, 0.01, 2.5])


def scan_at(stamp, ranges=RANGES):
    return Scan(ranges, -1.0, 0.5, 8.0, pose=(0.0, 0.0, 0.0), stamp=stamp)


def drive(path, seconds=1.0):
    """A straight drive at 0.5 m/s, two scans every 0.1 s."""
    with DriveWriter(path, MOUNTS, track=0.54, ahead=WALL) as bag:
        for k in range(round(seconds / 0.1)):
            t = 5.0 + 0.1 * k
            state = np.array([0.05 * k, 1.0, 0.2, 0.5, 0.5])
            bag.see([scan_at(t), scan_at(t, RANGES[::-1])], state)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_a_drive_is_written_and_comes_back(tmp_path, suffix):
    path = tmp_path / "deep" / f"drive{suffix}"
    drive(path)
    assert [p.name for p in path.parent.iterdir()] == [path.name]
    recording = Recording(path, track=0.54)
    assert recording.begin == pytest.approx(WALL + 5.0, abs=1e-6)
    found = list(recording.instants(range_max=8.0))
    assert len(found) == 10
    for k, instant in enumerate(found):
        assert instant.stamp == pytest.approx(0.1 * k, abs=1e-6)
        assert instant.state == pytest.approx([0.05 * k, 1.0, 0.2, 0.5, 0.5], abs=1e-6)
        front, rear = instant.scans
        assert front.ranges == pytest.approx([1.0, math.inf, math.nan, TOO_NEAR, 2.5], nan_ok=True)
        assert rear.ranges == pytest.approx([2.5, TOO_NEAR, math.nan, math.inf, 1.0], nan_ok=True)
        x, y, theta = front.pose
        ahead = (0.05 * k + 0.3 * math.cos(0.2), 1.0 + 0.3 * math.sin(0.2), 0.2)
        assert (x, y, theta) == pytest.approx(ahead)
    assert not recording.trouble


def test_the_same_drive_leaves_the_same_recording_in_both_formats(tmp_path):
    told = []
    for suffix in (".bag", ".mcap"):
        drive(tmp_path / f"drive{suffix}")
        kinds = ["sensor_msgs/LaserScan", "nav_msgs/Odometry", "tf2_msgs/TFMessage"]
        found = list(messages(tmp_path / f"drive{suffix}", kinds))
        told.append([(m.topic, m.kind, m.time) for m in found])
    assert told[0] == told[1]
    assert len(told[0]) == 1 + 3 * 10


@pytest.mark.campaign
def test_debians_rosbag_reads_what_is_written(tmp_path):
    tool = shutil.which("rosbag", path="/usr/bin")
    if tool is None:
        pytest.skip("rosbag is not installed; on Debian: apt-get install python3-rosbag")
    drive(tmp_path / "drive.bag")
    told = subprocess.run(
        ["/usr/bin/python3", tool, "info", "drive.bag"], cwd=tmp_path, capture_output=True,
        text=True, timeout=60, check=False,
    )  # fmt: skip
    assert told.returncode == 0, told.stderr
    assert "/scan_1" in told.stdout
    assert "sensor_msgs/LaserScan" in told.stdout


def test_where_no_odometry_tells_speeds_they_are_taken_from_the_poses(tmp_path):
    with BagWriter(tmp_path / "poses.mcap") as bag:
        for k in range(40):
            t = WALL + 0.05 * k
            still = Odometry(0.0, 0.02 * k, 0.0, 0.0, 0.0, 0.0)
            tree = odometry_message(still, t, "odom", "base", 0.5)
            bag.write("/odom", "nav_msgs/Odometry", tree, t)
            tree = laser_scan(scan_at(0.0), t, "laser")
            bag.write("/scan", "sensor_msgs/LaserScan", tree, t)
    recording = Recording(tmp_path / "poses.mcap", track=0.5)
    assert recording.way.states[:, 3:] == pytest.approx(0.4, abs=1e-6)
    found = list(recording.instants())
    assert len(found) == 40
    # tf says nothing of the mount, and that is told
    assert list(recording.trouble) == [
        "laser is taken to be in the robot's middle: tf does not say"
    ]


def test_tf_alone_tells_where_the_robot_was(tmp_path):
    with BagWriter(tmp_path / "tf.bag") as bag:
        for k in range(20):
            t = WALL + 0.05 * k
            links = [("odom", "base_link", (0.02 * k, 0.0, 0.0)), ("base_link", "l", MOUNTS[0])]
            bag.write("/tf", "tf2_msgs/TFMessage", transforms(links, t), t)
            tree = laser_scan(scan_at(0.0), t, "l")
            bag.write("/scan", "sensor_msgs/LaserScan", tree, t)
    recording = Recording(tmp_path / "tf.bag", track=0.5)
    found = list(recording.instants())
    assert found[10].state[:2] == pytest.approx([0.2, 0.0], abs=1e-6)
    assert found[10].scans[0].pose[0] == pytest.approx(0.5)


def test_nothing_is_known_of_where_the_robot_was_in_a_gap(tmp_path):
    drive(tmp_path / "drive.mcap")
    way = Recording(tmp_path / "drive.mcap", track=0.54).way
    assert way.at(-0.1) is None
    assert way.at(2.0) is None
    assert way.at(0.05)[0] == pytest.approx(0.025, abs=1e-6)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_a_recording_of_nothing_is_one_all_the_same(tmp_path, suffix):
    BagWriter(tmp_path / f"none{suffix}").close()
    assert list(messages(tmp_path / f"none{suffix}", ["sensor_msgs/LaserScan"])) == []


def test_bad_recordings_are_refused_by_name(tmp_path):
    with pytest.raises(ValueError, match=r"\.bag or \.mcap"):
        BagWriter(tmp_path / "drive.db3")
    drive(tmp_path / "drive.bag", 0.2)
    with pytest.raises(ValueError, match="exists already"):
        BagWriter(tmp_path / "drive.bag")
    with pytest.raises(ValueError, match="no such recording"):
        Recording(tmp_path / "none.bag", track=0.5)
    (tmp_path / "noise.bag").write_bytes(b"noise")
    with pytest.raises(ValueError, match="not a recording"):
        Recording(tmp_path / "noise.bag", track=0.5)
    with pytest.raises(ValueError, match="no scans on /front; there are /scan, /scan_1"):
        Recording(tmp_path / "drive.bag", track=0.5, scans=["front"])
    with pytest.raises(ValueError, match="nothing tells where the robot was"):
        Recording(tmp_path / "drive.bag", track=0.5, odometry="wheels")


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
@pytest.mark.parametrize(
    "broken",
    [
        lambda told: told[: len(told) // 2],
        lambda told: told[:200] + b"\xff" * 8 + told[200:],
        lambda told: told[:-40] + b"\xff" * 40,
        lambda told: b"\xc1" + told,
        lambda told: b"",
    ],
)
def test_a_broken_recording_is_refused_by_name_whatever_its_reader_raises(
    tmp_path, capsys, suffix, broken
):
    drive(tmp_path / f"right{suffix}", 0.2)
    path = tmp_path / f"broken{suffix}"
    path.write_bytes(broken((tmp_path / f"right{suffix}").read_bytes()))
    with pytest.raises(ValueError, match=f"broken{suffix}"):
        Recording(path, track=0.5)
    assert main(["replay", str(path)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_replay_with_a_robot_s_file_that_is_none_ends_with_one_line(tmp_path, capsys):
    drive(tmp_path / "drive.bag", 0.2)
    (tmp_path / "robot.yaml").write_text("settings: 5\n")
    given = ["replay", str(tmp_path / "drive.bag"), "--config", str(tmp_path / "robot.yaml")]
    assert main(given) == 2
    (told,) = capsys.readouterr().err.splitlines()
    assert "settings must be names and values" in told


def test_odometry_of_no_robot_is_refused_by_name(tmp_path):
    # braking from such a speed would be reckoned step by step, without an end
    for name, speed in (("fast", 1e9), ("none", math.nan)):
        with BagWriter(tmp_path / f"{name}.mcap") as bag:
            for k in range(4):
                t = WALL + 0.1 * k
                told = Odometry(0.0, 0.1 * k, 0.0, 0.0, speed, speed)
                tree = odometry_message(told, t, "odom", "base", 0.5)
                bag.write("/odom", "nav_msgs/Odometry", tree, t)
                bag.write("/scan", "sensor_msgs/LaserScan", laser_scan(scan_at(0.0), t, "l"), t)
        with pytest.raises(ValueError, match=rf"{name}\.mcap: nothing tells where the robot was"):
            Recording(tmp_path / f"{name}.mcap", track=0.5)


def test_a_map_that_is_none_is_refused_by_the_recordings_name(tmp_path):
    path = tmp_path / "map.mcap"
    drive(path, 0.2)
    recording = Recording(path, track=0.5)
    with BagWriter(tmp_path / "other.mcap") as bag:
        bag.write("/map", "nav_msgs/OccupancyGrid", {"data": np.zeros(3, dtype=np.int8)}, WALL)
    recording.path = tmp_path / "other.mcap"
    with pytest.raises(ValueError, match=r"other\.mcap: on /map"):
        recording.static_map("/map")
