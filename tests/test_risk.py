"""The risk of motions: a bound on what happens, and of use (eqs. 11 and 12, mended)."""

import functools

import numpy as np
import pytest
from oracle import cases
from oracle.forecasts import Mover, any_mover, forecast_of

import passpmp_ti as pti
from passpmp_ti import FutureModel, device
from passpmp_ti.grid.body import Body, to_poses
from passpmp_ti.grid.chances import chances_of
from passpmp_ti.grid.spans import spans_of
from passpmp_ti.kernels.check import trace
from passpmp_ti.kernels.printed import printed_path_risk, printed_states_risk
from passpmp_ti.kernels.risk import path_risk, states_risk

ROBOT = pti.DifferentialDrive()
SETTINGS = pti.Settings.for_robot(ROBOT)
BODY = Body.of(ROBOT, SETTINGS)
SIZE = 320
FREE = np.full((SIZE, SIZE), 65535, dtype=np.uint16)
"""Nothing hidden ever comes."""
COUNTS = BODY.placed((-SIZE // 2, -SIZE // 2), SIZE)
STAMP = 100.0
TIMES = STAMP + 0.1 * np.arange(30)
STEP = SETTINGS.time_step
MOTIONS = ("standing", "crossing", "following", "head-on", "braking", "turning")


def chances(movers, **given):
    forecast = forecast_of(movers, TIMES)
    options = dict(speed=2.5) | given
    return chances_of(forecast, ROBOT, SETTINGS, (0.0, 0.0), STAMP, 100_000, (0.0, 0.0), **options)


def along(made, states, ticks, arrival=FREE, body=BODY, counts=COUNTS):
    """[3] risk of following a path: of what is tracked, of what is hidden, of anything."""
    chance = np.zeros(3, dtype=np.float32)
    path_risk(
        body.kind, arrival, body.numbers, counts, *made.hazard, to_poses(states, (0.0, 0.0)),
        ticks.astype(np.int32), np.zeros((len(states), 2), dtype=np.float32), chance,
    )  # fmt: skip
    return chance


def from_states(made, states, ticks, arrival=FREE, body=BODY, counts=COUNTS, printed=False):
    """[N] least braking risk, [N] control."""
    poses, ticks = to_poses(states, (0.0, 0.0)), ticks.astype(np.int32)
    chance = np.zeros(len(states), dtype=np.float32)
    control = np.full(len(states), -1, dtype=np.int32)
    if printed:
        printed_states_risk(
            body.kind, arrival, body.numbers, counts, body.braking, *made.windows, poses, ticks,
            chance, control,
        )  # fmt: skip
    else:
        spans = spans_of(arrival, counts, len(arrival))
        states_risk(
            body.kind, arrival, spans, body.numbers, counts, body.braking, *made.hazard, poses,
            ticks, chance, control,
        )  # fmt: skip
    return chance, control


def motion(kind, rng, seconds=2.5):
    """[n, 5] states a time step apart; it ends where the robot comes to rest."""
    t = STEP * np.arange(round(seconds / STEP) + 1)
    speed = np.full(len(t), rng.uniform(0.4, 2.0))
    if kind == "standing":
        # slow enough to stand, fast enough to count as moving
        speed[:] = 1e-4
    if kind == "braking":
        speed = np.maximum(speed - ROBOT.acceleration * t, 0.0)
    turn = rng.uniform(-1, 1) if kind == "turning" else 0.0
    heading = rng.uniform(-np.pi, np.pi) + turn * t
    way = speed[:-1, None] * np.stack([np.cos(heading[:-1]), np.sin(heading[:-1])], -1) * STEP
    states = np.zeros((len(t), 5))
    states[1:, :2] = np.cumsum(way, axis=0)
    states[:, 2] = heading
    states[:, 3] = speed + 0.5 * turn * ROBOT.track
    states[:, 4] = speed - 0.5 * turn * ROBOT.track
    rest = np.flatnonzero(speed == 0.0)
    return states[: rest[0] + 1] if len(rest) else states


def meeting(kind, rng, states):
    """Somebody whose way comes near the robot's, not in it when it begins."""
    k = rng.integers(len(states) // 5, len(states))
    heading = states[0, 2]
    mine = {"following": heading, "head-on": heading + np.pi, "crossing": heading + np.pi / 2}
    way = mine.get(kind, rng.uniform(-np.pi, np.pi)) + rng.normal(0, 0.2)
    velocity = rng.uniform(0.3, 1.8) * np.array([np.cos(way), np.sin(way)])
    start = states[k, :2] + rng.normal(0, 0.8, 2) - velocity * k * STEP
    if np.hypot(*start) < 0.7:
        start = start + 1.2 * np.array([np.cos(way + 2), np.sin(way + 2)])
    return any_mover(rng, start, velocity)


@functools.cache
def promised_and_met(kind, seed, movers, futures):
    """Risk computed; frequency, chance of each moment's contact [n] of futures drawn."""
    rng = np.random.default_rng(seed)
    states = motion(kind, rng)
    others = [meeting(kind, rng, states) for _ in range(movers)]
    every = np.arange(0, len(states), 10)
    if every[-1] != len(states) - 1:
        every = np.append(every, len(states) - 1)
    computed = along(chances(others), states[every], 1000 * STEP * every)[0]
    touch = ROBOT.disc_radius + 0.3
    met = np.zeros((len(states), futures), dtype=bool)
    for other in others:
        places = other.futures(futures, STEP, len(states) - 1, rng)
        off = places - states[:, None, :2]
        met |= off[..., 0] ** 2 + off[..., 1] ** 2 <= touch**2
    return computed, met.any(axis=0).mean(), met.mean(axis=1)


def compared(seeds, movers, futures):
    """[M, 5]: computed, met, and what independent steps of 0.1 s and of 10 ms and the worst moment
    would say."""
    rows = []
    for kind in MOTIONS:
        for seed in seeds:
            computed, met, moments = promised_and_met(kind, seed, movers, futures)
            noise = 3 * np.sqrt(max(met * (1 - met), 1 / futures) / futures)
            assert computed >= met - noise, (kind, seed)
            steps = [1 - np.prod(1 - moments[::k]) for k in (10, 1)]
            rows.append([computed, met, *steps, moments.max()])
    rows = np.array(rows)
    return rows[(rows[:, 1] >= 0.01) & (rows[:, 1] <= 0.9)]


def test_risk_bounds_the_frequency_of_drawn_futures_and_is_of_use():
    rows = compared(range(4), movers=1, futures=800)
    assert np.median(rows[:, 0] / rows[:, 1]) <= 2.0


@pytest.mark.campaign
@pytest.mark.parametrize("movers", [1, 3])
def test_risk_bounds_the_frequency_of_many_drawn_futures(movers):
    rows = compared(range(100, 130), movers=movers, futures=3000)
    ratios = rows[:, [0, 2, 3, 4]] / rows[:, 1:2]
    print(f"{len(rows)} motions, {movers} movers: computed, 0.1 s, 10 ms, worst moment / met")
    for share in (0.1, 0.5, 0.9):
        print(share, np.round(np.quantile(ratios, share, axis=0), 2))
    assert np.median(ratios[:, 0]) <= 3.0
    # the worst moment misses the others
    assert np.median(ratios[:, 3]) < 0.8


def braking_path(state, control):
    """[n, 5] states of a braking from `state` to rest, a time step apart."""
    path = np.zeros((1000, 7), dtype=np.float32)
    length = np.zeros(1, dtype=np.int32)
    trace(
        BODY.kind, BODY.numbers, to_poses(state[None], (0.0, 0.0)), BODY.braking[control][None],
        np.array([-1], dtype=np.int32), path, length,
    )  # fmt: skip
    path = path[: length[0]]
    return np.column_stack([path[:, :2], path[:, 4:]]).astype(float)


def test_the_least_braking_risk_is_that_of_the_path_it_names():
    rng = np.random.default_rng(4)
    made = chances([any_mover(rng, rng.uniform(-2, 2, 2), rng.normal(0, 1, 2)) for _ in range(4)])
    states = np.zeros((12, 5))
    states[:, 2] = rng.uniform(-3, 3, 12)
    states[:, 3:] = rng.uniform(0.3, 2.0, (12, 2))
    ticks = rng.integers(100, 400, 12)
    least, best = from_states(made, states, ticks)
    for n, state in enumerate(states):
        risks = []
        for control in range(len(BODY.braking)):
            path = braking_path(state, control)
            at = np.append(np.arange(0, len(path) - 1, 10), len(path) - 1)
            risks.append(along(made, path[at], ticks[n] + 10 * at)[2])
        assert best[n] == int(np.argmin(risks))
        assert least[n] == pytest.approx(min(risks), rel=1e-4, abs=1e-6)


def test_at_rest_a_robot_is_at_no_risk():
    made = chances([Mover(np.zeros(4), 0.1 * np.eye(4), 0.1)])
    least, best = from_states(made, np.zeros((1, 5)), np.array([100]))
    assert least[0] == 0.0
    assert best[0] == 0
    assert along(made, np.zeros((3, 5)), np.array([100, 200, 300]))[2] == 0.0


def test_of_equal_brakings_the_first_is_named():
    _, best = from_states(chances([]), np.array([[0, 0, 0, 1.0, 1.0]]), np.array([100]))
    assert best[0] == 0


def test_sample_lengths_hardly_matter():
    rng = np.random.default_rng(6)
    for kind in ("crossing", "head-on"):
        states = motion(kind, rng)
        made = chances([meeting(kind, rng, states)])
        ticks = 1000 * STEP * np.arange(len(states))
        fine, coarse = along(made, states, ticks)[0], along(made, states[::10], ticks[::10])[0]
        assert coarse == pytest.approx(fine, rel=0.12)
        # what is looked at less often is not thought safer
        assert coarse >= fine * 0.98


def test_as_printed_the_risk_of_a_long_path_vanishes():
    made = chances([Mover(np.array([1.0, 0.0, 0.0, 0.0]), 0.01 * np.eye(4), 0.01)] * 2)
    states = np.zeros((30, 5))
    states[:, 0] = 0.05 * np.arange(30)
    states[:, 3:] = 1.0
    ticks = (100 + 50 * np.arange(30)).astype(np.int32)
    each = np.zeros(30, dtype=np.float32)
    reached = np.full((SIZE, SIZE), 1, dtype=np.uint16)
    printed_path_risk(
        reached, BODY.numbers, COUNTS, *made.windows, to_poses(states, (0.0, 0.0)), ticks, each
    )
    # one of the objects is where the robot goes, for sure
    assert each.max() > 0.9
    # eq. 12: to collide it would have to collide all the time
    assert np.prod(each) < 1e-6
    assert from_states(made, states[:1], ticks[:1], reached, printed=True)[0][0] < 1e-6
    assert along(made, states, ticks)[0] > 0.9


def cases_of(count):
    for seed in range(count):
        generator = np.random.default_rng(seed)
        case = cases.random_case(generator, plain=True)
        model = FutureModel.from_scan(
            case.scans, case.robot, case.settings, static_map=case.static_map,
            position=case.position,
        )  # fmt: skip
        yield case, model, generator


def nothing_tracked(case, model, **given):
    times = model.stamp + 0.25 * np.arange(40)
    return chances_of(
        forecast_of([], times), case.robot, case.settings, case.position[:2], model.stamp,
        model.base_ticks, model.window.anchor, **given,
    )  # fmt: skip


def test_with_certainty_at_the_bound_the_layers_are_the_conservative_ones_cell_by_cell():
    for case, model, _ in cases_of(6):
        made = nothing_tracked(case, model, emergence=1.0, hidden_speeds=(1.0,))
        length = case.settings.layer_length
        for index in (0, 1, 4, 9):
            layer = made.layer(
                model.window, model.ticks, model.base + index * length,
                model.base + (index + 1) * length,
            )  # fmt: skip
            np.testing.assert_array_equal(layer, model.layer(index).astype(np.float32))


def test_slower_movers_that_may_not_come_leave_less_risk():
    case, model, _ = next(cases_of(1))
    window = model.base + 0.5, model.base + 0.6
    sure = nothing_tracked(case, model).layer(model.window, model.ticks, *window)
    some = nothing_tracked(case, model, emergence=0.2, hidden_speeds=(0.25, 0.5, 0.75, 1.0))
    some = some.layer(model.window, model.ticks, *window)
    assert (some <= sure).all()
    reached = (sure == 1.0) & (device.host(model.ticks) > 0)
    assert set(np.round(20 * some[reached], 4)) == {1.0, 2.0, 3.0, 4.0}
    # where nothing is proven there is no chance to speak of
    assert (some[device.host(model.ticks) == 0] == 1.0).all()


def test_with_certainty_at_the_bound_a_path_is_at_risk_where_the_check_says_so():
    found = set()
    for case, model, generator in cases_of(5):
        made = nothing_tracked(case, model)
        states, times = cases.random_states(case, 40, generator)
        ticks = model.ticks_of(times)
        for state, tick in zip(states, ticks, strict=True):
            path = np.repeat(state[None], 3, axis=0)
            speed = case.robot.speed(state)
            way = speed * np.array([np.cos(state[2]), np.sin(state[2])]) * case.settings.time_step
            path[:, :2] += np.arange(3)[:, None] * way
            at = tick + case.settings.step_ms * np.arange(3)
            touched = model.touched(path, (model.base_ticks + at) * 1e-3).any()
            chance = np.zeros(3, dtype=np.float32)
            path_risk(
                model.body.kind, model.ticks, model.body.numbers, model.counts, *made.hazard,
                to_poses(path, model.window.anchor), at.astype(np.int32),
                np.zeros((3, 2), dtype=np.float32), chance,
            )  # fmt: skip
            assert chance[1] == float(touched)
            found.add(bool(touched))
    assert found == {True, False}


def test_with_certainty_at_the_bound_states_are_safe_as_the_check_says():
    proven = []
    for case, model, generator in cases_of(4):
        made = nothing_tracked(case, model)
        states, times = cases.random_states(case, 200, generator)
        reach = np.hypot(*(states[:, :2] - np.array(case.position[:2])).T)
        # elsewhere the robot cannot be
        there = reach < 0.9 * case.robot.top_speed * (times - model.stamp)
        states, times = states[there], times[there]
        chance = np.zeros(len(states), dtype=np.float32)
        control = np.zeros(len(states), dtype=np.int32)
        states_risk(
            model.body.kind, model.ticks, model.spans, model.body.numbers, model.counts,
            model.body.braking, *made.hazard, to_poses(states, model.window.anchor),
            model.ticks_of(times), chance, control,
        )  # fmt: skip
        safe = model.passively_safe(states, times)
        proven.append(chance[safe] == 0.0)
        assert set(chance) <= {0.0, 1.0}
        # and the check gives up on some that are not touched
        assert (chance[~safe] == 1.0).mean() > 0.95
    # one look speaks for all places about a sample: some that the check proves are at risk here
    assert np.concatenate(proven).mean() > 0.5


def test_risks_of_two_runs_are_of_the_same_bytes():
    rng = np.random.default_rng(9)
    made = chances([any_mover(rng, rng.uniform(-2, 2, 2), rng.normal(0, 1, 2)) for _ in range(3)])
    states = np.zeros((50, 5))
    states[:, 2:] = rng.uniform(-1.5, 1.5, (50, 3))
    ticks = rng.integers(0, 1000, 50)
    runs = [from_states(made, states, ticks) for _ in range(2)]
    assert runs[0][0].tobytes() == runs[1][0].tobytes()
    assert runs[0][1].tobytes() == runs[1][1].tobytes()


def test_arrays_on_a_device_give_the_same_risk():
    rng = np.random.default_rng(11)
    movers = [any_mover(rng, rng.uniform(-2, 2, 2), rng.normal(0, 1, 2)) for _ in range(3)]
    states = np.zeros((20, 5))
    states[:, 2:] = rng.uniform(-1.5, 1.5, (20, 3))
    ticks = rng.integers(0, 1000, 20)
    here = from_states(chances(movers), states, ticks)[0]
    with device.forced():
        apart = from_states(chances(movers), states, ticks)[0]
    np.testing.assert_array_equal(here, apart)
