"""Scans of two range finders become scans of one instant."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.merge import Pairing, check_stamp_error, needed_stamp_error
from hardware.scip_settings import ScipSettings
from passpmp_ti import DifferentialDrive, Navigator, Scan, Settings

FRONT = Scan(np.full(271, np.inf), -np.radians(135), np.radians(1), 10.0, (0.3, 0.0, 0.0), 0.0)
REAR = replace(FRONT, pose=(-0.3, 0.0, np.pi))


def paired(fronts, rears, apart):
    """(pairs of the original stamps in ms, pairing), all arriving in the order of their stamps."""
    pairing = Pairing(2, apart=apart)
    arrivals = sorted([(t, 0) for t in fronts] + [(t, 1) for t in rears])
    pairs = []
    for t, stream in arrivals:
        # the range tells what the stamp was
        scan = replace((FRONT, REAR)[stream], ranges=np.full(271, 1 + t / 1000), stamp=t / 1000)
        pair = pairing.add(stream, scan)
        if pair is not None:
            assert {s.stamp for s in pair} == {t / 1000}
            pairs.append(tuple(round(1000 * (s.ranges[0] - 1)) for s in pair))
    return pairs, pairing


def test_each_scan_is_joined_with_the_one_that_was_measured_next_to_it():
    pairs, pairing = paired([0, 25, 50, 75], [20, 45, 70], apart=0.0125)
    assert pairs == [(25, 20), (50, 45), (75, 70)]
    assert pairing.alone == 1
    pairs, _ = paired([0, 25, 50], [5, 30, 55], apart=0.0125)
    assert pairs == [(0, 5), (25, 30), (50, 55)]


@pytest.mark.parametrize("phase", range(1, 25, 3))
def test_half_a_period_apart_is_enough_for_every_phase(phase):
    fronts = np.arange(0, 1000, 25)
    pairs, _ = paired(fronts, fronts + phase, apart=0.0125)
    assert len(pairs) >= 39
    assert all(abs(a - b) <= 12.5 for a, b in pairs)


def test_no_pair_is_farther_apart_than_promised_and_no_scan_is_used_twice():
    generator = np.random.default_rng(3)
    fronts = np.unique(generator.integers(0, 5000, 200))
    rears = np.unique(generator.integers(0, 5000, 150))
    pairs, pairing = paired(fronts, rears, apart=0.012)
    assert len(pairs) > 50
    assert all(abs(a - b) <= 12 for a, b in pairs)
    assert len({a for a, _ in pairs}) == len({b for _, b in pairs}) == len(pairs)
    assert pairing.alone <= len(fronts) + len(rears) - 2 * len(pairs)


def test_a_silent_range_finder_leaves_nothing_to_plan_with():
    pairs, pairing = paired([0, 25, 50, 75], [1], apart=0.0125)
    assert pairs == [(0, 1)]
    assert pairing.alone == 2


def test_the_planner_takes_what_was_joined():
    robot = DifferentialDrive()
    scanners = [ScipSettings(host="127.0.0.1"), ScipSettings(host="127.0.0.1", stamp_error=0.025)]
    needed = needed_stamp_error(scanners, apart=0.0125)
    assert needed == pytest.approx(0.0425)
    settings = Settings.for_robot(robot, object_speed=1.0, stamp_error=needed)
    check_stamp_error(settings, scanners, apart=0.0125)
    pairing = Pairing(2, apart=0.0125)
    assert pairing.add(1, replace(REAR, stamp=5.0)) is None
    scans = pairing.add(0, replace(FRONT, stamp=5.01))
    navigator = Navigator(robot, settings, goal=(5.0, 0.0))
    plan = navigator.update(scans, (0.0, 0.0, 0.0, 0.0, 0.0))
    assert not navigator.record.fault
    assert np.ptp(plan.states[:, 0]) > 0.1


@pytest.mark.parametrize(
    ("changes", "field"),
    [({"stamp_error": 0.04}, "stamp_error"), ({"object_speed": 12.0}, "object_speed")],
)
def test_settings_that_promise_more_than_the_range_finders_are_refused(changes, field):
    settings = Settings.for_robot(DifferentialDrive(), stamp_error=0.0425).changed(**changes)
    with pytest.raises(ValueError, match=f"Settings.{field}"):
        check_stamp_error(settings, [ScipSettings(host="127.0.0.1")], apart=0.0125)


def test_what_cannot_be_paired_is_refused_by_name():
    with pytest.raises(ValueError, match="apart"):
        Pairing(2, apart=-0.1)
    with pytest.raises(ValueError, match="stream"):
        Pairing(2, apart=0.01).add(2, FRONT)
