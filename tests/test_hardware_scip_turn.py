"""A range finder on a robot that turns: each beam has the heading of its own time."""

import numpy as np
import pytest

from hardware.emulated_lidar import cast
from hardware.scip_device import Device
from hardware.scip_rotor import Nature
from hardware.scip_session import Session
from hardware.scip_settings import ScipSettings
from hardware.scip_sweep import UST_10LX
from hardware.scip_wire import Wire

WALLS = np.array([[-6, -4, 6, -4], [6, -4, 6, 4], [6, 4, -6, 4], [-6, 4, -6, -4]], dtype=float)
RATE = 2.0
"""[rad/s]."""
STEPS = np.arange(1081)


def scans_of(*, rate, upside_down=False, **settings):
    """Scans of a sensor that turns on the spot in a room, and is told its heading exactly."""

    def heading(time):
        return 0.4 + rate * time

    def source(begin):
        bearings = UST_10LX.angle(STEPS)
        bearings = -bearings if upside_down else bearings
        bearings = bearings + heading(begin + UST_10LX.after(STEPS))
        rays = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        return cast(np.zeros((1081, 2)), rays, WALLS, np.zeros((0, 3)))

    told = ScipSettings(host="127.0.0.1", upside_down=upside_down, **settings)
    session = Session(told, 0.0, pose_at=lambda time: (0.0, 0.0, heading(time)))
    return Wire(session, Device(source, 0.0, Nature()), 0.0).run(1.0)


def farthest_from_walls(scan):
    """[m]; the room is 12 m by 8 m."""
    x, y = np.abs(scan.points()).T
    return float(np.max(np.minimum(np.abs(x - 6.0), np.abs(y - 4.0))))


@pytest.mark.parametrize("rate", [RATE, -RATE])
@pytest.mark.parametrize("upside_down", [False, True])
def test_a_beam_has_the_heading_of_its_own_time(rate, upside_down):
    scans = scans_of(rate=rate, upside_down=upside_down, straighten=True)
    assert len(scans) > 20
    worst = max(map(farthest_from_walls, scans))
    # a millimetre of the device, and its clock's millisecond at 2 rad/s and 7 m
    assert worst < 0.02
    # with the heading of the sweep's middle the walls bend
    bent = max(map(farthest_from_walls, scans_of(rate=rate, upside_down=upside_down)))
    assert bent > 2.5 * worst


def test_who_stands_sees_the_same_either_way():
    straight, plain = (scans_of(rate=0.0, straighten=s) for s in (True, False))
    for one, other in zip(straight, plain, strict=True):
        assert one.angle_min == pytest.approx(other.angle_min, abs=1e-12)
        assert one.angle_increment == pytest.approx(other.angle_increment, abs=1e-15)
        assert (one.ranges == other.ranges).all()


def test_scans_of_a_sensor_that_is_said_to_spin_like_its_mirror_are_not_handed_out():
    for rate in (-400.0, 400.0, 100.0):
        assert scans_of(rate=rate, straighten=True) == []
    assert len(scans_of(rate=10.0, straighten=True)) > 20


def test_what_was_seen_from_nobody_knows_where_is_not_handed_out():
    known = {"from": 0.5}

    def pose_at(time):
        return (1.0, 2.0, 0.0) if time > known["from"] else (np.nan, np.nan, np.nan)

    session = Session(ScipSettings(host="127.0.0.1", straighten=True), 0.0, pose_at=pose_at)
    scans = Wire(session, Device(lambda begin: np.full(1081, 3.0), 0.0), 0.0).run(1.0)
    # of those that straddle it neither
    assert min(scan.stamp for scan in scans) > 0.5 + 0.018
    assert session.counters.unsure > 5
