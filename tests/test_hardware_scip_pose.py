"""Scans of a range finder of which it is not known where it is."""

import numpy as np

from hardware.scip_device import Device
from hardware.scip_session import Session
from hardware.scip_settings import ScipSettings
from hardware.scip_wire import Wire

KNOWN_FROM = 0.5
"""[s]."""


def test_what_was_seen_from_nobody_knows_where_is_not_handed_out():
    def pose_at(time):
        return (1.0, 2.0, 0.0) if time > KNOWN_FROM else (np.nan, np.nan, np.nan)

    session = Session(ScipSettings(host="127.0.0.1"), 0.0, pose_at=pose_at)
    scans = Wire(session, Device(lambda begin: np.full(1081, 3.0), 0.0), 0.0).run(1.0)
    # a pose is that of a sweep's middle
    assert min(scan.stamp for scan in scans) > KNOWN_FROM + 0.009
    assert all(scan.pose == (1.0, 2.0, 0.0) for scan in scans)
    assert session.counters.unsure > 5
