"""The executor as a process: what it carries, how it starts and ends, and real faults.

Bounds are on the monotonic stamps of the base and of the executor itself. Where the machine stood
still, that long is allowed on top. Long form: pytest -m campaign.
"""

import fcntl
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hardware.executor_faults import try_once
from hardware.executor_kinds import kinds
from hardware.executor_process import ExecutorConfig, ExecutorProcess
from hardware.executor_rig import Rig
from hardware.executor_settings import ExecutorSettings
from hardware.stop_button import StopButton
from passpmp_ti.robots import DifferentialDrive, cover_rectangle

HOME = str(Path(__file__).parents[1])
PATIENT = ExecutorSettings(
    feedback_timeout=0.5, planner_timeout=1.0, sensor_timeout=1.0, rest_late=0.3
)
"""For machines on which nobody has a priority."""


def config(directory, **changes):
    return ExecutorConfig(directory=directory, base="hardware.simulated_base:build", **changes)


def test_its_process_holds_neither_taichi_nor_anything_else_that_is_large():
    program = (
        "import sys, hardware.executor_process, hardware.base_link, hardware.simulated_base\n"
        "print([m for m in ('taichi', 'scipy', 'cv2', 'yaml', 'filterpy') if m in sys.modules])"
    )
    told = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONPATH": HOME},
    )  # fmt: skip
    assert told.stdout.strip() == "[]"


def test_it_is_told_all_in_one_text(tmp_path):
    robot = DifferentialDrive(discs=cover_rectangle(0.8, 0.3, 0.6, 2), wheel_speed=1.0)
    told = config(
        tmp_path, robot=robot, settings=PATIENT, base_options={"seed": 3}, log=tmp_path / "log"
    )
    assert ExecutorConfig.from_json(told.to_json()) == told


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"base": "hardware.simulated_base"}, "module:function"),
        ({"priority": 100}, "priority"),
        ({"robot": None}, "configuration"),
        ({"colour": 1}, "colour"),
    ],
)
def test_a_configuration_that_makes_no_sense_is_refused(change, named, tmp_path):
    told = {**json.loads(config(tmp_path).to_json()), **change}
    with pytest.raises(ValueError, match=named):
        ExecutorConfig.from_json(json.dumps(told))


def test_a_base_that_nobody_makes_is_named(tmp_path):
    with pytest.raises(ValueError, match="no_such"):
        config(tmp_path).__class__(directory=tmp_path, base="no_such:thing").build_base()


def test_a_base_that_is_too_weak_ends_the_process_with_a_reason(tmp_path):
    weak = config(tmp_path / "x", base_options={"limits": {"acceleration": 0.5}})
    with pytest.raises(RuntimeError, match="acceleration"):
        ExecutorProcess(weak)


def test_the_button_has_its_own_way_and_the_sockets_are_for_this_user_only(tmp_path):
    directory = tmp_path / "x"
    with ExecutorProcess(config(directory, base_options={"seed": 1})) as process:
        assert directory.stat().st_mode & 0o777 == 0o700
        with StopButton(directory) as button:
            assert button.press()
            assert button.release()
        assert process.alive
        process.close()
        assert process.process.returncode == 0
        assert list(directory.glob("executor")) == []


def test_a_second_executor_waits_for_the_first_and_is_refused_while_it_stays(tmp_path):
    first = os.open(tmp_path, os.O_RDONLY)
    fcntl.flock(first, fcntl.LOCK_EX)
    with pytest.raises(RuntimeError, match="another executor"):
        ExecutorProcess(config(tmp_path))
    os.close(first)
    with ExecutorProcess(config(tmp_path, log=tmp_path / "log")) as process:
        assert process.alive


def test_a_moving_robot_comes_to_rest_when_something_fails_or_it_is_asked_to_end():
    rng = np.random.default_rng(0)
    with Rig(rng, settings=PATIENT) as rig:
        by_name = {kind.name: kind for kind in kinds(rig)}
        for name in ("planner killed", "feedback nan"):
            run = try_once(rig, by_name[name], rng)
            assert run.failure == "", run
        assert rig.wait(lambda: rig.fastest > 0.3, 30.0)
        rig.executor.process.send_signal(signal.SIGTERM)
        rig.executor.process.wait(20.0)
        last = rig.ticks()[-1]
        assert (last.right, last.left) == (0.0, 0.0)
        assert last.time >= last.rests_from - PATIENT.period
        assert rig.wait(lambda: rig.fastest < 0.02, 2.0)


@pytest.mark.campaign
def test_every_fault_twice():
    # a process of its own, since it takes a priority where the system grants one
    told = subprocess.run(
        [sys.executable, "-m", "hardware.executor_faults", "--runs", "2"],
        capture_output=True, text=True, env={**os.environ, "PYTHONPATH": HOME},
    )  # fmt: skip
    assert told.returncode == 0, told.stdout + told.stderr
