"""Certificates of plans that rest on the size of objects: the verifier knows where nobody fits."""

from dataclasses import replace

import numpy as np
import pytest
from oracle import attack, cases, exact, gridless, hidden
from test_certificate import drive

import passpmp_verify.opening as opening
import passpmp_verify.raster as raster
from passpmp_ti import CarLike, DifferentialDrive, Settings
from passpmp_verify.document import CertificateError, read
from passpmp_verify.pieces import joined, split
from passpmp_verify.reader import certificate_of
from passpmp_verify.verify import verify, verify_file

CAR, CHAIR = CarLike(), DifferentialDrive(wheel_speed=2.0)


def among_posts(seed):
    """(case, points [n, 2], times [n]): posts whose shadows are narrower than objects up to the
    wall behind them, or, without a wall, until they have grown wide enough; half for a car."""
    generator = np.random.default_rng([31, seed])
    robot, scale = ((CHAIR, 1.0), (CAR, 5.0))[seed % 2]
    settings = Settings.for_robot(
        robot, object_radius=scale * float(generator.uniform(0.15, 0.3)),
        object_speed=scale * float(generator.choice([0.5, 1.0])),
        localisation_error=scale * float(generator.choice([0.0, 0.02])),
    )  # fmt: skip
    boxes = [
        exact.box(
            *(scale * generator.uniform((2, -2.5), (3.2, 2.5))),
            *(scale * generator.uniform(0.08, 0.25, 2)), generator.uniform(0, 3),
        )
        for _ in range(4)
    ]  # fmt: skip
    if seed % 4 < 2:
        tilt = generator.uniform(-0.2, 0.2)
        boxes.append(exact.box(4.2 * scale, 0, 0.5 * scale, 14 * scale, tilt))
    world, place = exact.world_of(boxes), (0.0, 0.0, 0.0)
    scan = exact.sweep(world, place, 720, 2 * np.pi, 7 * scale, 10.0)
    case = cases.believed(cases.Case(robot, settings, world, [scan], place), generator)
    points = scale * generator.uniform((0.5, -4), (5.2, 4), (1500, 2)) + case.position[:2]
    return case, points, 10 + generator.uniform(0, 0.8, 1500)


def of_points(case):
    """The same, but a point may hide in every sliver."""
    return replace(case, settings=case.settings.changed(object_radius=0.0))


def need_of(case):
    """What must be free about the robot's disc [m]."""
    s = case.settings
    return case.robot.disc_radius + s.tracking_error + 2 * s.localisation_error


def test_what_the_planner_calls_free_by_the_size_of_objects_is_free():
    missed = 0
    for seed in range(5):
        case, points, times = among_posts(seed)
        need = need_of(case)
        free = gridless.gridless(case).free(points, need, times)
        before = gridless.gridless(of_points(case)).free(points, need, times)
        claimed = ~case.model().occupied(points, times)
        assert free[before | claimed].all(), f"seed {seed}"
        missed += int((claimed & ~before).sum())
    assert missed > 100, "where a point may hide the planner would prove as much"


def attacked_at_the_last_moment(case, points, whose, generator):
    """(how many points are free for longer than if points could hide, how many of those attackers
    on the case `whose` touch just before the verifier says that somebody may)."""
    need, settings = need_of(case), case.settings
    to_unseen, to_source, _ = gridless.gridless(case).margins(points)
    sooner = gridless.gridless(of_points(case)).margins(points)[1]
    chosen = (to_unseen > need) & (to_source > np.maximum(sooner, need) + 0.01)
    elapsed = (to_source[chosen] - need) / settings.object_speed - settings.stamp_error - 1e-6
    states = np.zeros((int(chosen.sum()), 5))
    states[:, :2] = points[chosen]
    true = case.true_states(states, generator)[:, :2]
    attackers, radius = hidden.hidden_discs(whose, 1000, generator), case.robot.disc_radius
    # beyond what a day is long the numbers are of no use
    age = case.age(case.scans[0].stamp + np.minimum(elapsed, 1e3))
    touched = attack.reaches(true, age, attackers, radius, case.blockers)
    return len(true), int(touched.sum())


def test_nobody_of_the_declared_size_comes_before_the_verifier_says_that_somebody_may():
    gained = by_smaller = 0
    for seed in range(5):
        case, points, _ = among_posts(seed)
        generator = np.random.default_rng([32, seed])
        later, touched = attacked_at_the_last_moment(case, points, case, generator)
        assert touched == 0, f"seed {seed}"
        by_smaller += attacked_at_the_last_moment(case, points, of_points(case), generator)[1]
        gained += later
    assert gained > 2000
    assert by_smaller > 500


def hidden_opening(case):
    """The opened region of a case."""
    model, s = gridless.gridless(of_points(case)), case.settings
    pieces = joined([model._border, model._sources])
    return opening.Opening(model.views, pieces, s.object_radius - s.localisation_error)


def test_whoever_fits_is_in_the_opened_region():
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    rim = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    asked = slivers = 0
    for seed in range(8):
        case, _, _ = among_posts(seed)
        found = hidden_opening(case)
        squares = found._raster
        # a disc as large as it must be, its error included, wherever no beam excludes it
        attackers = hidden.hidden_discs(case, 400, np.random.default_rng([33, seed]))
        radius = case.settings.object_radius
        centres = attackers.centres + np.array(case.error)
        within = np.abs(centres - (squares.x, squares.y) - 0.5 * squares.count * squares.side)
        for centre in centres[within.max(axis=1) < 0.5 * squares.count * squares.side - 2 * radius]:
            for share in (0.0, 0.5, 1.0):
                points = centre + share * radius * rim
                assert found._opened.ravel()[squares.flat(points)].all(), f"seed {seed}"
            asked += 1
        slivers += int(found._sliver.sum())
    assert asked > 300
    assert slivers > 1000


def one_post():
    """(opening, pieces of its shadow's edges, bearing of an edge [rad]): a post of 0.2 m, 2 m
    ahead, that nothing is behind; discs of 0.2 m."""
    world = exact.world_of([exact.box(2.0, 0.0, 0.2, 0.2)])
    settings = Settings.for_robot(CHAIR, object_radius=0.2)
    scan = exact.sweep(world, (0.0, 0.0, 0.0), 2880, 2 * np.pi, 7.0, 10.0)
    case = cases.Case(CHAIR, settings, world, [scan], (0.0, 0.0, 0.0))
    edges = gridless.gridless(of_points(case))._sources
    edges = edges.take((edges.half > 1.0) & (edges.low == edges.high))
    assert len(edges) == 2
    return hidden_opening(case), split(edges, 0.01)[0], np.arctan(0.1 / 1.9)


def test_who_comes_out_of_a_sliver_came_in_at_its_mouth():
    found, edges, bearing = one_post()
    # where the first disc that fits into the shadow touches its edges, and its nearest point
    touch, tip = 0.2 / np.tan(bearing), 0.2 / np.sin(bearing) - 0.2
    ranges = np.hypot(*edges.middle.T)
    assert touch > 3.5
    origins = found.origins(edges.take(ranges < 2.5))
    assert len(origins.border) == 0
    mouths = origins.mouths.middle
    assert (np.abs(np.arctan2(mouths[:, 1], mouths[:, 0])) < bearing + 0.02).all()
    far = np.hypot(*mouths.T)
    assert far.min() < tip + origins.half
    # the squares let in discs that are smaller by no more than two of them on each side
    assert far.min() > 0.8 * tip
    assert origins.distance_to(np.zeros((1, 2)))[0] == pytest.approx(far.min() - origins.half)


def test_who_comes_over_the_border_of_the_opened_region_comes_from_there():
    found, edges, bearing = one_post()
    ranges = np.hypot(*edges.middle.T)
    beyond = edges.take(ranges > 0.2 / np.tan(bearing))
    assert len(found.origins(beyond).border) == len(beyond)
    assert len(found.origins(beyond).mouths) == 0
    assert len(found.origins(edges.take(ranges < 2.5)).border) == 0


def test_squares_that_are_called_seen_are_so_in_every_point():
    generator = np.random.default_rng(3)
    for seed in range(4):
        case, _, _ = among_posts(seed)
        found, views = hidden_opening(case), gridless.gridless(of_points(case)).views
        squares = found._raster
        j, i = np.nonzero(~found._opened & ~found._sliver)
        some = generator.integers(len(j), size=4000)
        inside = generator.uniform(-0.5, 0.5, (4000, 2)) * squares.side
        points = squares.centres(j[some], i[some]) + inside
        assert np.any([view.proves(points) for view in views], axis=0).all()


def test_squares_grow_as_far_as_they_are_told():
    generator = np.random.default_rng(4)
    squares = np.zeros((64, 64), dtype=bool)
    squares[tuple(generator.integers(5, 59, (2, 12)))] = True
    widths = (4, 4, 3, 1)
    j, i = np.nonzero(squares)
    rows, columns = np.indices(squares.shape)
    expected = np.zeros_like(squares)
    for one, other in zip(j, i, strict=True):
        for k, width in enumerate(widths):
            expected |= (np.abs(rows - one) == k) & (np.abs(columns - other) <= width)
    assert (raster.grown(squares, widths) == expected).all()


def test_where_the_squares_would_be_too_coarse_everything_may_hide(monkeypatch):
    case, points, _ = among_posts(0)
    fine = gridless.gridless(case).margins(points)[1]
    monkeypatch.setattr(raster, "MOST", 64)
    coarse = gridless.gridless(case).margins(points)[1]
    assert (coarse == gridless.gridless(of_points(case)).margins(points)[1]).all()
    assert (coarse < fine).any()


# certificates ------------------------------------------------------------------------------------


CHAIR_ROAD = exact.world_of(
    [exact.box(x, y, 0.12, 0.12) for x in (1.2, 2.6, 4.0) for y in (1.0, -1.0)]
    + [exact.box(2.5, 1.4, 9.0, 0.2), exact.box(2.5, -1.4, 9.0, 0.2)]
)
CAR_ROAD = exact.world_of(
    [exact.box(x, y, 0.6, 0.6) for x in (8, 16, 24, 32) for y in (5.0, -5.0)]
    + [exact.box(20, 9, 80, 2), exact.box(20, -9, 80, 2)]
)


@pytest.mark.parametrize("who", ["chair", "car"])
def test_plans_that_rest_on_the_size_of_objects_verify_only_with_it(who, tmp_path):
    if who == "chair":
        robot, world, goal, range_max, cycles = CHAIR, CHAIR_ROAD, (5.0, 0.0), 6.0, 7
        settings = Settings.for_robot(robot, object_radius=0.2, object_speed=1.0, particles=20)
    else:
        robot, world, goal, range_max, cycles = CAR, CAR_ROAD, (60.0, 0.0), 50.0, 13
        settings = Settings.for_robot(
            robot, object_radius=1.0, object_speed=5.0, cell=0.4, particles=20
        )
    written = drive(tmp_path, robot, settings, world, goal, cycles, range_max=range_max)
    assert [v.reason for path, _ in written if not (v := verify_file(path)).safe] == []
    documents = [read(path) for path, _ in written]
    for document in documents:
        assert document["assumptions"]["object_radius"] == settings.object_radius
        document["assumptions"]["object_radius"] = 0.0
    assert sum(not verify(certificate_of(d)).safe for d in documents) >= 3
    del documents[0]["assumptions"]["object_radius"]
    with pytest.raises(CertificateError, match="object_radius"):
        certificate_of(documents[0])
