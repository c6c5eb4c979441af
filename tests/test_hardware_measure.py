"""What is made of a stop, on a base whose every number is known."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from hardware import measure
from hardware.base import BaseLimits
from hardware.config_file import read_config
from hardware.executor import LATCH
from hardware.simulated_base import BaseNature, SimulatedBase

EXAMPLES = Path(__file__).parents[1] / "hardware" / "examples"


def stop(*, speed=1.0, silent=False, lag=0.02, **nature):
    """A stop on a clock that only waiting moves; and the base."""
    now = [50.0]

    def sleep(seconds):
        now[0] += seconds

    limits = BaseLimits(acceleration=1.2, command_timeout=0.3)
    base = SimulatedBase(
        BaseNature(limits=limits, lag=lag, **nature),
        rng=np.random.default_rng(0),
        clock=lambda: now[0],
    )
    known, told = measure.drive_and_stop(
        base, speed, 1.0, silent=silent, clock=lambda: now[0], sleep=sleep
    )
    return measure.stopped(known, told), base


@pytest.mark.parametrize("speed", [0.4, 1.0, 1.5])
def test_a_stop_is_as_long_as_it_is(speed):
    found, base = stop(speed=speed)
    assert found.speed == pytest.approx(speed, rel=0.02)
    # even braking, and the way of an odometry's 10 ms
    assert found.distance == pytest.approx(speed**2 / 2.4 + 0.01 * speed, abs=0.02)
    assert found.took == pytest.approx(speed / 1.2, abs=0.15)
    assert 0.0 <= found.delay < 0.06
    # it never counts for more than it is
    assert found.deceleration < 1.2
    assert base.truth.right < 0.01


def test_silence_tells_the_bases_own_time_out():
    found, _ = stop(silent=True)
    assert found.delay == pytest.approx(0.3, abs=0.03)
    # from the last order on, not from when no other came: less would be put into the file
    assert found.delay >= 0.3
    assert found.distance == pytest.approx(0.3 + 1.0 / 2.4, abs=0.03)
    assert "command_timeout: 0.3" in measure.report(found, silent=True)


def test_noise_makes_little_of_a_difference():
    found, _ = stop(pose_noise=0.002, speed_noise=0.004)
    plain, _ = stop()
    assert found.distance == pytest.approx(plain.distance, abs=0.02)


def test_what_does_not_drive_is_no_measurement(monkeypatch):
    monkeypatch.setattr(SimulatedBase, "drive", lambda *_: None)
    with pytest.raises(ValueError, match="did not drive"):
        stop()
    monkeypatch.setattr(SimulatedBase, "odometry", lambda _: None)
    with pytest.raises(ValueError, match="no odometry"):
        stop()


def test_nothing_is_driven_before_odometry_comes_nor_long_after_it_ended(monkeypatch):
    orders, real = [], SimulatedBase.odometry
    drive = SimulatedBase.drive

    def told(base, right, left):
        orders.append((base._clock(), max(abs(right), abs(left))))
        drive(base, right, left)

    def heard(first, last):
        return lambda base: real(base) if first <= base._clock() <= last else None

    monkeypatch.setattr(SimulatedBase, "drive", told)
    monkeypatch.setattr(SimulatedBase, "odometry", heard(50.5, math.inf))
    stop()
    assert not any(wheel for when, wheel in orders if when < 50.5)
    orders.clear()
    monkeypatch.setattr(SimulatedBase, "odometry", heard(50.0, 50.6))
    with pytest.raises(ValueError, match="odometry ended"):
        stop()
    assert orders[-1][0] < 50.6 + measure.LOST + 0.05


def test_a_way_that_is_too_short_is_refused(monkeypatch, capsys):
    path = EXAMPLES / "emulated.yaml"
    needed = measure.way(read_config(path), 1.0)
    assert needed > 2 * (1.0 / 2.4 + 1.0)
    for options, told in (
        (["--clear", str(needed - 0.1)], "clear more"),
        (["--clear", "nan"], "clear more"),
        (["--clear", "9", "--speed", "1.6"], "base.wheel_speed"),
    ):
        monkeypatch.setattr(sys, "argv", ["measure", str(path), *options])
        assert measure.main() == 2
        assert told in capsys.readouterr().err


def test_nothing_is_driven_while_the_emergency_stop_is_pressed(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "passpmp").mkdir()
    (tmp_path / "passpmp" / LATCH).touch()
    told = [str(EXAMPLES / "emulated.yaml"), "--clear", "9"]
    monkeypatch.setattr(sys, "argv", ["measure", *told])
    monkeypatch.setattr(measure, "_measured", lambda *_, **__: pytest.fail("it drove"))
    assert measure.main() == 2
    assert "--reset" in capsys.readouterr().err


def test_its_report_is_lines_of_a_robots_file():
    found = measure.Stopped(speed=0.806, distance=0.3312, delay=0.0412, took=0.8)
    told = measure.report(found, silent=False)
    # down and up: less speed, more way
    assert "braking_speed: 0.8\n" in told
    assert "braking_distance: 0.34\n" in told
    assert math.isclose(found.deceleration, 0.806**2 / 0.6624)
