"""Sweeps of a sensor that moved: what they are taken to prove is what they saw."""

import math

import numpy as np
import pytest

from hardware.scip_client import ScipClient
from hardware.scip_settings import ScipSettings
from hardware.steady import OWN, SteadyClient, steadied
from passpmp_ti.scan import Scan

STEP = math.radians(0.25)
BEAMS = 1081
FIRST = -math.radians(135)
WALLS = np.array(
    [[0.7, 0.65, 0.9, 0.65], [0.9, 0.65, 0.9, 5.0], [0.7, 0.65, 0.7, 5.0], [0.9, -5.0, 0.9, -0.65],
     [-2.0, -1.2, 6.0, -1.2], [6.0, -3.0, 6.0, 3.0], [-0.4, 0.5, -0.3, 3.0]]
)  # fmt: skip
"""A passage with edges close by, a wall along the way, one ahead."""


def cast(place, bearings):
    """[n] true ranges from a place along bearings [m]."""
    ahead = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    a, b = WALLS[:, :2] - place, WALLS[:, 2:] - WALLS[:, :2]
    across = ahead[:, None, 0] * b[:, 1] - ahead[:, None, 1] * b[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / across
        share = (a[:, 0] * ahead[:, None, 1] - a[:, 1] * ahead[:, None, 0]) / across
    met = (along > 0) & (share >= 0) & (share <= 1)
    return np.where(met, along, np.inf).min(axis=1)


def swept(shift, turn, rng):
    """A scan at pose 0 of a sensor that was elsewhere: up to `shift`, turned by up to `turn`.

    Returns:
        The scan, and the pose of each beam [BEAMS, 3].
    """
    way = rng.uniform(-math.pi, math.pi)
    pace = np.linspace(-1.0, 1.0, BEAMS)
    poses = np.stack(
        [shift * pace * math.cos(way), shift * pace * math.sin(way), turn * pace], axis=1
    )
    bearings = FIRST + STEP * np.arange(BEAMS) + poses[:, 2]
    ranges = np.array(
        [cast(pose[:2], np.array([b]))[0] for pose, b in zip(poses, bearings, strict=True)]
    )
    return Scan(ranges, FIRST, STEP, 10.0, (0.0, 0.0, 0.0), 0.0), poses


def unproven(scan, poses, rng, count=4000):
    """How many of random places that a scan proves empty no beams of the sweep proved so: two that
    are beside a place, from where they looked, and both reach past it."""
    # lost beams are skipped: the wedge between those beside them is proven to the nearer one
    kept = np.flatnonzero(~scan.lost)
    wedge = rng.integers(0, len(kept) - 1, count)
    before, after = kept[wedge], kept[wedge + 1]
    nearer = np.minimum(np.minimum(scan.ranges[before], scan.ranges[after]), 8.0)
    # and no farther than an object is wide
    nearer = np.minimum(nearer, 0.4 / (STEP * (after - before)))
    distance = nearer * rng.uniform(0.02, 0.9999, count)
    index = before + rng.random(count) * (after - before)
    bearing = FIRST + STEP * index
    places = np.stack([np.cos(bearing), np.sin(bearing)], axis=1) * distance[:, None]
    wrong = 0
    true_bearings = FIRST + STEP * np.arange(BEAMS) + poses[:, 2]
    inner = np.abs(index - BEAMS / 2) < 450
    for place in places[distance > np.where(inner, 0.1, OWN)]:
        away = place - poses[:, :2]
        off = np.arctan2(away[:, 1], away[:, 0]) - true_bearings
        before = np.flatnonzero((off[:-1] >= 0) & (off[1:] <= 0))
        seen = TRUE[before] >= np.hypot(*away[before].T)
        beside = TRUE[before + 1] >= np.hypot(*away[before + 1].T)
        wrong += not (seen & beside).any()
    return wrong


TRUE = np.zeros(BEAMS)


@pytest.mark.parametrize(("shift", "turn"), [(0.015, 0.0), (0.0, 0.02), (0.012, 0.015)])
def test_nothing_is_proven_that_no_beam_saw(shift, turn):
    rng = np.random.default_rng(round(1e4 * (shift + turn)))
    scan, poses = swept(shift, turn, rng)
    TRUE[:] = scan.ranges
    assert unproven(steadied(scan, shift, turn), poses, rng) == 0
    # without it edges stand where they do not
    assert unproven(scan, poses, rng) > 0


def test_who_stands_still_loses_a_beam_beside_each_edge():
    ranges = np.full(BEAMS, 5.0)
    ranges[500:510] = 2.0
    told = steadied(Scan(ranges, FIRST, STEP, 10.0, (0.0, 0.0, 0.0), 0.0), 0.0, 0.0)
    assert np.flatnonzero(told.ranges == 2.0).tolist() == list(range(500, 510))
    assert np.flatnonzero(told.lost).tolist() == [0, 499, 510, BEAMS - 1]


def test_what_stands_is_not_seen_where_it_does_not_stand():
    # a turn spreads what a beam met over its neighbours: as returns, they would tell of somebody
    # where the scan before had proven that nobody is
    ranges = np.full(BEAMS, 5.0)
    ranges[500:510] = 2.0
    told = steadied(Scan(ranges, FIRST, STEP, 10.0, (0.0, 0.0, 0.0), 0.0), 0.0, 0.03)
    assert np.flatnonzero(told.ranges == 2.0).tolist() == list(range(500, 510))
    assert told.lost[480:500].sum() == told.lost[510:530].sum() == 8


def test_a_scan_of_a_whole_turn_has_no_ends_and_its_seam_is_as_any_other_place():
    n = 360
    ranges = np.full(n, 5.0)
    ranges[100:110] = 2.0
    for beams in (n, n + 1):  # the last may look where the first does
        told = []
        for off in (0, 255):  # the near ones in the middle, and across the seam
            rolled = np.roll(ranges, off)
            given = np.concatenate([rolled, rolled[: beams - n]])
            scan = Scan(given, 0.0, math.tau / n, 10.0, (0.0, 0.0, 0.0), 0.0)
            found = steadied(scan, 0.0, 0.03).ranges[:n]
            told.append(np.roll(found, -off))
        middle, seam = told
        lost = np.flatnonzero(middle == 0.0)
        # two beams of turn, one in between, and one more for the seam
        assert lost.tolist() == [*range(96, 100), *range(110, 114)]
        assert (seam <= middle).all()
        assert (seam[[90, 120]] == 5.0).all()


def test_a_lost_beam_is_lost_to_all_that_may_have_been_it():
    ranges = np.full(BEAMS, 5.0)
    ranges[500] = math.nan
    told = steadied(Scan(ranges, FIRST, STEP, 10.0, (0.0, 0.0, 0.0), 0.0), 0.0, 2 * STEP)
    assert np.flatnonzero(told.lost[10:-10]).tolist() == list(range(500 - 13, 500 - 6))


def test_what_lost_beams_side_by_side_may_have_looked_at_from_elsewhere_is_lost():
    ranges = np.full(BEAMS, 5.0)
    ranges[500:520] = math.nan
    told = steadied(Scan(ranges, FIRST, STEP, 10.0, (0.0, 0.0, 0.0), 0.0), 0.015, 0.0)
    # a place at the body's edge, seen from 15 mm aside, is off by as much
    away = math.ceil(math.asin(0.015 / OWN) / STEP)
    assert told.lost[500 - away : 520 + away].all()
    assert not told.lost[500 - away - 5]
    assert not told.lost[520 + away + 5]


def test_who_met_nothing_looked_no_farther_than_from_where_he_was():
    ranges = np.full(BEAMS, math.inf)
    told = steadied(Scan(ranges, FIRST, STEP, 10.0, (0.0, 0.0, 0.0), 0.0), 0.02, 0.0)
    assert told.range_max == pytest.approx(9.98)
    # what was met just within reach is met there still
    ranges[:] = 9.99
    told = steadied(Scan(ranges, FIRST, STEP, 10.0, (0.0, 0.0, 0.0), 0.0), 0.02, 0.0)
    assert told.returned[100:-100].all()


def test_a_range_gets_shorter_by_what_the_sensor_moved_and_none_longer():
    scan = Scan(np.full(BEAMS, 5.0), FIRST, STEP, 10.0, (0.0, 0.0, 0.0), 0.0)
    told = steadied(scan, 0.01, 0.0)
    assert told.ranges[20:-20] == pytest.approx(4.99)


def read_by(state, monkeypatch):
    """What a client tells of a wall 5 m away, whose robot is in such a state."""
    scan = Scan(np.full(BEAMS, 5.0), FIRST, STEP, 10.0, (0.0, 0.0, 0.0), 7.0)
    monkeypatch.setattr(ScipClient, "read", lambda self, timeout: scan)
    asked = []

    def state_at(when):
        asked.append(when)
        return state

    client = SteadyClient(
        ScipSettings(host="127.0.0.1"), state_at=state_at, pose_at=lambda when: (0.0, 0.0, 0.0),
        track=0.54, arm=0.3, heading_error=0.006,
    )  # fmt: skip
    told = client.read(0.0)
    # of the moment that no beam is more than half of the stamp's error away from
    assert asked == [7.0 - 0.5 * client.settings.stamp_error]
    return told


def test_the_faster_a_robot_goes_the_less_its_scans_prove(monkeypatch):
    stands, rolls, turns = (
        read_by(np.array([0.0, 0.0, 0.0, right, left]), monkeypatch)
        for right, left in ((0.0, 0.0), (1.0, 1.0), (0.3, -0.3))
    )
    # 15 ms at 1 m/s, a quarter and 5 cm/s more
    assert rolls.ranges[500] <= 5.0 - 0.015 * 1.3
    assert 4.99 < stands.ranges[500] < 5.0
    assert turns.lost.sum() > stands.lost.sum()


def test_a_heading_that_is_off_has_the_sensor_elsewhere_on_its_arm(monkeypatch):
    stands = read_by(np.zeros(5), monkeypatch)
    assert stands.ranges[500] <= 5.0 - 0.3 * 0.006


@pytest.mark.parametrize("speed", [1e3, 1e200, 1.7e308])
def test_wheels_as_fast_as_no_wheels_are_prove_nothing_and_break_nothing(speed, monkeypatch):
    assert read_by(np.array([0.0, 0.0, 0.0, speed, -speed]), monkeypatch).lost.all()
    assert read_by(np.array([0.0, 0.0, 0.0, speed, speed]), monkeypatch).lost.all()


def test_a_robot_of_whose_motion_nothing_is_known_has_seen_nothing(monkeypatch):
    assert read_by(None, monkeypatch).lost.all()


@pytest.mark.parametrize("bad", [-0.1, math.nan])
def test_a_bound_that_is_none_is_refused(bad):
    scan = Scan(np.full(BEAMS, 5.0), FIRST, STEP, 10.0, (0.0, 0.0, 0.0), 0.0)
    with pytest.raises(ValueError, match="shift"):
        steadied(scan, bad, 0.0)
    with pytest.raises(ValueError, match="turn"):
        steadied(scan, 0.0, bad)
