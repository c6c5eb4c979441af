"""The tracker's parts: segments, centres, assignment, the IMM, forecasts, and their judge."""

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import IMMEstimator
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

import passpmp_ti as pti
from passpmp_ti.bench.reliability import Reliability, touch_chance
from passpmp_ti.tracking import Forecast, Sighting, follow, imm, modes
from passpmp_ti.tracking.assignment import matched
from passpmp_ti.tracking.detections import detect
from passpmp_ti.tracking.forecast import forecast
from passpmp_ti.tracking.segments import segments_of
from passpmp_ti.tracking.visibility import seen_empty

CHECK = settings(max_examples=40, deadline=None, derandomize=True)
PEOPLE = pti.Settings(object_speed=2.0, object_width=0.4)
HALF = np.radians(0.5)


def sighting(ranges, *, first=0.0, increment=HALF, closed=False, **changes):
    """Beams counter-clockwise; nan: lost; 9 or more: nothing."""
    ranges = np.asarray(ranges, dtype=float)
    lost = np.isnan(ranges)
    given_ = {"movable": ~lost & (np.nan_to_num(ranges, nan=9.0) < 9.0), "lost": lost, **changes}
    return Sighting(
        origin=(0.0, 0.0), bearings=first + increment * np.arange(len(ranges)), ranges=ranges,
        increment=increment, closed=closed, range_max=9.0, **given_,
    )  # fmt: skip


def picture(found, beams):
    """A letter a beam: which segment it belongs to."""
    letters = np.full(beams, ".")
    letters[found.beams] = np.array(list("abcdef"))[found.label]
    return "".join(letters)


def disc_ranges(bearings, centre, radius):
    """Ranges [n] of rays from the origin to a disc; inf beside it."""
    across = centre[0] * np.sin(bearings) - centre[1] * np.cos(bearings)
    along = centre[0] * np.cos(bearings) + centre[1] * np.sin(bearings)
    square = radius**2 - across**2
    hit = (square > 0) & (along > 0)
    return np.where(hit, along - np.sqrt(np.maximum(square, 0.0)), np.inf)


@pytest.mark.parametrize(
    ("ranges", "drawn"),
    [
        ([2, 2, 2, 9, 2, 2, 9], "aaa.bb."),  # a beam that sees past parts
        ([2, 2, 2, 2.9, 2.9, 9], "aaabb."),  # so does a jump
        ([2, 2, np.nan, 2, 2, 9], "aa.aa."),  # a lost beam does not
        ([9, 2, 2.05, 2.1, 9], ".aaa."),
        ([9, 9, 9], "..."),
    ],
)
def test_returns_part_where_something_is_seen_between_them_or_they_are_far_apart(ranges, drawn):
    assert picture(segments_of(sighting(ranges), PEOPLE), len(ranges)) == drawn


def test_the_break_point_grows_with_the_range():
    # the same step of 0.35 m is a break near by, but no more than the spacing far away
    for r, count in ((2.0, 2), (8.0, 1)):
        found = segments_of(sighting([r, r, r + 0.35, r + 0.35], increment=np.radians(1)), PEOPLE)
        assert len(found.first) == count


def test_a_segment_goes_on_round_the_back_of_a_closed_sweep():
    ranges = np.full(720, 9.0)
    ranges[[0, 1, 2, 718, 719]] = 3.0
    for closed, count in ((True, 1), (False, 2)):
        found = segments_of(sighting(ranges, closed=closed), PEOPLE)
        assert len(found.first) == count
    centre, _, _ = detect([sighting(ranges, closed=True)], PEOPLE).placed()
    assert abs(centre[0, 1]) < 0.02


def test_a_wall_is_no_object():
    bearings = np.radians(0.5) * np.arange(-200, 201)
    wall = np.minimum(2.0 / np.maximum(np.cos(bearings), 0.25), 9.0)
    assert len(segments_of(sighting(wall, first=bearings[0]), PEOPLE).first) == 0
    board = np.where(np.abs(bearings) < 0.2, wall, 9.0)
    assert len(segments_of(sighting(board, first=bearings[0]), PEOPLE).first) == 1


@CHECK
@given(distance=st.floats(1.0, 6.0), bearing=st.floats(-3.0, 3.0), radius=st.floats(0.21, 0.8))
def test_the_centre_of_a_disc_is_found_behind_its_near_side(distance, bearing, radius):
    distance += radius
    bearings = np.radians(0.25) * np.arange(-720, 720)
    centre = distance * np.array([np.cos(bearing), np.sin(bearing)])
    ranges = np.minimum(disc_ranges(bearings, centre, radius), 9.0)
    seen = sighting(ranges, first=bearings[0], increment=np.radians(0.25), closed=True)
    found = detect([seen], PEOPLE)
    assert found.count == 1
    place, deviation, body = found.placed()
    spacing = distance * np.radians(0.25)
    assert np.hypot(*(place[0] - centre)) < 2.5 * spacing + 0.01
    assert abs(body[0] - radius) < 2.5 * spacing + 0.01
    assert deviation[0] > 0


RANGES = st.one_of(st.floats(0.05, 10.0), st.sampled_from([np.nan, np.inf, 2.0, 2.0, 2.1]))


@CHECK
@given(
    sweeps=st.lists(st.lists(RANGES, min_size=2, max_size=40), min_size=1, max_size=3),
    closed=st.booleans(),
)
def test_whatever_is_seen_each_return_has_a_track_unless_it_is_a_wall_s(sweeps, closed):
    tracks = None
    for k, ranges in enumerate(sweeps):
        increment = 2 * np.pi / len(ranges) if closed else 0.03
        seen = sighting(ranges, increment=increment, closed=closed)
        objects = np.zeros(len(ranges), dtype=bool)
        objects[segments_of(seen, PEOPLE).beams] = True
        tracks = follow(tracks, [seen, seen], 0.1 * k, PEOPLE)
        for owner in tracks.owner:
            assert ((owner >= 0) == objects).all()
            assert set(owner[owner >= 0]) <= set(tracks.ids)
        assert len(tracks.forecast(tracks.stamp + np.array([0.5])).radius) == len(tracks)


def test_who_is_half_hidden_is_placed_by_the_end_that_is_seen():
    bearings = np.radians(0.25) * np.arange(-720, 720)
    centre, radius = np.array([4.0, 0.0]), 0.5
    ranges = np.minimum(disc_ranges(bearings, centre, radius), 9.0)
    ranges[bearings < 0.03] = 1.0  # something wide in front; its own returns are labelled
    seen = sighting(
        ranges, first=bearings[0], increment=np.radians(0.25), movable=(ranges > 1) & (ranges < 9)
    )
    found = detect([seen], PEOPLE)
    blind, deviation, _ = found.placed()
    told, _, _ = found.placed(np.array([radius]))
    assert np.hypot(*(told[0] - centre)) < 0.06 < np.hypot(*(blind[0] - centre))
    assert deviation[0] > 0.1  # and is known to be placed badly
    assert not found.clear()[0]


def test_the_nearest_in_all_is_assigned_and_nobody_beyond_the_gate():
    mean = np.array([[0.0, 0.0], [1.0, 0.0]])
    covariance = np.tile(0.09 * np.eye(2), (2, 1, 1))
    centre = np.array([[1.1, 0.0], [0.4, 0.0], [5.0, 0.0]])
    far = np.full(2, 10.0)
    assert matched(mean, covariance, centre, np.full(3, 0.05), far).tolist() == [1, 0, -1]
    assert matched(mean, covariance, centre, np.full(3, 0.05), far * 0.03).tolist() == [1, -1, -1]
    assert matched(mean[:0], covariance[:0], centre, np.full(3, 0.05), far[:0]).tolist() == [-1] * 3


def test_ties_go_to_the_lowest_numbers():
    one, two = np.zeros((1, 2)), np.zeros((2, 2))
    P, far = np.tile(np.eye(2), (2, 1, 1)), np.full(2, 9.0)
    assert matched(two, P, one, np.ones(1), far).tolist() == [0]
    assert matched(one, P[:1], two, np.ones(2), far[:1]).tolist() == [0, -1]
    assert matched(two, P, two, np.ones(2), far).tolist() == [0, 1]


def test_a_place_is_empty_only_where_beams_go_past_it():
    bearings = np.radians(1.0) * np.arange(-90, 91)
    ranges = np.full(181, 9.0)
    ranges[80:101] = 2.0  # something in the middle of the field, 2 m off
    ranges[40:60] = np.nan
    seen = sighting(ranges, first=bearings[0], increment=np.radians(1.0))
    ask = {
        "before it": (1.5, 0.0), "behind it": (4.0, 0.0), "in the open": (0.0, 4.0),
        "out of the field": (-3.0, 0.0), "out of range": (0.1, 12.0),
        "on lost beams": (2.9, -2.4),
    }  # fmt: skip
    share = seen_empty(np.array(list(ask.values())), np.full(len(ask), 0.3), [seen])
    assert dict(zip(ask, share.tolist(), strict=True)) == {
        "before it": 1.0, "behind it": 0.0, "in the open": 1.0, "out of the field": 0.0,
        "out of range": 0.0, "on lost beams": 0.0,
    }  # fmt: skip


def some_bank(count, seed=0, speed=2.0):
    """Tracks that were met a few times."""
    generator = np.random.default_rng(seed)
    place = generator.uniform(-5, 5, (count, 2))
    velocity = generator.uniform(-1, 1, (count, 2))
    bank = imm.born(place, np.full(count, 0.05), speed)
    for k in range(1, 6):
        bank = imm.predicted(bank, 0.1, speed)
        seen = place + 0.1 * k * velocity + generator.normal(0, 0.02, place.shape)
        bank = imm.updated(bank, seen, np.full(count, 0.05), speed)
    return bank


def test_the_bank_does_what_filterpys_estimator_does():
    bank = some_bank(3)
    speed, dt, R = 50.0, 0.1, 0.05  # a bound that cuts nothing
    for n in range(3):
        mine = bank.taken(np.array([n]))
        estimator = None
        for z in ([0.1, 0.2], [0.2, 0.1], [0.3, 0.3]):
            pace = float(modes.pace(*mine.combined(), speed)[0])
            filters = modes.filters(dt, pace)
            if estimator is None:
                for c, filter_ in enumerate(filters):
                    filter_.x, filter_.P = mine.mean[0, c][:, None], mine.covariance[0, c].copy()
                    filter_.R = R**2 * np.eye(2)
                estimator = IMMEstimator(filters, mine.weight[0], modes.switching(dt))
            for own, now in zip(estimator.filters, filters, strict=True):
                own.Q = now.Q
            estimator.predict()
            centre = mine.combined()[0][:, :2] + z
            estimator.update(centre[0][:, None])
            mine = imm.updated(imm.predicted(mine, dt, speed), centre, np.array([R]), speed)
            theirs = np.stack([f.x[:, 0] for f in estimator.filters])
            assert np.allclose(mine.mean[0], theirs, atol=1e-9)
            assert np.allclose(mine.covariance[0], [f.P for f in estimator.filters], atol=1e-9)
            assert np.allclose(mine.weight[0], estimator.mu, atol=1e-5)


def test_constant_velocity_has_filterpys_white_noise():
    F, Q = modes.matrices(0.25)
    for c, mode in enumerate(modes.MODES):
        if not np.isfinite(mode.settling):
            one = Q_continuous_white_noise(2, 0.25, spectral_density=mode.restlessness)
            assert np.allclose(Q[c], np.kron(one, np.eye(2)))
            assert np.allclose(F[c], np.kron([[1, 0.25], [0, 1]], np.eye(2)))


def test_many_small_steps_are_one_large_one():
    F, Q = modes.propagation((0.1,) * 24)
    once_F, once_Q = modes.propagation((2.4,))
    assert np.allclose(F[:, -1], once_F[:, 0])
    assert np.allclose(Q[:, -1], once_Q[:, 0])


def forecast_of(bank, ahead, speed=2.0):
    return forecast(bank, np.full(len(bank), 0.3), 5.0, 5.0 + np.asarray(ahead), speed)


@CHECK
@given(count=st.integers(1, 5), seed=st.integers(0, 50), speed=st.sampled_from([0.0, 2.0, 20.0]))
def test_forecasts_are_definite_and_keep_to_the_bound(count, seed, speed):
    bank = some_bank(count, seed, speed)
    ahead = np.array([0.0, 0.1, 0.7, 2.4, 8.0])
    found = forecast_of(bank, ahead, speed)
    fast = np.hypot(found.mean[..., 2], found.mean[..., 3])
    assert fast.max() <= speed + 1e-6
    now = np.linalg.eigvalsh(bank.covariance[..., :2, :2])[..., -1, None] ** 0.5
    spread = np.linalg.eigvalsh(found.covariance[..., :2, :2])[..., -1] ** 0.5
    assert (spread <= now + 0.5 * max(speed, modes.SLOWEST) * ahead + 1e-6).all()
    assert np.allclose(found.weight.sum(axis=1), 1.0)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"covariance": -np.eye(4)}, "positive definite; its least eigenvalue is -1"),
        ({"covariance": np.eye(4) + np.eye(4, k=1)}, "must be symmetric"),
        ({"weight": np.array([[0.7]])}, "sum to 1; divide it by its sum"),
        ({"radius": np.array([-1.0])}, "must be >= 0"),
        ({"mean": np.full((1, 1, 1, 4), np.nan)}, "must be finite"),
        ({"mean": np.zeros((1, 1, 2, 4))}, "must have shape"),
    ],
)
def test_a_forecast_that_is_none_is_refused(change, told):
    good = {
        "times": np.array([1.0]), "weight": np.array([[1.0]]), "mean": np.zeros((1, 1, 1, 4)),
        "covariance": np.eye(4).reshape(1, 1, 1, 4, 4), "radius": np.array([0.3]),
    }  # fmt: skip
    Forecast(**good)
    if "covariance" in change:
        change = {"covariance": change["covariance"].reshape(1, 1, 1, 4, 4)}
    with pytest.raises(ValueError, match=told):
        Forecast(**{**good, **change})


def test_times_before_the_stamp_are_refused():
    with pytest.raises(ValueError, match="none may lie before"):
        forecast_of(some_bank(1), [-0.1, 0.4])


def test_the_chance_of_a_touch_is_that_of_draws():
    mean = np.array([[[0.3, -0.2], [2.0, 1.0]]])
    covariance = np.array([[[[0.5, 0.3], [0.3, 0.4]], [[0.01, 0.0], [0.0, 1.0]]]])
    weight, place, reach = np.array([[0.7, 0.3]]), np.array([[0.5, 0.4]]), np.array([0.9])
    chance = touch_chance(weight, mean, covariance, place, reach)[0]
    # midpoints of squares of 2 mm
    axis = np.arange(-0.9, 0.9, 0.002) + 0.001
    x, y = np.meshgrid(axis, axis)
    inside = np.hypot(x, y) < 0.9
    at = place[0] + np.stack([x[inside], y[inside]], axis=1)
    density = sum(
        w * multivariate_normal(m, c).pdf(at)
        for w, m, c in zip(weight[0], mean[0], covariance[0], strict=True)
    )
    assert chance == pytest.approx(density.sum() * 0.002**2, abs=2e-4)


def test_promises_that_are_kept_are_reliable_and_others_are_not():
    generator = np.random.default_rng(0)
    chance = generator.uniform(size=40_000)
    came = generator.uniform(size=40_000) < chance
    assert Reliability.of(chance, came).worst < 0.03
    assert Reliability.of(chance, np.zeros(40_000, dtype=bool)).worst > 0.9
