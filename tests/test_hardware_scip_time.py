"""A session and an emulated device in memory: what is promised of stamps, and every fault."""

import itertools
import random

import numpy as np
import pytest

from hardware import scip
from hardware.scip_clock import ClockJumped, DeviceClock
from hardware.scip_commands import Measure
from hardware.scip_device import Device
from hardware.scip_receiver import Counters
from hardware.scip_rotor import Nature
from hardware.scip_session import Session, Silent, Unfit
from hardware.scip_settings import ScipSettings
from hardware.scip_sweep import UST_10LX, Parameters, Sweep, encode_sweep
from hardware.scip_wire import Wire

HERE = "127.0.0.1"
SMALL = Parameters(
    model="small", nearest=20, farthest=30000, steps_per_turn=80, first=0, last=60, front=30,
    speed=2400,
)  # fmt: skip


class Counting:
    """A source whose k-th look has the distance 1000 + k mm everywhere; knows when each began."""

    def __init__(self, steps=SMALL.steps):
        self.began = []
        self._steps = steps

    def __call__(self, begin):
        self.began.append(begin)
        return np.full(self._steps, 999 + len(self.began))


def joined(*, now=50.0, source=None, delay=lambda: 0.0, pose_at=None, nature=None, **settings):
    """(wire, session, device) of a small device."""
    source = Counting() if source is None else source
    device = Device(source, now, Nature(parameters=SMALL) if nature is None else nature)
    session = Session(ScipSettings(host=HERE, **settings), now, pose_at=pose_at)
    return Wire(session, device, now, delay), session, device


def looks(scans):
    """Which look of `Counting` each scan shows."""
    return [round(scan.ranges[0] * 1000) - 1000 for scan in scans]


@pytest.mark.parametrize("rate", [1 - 1e-4, 1 + 1e-4])
@pytest.mark.parametrize("unevenness", [-0.005, 0.005])
@pytest.mark.parametrize("start", [0, scip.CLOCK_TURN - 3000])
def test_no_beam_is_older_than_promised_nor_newer_than_its_stamp(rate, unevenness, start):
    # the clock drifts, wraps and is read in milliseconds; the turning is uneven; the net dawdles
    draw = random.Random(f"{rate} {unevenness} {start}")
    source = Counting()
    nature = Nature(
        parameters=SMALL, clock_start=start, clock_rate=rate, unevenness=unevenness, tick=5e-3
    )
    wire, session, _ = joined(
        now=1e6, source=source, nature=nature, delay=lambda: draw.random() ** 8 * 0.01,
        clock_every=2.0,
    )  # fmt: skip
    scans = wire.run(5.0)
    assert len(scans) > 185
    turn = SMALL.period * (1 + unevenness) / rate
    for scan, look in zip(scans, looks(scans), strict=True):
        first = source.began[look]
        last = first + turn * SMALL.last / SMALL.steps_per_turn
        assert scan.stamp - 0.03 <= first
        assert last <= scan.stamp <= wire.now
    assert all(b.stamp > a.stamp for a, b in itertools.pairwise(scans))
    assert session.counters.missed == session.counters.unsure == 0


def test_a_scan_that_cannot_be_promised_its_stamp_is_not_handed_out():
    # half a second to answer: the two clocks can be compared to no better than that
    wire, session, _ = joined(delay=lambda: 0.2, answer_within=1.0, silent_after=1.0)
    assert wire.run(10.0) == []
    assert session.counters.unsure == session.counters.sweeps > 0


def test_clocks_that_drift_apart_are_compared_again_before_it_shows():
    wire, session, _ = joined(clock_every=5.0, drift=5e-4)
    scans = wire.run(20.0)
    assert session.counters.unsure == 0
    assert len(scans) > 0.95 * 20 * 40


def test_a_device_whose_clock_keeps_other_time_than_declared_is_found_out():
    wire, _, _ = joined(nature=Nature(parameters=SMALL, clock_rate=1.01))
    with pytest.raises(ClockJumped):
        wire.run(60.0)


@pytest.mark.parametrize("ahead", [-5000, -50, 50, 5000])
def test_a_clock_that_is_set_is_found_out(ahead):
    clock = DeviceClock(drift=1e-4)
    clock.exchanged(10_000, 5.0, 5.0004)
    clock.arrived(10_100, 0.0, 5.103)
    with pytest.raises(ClockJumped):
        clock.exchanged(10_200 + ahead, 5.2, 5.2004)


def test_readings_of_the_clock_are_unwrapped_through_many_turns():
    clock = DeviceClock(drift=0.0)
    step = scip.CLOCK_TURN // 2 - 1000
    told = [clock.turned(k * step % scip.CLOCK_TURN) for k in range(50)]
    assert told == [k * step for k in range(50)]


def test_the_pose_is_that_of_the_middle_of_the_sweep():
    source = Counting()
    wire, _, _ = joined(source=source, pose_at=lambda when: (when, 0.0, 0.0))
    scans = wire.run(1.0)
    for scan, look in zip(scans, looks(scans), strict=True):
        middle = source.began[look] + 0.5 * SMALL.after(SMALL.last)
        assert scan.pose[0] == pytest.approx(middle, abs=2e-3)


@pytest.mark.parametrize("streams", [True, False])
@pytest.mark.parametrize("intensities", [True, False])
def test_sweeps_come_by_stream_or_one_by_one_with_intensities_or_without(streams, intensities):
    wire, session, _ = joined(streams=streams, intensities=intensities)
    scans = wire.run(1.0)
    # one that is asked for when another has come misses every other turn
    assert len(scans) >= (38 if streams else 18)
    assert session.counters.scans == session.counters.sweeps == len(scans)
    assert session.counters.strays == 0


def test_beams_look_where_the_device_says():
    ranges = np.linspace(1.0, 2.0, 1081)
    wire, _, _ = joined(source=lambda _: ranges, nature=Nature(parameters=UST_10LX))
    scan = wire.run(0.2)[0]
    assert np.allclose(scan.ranges, ranges, atol=6e-4)
    assert np.degrees(scan.angle_min) == pytest.approx(-135.0)
    assert np.degrees(scan.angle_increment) == pytest.approx(0.25)
    wire, _, _ = joined(
        source=lambda _: ranges, nature=Nature(parameters=UST_10LX), start=540, end=899,
        upside_down=True,
    )  # fmt: skip
    scan = wire.run(0.2)[0]
    # steps 540 to 899 look from 0 to 89.75 degrees, seen from above from -89.75 to 0
    assert np.degrees(scan.angle_min) == pytest.approx(-89.75)
    assert np.allclose(scan.ranges, ranges[540:900][::-1], atol=6e-4)


def test_a_cluster_tells_its_least_distance_in_its_middle():
    told = np.arange(61) + 1000
    told[[4, 9, 10, 11]] = [900, 65533, 65533, 65533]
    wire, _, _ = joined(source=lambda _: told, cluster=3, start=3, end=11)
    scan = wire.run(0.2)[0]
    assert scan.ranges.tolist() == [0.9, 1.006, np.inf]
    assert scan.angle_min == pytest.approx(SMALL.angle(4))
    assert scan.angle_increment == pytest.approx(SMALL.angle(33))


def test_skipped_sweeps_are_not_missed_ones():
    wire, session, _ = joined(skip=3)
    assert len(wire.run(2.0)) in (19, 20)
    assert session.counters.missed == 0


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"end": 61}, "end"), ({"start": 30, "end": 30}, "start"), ({"cluster": 2}, "cluster"),
        ({"range_max": 31.0}, "range_max"),
    ],
)  # fmt: skip
def test_what_the_device_cannot_do_is_refused_by_name(settings, field):
    wire, _, _ = joined(**settings)
    with pytest.raises(Unfit, match=field) as refusal:
        wire.run(1.0)
    assert isinstance(refusal.value, ValueError)


@pytest.mark.parametrize(
    ("fault", "sweeps", "counted", "number"),
    [
        ("checksum", 3, "bad_sums", 3),
        ("drop", 3, "missed", 3),
        ("unstable", 2, "unstable", 2),
        ("freeze", 6, "frozen", 4),
        ("truncate", 1, "garbled", 1),
        ("stall", 5, "late", 3),
    ],
)
def test_what_goes_wrong_is_counted_and_handed_out_to_nobody(fault, sweeps, counted, number):
    wire, session, device = joined(frozen_after=3)
    before = wire.run(1.0)
    device.inject(fault, sweeps)
    after = wire.run(1.0)
    assert getattr(session.counters, counted) == number
    numbers = looks(before + after)
    # a frozen sweep shows what was seen before until it is found out
    assert numbers == sorted(numbers if fault == "freeze" else set(numbers))
    if fault == "stall":
        # late, but with the stamps of when they were measured
        assert numbers == list(range(len(numbers)))
        steps = np.diff([scan.stamp for scan in after])
        assert np.allclose(steps, 0.025, atol=1.1e-3)
    else:
        assert len(before + after) < session.counters.sweeps + number + 1
    assert len(after) >= 40 - sweeps - 2


def test_a_link_that_is_silent_or_garbled_is_given_up():
    wire, _, device = joined()
    wire.run(0.5)
    device.inject("drop", 1000)
    with pytest.raises(Silent):
        wire.run(0.3)
    wire, _, device = joined()
    wire.run(0.5)
    device.inject("checksum", 1000)
    with pytest.raises(scip.ScipError, match="5 replies in a row"):
        wire.run(0.3)


def test_a_device_that_repeats_one_sweep_gives_no_sign_of_life():
    wire, session, _ = joined()
    wire.run(0.5)
    # its clock began at 50 s, and this is half a second later
    frame = scip.encode_reply(encode_sweep(Measure("MD", 0, 60), Sweep(480, np.full(61, 1000))))
    came = []
    for k in range(10):
        came += session.receive(frame, 50.5 + 0.025 * k)
        session.check(50.5 + 0.025 * k)
    assert session.receive(frame, 50.76) == []
    with pytest.raises(Silent):
        session.check(50.76)
    assert len(came) == 1
    assert session.counters.repeated == 10


def test_a_device_that_was_left_in_the_middle_of_anything_is_opened_all_the_same():
    for left in (b"TM0\n", b"MD0000006001000\n", b"%SL\n", b"BM\nGD0000006001\n"):
        device = Device(Counting(), 0.0, Nature(parameters=SMALL))
        device.connect(0.0)
        device.receive(left, 0.0)
        wire = Wire(Session(ScipSettings(host=HERE), 0.0), device, 0.0)
        assert len(wire.run(1.0)) > 35


def test_the_counters_go_on_from_one_session_to_the_next():
    counters = Counters()
    for _ in range(2):
        device = Device(Counting(), 0.0, Nature(parameters=SMALL))
        session = Session(ScipSettings(host=HERE), 0.0, counters=counters)
        Wire(session, device, 0.0).run(0.5)
    assert counters.scans >= 36


def test_the_same_happens_every_time():
    def once():
        draw = random.Random(5)
        wire, _, device = joined(delay=lambda: draw.random() * 1e-3)
        wire.run(0.5)
        device.inject("checksum", 2)
        return [(scan.stamp, scan.ranges.tobytes()) for scan in wire.run(1.0)]

    assert once() == once()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("host", "lidar.local"), ("port", 0), ("range_max", 0.0), ("stamp_error", -1.0),
        ("cluster", 0), ("skip", 10), ("start", -1), ("drift", 0.5), ("retry_most", 0.01),
        ("garbled_most", 0), ("silent_after", float("nan")),
    ],
)  # fmt: skip
def test_settings_that_make_no_sense_are_refused_by_name(field, value):
    with pytest.raises(ValueError, match=field):
        ScipSettings(**({"host": HERE} | {field: value}))
