"""Planning on recordings: what was safe is told so, what was not is not, and twice is the same."""

import gzip
import json
import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed: pip install 'passpmp_ti[bags]'")

from hardware.bags import BagWriter
from hardware.bags_drive import DriveWriter
from hardware.bags_recording import Recording
from hardware.base import Odometry
from hardware.replay import recorded_motion, replay
from hardware.ros_messages import laser_scan, odometry_message
from hardware.ros_settings import RosSettings
from passpmp_ti.cli import main
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.scan import Scan
from passpmp_ti.sim.data_files import DATA, REPOSITORY
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.world import World

ROOM = np.array([[-4, -3, 6, -3], [6, -3, 6, 3], [6, 3, -4, 3], [-4, 3, -4, -3]], dtype=float)
LIDAR = Lidar(range_max=12.0, beams=360)
SETTINGS = RosSettings(
    robot=DifferentialDrive(wheel_speed=1.0), object_speed=0.5, sweep=0.005,
    settings={"particles": 20, "iterations": 10, "capacity": 300},
)  # fmt: skip


def drive_in_room(path, speed, seconds=1.0, start=-2.0, rest=0.2):
    """A drive towards the wall at x = 6 m, after a while of rest; the map is recorded too."""
    world = World((-5, -4, 7, 4), (), ROOM)
    known = StaticMap.from_segments(ROOM)
    with DriveWriter(path, [(0.0, 0.0, 0.0)], track=0.54, ahead=1.7e9, known=known) as bag:
        for k in range(round((rest + seconds) / 0.1) + 1):
            moving = max(0.0, 0.1 * k - rest)
            v = speed if moving > 0 else 0.0
            state = np.array([start + speed * moving, 0.0, 0.0, v, v])
            bag.see([LIDAR.scan(world, state, 0.1 * k)], state)
    return path


def replayed(path, *, static_map="/map", **changes):
    recording = Recording(path, track=0.54)
    settings = replace(SETTINGS, **changes)
    known = recording.static_map(static_map) if static_map else None
    return replay(
        recording.instants(range_max=12.0), recording.way, settings.robot,
        settings.planner_settings().changed(deadline=None), static_map=known,
    )  # fmt: skip


def test_a_slow_drive_in_a_known_room_was_safe_and_there_was_a_plan(tmp_path):
    told = replayed(drive_in_room(tmp_path / "slow.mcap", 0.4)).summary()
    assert told["cycles"] == 12  # the last scan's cycle has no recorded end
    assert told["recorded_motion_clear"] == 1.0
    assert told["share_plan"] > 0.5
    assert told["lost_scans"] == told["faults"] == told["broken_premises"] == 0


def test_a_drive_into_a_wall_was_not(tmp_path):
    path = drive_in_room(tmp_path / "wall.mcap", 0.9, start=4.9)
    told = replayed(path).summary()
    assert told["recorded_motion_clear"] < 0.5
    assert "brake" in told["decisions"]


@pytest.mark.campaign
def test_the_same_recording_is_judged_the_same_in_either_format(tmp_path):
    found = [
        replayed(drive_in_room(tmp_path / f"same{suffix}", 0.4, seconds=0.5))
        for suffix in (".bag", ".mcap")
    ]
    told = [[(r.decision, r.tree_nodes, r.cost) for r in f.records] for f in found]
    assert told[0] == told[1]
    assert found[0].shares == found[1].shares


def test_what_was_recorded_goes_on_to_rest_by_braking(tmp_path):
    way = Recording(drive_in_room(tmp_path / "way.bag", 0.8), track=0.54).way
    robot, settings = SETTINGS.robot, SETTINGS.planner_settings()
    found = recorded_motion(way, 0.6, robot, settings)
    assert found.states[0][0] == pytest.approx(-2.0 + 0.8 * 0.4, abs=1e-6)
    assert robot.at_rest(found.states[-1])
    braked = found.states[-1][0] - found.states[found.brakes_from][0]
    # v^2 / 2a, and a step's worth of either side
    assert braked == pytest.approx(0.8**2 / (2 * robot.acceleration), abs=0.01)
    assert recorded_motion(way, way.times[-1], robot, settings) is None


def test_a_robot_that_could_not_have_followed_is_refused(tmp_path):
    path = drive_in_room(tmp_path / "fast.bag", 0.9, seconds=0.3)
    with pytest.raises(ValueError, match=r"up to 0\.90 m/s"):
        replayed(path, robot=DifferentialDrive(wheel_speed=0.5))


def test_the_command_replays_and_leaves_pictures_and_a_summary(tmp_path, capsys):
    path = drive_in_room(tmp_path / "drive.bag", 0.4, seconds=0.4)
    out = tmp_path / "out"
    few = [f"--set={v}" for v in ("particles=20", "iterations=10", "capacity=300")]
    options = ["--map", "/map", "--object-speed", "0.5", *few, "--no-video", "--out", str(out)]
    assert main(["replay", str(path), *options]) == 0
    told = json.loads((out / "summary.json").read_text())
    assert told["topics"] == ["/scan"]
    assert told["cycles"] == 5
    assert list((out / "snapshots").glob("*.png"))
    shown = capsys.readouterr()
    assert "a new plan" in shown.out
    assert "t    0.0 of" in shown.err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--seconds", "0"], "seconds"),
        (["--map", "/none"], "no map on /none"),
        (["--scan", "/front"], "no scans on /front"),
        (["--config", "{folder}/bad.yaml"], "scans"),
    ],
)
def test_bad_options_are_refused_by_name(tmp_path, capsys, options, said):
    path = drive_in_room(tmp_path / "drive.bag", 0.4, seconds=0.1)
    (tmp_path / "bad.yaml").write_text("scan: [a]\n")
    given = [option.format(folder=tmp_path) for option in options]
    assert main(["replay", str(path), *given]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.campaign
def test_a_recorded_rover_is_replayed(tmp_path):
    # a URG-04LX and wheel encoders; its README tells the columns
    source = Path(os.environ.get(DATA, REPOSITORY.parent / "shared" / "data"))
    source = source / "lidar_breezyslam" / "exp1.dat.gz"
    if not source.is_file():
        pytest.skip(f"no recording {source}; set {DATA} to the folder of the recorded data")
    with gzip.open(source, "rt") as lines:
        rows = [[float(v) for v in line.split()] for line, _ in zip(lines, range(12), strict=False)]
    way, turned = 0.077 * 2 * math.pi / 2000, 2 * 0.165  # metres a tick, metres between wheels
    with BagWriter(tmp_path / "rover.bag") as bag:
        x = y = theta = 0.0
        before = rows[0]
        for row in rows:
            left, right = (way * (row[c] - before[c]) for c in (2, 3))
            theta += (right - left) / turned
            x += 0.5 * (left + right) * math.cos(theta)
            y += 0.5 * (left + right) * math.sin(theta)
            before, when = row, 1.6e9 + 1e-6 * row[0]
            tree = odometry_message(Odometry(0, x, y, theta, 0, 0), when, "odom", "base", turned)
            bag.write("/odom", "nav_msgs/Odometry", tree, when)
            mm = np.array(row[24:706])
            ranges = np.where(mm >= 20, mm / 1000, np.where(mm == 0, np.inf, np.nan))
            step = math.radians(240) / 681
            scan = Scan(ranges, -math.radians(120), step, 4.0, pose=(0, 0, 0), stamp=0.0)
            bag.write("/scan", "sensor_msgs/LaserScan", laser_scan(scan, when, "laser"), when)
    found = replayed(
        tmp_path / "rover.bag", static_map="",
        robot=DifferentialDrive(discs=((0.0, 0.25),), wheel_speed=2.0),
        settings={**SETTINGS.settings, "blind_speed": 0.0, "clear_radius": 1.0},
    )  # fmt: skip
    told = found.summary()
    assert told["cycles"] >= 9
    assert told["faults"] == 0
