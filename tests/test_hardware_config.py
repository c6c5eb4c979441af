"""A robot's file: what it may say, what it comes to, and a drive from it with emulated devices."""

import fcntl
import importlib
import math
import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hardware import doctor_robot, on_robot, stop_button
from hardware import driven as driven_
from hardware.base import Odometry
from hardware.base_kinds import KINDS
from hardware.button_device import DOWN, EVENT, KEY, pressed
from hardware.child import ended, started
from hardware.complaints import advice
from hardware.config import FIELD_OF_VIEW, MARGINS
from hardware.config_file import read_config
from hardware.doctor_finding import OK
from hardware.emulated_lidar import EmulatedLidar, Track
from hardware.emulated_process import EmulatedConfig
from hardware.executor import LATCH
from hardware.executor_process import ExecutorConfig, ExecutorProcess
from hardware.margins import APART, HALF_SWEEP, deceleration, executor_settings, with_margins
from hardware.merge import check_stamp_error
from hardware.scip_settings import ScipSettings
from hardware.scip_sweep import UST_10LX
from hardware.status import State
from passpmp_ti import DifferentialDrive, Settings
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.scenario import load_scenario

EXAMPLES = Path(__file__).parents[1] / "hardware" / "examples"
CHAIR = (EXAMPLES / "wheelchair.yaml").read_text()


def written(tmp_path, text):
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    return path


def changed(tmp_path, old, new, text=CHAIR):
    assert old in text
    return written(tmp_path, text.replace(old, new, 1))


# what it comes to ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.yaml")))
def test_every_example_is_whole(name):
    config = read_config(EXAMPLES / name)
    config.executor_settings.check_margins(config.planner_settings, scan_age=config.scan_age)
    scips = [lidar.scip or ScipSettings(host="127.0.0.1") for lidar in config.lidars]
    check_stamp_error(config.planner_settings, scips, config.apart)


def test_what_was_measured_comes_to_margins():
    config = read_config(EXAMPLES / "wheelchair.yaml")
    m, planner, executor = config.measured, config.planner_settings, config.executor_settings
    # v^2 / 2d: as if it had braked evenly from the order on
    assert config.limits.acceleration == pytest.approx(0.8**2 / 0.66)
    assert executor.bound == pytest.approx(1.5 * m.tracking_error)
    assert planner.tracking_error >= executor.bound + executor.reaction
    # wheels may change by twice what they brake while odometry is on its way
    # 10 ms to be measured, two of the executor's periods to be told, half of a sweep
    assert config.guess == pytest.approx(0.03)
    wheels = 0.5 * 2 * config.limits.acceleration * (config.guess + HALF_SWEEP) ** 2
    needed = m.localisation_error + wheels
    assert needed <= planner.localisation_error < needed + 0.01
    # each scan holds the heading's error itself
    assert config.heading_error == pytest.approx(m.heading_error + 2 * wheels / 0.54)
    assert planner.stamp_error == pytest.approx(0.03 + APART + m.rest_late)
    assert executor.follower.delay == pytest.approx(m.order_delay + 0.005)


def test_a_heading_that_is_off_swings_the_body():
    config = read_config(EXAMPLES / "wheelchair.yaml")
    long = replace(config.robot, discs=((-0.9, 0.4), (0.9, 0.4)))
    swung = replace(config, robot=long)
    needed = config.measured.localisation_error + 0.9 * swung.heading_error
    assert swung.planner_settings.localisation_error > needed


@pytest.mark.parametrize("field", ["discs", "wheel_speed", "acceleration", "track"])
def test_nothing_of_a_robots_body_and_wheels_is_taken_for_granted(field, tmp_path):
    head, robot = CHAIR.split("lidars:", 1)[0].splitlines(), CHAIR.split("lidars:", 1)[1]
    kept = "\n".join(one for one in head if not one.strip().startswith(f"{field}:"))
    with pytest.raises(ValueError, match=f"robot.{field} is missing"):
        read_config(written(tmp_path, f"{kept}\nlidars:{robot}"))


@pytest.mark.parametrize(
    ("field", "margin"),
    [
        ("tracking_error", "tracking_error"),
        ("localisation_error", "localisation_error"),
        ("rest_late", "stamp_error"),
    ],
)
def test_who_measures_worse_gets_more_margin(field, margin):
    config = read_config(EXAMPLES / "wheelchair.yaml")
    m = config.measured
    worse = replace(config, measured=replace(m, **{field: 2 * getattr(m, field)}))
    before, after = (getattr(c.planner_settings, margin) for c in (config, worse))
    assert after > before


def test_margins_are_rounded_to_more_and_never_to_less():
    robot, executor = DifferentialDrive(wheel_speed=1.0), executor_settings(0.2)
    for error in np.linspace(0.0, 0.05, 41):
        told = with_margins(
            Settings.for_robot(robot), executor, cycle=0.2, localisation_error=float(error),
            range_noise=0.04, scan_age=0.03,
        )  # fmt: skip
        assert told.localisation_error >= error - 1e-9
        assert told.localisation_error < error + 0.01
    with pytest.raises(ValueError, match="cycle"):
        with_margins(
            Settings.for_robot(robot), executor, cycle=0.02, localisation_error=0.0,
            range_noise=0.0, scan_age=0.03,
        )  # fmt: skip


def test_braking_counts_for_no_more_than_it_is():
    # 1.6 m/s^2 after 50 ms, with a lag of 50 ms: what is made of it is less
    for speed in (0.3, 0.8, 2.0):
        distance = speed * 0.1 + speed**2 / (2 * 1.6)
        assert deceleration(speed, distance) < 1.6


# what it may say -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("kind: socket", "kind: sockets", "did you mean 'socket'"),
        ("address: /run", "adress: /run", "did you mean 'address'"),
        ("address: /run", "address: run", "path from the root"),
        ("host: 192.168.0.10", "host: lidar.local", "address in numbers"),
        ("host: 192.168.0.10, ", "", "host is missing"),
        ("name: rear", "name: front", "its own"),
        ("braking_distance: 0.33", "braking_distance: -1", "braking_distance"),
        ("braking_distance: 0.33", "braking_distance: 0.4", "lower robot.acceleration"),
        ("  wheel_speed: 0.8", "  wheel_speed: 0.9", "nobody saw it brake"),
        ("  rest_late: 0.1", "  rest_lat: 0.1", "did you mean 'rest_late'"),
        ("runs_on: 0.35", "runs_on: 0.2", "runs on for 0.3 m"),
        ("  wheel_speed: 1.4", "  wheel_speed: 0.7", "below the robot's"),
        ("object_speed: 1.0", "object_speed: 10.0", "met by none"),
        ("object_speed: 1.0", "object_sped: 1.0", "object_speed is missing"),
        ("mode: conservative", "mode: bold", "mode"),
        ("mode: conservative", "stamp_error: 0.0", "not to be set"),
        ("goals: [[3.0, 0.0]]", "goals: []", "goals"),
        ("goals: [[3.0, 0.0]]", "goals: [[3.0]]", "config.goals"),
        ("goals: ", "goal: ", "goals is missing"),
        ("robot: ", "emulated: {scenario: corridor}\nrobot: ", "must be simulated"),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_line(old, new, told, tmp_path):
    path = changed(tmp_path, old, new)
    with pytest.raises(ValueError, match=r"robot\.yaml:\d+: ") as refused:
        read_config(path)
    assert told in str(refused.value)


def test_all_that_is_wrong_is_told_at_once(tmp_path):
    text = CHAIR.replace("cycle: 0.2", "cycle: -1").replace("track: 0.54", "track: x")
    with pytest.raises(ValueError, match="track") as refused:
        read_config(written(tmp_path, text.replace("runs_on: 0.35", "runs_on: 0")))
    assert "runs_on" in str(refused.value)


def test_a_robot_that_does_not_look_all_round_must_say_what_is_behind_it(tmp_path):
    rear = next(line for line in CHAIR.splitlines() if "name: rear" in line)
    path = changed(tmp_path, rear + "\n", "")
    with pytest.raises(ValueError, match="blind_speed is missing"):
        read_config(path)
    told = path.read_text().replace("mode: conservative", "blind_speed: 0.0\n  clear_radius: 0.8")
    assert read_config(written(tmp_path, told)).apart == 0.0
    # two that look nearly the same way leave a gap too
    narrow = changed(tmp_path, "3.141592653589793", "1.0")
    with pytest.raises(ValueError, match="blind_speed is missing"):
        read_config(narrow)
    assert math.pi < FIELD_OF_VIEW


def test_margins_are_no_fields_of_the_planner():
    assert set(MARGINS) <= set(Settings.__dataclass_fields__)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_of_base_names_what_makes_it(kind):
    module, name = KINDS[kind].build.split(":")
    imported = pytest.importorskip(module)
    assert callable(getattr(imported, name))


# devices ---------------------------------------------------------------------------------------


def test_an_emulated_range_finder_sees_what_a_simulated_one_does():
    world, _, start = load_scenario("corridor_person").build(0)
    track = Track()
    for stamp in (10.0, 20.0):
        track.note(Odometry(stamp, 6.0, 0.1, 0.3, 0.0, 0.0))
    mount = (0.3, 0.0, 0.2)
    begin = 12.0
    seen = EmulatedLidar(world, track, mount, np.random.default_rng(0), ahead=start, noise=0.0)(
        begin
    )
    middle = begin + UST_10LX.after(540)
    device = Lidar(range_max=30.0, beams=1081, field_of_view=math.radians(270), mount=mount)
    scan = device.scan(world, np.array([6.0, 0.1, 0.3]), middle + start)
    # beams that graze a corner or a disc may go either way
    apart = np.abs(seen - scan.ranges)
    assert np.median(apart) < 1e-5
    assert (apart > 1e-3).sum() <= 4


def test_nothing_is_seen_from_a_place_that_nobody_knows():
    world, _, start = load_scenario("corridor").build(0)
    see = EmulatedLidar(world, Track(), (0, 0, 0), np.random.default_rng(0), ahead=start, noise=0)
    assert np.isnan(see(1.0)).all()


def test_emulated_devices_are_told_all_in_one_text(tmp_path):
    told = EmulatedConfig(
        directory=tmp_path, scenario="corridor", mounts=((0.3, 0.0, 1.0),), seed=4
    )
    assert EmulatedConfig.from_json(told.to_json()) == told
    with pytest.raises(ValueError, match="configuration"):
        EmulatedConfig.from_json("{}")


def test_a_base_of_another_process_is_asked_where_it_stands(tmp_path):
    address = tmp_path / "own" / "base"
    example = EXAMPLES / "serve_base.py"
    process = subprocess.Popen(
        [sys.executable, str(example), str(address)],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(EXAMPLES.parents[1])},
    )
    try:
        assert process.stdout.readline() == f"serving {address}\n".encode()
        path = changed(tmp_path, "/run/passpmp-base/base", str(address))
        found = doctor_robot.base(read_config(path), served(path))
        assert found.level == OK, found
        assert str(address) in found.told
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(5.0)
    assert not address.exists()


def served(path):
    """What the executor would drive."""
    config = read_config(path)
    module, name = config.base.made_by.build.split(":")
    return getattr(importlib.import_module(module), name)(**config.base_options())


def test_each_trouble_of_a_range_finder_has_something_to_look_at():
    device = ScipSettings(host="192.0.2.7")
    assert "one host at a time" in advice(device, "Connection refused")
    assert "powered" in advice(device, "no connection within the time allowed")
    assert "192.168.0.15/24" in advice(device, "Network is unreachable")
    assert "scip_look" in advice(device, "?")


def test_a_key_that_goes_down_is_a_press_and_one_that_comes_up_is_none():
    down, up = EVENT.pack(0, 0, KEY, 30, DOWN), EVENT.pack(0, 0, KEY, 30, 0)
    assert pressed(up + down)
    assert not pressed(up)
    assert not pressed(EVENT.pack(0, 0, 0, 0, 0))
    # half an event says nothing, and is no reason to drive on
    assert pressed(up[:7])


def test_a_button_on_a_device_stops_the_robot(tmp_path):
    device = tmp_path / "events"
    os.mkfifo(device)
    directory = tmp_path / "x"
    config = ExecutorConfig(directory=directory, base="hardware.simulated_base:build")
    with ExecutorProcess(config):
        # somebody has to hold the other end, or there is no device
        hand = os.open(device, os.O_RDWR)
        told = f'{{"directory": "{directory}", "device": "{device}"}}'
        process, ready = started("hardware.button_device", told, 20.0)
        assert ready == b"ready\n"
        assert not (directory / LATCH).exists()
        os.write(hand, EVENT.pack(0, 0, KEY, 30, DOWN))
        while not (directory / LATCH).exists():
            assert process.poll() is None
        ended(process, 5.0)
        os.close(hand)


def test_a_button_outlives_the_planner_while_the_executor_carries_on(tmp_path):
    device = tmp_path / "events"
    os.mkfifo(device)
    hand = os.open(device, os.O_RDWR)
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    carries_on = os.open(tmp_path, os.O_RDONLY)
    fcntl.flock(carries_on, fcntl.LOCK_EX)
    process = subprocess.Popen(
        [sys.executable, "-m", "hardware.button_device",
         f'{{"directory": "{tmp_path}", "device": "{device}"}}', str(gone.pid)],
        stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(EXAMPLES.parents[1])},
    )  # fmt: skip
    assert process.stdout.readline() == b"ready\n"
    os.write(hand, EVENT.pack(0, 0, KEY, 30, DOWN))
    # nobody answers: the next executor is to know of it all the same
    while not (tmp_path / LATCH).exists():
        assert process.poll() is None
        time.sleep(0.01)
    os.close(carries_on)
    assert process.wait(20.0) == 0
    os.close(hand)


def test_a_button_that_no_executor_hears_tells_the_next_one(tmp_path, monkeypatch):
    monkeypatch.setattr(stop_button, "PATIENCE", 0.1)
    with stop_button.StopButton(tmp_path) as button:
        assert not button.press()
        assert (tmp_path / LATCH).exists()
        # one that works and does not answer may move still
        works = os.open(tmp_path, os.O_RDONLY)
        fcntl.flock(works, fcntl.LOCK_EX)
        assert not button.release()
        assert (tmp_path / LATCH).exists()
        os.close(works)
        assert button.release()
        assert not (tmp_path / LATCH).exists()


def test_a_button_of_no_folder_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["stop_button", str(tmp_path / "none")])
    assert stop_button.main() == 2
    assert "no such folder" in capsys.readouterr().err


# a drive ---------------------------------------------------------------------------------------


def emulated(tmp_path):
    config = read_config(EXAMPLES / "emulated.yaml")
    small = config.planner.changed(capacity=300, particles=20, iterations=20, primitives=(0.4,))
    return replace(config, directory=tmp_path / "x", planner=small)


def drive(config, presses):
    """A drive that somebody interrupts once it moves; the executor's status, and what was seen."""
    seen = []

    def see(look):
        moved = any(one.speed > 0.05 for one in seen)
        seen.append(look)
        for _ in range(presses if look.speed > 0.05 and not moved else 0):
            os.kill(os.getpid(), signal.SIGINT)

    with on_robot.RobotDrive(config) as robot:
        driven = robot.run(60.0, see)
        robot.link.poll(timeout=1.0)
        return driven, robot.link.status, seen


def test_ctrl_c_brings_the_robot_to_rest(tmp_path, monkeypatch):
    monkeypatch.setattr(on_robot, "TELL", 0.4)
    driven, status, seen = drive(emulated(tmp_path), presses=1)
    assert seen[-1].silent == ()
    assert driven.interrupted
    assert not driven.reached
    assert driven.sent > 0
    assert status.state is State.RESTING
    assert status.worst_error < 0.05
    assert "interrupted" in driven_.report(driven.summary())
    assert driven_.line(seen[0]).startswith("t ")


@pytest.mark.campaign
def test_a_second_ctrl_c_presses_the_emergency_stop(tmp_path):
    config = emulated(tmp_path)
    driven, status, _ = drive(config, presses=2)
    assert driven.interrupted
    assert status.state is State.EMERGENCY
    assert (config.directory / LATCH).exists()
    assert "--reset" in driven.why


@pytest.mark.campaign
def test_a_button_that_is_pulled_out_stops_the_robot_and_ends_the_drive(tmp_path):
    device = tmp_path / "events"
    os.mkfifo(device)
    hand = [os.open(device, os.O_RDWR)]
    config = replace(emulated(tmp_path), button=device)

    def see(look):
        while hand:
            os.close(hand.pop())

    with on_robot.RobotDrive(config) as robot:
        driven = robot.run(60.0, see)
        robot.link.poll(timeout=1.0)
        assert robot.link.status.state is State.EMERGENCY
    assert "the stop button is gone" in driven.why
    assert not driven.reached


@pytest.mark.campaign
def test_the_example_gets_to_its_goal(tmp_path):
    config = replace(read_config(EXAMPLES / "emulated.yaml"), directory=tmp_path / "x")
    with on_robot.RobotDrive(config) as robot:
        driven = robot.run(60.0)
    assert driven.reached
    assert driven.worst_error < config.executor_settings.bound


def test_a_range_finder_that_does_not_answer_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(on_robot, "START", 0.4)
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        port = nobody.getsockname()[1]
        text = CHAIR.replace("host: 192.168.0.10,", f"host: 127.0.0.1, port: {port},", 1)
        text = text.replace("host: 192.168.0.11", f"host: 127.0.0.1, port: {port}")
        text = text.replace("kind: socket", "kind: simulated")
        text = text.replace("  address: /run/passpmp-base/base\n", "")
        config = read_config(written(tmp_path, text))
        coarse = config.planner.changed(cell=0.1, capacity=400, particles=20, iterations=20)
        config = replace(config, directory=tmp_path / "x", planner=coarse)
        with (
            pytest.raises(RuntimeError, match=f"'front' at 127.0.0.1:{port}.*one host at a time"),
            on_robot.RobotDrive(config),
        ):
            pass
