"""Windows and layers of tracked objects: sound at every place, whatever the covariance."""

import math

import numpy as np
import pytest
import taichi as ti
from oracle.forecasts import (
    Forecast,
    Mover,
    any_mover,
    disc_integral,
    forecast_of,
    gaussian,
    ring_flow,
)
from oracle.moments import Shape, bends_of
from scipy.special import erf

import passpmp_ti as pti
from passpmp_ti import device
from passpmp_ti.grid.chances import body_radius, chances_of, points_of, sample_steps
from passpmp_ti.kernels.hazard import hazard_at
from passpmp_ti.kernels.risk import Counts, Links, Numbers, Table, vec2

ROBOT = pti.DifferentialDrive()
SETTINGS = pti.Settings.for_robot(ROBOT)
STAMP = 100.0
RADIUS = body_radius(ROBOT, SETTINGS, sample_steps(SETTINGS) * SETTINGS.time_step)
TIMES = STAMP + 0.1 * np.arange(16)


def chances(forecast, **changes):
    given = dict(speed=2.0) | changes
    return chances_of(forecast, ROBOT, SETTINGS, (0.0, 0.0), STAMP, 100_000, (0.0, 0.0), **given)


@ti.kernel
def look(
    layers: Numbers,
    grids: Table,
    begins: Links,
    starts: Counts,
    odds: Numbers,
    tally: Counts,
    places: Table,  # [M, 5] x, y, ux, uy, tick
    out: Table,  # [M, 2] crossings a second, P
):
    for m in range(places.shape[0]):
        u = vec2(places[m, 2], places[m, 3])
        p = vec2(places[m, 0], places[m, 1])
        h = hazard_at(layers, grids, begins, starts, odds, p, places[m, 4])
        q = h[0] * u[0] * u[0] + h[1] * u[1] * u[1] + 2 * h[2] * u[0] * u[1]
        q += h[5] - 2 * (h[3] * u[0] + h[4] * u[1])
        out[m, 0] = ti.sqrt((h[0] + h[1]) * ti.max(q, 0.0)) + h[6]
        out[m, 1] = h[7]


def looked(made, places):
    out = np.zeros((len(places), 2), dtype=np.float32)
    look(*made.hazard, np.asarray(places, dtype=np.float32), out)
    return out


def random_looks(seed, movers=9, each=12):
    """Bounds and true values of crossings and chances, [M, 2] each, and the margins' product."""
    rng = np.random.default_rng(seed)
    bounds, truths, margins = [], [], []
    for _ in range(movers):
        mover = any_mover(rng, rng.uniform(-1.5, 1.5, 2), rng.normal(0, 1, 2))
        made = chances(forecast_of([mover], TIMES))
        places, truth = [], []
        while len(places) < each:
            t = rng.uniform(0.1, 1.4)
            mean, covariance = mover.at(t)
            p = rng.multivariate_normal(mean[:2], covariance[:2, :2] + RADIUS**2 * np.eye(2))
            u = rng.normal(0, 1, 2)
            touch = disc_integral(p, RADIUS + 0.3, mean, covariance)
            if np.hypot(*p) < 2 * t and touch > 1e-4:
                places.append([*p, *u, 1000 * t])
                truth.append([ring_flow(p, u, RADIUS + 0.3, mean, covariance), touch])
        bounds.append(looked(made, places))
        truths.append(truth)
        rows = made.rows[made.places[:, 0] >= 0]
        margins.append(np.full((each, 1), (rows[:, 20] * rows[:, 21]).max()))
    return np.concatenate(bounds), np.concatenate(truths), np.concatenate(margins)


def test_looks_between_nodes_and_moments_bound_the_true_integrals():
    bounds, truths, margins = random_looks(1)
    assert (bounds >= truths).all()
    # and are of use: crossings of correlated velocities within 2.5, chances within 1.5
    assert np.median(bounds[:, 0] / truths[:, 0]) < 2.5
    assert np.median(bounds[:, 1] / truths[:, 1]) < 1.5
    # without the margins they would fall short
    assert (bounds[:, 1] / margins[:, 0] < truths[:, 1]).any()


def test_nodes_hold_eq_15_of_correlated_covariances():
    rng = np.random.default_rng(3)
    for _ in range(6):
        mover = any_mover(rng, np.zeros(2), np.zeros(2))
        made = chances(forecast_of([mover], TIMES))
        row = int(rng.choice(np.flatnonzero(made.places[:, 0] >= 0)))
        first, columns, rows_of = made.places[row, :3]
        values = made.pool.reshape(-1, 6)[first : first + columns * rows_of]
        values = values.reshape(columns, rows_of, 6)
        clock = made.odds[int(made.odds[3]) :]
        mean, covariance = mover.at(clock[row] * 1e-3)
        frame = np.array([made.rows[row, 2:4], [-made.rows[row, 3], made.rows[row, 2]]])
        margin = None
        for i, j in ((0, 0), (2, 3), (columns // 2, 1), (1, rows_of // 2)):
            off = np.array([i / made.rows[row, 4], j / made.rows[row, 5]])
            true = disc_integral(mean[:2] + off @ frame, RADIUS + 0.3, mean, covariance)
            if true > 1e-3:
                margin = margin or values[i, j, 0] / true
                # every node is above by one and the same margin, within the stated 1e-3 and 4e-7
                assert values[i, j, 0] / true == pytest.approx(margin, rel=1.2e-3)
        assert 1.0 <= margin < 1.2


def test_rings_have_points_enough():
    # exp(k cos) over a ring: the trapezoidal rule against a dense one, with the weights cos^2
    for sharpness in (0.1, 1.0, 4.0, 16.0):
        k = sharpness * (sharpness + 4.5)
        for n in range(0, 3):
            count = int(points_of(np.array([sharpness]))[0])
            dense = np.cos(2 * np.pi * np.arange(4000) / 4000)
            few = np.cos(2 * np.pi * np.arange(count) / count)
            exact = (np.exp(k * (dense - 1)) * dense**n).mean()
            assert (np.exp(k * (few - 1)) * few**n).mean() == pytest.approx(exact, rel=1e-3)


def test_densities_are_bent_no_more_than_bends_say():
    rng = np.random.default_rng(5)
    steps = np.linspace(0, 1, 41)
    for _ in range(40):
        mover = any_mover(rng, np.zeros(2), rng.normal(0, 2, 2))
        t = rng.uniform(0.05, 1.0)
        length = rng.uniform(0.02, 0.1)
        moments = [mover.at(t + length * s) for s in steps]
        mean = np.array([moments[0][0], moments[-1][0]])
        covariance = np.array([moments[0][1], moments[-1][1]])
        bend = bends_of(Shape.of(covariance, 0.0), mean, covariance, length)[0]
        if bend < 1.3:
            places = rng.multivariate_normal(mean[0, :2], 4 * covariance[0, :2, :2], 200)
            along = np.array([gaussian(places, m[:2], c[:2, :2]) for m, c in moments])
            chord = (1 - steps)[:, None] * along[0] + steps[:, None] * along[-1]
            assert (along <= chord / math.cos(bend) * (1 + 1e-9)).all()


def test_sharp_objects_are_blurred_to_the_unsafe_side():
    # known to a millimetre: there or not there
    mover = Mover(np.array([1.0, 0.0, 0.0, 0.0]), np.diag([1e-6, 1e-6, 1e-4, 1e-4]), 1e-6)
    made = chances(forecast_of([mover], TIMES))
    inside = looked(made, [[1.0 - RADIUS - 0.25, 0.0, 0.0, 0.0, 500.0]])
    outside = looked(made, [[0.2, 0.99, 0.0, 0.0, 600.0]])
    assert inside[0, 1] >= 1.0
    assert outside[0, 1] < 0.05


def test_what_nobody_can_say_is_no_chance_but_risk():
    mover = any_mover(np.random.default_rng(0), np.ones(2), np.ones(2))
    made = chances(forecast_of([mover], TIMES))
    # where the robot cannot be, and after the forecast's end
    assert looked(made, [[5.0, 0.0, 0.0, 0.0, 200.0], [0.0, 0.0, 0.0, 0.0, 1600.0]])[:, 1].min() > 1


def test_far_objects_take_no_memory():
    rng = np.random.default_rng(0)
    movers = [any_mover(rng, np.array([30.0 + i, 0.0]), np.zeros(2)) for i in range(5)]
    made = chances(forecast_of(movers, TIMES))
    assert (made.places[:, 0] < 0).all()
    assert made.memory < 20_000


def test_nothing_tracked_is_no_risk():
    none = Forecast(
        TIMES, np.zeros((0, 3)), np.zeros((0, 3, 16, 4)), np.zeros((0, 3, 16, 4, 4)), np.zeros(0)
    )
    assert looked(chances(none), [[0.1, 0.0, 1.0, 0.0, 300.0]]).max() == 0.0


def test_components_count_by_their_weights():
    mover = any_mover(np.random.default_rng(2), np.array([0.5, 0.5]), np.zeros(2))
    one = forecast_of([mover], TIMES)
    three = Forecast(
        TIMES, np.array([[0.5, 0.3, 0.2]]), np.repeat(one.mean, 3, 1),
        np.repeat(one.covariance, 3, 1), one.radius,
    )  # fmt: skip
    places = [[0.3, 0.2, 0.5, 0.0, 400.0]]
    assert looked(chances(three), places) == pytest.approx(looked(chances(one), places), rel=1e-5)


def test_the_same_forecast_gives_the_same_bytes_also_on_a_device():
    rng = np.random.default_rng(8)
    movers = [any_mover(rng, rng.uniform(-1, 1, 2), np.ones(2)) for _ in range(4)]
    forecast = forecast_of(movers, TIMES)
    first, second = chances(forecast), chances(forecast)
    with device.forced():
        apart = chances(forecast)
        assert not isinstance(apart.layers, np.ndarray)
    for made in (second, apart):
        assert device.host(made.layers).tobytes() == first.layers.tobytes()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (dict(emergence=1.5), "emergence must be finite and >= 0 and <= 1"),
        (dict(hidden_speeds=()), "one share of the bound at least"),
        (dict(hidden_speeds=(0.5, 2.0)), "each between 0 and 1"),
    ],
)
def test_bad_input_is_refused(changes, message):
    mover = any_mover(np.random.default_rng(0), np.ones(2), np.ones(2))
    with pytest.raises(ValueError, match=message):
        chances(forecast_of([mover], TIMES), **changes)
    with pytest.raises(ValueError, match="equally spaced"):
        chances(forecast_of([mover], TIMES[[0, 1, 3]]))


def test_a_root_mean_square_with_two_over_pi_bounds_the_mean_size_of_a_normal_number():
    mean = np.linspace(0, 12, 4001)
    size = math.sqrt(2 / math.pi) * np.exp(-0.5 * mean**2) + mean * erf(mean / math.sqrt(2))
    assert (size <= np.sqrt(mean**2 + 2 / math.pi) * (1 + 1e-12)).all()
