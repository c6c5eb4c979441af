"""What the doctor says of a machine and of a robot: each line, and what becomes of it."""

import fcntl
import json
import os
import socket
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hardware import doctor, doctor_machine, doctor_robot, doctor_speed
from hardware.base import Odometry
from hardware.config_file import read_config
from hardware.doctor_finding import FAIL, OK, WARN, Finding, graded
from hardware.executor_settings import ExecutorSettings
from hardware.scip_device import Device
from hardware.scip_emulator import Emulator
from hardware.scip_settings import ScipSettings
from passpmp_ti import DifferentialDrive, Settings, Trajectory, cli

EXAMPLES = Path(__file__).parents[1] / "hardware" / "examples"


@pytest.fixture
def chair(tmp_path):
    return replace(read_config(EXAMPLES / "wheelchair.yaml"), directory=tmp_path)


# lines -----------------------------------------------------------------------------------------


def test_a_line_says_how_it_is_and_what_to_do():
    assert Finding("map", OK, "10 x 8 m").line() == "ok    map                10 x 8 m"
    assert Finding("map", FAIL, "no", "draw one").line().endswith("no; draw one")


def test_a_number_is_judged_by_its_limits_and_a_good_one_has_no_remedy():
    levels = [graded("x", v, "", "less", warn=1.0, fail=2.0) for v in (0.5, 1.0, 1.5, 2.5)]
    assert [f.level for f in levels] == [OK, OK, WARN, FAIL]
    assert [f.remedy for f in levels] == ["", "", "less", "less"]


@pytest.mark.parametrize(("levels", "code"), [((OK, WARN), 0), ((OK, FAIL), 1)])
def test_only_what_does_not_work_fails(levels, code, monkeypatch, capsys):
    found = [Finding("x", level, "seen") for level in levels]
    monkeypatch.setattr(doctor, "findings", lambda config, quick: iter(found))
    assert cli.main(["doctor"]) == code
    assert capsys.readouterr().out.count("seen") == len(levels)
    assert cli.main(["doctor", "--json"]) == code
    assert [f["level"] for f in json.loads(capsys.readouterr().out)] == list(levels)


# the machine -----------------------------------------------------------------------------------


def test_the_machine_is_looked_at_without_a_robot(monkeypatch):
    monkeypatch.setattr(doctor_machine.probe, "has_driver", lambda name: False)
    found = {f.what: f for f in doctor.findings(None, quick=True)}
    assert found["sockets"].level == OK
    assert {f"extra {name}" for name in doctor_machine.EXTRAS} <= set(found)
    assert all(f.remedy for f in found.values() if f.level != OK)


def test_what_is_not_installed_comes_with_how_it_is_had(monkeypatch):
    monkeypatch.setitem(doctor_machine.EXTRAS, "twin", (("no_such_module",), "pip install it"))
    found = doctor_machine.extra("twin")
    assert (found.level, found.remedy) == (WARN, "pip install it")
    assert "no_such_module" in found.told


@pytest.mark.parametrize(("told", "level"), [("performance", OK), ("powersave", WARN), (None, OK)])
def test_a_governor_that_saves_power_is_told(told, level, tmp_path):
    for n in range(2 if told else 0):
        folder = tmp_path / f"cpu{n}" / "cpufreq"
        folder.mkdir(parents=True)
        (folder / "scaling_governor").write_text(told + "\n")
    assert doctor_machine.governor(tmp_path).level == level


def test_a_priority_that_is_refused_is_told_and_one_that_is_granted_is_given_back(monkeypatch):
    before = os.sched_getscheduler(0)
    doctor_machine.priority()
    assert os.sched_getscheduler(0) == before

    def refuse(*_):
        raise PermissionError("not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    found = doctor_machine.priority()
    assert found.level == WARN
    assert "rtprio" in found.remedy


@pytest.mark.parametrize(("trouble", "level"), [("", OK), ("it hangs", WARN)])
def test_a_driver_that_does_not_work_is_told(trouble, level, monkeypatch):
    monkeypatch.setattr(doctor_machine.probe, "has_driver", lambda name: True)
    monkeypatch.setattr(doctor_machine.probe, "trouble", lambda name, again: trouble)
    assert doctor_machine.gpu().level == level


def test_an_empty_kernel_cache_is_told(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert doctor_machine.cache().level == WARN
    (doctor_machine.kernel_cache.folder() / "x.tic").write_text("x")
    assert doctor_machine.cache().level == OK


# the robot -------------------------------------------------------------------------------------


def test_a_file_that_cannot_be_read_is_a_finding(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text("robot: 3\n")
    found = [f for f in doctor.findings(str(path), quick=True) if f.what == "file"]
    assert [f.level for f in found] == [FAIL]
    assert "robot must be a mapping" in found[0].told


def test_the_directory_of_the_sockets(monkeypatch, tmp_path):
    # folders of tests have long names
    monkeypatch.setattr(doctor_robot, "LONGEST_NAME", 150)
    assert doctor_robot.directory(tmp_path).level == OK
    assert "will be made" in doctor_robot.directory(tmp_path / "new").told
    assert doctor_robot.directory(tmp_path / ("x" * 120)).level == FAIL
    wide = tmp_path / "wide"
    wide.mkdir()
    wide.chmod(0o755)
    assert "chmod 700" in doctor_robot.directory(wide).told


def test_a_button_that_is_pressed_or_gone(chair, tmp_path):
    assert doctor_robot.button(chair).level == OK
    assert doctor_robot.button(replace(chair, button=tmp_path / "gone")).level == FAIL
    (tmp_path / "stopped").touch()
    found = doctor_robot.button(chair)
    assert found.level == FAIL
    assert "--reset" in found.remedy


def test_nothing_is_asked_while_somebody_drives(chair, tmp_path):
    driver = os.open(tmp_path, os.O_RDONLY)
    fcntl.flock(driver, fcntl.LOCK_EX)
    found = list(doctor_robot.robot(chair))
    os.close(driver)
    assert found[-1].what == "devices"
    assert "somebody drives" in found[-1].remedy
    assert not doctor_robot.busy(tmp_path)


def room(begin):
    return np.full(1081, 4.0) + 0.01 * np.sin(1000 * begin + np.arange(1081))


@pytest.mark.parametrize(
    ("fault", "level", "told"),
    [(None, OK, "UST-10LX"), ("drop", WARN, "fewer scans"), ("checksum", WARN, "cable")],
)
def test_a_range_finder_is_listened_to(fault, level, told, chair, monkeypatch):
    monkeypatch.setattr(doctor_robot, "LISTEN", 0.45)
    # a machine under load is no fault of the device's
    monkeypatch.setattr(doctor_robot, "SLOW", 0.75)
    made, swept = [], []

    def source(begin):
        swept.append(begin)
        # every second sweep of some, from the fifth on
        if fault and len(swept) % 2 and (fault == "drop" or 4 < len(swept) < 10):
            made[0].inject(fault, 1)
        return room(begin)

    def make(now):
        made.append(Device(source, now))
        return made[0]

    for _ in range(3):
        made.clear()
        swept.clear()
        with Emulator(make) as device:
            host, port = device.address
            found = doctor_robot.range_finder(chair.lidars[0], ScipSettings(host=host, port=port))
        if found.level == level and told in found.told + found.remedy:
            break  # where all cores are busy a sweep comes late at times, and it says so
    assert found.level == level, found
    assert told in found.told + found.remedy


def test_a_range_finder_that_is_not_there_fails_with_what_to_look_at(chair, monkeypatch):
    monkeypatch.setattr(doctor_robot, "LISTEN", 0.2)
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        settings = ScipSettings(host="127.0.0.1", port=nobody.getsockname()[1])
        found = doctor_robot.range_finder(chair.lidars[0], settings)
    assert found.level == FAIL
    assert "one host at a time" in found.remedy


class Standing:
    """A base that tells what it is given, every 10 ms."""

    def __init__(self, **wrong):
        self.wrong, self.closed, self.told = wrong, False, []

    def drive(self, right, left):
        self.told.append((right, left))

    def odometry(self):
        now = time.monotonic()
        here = Odometry(now - now % 0.01, 1.0, 2.0, 0.0, 0.0, 0.0)
        return None if "silent" in self.wrong else here._replace(**self.wrong)

    def close(self):
        self.closed = True


@pytest.mark.parametrize(
    ("wrong", "level", "told"),
    [
        ({}, OK, "stands at (1.00, 2.00) m"),
        ({"silent": True}, FAIL, "no odometry"),
        ({"x": np.nan}, FAIL, "numbers that are none"),
        ({"right": 0.3}, FAIL, "wheels turn"),
        ({"stamp": 1e9}, FAIL, "monotonic"),
        ({"stamp": 1.0}, FAIL, "monotonic"),
    ],
)
def test_a_base_is_told_to_stand_and_asked_where(wrong, level, told, chair, monkeypatch):
    monkeypatch.setattr(doctor_robot, "ASK", 0.1)
    standing = Standing(**wrong)
    found = doctor_robot.base(chair, standing)
    assert found.level == level, found
    assert told in found.told + found.remedy
    assert set(standing.told) == {(0.0, 0.0)}
    assert standing.closed


def test_a_base_that_cannot_be_made_is_a_finding(chair, tmp_path):
    address = str(tmp_path / "nobody" / "base")
    found = doctor_robot.driven(chair, chair.base.made_by.build, {"address": address})
    assert found.level == FAIL
    assert "serve_base.py" in found.told
    missing = doctor_robot.driven(chair, "no_such_module:build", {})
    assert (missing.level, missing.remedy) == (FAIL, "install what this kind of base needs")


# speed -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("late", "level"), [(1e-3, OK), (8e-3, WARN), (0.08, FAIL)])
def test_ticks_that_are_late_are_told(late, level):
    settings = ExecutorSettings()
    steps = np.full(200, settings.period)
    steps[::20] += late
    assert doctor_speed.jitter(steps, settings).level == level


def test_an_executor_that_did_not_tick_has_failed():
    assert doctor_speed.jitter(np.zeros(0), ExecutorSettings()).level == FAIL


class Planner:
    """Takes a cycle's time by a clock of its own, and stands."""

    now = 0.0

    def __init__(self, robot, settings, goal):
        self.settings = settings

    def update(self, scans, state):
        assert len(scans) == 2
        Planner.now += self.takes
        return Trajectory.resting(np.zeros(5), scans[0].stamp)


@pytest.mark.parametrize(("takes", "level"), [(0.02, OK), (0.07, WARN), (0.3, FAIL)])
def test_a_cycle_is_timed_against_what_it_has(takes, level, monkeypatch):
    Planner.takes = takes
    monkeypatch.setattr(doctor_speed, "Navigator", Planner)
    monkeypatch.setattr(doctor_speed, "rehearse", lambda *_: None)
    monkeypatch.setattr(doctor_speed.time, "perf_counter", lambda: Planner.now)
    robot = DifferentialDrive(wheel_speed=1.0)
    found = doctor_speed.planner(Settings.for_robot(robot, cycle=0.1), robot)
    assert found.level == level
    assert f"takes {1000 * takes:.0f} ms" in found.told
    assert "of 80 ms" in found.told


@pytest.mark.campaign
def test_all_is_well_with_emulated_devices(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    found = list(doctor.findings(str(EXAMPLES / "emulated.yaml")))
    assert {f.what for f in found} >= {"lidar front", "lidar rear", "base simulated", "executor"}
    assert [f for f in found if f.level == FAIL and f.what != "planner"] == []
