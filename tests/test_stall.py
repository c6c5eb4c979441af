"""A robot that stands short of its goal backs out, by what the guide adds about that place."""

import math

import numpy as np
import pytest
from oracle import exact

from passpmp_ti import DifferentialDrive, Settings
from passpmp_ti.certificate.writer import CertificateWriter
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.planner.guide import Guide
from passpmp_ti.planner.plan import roomiest
from passpmp_ti.planner.stall import REACH, SINK, Hill, Stall
from passpmp_ti.sim.episode import simulate
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.scenario import Scenario
from passpmp_verify.document import read
from passpmp_verify.reader import certificate_of
from passpmp_verify.verify import verify

ROBOT = DifferentialDrive(discs=((0.0, 0.25),), wheel_speed=1.0, acceleration=1.35, track=0.4)
PATIENCE = 2.0
SETTINGS = Settings.for_robot(
    ROBOT, object_speed=1.0, object_width=0.5, cell=0.1, time_step=0.02, capacity=400,
    optimizer="exhaustive", guide_movers=False, cruise_speed=1.0, patience=PATIENCE,
)  # fmt: skip
NEAR = ROBOT.radius
FAR = REACH * ROBOT.radius


def watching(**changes):
    return Stall(ROBOT, SETTINGS.changed(**changes))


def stand(stall, begin, end, place=(0.0, 0.0)):
    """What it says after standing from `begin` to `end` [s]."""
    hill = None
    for stamp in np.arange(round(10 * begin), round(10 * end) + 1) / 10:
        hill = stall.look(float(stamp), *place)
    return hill


def test_nothing_is_raised_before_patience_ends():
    stall = watching()
    assert stand(stall, 0.0, PATIENCE) is None
    assert stall.look(PATIENCE + 0.1, 0.0, 0.0) is not None


def test_the_longer_it_stands_the_higher_the_hill():
    stall = watching()
    first, second = stand(stall, 0.0, 3.0), stand(stall, 3.0, 4.0)
    assert first.place == second.place == (0.0, 0.0)
    assert first.reach == second.reach == FAR
    assert second.height == pytest.approx(2 * first.height)


def test_to_and_fro_is_standing_and_getting_on_is_not():
    shuffling, creeping = watching(), watching()
    for k in range(60):
        swayed = shuffling.look(0.1 * k, 0.9 * NEAR * math.sin(k), 0.0)
        crept = creeping.look(0.1 * k, 1.2 * NEAR * 0.1 * k / PATIENCE, 0.0)
    assert swayed is not None
    assert crept is None


def test_a_hill_that_was_left_sinks_until_it_is_gone():
    stall = watching()
    full = stand(stall, 0.0, 3.0)
    away = 2 * NEAR
    half = stall.look(3.0 + 0.5 * SINK * PATIENCE, away, 0.0)
    assert half.place == full.place
    assert half.height == pytest.approx(0.5 * full.height)
    assert stall.look(3.0 + SINK * PATIENCE, 2 * away, 0.0) is None


def test_where_it_stalls_again_the_hill_sinks_more_slowly():
    def left(first, second):
        """What is left of the second hill later than a first one lasts."""
        stall = watching()
        stand(stall, 0.0, 3.0, first)
        stall.look(3.1, *(np.array(first) + 2 * FAR))
        stand(stall, 10.0, 13.0, second)
        return stall.look(13.0 + 1.5 * SINK * PATIENCE, *(np.array(second) + 2 * FAR))

    assert left((0.0, 0.0), (5 * FAR, 0.0)) is None
    assert left((0.0, 0.0), (0.5 * NEAR, 0.0)) is not None


def test_what_is_forgotten_counts_from_the_start():
    stall = watching()
    stand(stall, 0.0, 3.0)
    stall.forget()
    assert stand(stall, 3.1, 3.0 + PATIENCE) is None


def test_without_an_end_to_its_patience_it_stands():
    assert stand(watching(patience=None), 0.0, 100.0) is None


def test_patience_is_checked():
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match=r"Settings\.patience"):
            SETTINGS.changed(patience=bad)


PLACES_ALONE = SETTINGS.changed(weight_turn=0.0)
"""A hill turns the way down, and so the time to turn towards it: not to be seen here."""


def costs(hill, states):
    """[n] cost to go in the open."""
    scan = exact.sweep(exact.world_of(), (0.0, 0.0, 0.0), 180, 2 * np.pi, 4.0, 0.0)
    model = FutureModel.from_scan(scan, ROBOT, PLACES_ALONE)
    goal = (3.0, 0.5)
    guide = Guide(ROBOT, PLACES_ALONE, (0.0, 0.0), [goal], model.window.anchor, 4.0, None)
    return guide.field(model, goal, np.zeros(2), hill).at(states)


def test_a_hill_is_a_cone_about_its_place_and_nothing_elsewhere():
    hill = Hill((0.5, -0.3), 1.0, 7.0)
    states = np.zeros((400, 5))
    states[:, :2] = np.random.default_rng(3).uniform(-1.0, 1.5, (400, 2))
    added = costs(hill, states) - costs(None, states)
    away = np.hypot(*(states[:, :2] - hill.place).T)
    cone = hill.height * np.maximum(1 - away / hill.reach, 0.0)
    # between the centres of cells a cone is not straight: at its top and at its foot
    assert np.abs(added - cone).max() < hill.height / hill.reach * SETTINGS.cell
    assert not added[away > hill.reach + 1.5 * SETTINGS.cell].any()
    assert added[away < 0.2].min() > 5.0


# in a drive -------------------------------------------------------------------------------------

CORNERS = 2 * np.pi * np.arange(24) / 24
PILLAR = np.array([24.97, 6.95]) + 0.98 * np.stack([np.cos(CORNERS), np.sin(CORNERS)], axis=1)
"""Beside this one standing looks best, from where `driven` begins."""


def driven(patience, start=(23.777, 7.994, -1.145), seconds=22.0, labels="sensor", see=None):
    scenario = Scenario(
        name="pillar", robot=ROBOT, settings=SETTINGS.changed(patience=patience),
        lidars=(Lidar(range_max=10.0, beams=720, field_of_view=2 * np.pi, labels=labels),),
        bounds=(-2.0, -2.0, 32.0, 32.0), polygons=(PILLAR,), start=start, goals=((28.0, 2.0),),
        duration=seconds,
    )  # fmt: skip
    return simulate(scenario, seed=0, on_cycle=see)


def gone(episode):
    """[n] how far from its start [m]."""
    return np.hypot(*(episode.states[:, :2] - episode.states[0, :2]).T)


def test_a_robot_that_stalls_backs_out_and_arrives():
    for_good, patient = driven(None), driven(PATIENCE)
    assert not for_good.summary()["reached_goal"]
    assert gone(for_good).max() < NEAR
    assert patient.summary()["reached_goal"]
    assert patient.summary()["collisions_moving"] == 0


LOCKED = (23.747, 8.020, -1.145)
"""Half a metre beside the pillar, where that may begin to move: it would be here within 0.2 s."""


def test_a_robot_that_no_primitive_frees_leaves_by_shorter_motions(tmp_path):
    shorter, writer = [], CertificateWriter(tmp_path)

    def see(info):
        file = writer.see(info.scans, info.state, info.navigator)
        held = info.navigator.record.chosen
        if info.navigator.record.decision == "new" and held.duration <= SETTINGS.cycle + 1e-9:
            shorter.append(file)

    for_good = driven(None, LOCKED, 3.0, "none")
    patient = driven(PATIENCE, LOCKED, 12.0, "none", see)
    assert gone(for_good).max() == 0.0
    assert len(shorter) > 3
    # who knows nothing of planners finds each of them safe
    for file in shorter[:6]:
        assert verify(certificate_of(read(file))).safe
    assert gone(patient).max() > NEAR
    assert patient.summary()["collisions_moving"] == 0


def test_what_is_shorter_leads_to_where_more_time_is_left_and_is_free():
    kept = []
    driven(None, LOCKED, 0.5, "none", lambda info: kept.append((info.navigator.record, info.state)))
    record, state = kept[-1]
    assert record.tree.stays
    model, start = record.model, record.stamp + SETTINGS.cycle
    way = roomiest(model, state, start)
    assert not model.touched(way.states, way.times).any()
    before, after = model.room(np.stack([state, way.states[-1]]))
    assert after > before
    assert 0.0 < before < 0.5
    # where there is nothing to gain there is no motion
    open_ = FutureModel.from_scan(
        exact.sweep(exact.world_of(), (0.0, 0.0, 0.0), 180, 2 * np.pi, 4.0, 0.0), ROBOT,
        SETTINGS.changed(object_speed=0.0),
    )  # fmt: skip
    assert roomiest(open_, np.zeros(5), SETTINGS.cycle) is None
