"""What one cycle proved, the next one keeps, unless a premise broke."""

import numpy as np
import pytest
from oracle import exact

import passpmp_ti.grid.window as window_module
from passpmp_ti import DifferentialDrive, FutureModel, Settings

ROBOT = DifferentialDrive()
SETTINGS = Settings(cell=0.05, object_width=0.4, object_speed=1.0)
NEVER = 65535


def model_at(pose, stamp, boxes=(), discs=(), previous=None, settings=SETTINGS, **more):
    scan = exact.sweep(
        exact.world_of(boxes, discs), pose, 720, 2 * np.pi, 4.0, stamp, labelled=True
    )
    return FutureModel.from_scan(scan, ROBOT, settings, previous, **more)


def overlap(before, after):
    """Both models' ticks on the cells that both have, counted from the newer base."""
    shift = np.round((np.array(after.origin) - before.origin) / before.cell).astype(int)
    n = before.shape[0]
    i0, j0 = np.maximum(shift, 0)
    i1, j1 = np.minimum(shift + n, n)
    old = before.ticks[j0:j1, i0:i1].astype(int)
    new = after.ticks[j0 - shift[1] : j1 - shift[1], i0 - shift[0] : i1 - shift[0]].astype(int)
    age = after.base_ticks - before.base_ticks
    return np.where(old == NEVER, NEVER, np.maximum(old - age, 0)), new


@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_no_cell_is_touched_earlier_than_the_model_before_said(speed):
    settings = SETTINGS.changed(object_speed=speed)
    generator = np.random.default_rng(4)
    boxes = [exact.box(1.5, 1.0, 0.8, 0.5, 0.3), exact.box(-1.0, -1.6, 0.5, 1.2, 1.0)]
    walker = np.array([2.4, -1.0])
    model, pose, stamp = None, np.array([0.013, -0.021, 0.2]), 7.0004
    for _ in range(8):
        after = model_at(tuple(pose), stamp, boxes, [(*walker, 0.25)], model, settings)
        if model is not None:
            assert len(after.broken_premises) == 0
            old, new = overlap(model, after)
            assert (new >= old).all()
        model = after
        stamp += 0.1003
        pose = pose + generator.uniform(-1, 1, 3) * [0.12, 0.12, 0.3]
        walker = walker + speed * 0.1 * np.array([-0.6, 0.8])


def test_a_robot_that_drives_far_keeps_its_memory_and_its_precision(monkeypatch):
    # as if 200 m were 0.5 m: the anchor moves on, by whole cells
    monkeypatch.setattr(window_module, "FARTHEST_ANCHOR", 0.5)
    boxes = [exact.box(1.5, 1.0, 0.8, 0.5, 0.3)]
    model, anchors = None, set()
    for k in range(12):
        after = model_at((0.1003 * k, 0.0, 0.0), 7.0 + 0.1 * k, boxes, (), model)
        anchors.add(after.window.anchor)
        assert np.abs(np.array(after.window.anchor) - (0.1003 * k, 0.0)).max() <= 0.55
        if model is not None:
            assert len(after.broken_premises) == 0
            old, new = overlap(model, after)
            assert (new >= old).all()
        model = after
    assert len(anchors) > 2


def test_a_shadow_that_was_seen_empty_stays_free_for_a_while():
    place, disc = np.array([[2.3, 0.0]]), [(1.3, 1.1, 0.25)]
    before = model_at((0.0, 0.0, 0.0), 1.0, discs=disc)
    assert not before.occupied(place, [1.2]).any()
    # from the other side, the disc hides the place
    hidden = dict(pose=(0.76, 1.69, 0.0), stamp=1.1, discs=disc)
    forgetful = model_at(**hidden)
    remembering = model_at(**hidden, previous=before)
    assert forgetful.occupied(place, [1.15]).all()
    assert not remembering.occupied(place, [1.15]).any()
    # but not for ever: whoever was nearest has come in the meantime
    assert remembering.occupied(place, [4.0]).all()


def test_the_window_moves_by_whole_cells_on_a_fixed_anchor():
    model = model_at((0.0, 0.0, 0.0), 0.0)
    anchor, first = model.window.anchor, np.array(model.origin)
    for step in range(1, 12):
        pose = (0.137 * step, -0.083 * step, 0.1)
        model = model_at(pose, 0.1 * step, previous=model)
        assert model.window.anchor == anchor
        cells = (np.array(model.origin) - first) / model.cell
        assert cells == pytest.approx(np.round(cells), abs=1e-6)
        middle = np.array(model.origin) + 0.5 * model.shape[0] * model.cell
        assert np.abs(middle - pose[:2]).max() <= 0.5 * model.cell + 1e-9


def test_a_return_where_nothing_can_be_is_reported_and_ends_memory_there():
    before = model_at((0.0, 0.0, 0.0), 0.0)
    born = (1.5, 0.3, 0.25)
    after = model_at((0.0, 0.0, 0.0), 0.1, discs=[born], previous=before)
    assert len(after.broken_premises) > 0
    away = np.hypot(*(after.broken_premises - born[:2]).T)
    assert (np.abs(away - 0.25) < 0.02).all()
    # memory promised this place for longer; what stands there now is believed instead
    for x in (1.3, 1.5, 1.7):
        assert after.occupied(np.array([[x, 0.3]]), [0.1]).all()
    beside = np.array([[1.5 - 0.25 - ROBOT.radius - 0.3, 0.3]])
    assert after.occupied(beside, [0.1 + 0.4]).all()
    # far from it, memory still holds
    old, new = overlap(before, after)
    n = old.shape[0]
    assert (new[:, : n // 4] >= old[:, : n // 4]).all()


def test_a_person_within_the_bound_breaks_no_premise():
    model, x = None, 3.5
    for step in range(25):
        model = model_at((0.0, 0.0, 0.0), 0.1 * step, discs=[(x, 0.5, 0.25)], previous=model)
        assert len(model.broken_premises) == 0
        x -= 0.1
    # the same person at three times the bound does
    broken = 0
    model, x = None, 3.5
    for step in range(10):
        model = model_at((0.0, 0.0, 0.0), 0.1 * step, discs=[(x, 0.5, 0.25)], previous=model)
        broken += len(model.broken_premises)
        x -= 0.3
    assert broken > 0


def test_memory_of_weaker_assumptions_is_refused():
    before = model_at((0.0, 0.0, 0.0), 0.0)
    for change in (
        dict(object_speed=2.0),
        dict(tracking_error=0.1),
        dict(cell=0.1),
        dict(object_width=0.2),
        dict(range_noise=0.1),
        dict(stamp_error=0.1),
    ):
        with pytest.raises(ValueError, match="start without memory"):
            model_at((0.0, 0.0, 0.0), 0.1, previous=before, settings=SETTINGS.changed(**change))
    still = model_at(
        (0.0, 0.0, 0.0), 0.0, settings=SETTINGS.changed(blind_speed=0.0, clear_radius=2.0)
    )
    with pytest.raises(ValueError, match="start without memory"):
        model_at((0.0, 0.0, 0.0), 0.1, previous=still)


def test_an_older_scan_after_a_newer_one_is_refused():
    before = model_at((0.0, 0.0, 0.0), 1.0)
    with pytest.raises(ValueError, match="after the scan"):
        model_at((0.0, 0.0, 0.0), 0.5, previous=before)
