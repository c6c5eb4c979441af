"""The guide is the solution of the eikonal equation, whoever solves it."""

import contextlib

import numpy as np
import pytest
from oracle import exact
from scipy.ndimage import distance_transform_edt

from passpmp_ti import DifferentialDrive, FutureModel, Settings, device
from passpmp_ti.kernels.eikonal import UNREACHED
from passpmp_ti.planner.eikonal import solve
from passpmp_ti.planner.guide import Guide

ROBOT = DifferentialDrive()
SETTINGS = Settings(cell=0.05, object_width=0.4, object_speed=1.0)


def plainly(slowness, goal):
    """Every cell looks at its neighbours, all at once, until nothing changes at all."""
    s = slowness.astype(np.float64)
    time = np.full((s.shape[0] + 2, s.shape[1] + 2), np.inf)
    time[goal[0] + 1, goal[1] + 1] = 0.0
    while True:
        a = np.minimum(time[1:-1, :-2], time[1:-1, 2:])
        b = np.minimum(time[:-2, 1:-1], time[2:, 1:-1])
        low, high = np.minimum(a, b), np.maximum(a, b)
        apart = np.where(np.isfinite(high), high - np.where(np.isfinite(low), low, 0.0), np.inf)
        root = np.sqrt(np.maximum(2 * s**2 - np.minimum(apart, 2 * s) ** 2, 0.0))
        both = np.where(apart < s, low + 0.5 * (np.minimum(apart, s) + root), low + s)
        better = np.minimum(time[1:-1, 1:-1], both)
        if (better == time[1:-1, 1:-1]).all():
            return better
        time[1:-1, 1:-1] = better


def a_field(seed, rows=61, columns=83):
    """Smooth speeds, walls in which it is 300 times as slow, and gaps in them."""
    generator = np.random.default_rng(seed)
    y, x = np.mgrid[:rows, :columns]
    speed = 1.2 + np.sin(0.11 * x + generator.uniform(0, 6)) * np.cos(0.17 * y)
    for column in range(12, columns - 5, 17):
        gap = int(generator.integers(0, rows - 5))
        wall = np.abs(y[:, 0] - gap) > 2
        speed[wall, column : column + 2] = 1 / 300
    goal = (int(generator.integers(rows)), int(generator.integers(columns)))
    return (0.1 / speed).astype(np.float32), goal


def solved(slowness, goal):
    time = np.full(slowness.shape, UNREACHED, dtype=np.float32)
    time[goal] = 0.0
    on_device = device.put(time)
    solve(device.put(slowness), goal, on_device)
    return device.host(on_device)


def spiral():
    """A way that winds inwards through walls, longer than any sweep foresees."""
    speed = np.full((41, 41), 1 / 300)
    for ring in range(0, 20, 4):
        speed[ring, ring : 41 - ring] = speed[40 - ring, ring : 41 - ring] = 1.0
        speed[ring : 41 - ring, 40 - ring] = 1.0
        speed[ring + 4 : 41 - ring, ring] = 1.0
        speed[ring + 4, ring : ring + 5] = 1.0
    return (0.1 / speed).astype(np.float32), (20, 20)


FIELDS = [a_field(seed) for seed in range(6)] + [spiral()]
CORNERS = [(0, 0), (0, 82), (60, 0), (60, 82)]


@pytest.mark.parametrize(("slowness", "goal"), FIELDS + [(a_field(9)[0], c) for c in CORNERS])
def test_one_thread_finds_the_fixed_point(slowness, goal):
    wanted = plainly(slowness, goal)
    assert solved(slowness, goal) == pytest.approx(wanted, rel=1e-3, abs=1e-4)


@pytest.mark.parametrize(("slowness", "goal"), FIELDS + [(a_field(9)[0], c) for c in CORNERS[:2]])
def test_many_threads_find_the_same_and_always_the_same_bytes(slowness, goal):
    one = solved(slowness, goal)
    with device.forced():
        many = solved(slowness, goal)
        again = solved(slowness, goal)
    assert many == pytest.approx(one, rel=1e-3, abs=1e-4)
    assert many.tobytes() == again.tobytes()


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (8, 8), (17, 9)])
def test_grids_of_any_size_are_solved(shape):
    slowness = np.full(shape, 0.1, dtype=np.float32)
    wanted = plainly(slowness, (0, 0))
    assert solved(slowness, (0, 0)) == pytest.approx(wanted, rel=1e-3)
    with device.forced():
        assert solved(slowness, (0, 0)) == pytest.approx(wanted, rel=1e-3)


def model_at(pose, boxes, stamp=0.0, settings=SETTINGS):
    scan = exact.sweep(exact.world_of(boxes), pose, 720, 2 * np.pi, 4.0, stamp, labelled=True)
    return FutureModel.from_scan(scan, ROBOT, settings)


def guide_to(goal, model, settings=SETTINGS):
    return Guide(ROBOT, settings, (0.0, 0.0), [goal], model.window.anchor, 4.0, None)


def states_about(seed, count=200):
    states = np.random.default_rng(seed).uniform(-3, 5, (count, 5))
    states[:, 2] *= 0.5
    return states


@pytest.mark.parametrize("kind", ["safe_time", "euclidean"])
@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_off_the_host_the_guide_costs_the_same(kind, speed):
    settings = SETTINGS.changed(object_speed=speed, guide=kind, guide_movers=True)
    model = model_at((0, 0, 0), [exact.box(1.5, 0.4, 0.4, 2.0, 0.0)], settings=settings)
    states = states_about(3)
    here = guide_to((3.0, 0.5), model, settings).field(model, (3.0, 0.5), np.zeros(2)).at(states)
    with device.forced():
        field = guide_to((3.0, 0.5), model, settings).field(model, (3.0, 0.5), np.zeros(2))
        assert not isinstance(field.time, np.ndarray)
        assert not isinstance(field.ahead, np.ndarray)
        there = field.at(states)
    # the way ahead goes by which of two neighbours is the lesser, and they may be as good as equal
    close = np.isclose(here, there, rtol=2e-3, atol=1e-3)
    assert close.mean() > 0.97


def cells_of(guide, model, mask):
    """Cells of the guide's grid that hold the centres of a model's marked cells, as a mask."""
    j, i = np.nonzero(mask)
    low = np.array(guide.anchor) + guide._low
    places = np.array(model.origin) + (np.stack([i, j], axis=1) + 0.5) * model.cell
    cells = np.floor((places - low) / guide._cell).astype(int)
    found = np.zeros(guide._shape, dtype=bool)
    cells = cells[((cells >= 0) & (cells < found.shape[::-1])).all(axis=1)]
    found[cells[:, 1], cells[:, 0]] = True
    return found


@pytest.mark.parametrize("movers", [False, True])
@pytest.mark.parametrize("resident", [False, True])
def test_what_a_model_shows_is_met_where_it_lies(movers, resident):
    settings = SETTINGS.changed(guide_movers=movers)
    world = exact.world_of([exact.box(1.5, 0.4, 0.4, 2.0)], [(-0.8, 1.1, 0.3)])
    scan = exact.sweep(world, (0.3, 0, 0), 720, 2 * np.pi, 4.0, 0.0, labelled=True)
    with device.forced() if resident else contextlib.nullcontext():
        model = FutureModel.from_scan(scan, ROBOT, settings)
        guide = guide_to((2.2, 0.5), model, settings)
        corners = device.host(guide._meet(model)) == 0
        walls, blocked = device.host(guide._walls) == 0, device.host(guide._blocked) == 1
    for shown in (model.static, model.movable, model.standing_sources):
        assert shown.any()
    assert (walls == cells_of(guide, model, model.static)).all()
    out_of = model.standing_sources | (model.movable if movers else False)
    assert (corners == cells_of(guide, model, out_of)).all()
    assert (blocked == (distance_transform_edt(~walls) < guide._kept)).all()


def test_walls_met_on_the_way_are_kept_and_new_ones_count_at_once():
    wall = exact.box(1.5, 0.0, 0.2, 2.0, 0.0)
    before, after = model_at((0, 0, 0), []), model_at((0, 0, 0), [wall], 0.1)
    goal, here = (3.0, 0.0), np.zeros((1, 5))
    guide = guide_to(goal, before)
    free = guide.field(before, goal, np.zeros(2)).at(here)
    around = guide.field(after, goal, np.zeros(2)).at(here)
    assert around > free + 0.5
    # it is not seen any more, yet it stands
    assert guide.field(before, goal, np.zeros(2)).at(here) > free + 0.5
    fresh = guide_to(goal, after).field(after, goal, np.zeros(2)).at(here)
    assert around == fresh


def test_the_way_ahead_leads_around_a_wall():
    model = model_at((0, 0, 0), [exact.box(1.2, 0.0, 0.2, 2.0, 0.0)])
    goal = (3.0, 0.0)
    field = guide_to(goal, model, SETTINGS).field(model, goal, np.zeros(2))
    straight_on, aside = field.at(np.array([[0, 0.1, 0, 0, 0], [0, 0.1, np.pi / 2, 0, 0]]))
    assert aside < straight_on


def test_a_passage_that_some_cells_may_close_is_led_into_only_if_asked():
    plain = SETTINGS.changed(object_speed=0.0)
    clearance = plain.clearance(ROBOT)
    goal, cost = (2.5, 0.0), {}
    for margin in (0.0, 1.0):
        settings = plain.changed(guide_margin=margin)
        guide = guide_to(goal, model_at((0, 0, 0), [], settings=settings), settings)
        # from the middle to either wall: the clearance, and half of what 1 keeps beside it
        half = clearance + 0.5 * (settings.cell + 0.5 * guide._cell)
        gap = [exact.box(1.2, side * (half + 2.0), 0.2, 4.0, 0.0) for side in (-1, 1)]
        model = model_at((0, 0, 0), gap, settings=settings)
        cost[margin] = float(guide.field(model, goal, np.zeros(2)).at(np.zeros((1, 5)))[0])
    assert cost[0.0] < 4.0
    assert cost[1.0] > cost[0.0] + 2.0
