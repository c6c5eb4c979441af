"""Cones that follow walls round: never earlier than straight ones, never later than anybody.

A longer campaign: PASSPMP_CAMPAIGN=400000 PASSPMP_SEED=10000 pytest -m campaign -s
(places asked).
"""

import os
from dataclasses import replace

import numpy as np
import pytest
from oracle import cases, exact, hidden, open_ways, walkers, worlds
from test_soundness import broken_proofs_of

import passpmp_ti.grid.geodesic as geodesic_module
from passpmp_ti import FutureModel, Settings, device
from passpmp_ti.grid.arrival import rasterised
from passpmp_ti.grid.geodesic import ways_from_sources
from passpmp_ti.kernels.arrival import LANES, NEVER
from passpmp_ti.kernels.beams import LOST, SHUT
from passpmp_ti.kernels.geodesic import (
    COLUMNS,
    DIAGONAL,
    ENDS,
    FAR,
    KNIGHT,
    LEVEL,
    ROWS,
    UNIT,
    walk,
    walk_apart,
)

SIDE = 16
CAMPAIGN = int(os.environ.get("PASSPMP_CAMPAIGN", "400000"))
SEED = int(os.environ.get("PASSPMP_SEED", "10000"))


# lengths over open cells -----------------------------------------------------------------------


def laid_out(opened, sources):
    """(toll, way) as `open_cells` leaves them."""
    shape = (SIDE + 2 * ROWS + 1, SIDE + 3 * COLUMNS)
    toll, way = np.full(shape, FAR, np.int32), np.full(shape, FAR, np.int32)
    toll[ROWS : ROWS + SIDE, COLUMNS : COLUMNS + SIDE] = np.where(opened, 0, FAR)
    for j, i in np.argwhere(sources):
        way[ROWS + j : ROWS + j + 2, COLUMNS + i : COLUMNS + i + 2] = 0
    return toll, way


def corner_lengths(opened, sources):
    """[SIDE + 1, SIDE + 1] least lengths to corners [1 / UNIT cells]."""
    toll, way = laid_out(opened, sources)
    stirred = np.empty((len(way), way.shape[1] // LANES), dtype=np.int32)
    assert walk(toll, 100, way, stirred) <= 100
    return way[ROWS : ROWS + SIDE + 1, COLUMNS : COLUMNS + SIDE + 1]


def random_grid(generator):
    """(opened, source (j, i)): scattered cells that bar the way, or walls."""
    opened = generator.random((SIDE, SIDE)) > generator.choice([0.1, 0.3])
    if generator.random() < 0.5:
        opened[:] = True
        for j, i in generator.integers(0, SIDE, (5, 2)):
            if generator.random() < 0.5:
                opened[j, i : i + 9] = False
            else:
                opened[j : j + 9, i] = False
    choices = np.argwhere(opened)
    return opened, choices[generator.integers(len(choices))]


def test_a_way_round_a_wall_is_as_long_as_its_moves():
    opened = np.ones((SIDE, SIDE), dtype=bool)
    opened[:12, 8] = False  # open above row 12
    sources = np.zeros_like(opened)
    sources[4, 4] = True
    length = corner_lengths(opened, sources)
    assert length[4, 8] == 3 * LEVEL  # up to the wall
    # 7 up and 3 along to its end, 1 over it, and 7 down
    assert length[12, 8] == 3 * KNIGHT + LEVEL
    assert length[5, 9] == 3 * KNIGHT + 2 * LEVEL + 7 * LEVEL
    opened[:, 8] = False
    assert (corner_lengths(opened, sources)[:, 9:] == FAR).all()


def test_no_way_is_shorter_than_what_is_said_of_it():
    unscaled_too_long, asked = 0, 0
    for seed in range(12):
        generator = np.random.default_rng(seed)
        opened, (j, i) = random_grid(generator)
        sources = np.zeros_like(opened)
        sources[j, i] = True
        corner = corner_lengths(opened, sources)
        inner = np.linspace(0, 1, 4)
        starts = np.stack(np.meshgrid(i + inner, j + inner), axis=-1).reshape(-1, 2)
        choices = np.argwhere(opened)
        ends = choices[generator.integers(len(choices), size=40)]
        # anywhere in a cell, or in one of its corners
        within = np.where(generator.random((40, 1)) < 0.5, generator.random((40, 2)),
                          generator.choice([1e-6, 1 - 1e-6], (40, 2)))  # fmt: skip
        true = open_ways.lengths(opened, starts, ends[:, ::-1] + within).min(axis=0)
        least = np.min([corner[ends[:, 0] + a, ends[:, 1] + b] for a in (0, 1) for b in (0, 1)], 0)
        reached = np.isfinite(true)
        assert ((least < FAR) == reached).all()
        bound = (least[reached] - ENDS) / UNIT
        assert (bound <= true[reached] + 1e-9).all()
        # a cell at either end, and what the norm is less than the way
        assert (bound >= true[reached] * LEVEL / UNIT - 2 * np.sqrt(2) - ENDS / UNIT).all()
        unscaled_too_long += int((least[reached] / LEVEL > true[reached] + 1e-6).sum())
        asked += int(reached.sum())
    assert asked > 400
    assert unscaled_too_long > 10, "the norm's margin is not needed for anything here"


def test_no_move_is_longer_than_the_way_that_it_measures():
    # between two neighbouring moves the norm is linear: its gradients are what bounds it
    for gradient in ((LEVEL, KNIGHT - 2 * LEVEL), (KNIGHT - DIAGONAL, 2 * DIAGONAL - KNIGHT)):
        assert np.hypot(*gradient) <= UNIT


def test_lengths_end_where_they_end_whoever_works_them_out():
    for seed in range(4):
        opened, (j, i) = random_grid(np.random.default_rng(seed))
        sources = np.zeros_like(opened)
        sources[j, i] = True
        toll, way = laid_out(opened, sources)
        other = way.copy()
        while walk_apart(toll, way, other):
            pass
        found = way[ROWS : ROWS + SIDE + 1, COLUMNS : COLUMNS + SIDE + 1]
        assert (found == corner_lengths(opened, sources)).all()


# what is open ----------------------------------------------------------------------------------


def heading(views, v, beam):
    """[n, 2] unit vectors along beams, or between two."""
    bearing = views.view[v, 2] + views.view[v, 3] * beam
    return np.stack([np.cos(bearing), np.sin(bearing)], axis=1)


def walkable(views, generator, count):
    """[n, 2] places in device coordinates that the views prove empty, or before a shut wedge's
    chord."""
    found = []
    for v in range(views.scans):
        n = views.beams[v]
        told = np.flatnonzero(views.met[v, :n] != LOST)
        w = generator.integers(0, n, count)
        share = generator.random(count)
        # beams that are lost lie between two that are not
        a = told[np.searchsorted(told, w, side="right") - 1]
        b = told[np.searchsorted(told, w, side="right") % len(told)]
        ends = [heading(views, v, beam) * views.ranges[v, beam, None] for beam in (a, b)]
        chord = ends[0] + share[:, None] * (ends[1] - ends[0])
        proven = heading(views, v, w + share) * views.reach[v, w, None]
        edge = np.where(views.far_side[v, w, None] == SHUT, chord, proven)
        along = np.where(generator.random((count, 1)) < 0.7, 1.0, generator.random((count, 1)))
        found.append(views.view[v, :2] + along * edge)
    return np.concatenate(found)


def closed_share(case, places):
    """Share of places [n, 2] in device coordinates whose cell no way leads through."""
    model = case.model()
    seen, marks = rasterised(model.views, model.window, case.settings)
    assert ways_from_sources(model.views, seen, marks, model.window, case.settings) is not None
    toll, _, _ = geodesic_module._scratch(model.window.size)
    i, j = (np.floor(places / model.cell).astype(int) - np.array(model.window.corner)).T
    opened = toll[j + ROWS, i + COLUMNS] == 0
    assert not opened.all() or (toll != 0).any()
    return 1 - opened.mean(), 1 - model.seen[j, i].mean()


def test_whatever_may_be_walked_through_is_open():
    for seed in range(8):
        generator = np.random.default_rng(seed)
        case = walkers.corridor_case(generator)
        closed, unseen = closed_share(case, walkable(case.model().views, generator, 3000))
        assert closed == 0
        assert unseen > 0.1, "what is seen would do as well"


def test_views_that_may_disagree_open_as_much_more():
    generator = np.random.default_rng(3)
    far = 0.1
    case = walkers.corridor_case(generator, localisation_error=far)
    places = walkable(case.model().views, generator, 3000)
    away = generator.uniform(-np.pi, np.pi, len(places))
    places = places + 2 * far * np.stack([np.cos(away), np.sin(away)], axis=1)
    assert closed_share(case, places)[0] == 0
    sure = replace(case, settings=case.settings.changed(localisation_error=0.0))
    assert closed_share(sure, places)[0] > 0.05


# arrival times ---------------------------------------------------------------------------------


def straight(case):
    return replace(case, settings=case.settings.changed(cones="straight"))


def reached_too_soon(seed, places):
    """(asked, asked where walls make it later, how many of them somebody reaches before that)."""
    generator = np.random.default_rng(seed)
    case = walkers.corridor_case(generator)
    model, plain = case.model(), straight(case).model()
    assert (model.ticks >= plain.ticks).all()
    assert ((model.ticks == 0) == (plain.ticks == 0)).all()
    timed = (model.ticks > 0) & (model.ticks < NEVER - 1)
    later = timed & (model.ticks > plain.ticks)
    j, i = np.concatenate(
        [
            some[generator.integers(len(some), size=min(places, len(some)))]
            for some in (np.argwhere(timed), np.argwhere(later))
        ]
    ).T
    # a tick before anything could be there
    points = model.origin + (np.stack([i, j], 1) + generator.random((len(j), 2))) * model.cell
    elapsed = model.base + 1e-3 * (model.ticks[j, i] - 1.0) - model.stamp
    attackers = hidden.hidden_discs(case, 60, generator)
    walking = walkers.walkers_of(case, attackers)
    touched = walkers.reaches(points, elapsed, walking, case.robot.disc_radius, case.blockers)
    return len(j), int(later[j, i].sum()), int(touched.sum())


def test_nobody_walks_round_a_corner_before_the_model_says_so():
    found = np.array([reached_too_soon(seed, 60) for seed in range(5)])
    assert found[:, 2].sum() == 0
    assert found[:, 1].sum() > 250


@pytest.mark.campaign
def test_nobody_walks_round_a_corner_before_the_model_says_so_in_a_long_campaign():
    each = 400
    total = np.zeros(3, dtype=int)
    for n, seed in enumerate(range(SEED, SEED + max(CAMPAIGN // (2 * each), 1))):
        total += reached_too_soon(seed, each)
        if n % 50 == 0 or total[2]:
            print("{} places, {} of them later by walls, {} reached too soon".format(*total))
        assert not total[2], f"seed {seed}"


def test_no_proof_of_passive_safety_is_broken_where_walls_stop_cones():
    asked = proven = 0
    for seed in range(10):
        case = cases.random_case(np.random.default_rng(seed))
        slow = case.settings.unseen_speed < case.settings.object_speed
        settings = case.settings.changed(cones="geodesic", blind_speed=0.0 if slow else None)
        a, p, found = broken_proofs_of(
            replace(case, settings=settings), np.random.default_rng(seed), 60, 100
        )
        asked, proven = asked + a, proven + p
        assert not found
    assert proven > 0.1 * asked


def test_walls_keep_somebody_who_is_behind_them_from_coming_straight():
    """A mapped wall at a grazing angle, a door before it: what it hides begins close behind it."""
    wall = exact.box(5.0, 1.025, 7.0, 0.05)
    beyond = exact.box(0.0, 3.0, 20.0, 0.2)
    world = exact.world_of([wall, beyond, exact.box(0.0, -2.0, 20.0, 0.2)])
    settings = Settings.for_robot(cases.CHAIR, object_speed=1.0)
    pose = (0.0, 0.75, 0.0)
    scan = exact.sweep(world, pose, 1440, 2 * np.pi, 9.0, 0.0)
    case = cases.Case(cases.CHAIR, settings, world, [scan], pose, worlds.map_of(world, 0.05))
    place = np.array([[4.0, 0.3]])  # 1.2 m from what is hidden, 2.6 m from the door

    def arrival(cones):
        model = replace(case, settings=settings.changed(cones=cones)).model()
        times = np.arange(0.0, 5.0, 0.01)
        return times[np.argmax(model.occupied(np.repeat(place, len(times), axis=0), times))]

    apart = settings.clearance(cases.CHAIR)
    assert arrival("straight") < 1.3 - apart
    assert 2.3 - apart < arrival("geodesic") < 2.6 - apart


def test_ways_that_turn_too_often_are_not_relied_on(monkeypatch):
    case = walkers.corridor_case(np.random.default_rng(0))
    plain = straight(case).model().ticks
    assert (case.model().ticks != plain).any()
    monkeypatch.setattr(geodesic_module, "MOST_SWEEPS", 1)
    assert (case.model().ticks == plain).all()


@pytest.mark.parametrize("blind", [False, True])
def test_a_device_finds_what_the_host_finds(blind):
    case = walkers.corridor_case(np.random.default_rng(0), cell=0.1)
    places = [
        case.position,
        tuple(p + d for p, d in zip(case.position, (0.3, -0.1, 0.2), strict=True)),
    ]
    turn = 1.5 * np.pi if blind else 2 * np.pi
    scans = [
        exact.sweep(case.world, place, 1081, turn, 6.0, 10.0 + 0.1 * k)
        for k, place in enumerate(places)
    ]
    settings = case.settings.changed(
        blind_speed=0.0 if blind else None, clear_radius=0.85 if blind else 0.0
    )

    def found():
        first = FutureModel.from_scan(scans[0], case.robot, settings)
        second = FutureModel.from_scan(scans[1], case.robot, settings, first)
        return [device.host(model.ticks).tobytes() for model in (first, second)]

    expected = found()
    assert found() == expected
    with device.forced():
        assert found() == expected


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        (dict(cones="round"), "cones"),
        (dict(cones="geodesic", mode="hybrid"), 'cones="straight"'),
        (dict(cones="geodesic", blind_speed=0.5), "leave blind_speed out"),
    ],
)
def test_cones_that_would_promise_too_much_are_refused(changes, named):
    with pytest.raises(ValueError, match=named):
        Settings(**changes)
