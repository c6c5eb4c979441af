"""What must hold of p-safety whatever the scene: searched by Hypothesis.

Long form: PASSPMP_CAMPAIGN=2000000 pytest -m campaign (a thousandth of it in examples each).
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import strategies as st
from oracle import exact, margins, scenes
from oracle.hunt import Hunt

from passpmp_ti import FutureModel

HUNT = Hunt()
NEVER = 65535


@pytest.mark.campaign
@pytest.mark.parametrize("name", HUNT.properties)
def test_every_property_at_length(name):
    HUNT.at_length(name)


def safe(case, states, times):
    """[n] bool: what the model of a case proves."""
    return case.model().passively_safe(states, times)


# monotone -------------------------------------------------------------------------------------

MORE = {
    "object_speed": st.floats(0.0, 3.0),
    "tracking_error": st.floats(0.0, 0.5),
    "localisation_error": st.floats(0.0, 0.3),
    "range_noise": st.floats(0.0, 0.1),
    "stamp_error": st.floats(0.0, 0.3),
}


@HUNT.searched(
    120,
    scenes.scenes(),
    scenes.seeds,
    st.sampled_from(sorted(MORE)).flatmap(lambda name: st.tuples(st.just(name), MORE[name])),
)
def test_a_larger_bound_or_margin_makes_no_unsafe_state_safe(case, seed, more):
    name, amount = more
    larger = case.settings.changed(**{name: getattr(case.settings, name) + amount})
    states, times = scenes.states_for(case, seed)
    gained = safe(replace(case, settings=larger), states, times) & ~safe(case, states, times)
    assert not gained.any()


@HUNT.searched(40, scenes.scenes(lost=False), scenes.seeds, st.floats(0.0, 0.5))
def test_a_larger_body_makes_no_unsafe_state_safe(case, seed, more):
    discs = tuple((offset, radius + more) for offset, radius in case.robot.discs)
    larger = replace(case, robot=replace(case.robot, discs=discs))
    states, times = scenes.states_for(case, seed)
    gained = safe(larger, states, times) & ~safe(case, states, times)
    assert not gained.any()


@HUNT.searched(50, scenes.scenes(), scenes.seeds, scenes.lost_runs())
def test_fewer_beams_make_no_unsafe_state_safe(case, seed, runs):
    fewer = replace(case, scans=[scenes.without_beams(scan, runs) for scan in case.scans])
    states, times = scenes.states_for(case, seed)
    gained = safe(fewer, states, times) & ~safe(case, states, times)
    assert not gained.any()


@HUNT.searched(20, scenes.scenes(), scenes.seeds, st.floats(0.0, 1.0))
def test_a_later_start_makes_no_unsafe_state_safe(case, seed, later):
    model = case.model()
    states, times = scenes.states_for(case, seed)
    gained = model.passively_safe(states, times + later) & ~model.passively_safe(states, times)
    assert not gained.any()


# frames ---------------------------------------------------------------------------------------


def moved(case, dx, dy, turn=0.0):
    """World, robot and sensors turned about the origin, then shifted; what is seen is the same."""
    c, s = np.cos(turn), np.sin(turn)

    def of(pose):
        x, y, theta = pose
        return (c * x - s * y + dx, s * x + c * y + dy, theta + turn)

    scans = [replace(scan, pose=of(scan.pose)) for scan in case.scans]
    return replace(case, scans=scans, position=of(case.position)), of


@HUNT.searched(15, scenes.scenes(), st.integers(-500, 500), st.integers(-500, 500))
def test_a_move_by_whole_cells_changes_no_byte(case, columns, rows):
    # an eighth and a half are exact in binary: so is the move
    cell = 0.5 if case.robot.kind == exact.CAR else 0.125
    case = replace(case, settings=case.settings.changed(cell=cell))
    there, _ = moved(case, columns * cell, rows * cell)
    assert case.model().ticks.tobytes() == there.model().ticks.tobytes()


@HUNT.searched(
    50,
    scenes.scenes(),
    scenes.seeds,
    st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-3, 3)),
)
def test_a_state_with_room_to_spare_is_safe_in_every_frame(case, seed, motion):
    wary = case.settings.changed(tracking_error=margins.grid_margin(case.settings))
    states, times = scenes.states_for(case, seed)
    roomy = safe(replace(case, settings=wary), states, times)
    there, of = moved(case, *motion)
    turned = states.copy()
    for state in turned:
        state[:3] = of(state[:3])
    assert safe(there, turned, times)[roomy].all()


# along the proof ------------------------------------------------------------------------------


@HUNT.searched(40, scenes.scenes(), scenes.seeds)
def test_what_follows_on_the_proving_path_is_safe(case, seed):
    """With 2 mm to spare: a state read back from the path is rounded."""
    wary = replace(case, settings=case.settings.changed(tracking_error=0.002))
    states, times = scenes.states_for(case, seed)
    proof = wary.model().proving_brakes(states, times)
    model, step = case.model(), case.settings.time_step
    for k, control in enumerate(case.robot.braking):
        path = exact.midpoint_path(case.robot, states[proof == k], control, step)
        for n in (1, 2, 5, 11, 23, 47, 95):
            if n < path.shape[1]:
                assert model.passively_safe(path[:, n], times[proof == k] + n * step).all()


# memory and layers ----------------------------------------------------------------------------


@HUNT.searched(12, scenes.scenes(lidars=(1,), lost=False), scenes.seeds)
def test_a_later_scan_never_lets_anything_come_earlier(case, seed):
    generator = np.random.default_rng(seed)
    settings, bound = case.settings, case.settings.object_speed
    (scan,) = case.scans
    discs, pose = case.world.discs.copy(), np.array(case.position)
    model, stamp = None, scan.stamp
    for _ in range(5):
        world = exact.World(case.world.boxes, discs)
        seen = exact.sweep(
            world, tuple(pose), scenes.BEAMS, 2 * np.pi, scan.range_max, stamp,
            labelled=scan.moving is not None,
        )  # fmt: skip
        after = FutureModel.from_scan(seen, case.robot, settings, model)
        assert len(after.broken_premises) == 0
        if model is not None:
            before, now = on_common_cells(model, after)
            assert (now >= before).all()
        model = after
        stamp += settings.cycle + generator.uniform(-1e-3, 1e-3)
        way = generator.uniform(-np.pi, np.pi, len(discs))
        discs[:, :2] += bound * 0.098 * np.stack([np.cos(way), np.sin(way)], axis=1)
        pose = pose + generator.uniform(-1, 1, 3) * [0.1, 0.1, 0.3]


def on_common_cells(before, after):
    """Both models' ticks where both windows are, counted from the newer base."""
    shift = np.array(after.window.corner) - before.window.corner
    size = before.window.size
    (i0, j0), (i1, j1) = np.maximum(shift, 0), np.minimum(shift + size, size)
    old = before.ticks[j0:j1, i0:i1].astype(int)
    new = after.ticks[j0 - shift[1] : j1 - shift[1], i0 - shift[0] : i1 - shift[0]].astype(int)
    age = after.base_ticks - before.base_ticks
    return np.where(old == NEVER, NEVER, np.maximum(old - age, 0)), new


@HUNT.searched(15, scenes.scenes(), st.integers(1, 400))
def test_layers_and_arrival_times_agree(case, milliseconds):
    case = replace(case, settings=case.settings.changed(layer_length=milliseconds / 1000))
    model = case.model()
    layers = model.layers(5)
    j, i = np.indices(model.shape).reshape(2, -1)
    centres = np.array(model.origin) + (np.stack([i, j], axis=1) + 0.5) * model.cell
    for index, layer in enumerate(layers):
        assert (layer == model.layer(index)).all()
        # the last millisecond of the layer says the most
        last = model.base + ((index + 1) * milliseconds - 1) / 1000
        if last >= model.stamp:
            found = model.occupied(centres, np.full(len(centres), last))
            assert (found.reshape(model.shape) == layer).all()
    assert (layers[1:] >= layers[:-1]).all()
