"""The safety modes beside each other: what each refuses, and where they must agree."""

from __future__ import annotations

import builtins
import sys

import numpy as np
import pytest

import passpmp_ti as pti
import passpmp_ti.grid.model as model_module
from passpmp_ti import backend, device
from passpmp_ti.grid import tubes
from passpmp_ti.grid.reused import Reused
from passpmp_ti.grid.view import labels_of, views_of
from passpmp_ti.kernels import beams
from passpmp_ti.kernels.arrival import NEVER
from passpmp_ti.planner import plan as plan_module
from passpmp_ti.sim.episode import simulate

ROBOT = pti.DifferentialDrive()


def settings_of(mode, **changes):
    return pti.Settings.for_robot(ROBOT, mode=mode, cell=0.1, **changes)


def scan_at(stamp=0.0, person=None):
    """A room of 8 x 8 m about the origin with a pillar, and perhaps somebody in it."""
    beams = 720
    angle = 2 * np.pi * np.arange(beams) / beams - np.pi
    c, s = np.cos(angle), np.sin(angle)
    ranges = 4.0 / np.maximum(np.abs(c), np.abs(s))
    label = np.zeros(beams, dtype=bool)
    for (x, y), radius, moves in [((2.0, 1.5), 0.3, False)] + (
        [(person, 0.25, True)] if person else []
    ):
        along, across = x * c + y * s, x * s - y * c
        met = (along > 0) & (np.abs(across) < radius)
        hit = np.where(met, along - np.sqrt(np.maximum(radius**2 - across**2, 0)), np.inf)
        label[hit < ranges] = moves
        ranges = np.minimum(ranges, hit)
    return pti.Scan(
        ranges, -np.pi, 2 * np.pi / beams, 10.0, pose=(0.0, 0.0, 0.0), stamp=stamp, moving=label
    )


def model_of(settings, scan, previous=None):
    return pti.FutureModel.from_scan(scan, ROBOT, settings, previous)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"confidence": 1.0}, "confidence is a chance, above 0 and below 1; got 1"),
        ({"confidence": 0.0}, "confidence is a chance"),
        ({"allowed_risk": 0.0}, 'take mode="conservative"'),
        ({"allowed_risk": 1.5}, "allowed_risk is a chance, above 0 and below 1; got 1.5"),
        ({"allowed_risk_rate": 0.0}, "allowed_risk_rate must be finite and > 0"),
        ({"emergence": -0.1}, "emergence must be finite and >= 0"),
        ({"emergence": 1.1}, "and <= 1"),
        ({"hidden_speeds": ()}, "hidden_speeds is empty"),
        ({"hidden_speeds": (0.5, 1.5)}, r"hidden_speeds\[1\] must be"),
        ({"hidden_speeds": 0.5}, "hidden_speeds must be shares"),
        ({"risk": "papr"}, "did you mean 'paper'"),
        ({"mode": "probablistic"}, "did you mean 'probabilistic'"),
        ({"mode": "hybrid", "object_speed": 0.0}, "needs tracks"),
        ({"mode": "probabilistic", "object_speed": 0.0}, 'take mode="conservative"'),
    ],
)
def test_chances_that_make_no_sense_are_refused_at_the_door(changes, told):
    with pytest.raises(ValueError, match=told):
        pti.Settings.for_robot(ROBOT, **changes)


def test_a_mode_that_needs_tracks_says_what_is_missing(monkeypatch):
    real = builtins.__import__

    def without(name, *rest, **more):
        if name.split(".")[0] == "filterpy":
            raise ModuleNotFoundError("No module named 'filterpy'", name="filterpy")
        return real(name, *rest, **more)

    for name in [n for n in sys.modules if n.startswith(("filterpy", "passpmp_ti.tracking"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ValueError, match="filterpy is not installed: pip install filterpy"):
        model_of(settings_of("hybrid"), scan_at())


def test_chances_are_asked_of_a_model_that_has_them():
    model = model_of(settings_of("conservative"), scan_at())
    with pytest.raises(ValueError, match='make it with mode="probabilistic"'):
        model.collision_probability(np.zeros((1, 5)), np.zeros(1))


def test_memory_without_the_movers_that_were_tracked_is_refused():
    before = model_of(settings_of("probabilistic"), scan_at(person=(-2.0, 0.0)))
    with pytest.raises(ValueError, match="start without memory"):
        model_of(settings_of("conservative"), scan_at(0.1, person=(-2.0, 0.0)), before)
    again = model_of(settings_of("hybrid"), scan_at(0.1, person=(-2.0, 0.0)), before)
    assert list(again.tracks.ids) == list(before.tracks.ids)
    # hybrid mode remembers for the strict one as well, and no better than that one does
    after = model_of(settings_of("conservative"), scan_at(0.2, person=(-2.0, 0.0)), again)
    alone = [settings_of("conservative"), None]
    for k in (1, 2):
        alone[1] = model_of(alone[0], scan_at(0.1 * k, person=(-2.0, 0.0)), alone[1])
    assert (after.ticks == alone[1].ticks).all()


@pytest.mark.parametrize("stamp", [0.0, 7.0004])
def test_certain_movers_at_the_bound_are_the_conservative_grid_cell_by_cell(stamp):
    certain = settings_of("probabilistic", emergence=1.0, hidden_speeds=(1.0,))
    strict = model_of(settings_of("conservative"), scan_at(stamp))
    model = model_of(certain, scan_at(stamp))
    assert not len(model.tracks)
    for index in (0, 1, 3, 8, 20):
        layer = model.layer(index)
        assert set(np.unique(layer)) <= {0.0, 1.0}
        expected = strict.layer(index)
        assert expected.any()
        assert not expected.all()
        assert (layer.astype(bool) == expected).all()


def test_each_mode_gives_away_less_room_than_the_one_before():
    """Somebody walks through the room: where he is heading is lost in every mode."""
    models = {}
    for mode in ("conservative", "hybrid", "probabilistic"):
        model = None
        settings = settings_of(mode, object_radius=0.2)
        for k in range(12):
            scan = scan_at(0.1 * k, person=(-3.0 + 0.1 * k, -1.0))
            model = model_of(settings, scan, model)
        models[mode] = model
    states = np.zeros((400, 5))
    generator = np.random.default_rng(3)
    states[:, :2] = generator.uniform(-3.2, 3.2, (400, 2))
    states[:, 2] = generator.uniform(-np.pi, np.pi, 400)
    states[:, 3:] = generator.uniform(0.2, 1.0, (400, 1))
    times = np.full(400, models["hybrid"].stamp + 0.1)
    safe = {mode: model.passively_safe(states, times) for mode, model in models.items()}
    assert safe["conservative"].sum() > 20
    assert (safe["hybrid"] >= safe["conservative"]).all()
    hybrid = models["hybrid"]
    assert (hybrid.ticks >= hybrid.strict_ticks).all()
    assert (hybrid.ticks > hybrid.strict_ticks).any()
    assert safe["probabilistic"].sum() > safe["hybrid"].sum()
    risk = models["probabilistic"].collision_probability(states, times)
    assert ((risk >= 0) & (risk <= 1)).all()
    at = np.zeros((2, 5))
    at[:, :2] = [(-1.2, -1.0), (2.5, -3.0)]
    at[:, 2] = np.pi
    at[:, 3:] = 0.6
    into, away = models["probabilistic"].collision_probability(at, times[:2])
    assert into > 0.5
    assert away < 0.2


def test_in_the_printed_form_many_factors_make_every_risk_vanish():
    """Eqs. 10 and 12 multiply chances below one: the product of a whole braking is next to nothing
    even on the way into somebody."""
    model = printed = None
    for k in range(8):
        scan = scan_at(0.1 * k, person=(-3.0 + 0.1 * k, -1.0))
        model = model_of(settings_of("probabilistic"), scan, model)
        printed = model_of(settings_of("probabilistic", risk="paper"), scan, printed)
    state = np.zeros((1, 5))
    state[0, :3] = -0.6, -1.0, np.pi
    state[0, 3:] = 1.2
    times = np.array([model.stamp + 0.1])

    assert model.collision_probability(state, times)[0] > 0.5
    assert printed.collision_probability(state, times)[0] < 1e-3


@pytest.mark.parametrize("mode", ["hybrid", "probabilistic"])
def test_a_drive_in_each_mode_is_the_same_to_the_last_bit(mode):
    """And is cut to a few seconds: who drives farther is compared elsewhere."""
    scenario = pti.load_scenario("corridor_person").changed({"capacity": 40})
    drives = []
    for _ in range(2):
        cycles = []

        def see(info, cycles=cycles):
            cycles.append(info.navigator.record.risk)
            if len(cycles) > 12:
                raise KeyboardInterrupt

        episode = simulate(scenario, mode=mode, seed=2, on_cycle=see)
        drives.append((episode.states.tobytes(), tuple(cycles)))
        assert not episode.summary()["collisions_moving"]
        assert not any(r.fault for r in episode.records)
    assert drives[0] == drives[1]
    promised = drives[0][1]
    assert all(0.0 <= risk < 1.0 for risk in promised)


@pytest.mark.parametrize("mode", ["hybrid", "probabilistic"])
def test_arrays_apart_from_the_host_drive_the_same(mode):
    """As on a GPU; in the first cycles nobody is tracked, and a device has no empty arrays."""

    def drive():
        seen = []

        def see(info):
            seen.append(info.navigator.record)
            if len(seen) > 6:
                raise KeyboardInterrupt

        scenario = pti.load_scenario("crowded").changed({"capacity": 40}, object_speed=5.0)
        simulate(scenario, mode=mode, seed=1, on_cycle=see)
        return seen

    at_home = drive()
    with device.forced():
        apart = drive()
    for one, other in zip(at_home, apart, strict=True):
        assert one.fault == other.fault == ""
        assert one.decision == other.decision
        # trees grow along roads at home only, to the same but for rounding
        assert one.cost == pytest.approx(other.cost, rel=1e-4)
        assert one.risk == pytest.approx(other.risk, abs=1e-4)
    assert any(r.decision == "new" for r in at_home[1:])
    assert len(at_home[-1].model.tracks)


def remembered(monkeypatch, persons):
    """For each cycle, whether a track ended, and whether the hidden set was told of a memory."""
    told, model, found = [], None, []
    real = model_module.proven

    def proven(ground, memory, owners=None):
        told.append(memory is not None)
        return real(ground, memory, owners)

    monkeypatch.setattr(model_module, "proven", proven)
    for k, person in enumerate(persons):
        scan = scan_at(0.1 * k, person=person)
        model = model_of(settings_of("probabilistic"), scan, model)
        found.append((model.tracks.ended, told.pop()))
        assert not told
    return found


def test_memory_is_dropped_when_whoever_was_tracked_may_be_anywhere(monkeypatch):
    found = remembered(monkeypatch, [(-2.0, 0.5)] * 4 + [None] * 8)
    assert sum(ended for ended, _ in found) == 1
    assert [told for _, told in found[1:]] == [not ended for ended, _ in found[1:]]


def test_a_track_that_is_met_again_may_be_about_somebody_else(monkeypatch):
    there = (-2.0, 0.5)
    found = remembered(monkeypatch, [there] * 4 + [None] + [there] * 2)
    assert not any(ended for ended, _ in found)
    assert [told for _, told in found] == [False, True, True, True, True, False, True]


def test_between_two_movers_the_way_out_stays_open():
    settings, scan = settings_of("hybrid"), scan_at(person=(-2.0, 0.5))
    labels = labels_of([scan], settings, (0.0, 0.0), [9.0], None)
    person = labels.met[0] == beams.MOVABLE
    assert person.sum() > 8

    def shut(owner):
        views = views_of(labels, (), settings, (0.0, 0.0), None, [owner])
        return views.far_side[0, : len(person)] == beams.SHUT

    one = np.where(person, 7, -1)
    two = np.where(person & (np.arange(len(person)) > np.flatnonzero(person).mean()), 8, one)
    inside = person & np.roll(person, -1)
    assert shut(one)[inside].all()
    assert not shut(one)[person & ~inside].any()  # the step at his side
    assert (shut(one) & ~shut(two)).sum() == 1
    assert not shut(np.full(len(person), -1))[inside].any()


def test_what_is_seen_and_not_tracked_is_there_for_sure():
    settings = settings_of("probabilistic", emergence=0.01)
    window = model_of(settings, scan_at()).window
    laid = tubes.Laid(window, 0.0, 0.0, ROBOT, settings)
    never = np.full((window.size, window.size), NEVER, dtype=np.uint16)
    place = np.array([[1.0, -0.5]])
    free, asked = laid.slowed(never, np.zeros((0, 2))), laid.slowed(never, place)
    cell = np.floor((place[0] - np.array(window.origin)) / window.cell).astype(int)
    assert asked[cell[1], cell[0]] == 0 < free[cell[1], cell[0]]
    away = asked[cell[1], cell[0] + 15] / 1000 * settings.object_speed
    assert 1.5 - settings.clearance(ROBOT) - 0.3 < away < 1.5 - settings.clearance(ROBOT)


def test_the_calmest_way_is_the_one_of_least_risk_then_the_clearest(monkeypatch):
    model = model_of(settings_of("probabilistic"), scan_at())
    root = np.array([0.0, 0.0, 0.0, 0.5, 0.5])
    held = plan_module.braking_from(model, root, 0.1, 0)
    assert plan_module.calmest(model, held, root, 0.1) is held
    risks = iter([0.5, 0.4, *[0.6] * 20])
    monkeypatch.setattr(plan_module, "risk_of", lambda *_: next(risks))
    chosen = plan_module.calmest(model, held, root, 0.1)
    assert chosen is not held
    assert (chosen.states == plan_module.braking_from(model, root, 0.1, 0).states).all()


def test_memory_is_handed_out_again_when_nobody_holds_it():
    memory = Reused()
    first = memory.floats(1000)
    first[:] = 1.0
    place = first.ctypes.data
    second = memory.floats(1000)
    second[:] = 2.0
    assert second.ctypes.data != place
    assert (first == 1.0).all()
    del first
    third = memory.floats(900)
    assert third.ctypes.data == place
    assert (second == 2.0).all()


@pytest.mark.parametrize("running", ["metal", "vulkan"])
def test_a_backend_without_double_precision_weighs_no_risks(running, monkeypatch):
    pti.init("cpu")
    pti.Navigator(ROBOT, settings_of("probabilistic"), (1.0, 0.0))
    monkeypatch.setattr(backend, "_running", running)
    with pytest.raises(ValueError, match="double precision"):
        pti.Navigator(ROBOT, settings_of("probabilistic"), (1.0, 0.0))
    pti.Navigator(ROBOT, settings_of("hybrid"), (1.0, 0.0))
