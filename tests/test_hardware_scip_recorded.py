"""Scans of real and of simulated range finders go through emulator and client unchanged."""

import gzip
import os
from pathlib import Path

import numpy as np
import pytest

from hardware.scip_device import Device
from hardware.scip_rotor import Nature
from hardware.scip_session import Session
from hardware.scip_settings import ScipSettings
from hardware.scip_sweep import URG_04LX, URG_CODES, UST_CODES, Parameters
from hardware.scip_wire import Wire
from passpmp_ti.sim.data_files import DATA, REPOSITORY
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.movers import PathMovers
from passpmp_ti.sim.world import World

RECORDED = Path(os.environ.get(DATA, REPOSITORY.parent / "shared" / "data"))
SCANS = 60


def lines_of(name):
    path = RECORDED / name
    if not path.is_file():
        pytest.skip(f"no recording {path}; set {DATA} to the folder of the recorded data")
    with gzip.open(path, "rt") as lines:
        return list(lines)


def through_the_wire(sweeps, nature, **settings):
    """What a client makes of these sweeps, one each turn."""
    left = iter(sweeps)
    last = sweeps[-1]
    device = Device(lambda _: next(left, last), 0.0, nature)
    session = Session(ScipSettings(host="127.0.0.1", codes=nature.codes, **settings), 0.0)
    scans = Wire(session, device, 0.0).run((len(sweeps) + 5) * nature.parameters.period)
    return [scan.ranges for scan in scans[: len(sweeps)]]


@pytest.mark.parametrize("log", ["intel", "acapulco", "csail"])
def test_scans_of_robots_in_buildings_arrive_to_the_millimetre(log):
    lines = lines_of(f"lidar_carmen/{log}-corrected.log.gz")
    fields = [line.split() for line in lines if line.startswith("FLASER")][:SCANS]
    seen = np.array([[float(r) for r in f[2 : 2 + int(f[1])]] for f in fields])
    beams = seen.shape[1]
    # half a degree or one, from -90 degrees on
    per_turn = 720 if beams > 200 else 360
    parameters = Parameters(
        model="recorded", nearest=1, farthest=60000, steps_per_turn=per_turn, first=0,
        last=beams - 1, front=per_turn // 4, speed=2400,
    )  # fmt: skip
    came = through_the_wire(
        list(seen), Nature(parameters=parameters, codes=UST_CODES), range_max=30.0
    )
    meant = np.where(seen < 30.0, seen, np.inf)
    assert np.isfinite(meant).mean() > 0.5
    assert np.allclose(came, meant, rtol=0, atol=0.5e-3 + 1e-9)


def test_scans_of_a_hokuyo_arrive_number_by_number():
    lines = lines_of("lidar_breezyslam/exp1.dat.gz")[:SCANS]
    seen = np.array([[int(n) for n in line.split()[24:706]] for line in lines])
    came = through_the_wire(
        list(seen), Nature(parameters=URG_04LX, codes=URG_CODES), range_max=4.0,
        stamp_error=0.1,
    )  # fmt: skip
    # 0 is how it tells that nothing came back; what else is below 20 mm tells nothing
    meant = np.where((seen >= 20) & (seen < 4000), seen / 1000.0, np.inf)
    meant[(seen > 0) & (seen < 20)] = np.nan
    assert np.isinf(meant).mean() > 0.3
    assert np.array_equal(came, meant, equal_nan=True)


def test_the_simulated_range_finder_is_seen_over_the_wire_as_it_is_without():
    # somebody walks by at 1 m/s while the device turns
    way = np.array([[0.0, 2.0, -2.0], [4.0, 2.0, 2.0]])
    world = World((-8.0, -8.0, 8.0, 8.0), movers=PathMovers([way], np.array([0.3])))
    lidar = Lidar(range_max=10.0, beams=1081, field_of_view=np.radians(270))
    shown = []

    def source(begin):
        shown.append(lidar.scan(world, np.zeros(3), begin))
        return shown[-1].ranges

    device = Device(source, 0.0)
    scans = Wire(Session(ScipSettings(host="127.0.0.1"), 0.0), device, 0.0).run(1.0)
    assert len(scans) > 35
    for came, seen in zip(scans, shown, strict=True):
        assert np.allclose(came.ranges, seen.ranges, rtol=0, atol=0.5e-3 + 1e-9)
        assert np.allclose(came.bearings, seen.bearings)
        assert came.range_max == seen.range_max
        # the last beam is measured three quarters of a turn later, and the stamp is no earlier
        assert 0.01875 <= came.stamp - seen.stamp < 0.03
