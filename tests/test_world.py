"""Movers keep to what they declare: their speed, their clocks, clear of what stays."""

import gzip

import numpy as np
import pytest

from passpmp_ti.sim import geometry
from passpmp_ti.sim.movers import PathMovers
from passpmp_ti.sim.recordings import Recording, recorded_movers
from passpmp_ti.sim.splines import draw_spline_movers
from passpmp_ti.sim.world import World

BOUNDS = (0.0, 0.0, 100.0, 100.0)
BLOCK = np.array([[40.0, 40.0], [60.0, 40.0], [60.0, 60.0], [40.0, 60.0]])
EDGE = (-20.0, -20.0, 20.0, 20.0)
NO_WALLS = np.zeros((0, 4))


@pytest.fixture(scope="module")
def crowd():
    world = World(BOUNDS, [BLOCK])
    return draw_spline_movers(8, (1.0, 1.5), (5.0, 20.0), BOUNDS, world.clearance,
                              (10.0, 50.0, 15.0), np.random.default_rng(3))


def test_spline_movers_are_never_faster_than_they_declare(crowd):
    draw = np.random.default_rng(0)
    begin = draw.uniform(0, 120, 500)
    span = draw.uniform(1e-3, 1.0, 500)
    moved = np.linalg.norm(crowd.positions(begin + span) - crowd.positions(begin), axis=2)
    assert (moved / span[:, None] <= crowd.speed * (1 + 1e-9)).all()
    assert crowd.top_speed == crowd.speed.max() <= 20.0


def test_spline_movers_go_round_without_a_jump(crowd):
    times = np.linspace(0, 200, 40001)
    steps = np.linalg.norm(np.diff(crowd.positions(times), axis=0), axis=2)
    assert steps.max() <= 20.0 * 0.005 * (1 + 1e-9)


def test_spline_movers_touch_nothing_that_stays_and_keep_inside(crowd):
    world = World(BOUNDS, [BLOCK])
    places = crowd.positions(np.linspace(0, 200, 4001))
    for n, radius in enumerate(crowd.radius):
        assert world.clearance(places[:, n]).min() > radius
        assert places[:, n].min() >= radius
        assert places[:, n].max() <= 100.0 - radius


def test_spline_movers_leave_the_robots_start_alone(crowd):
    apart = np.linalg.norm(crowd.at(0.0) - [10.0, 50.0], axis=1)
    assert (apart >= 15.0 + crowd.radius).all()


def test_the_same_generator_draws_the_same_movers(crowd):
    world = World(BOUNDS, [BLOCK])
    again = draw_spline_movers(8, (1.0, 1.5), (5.0, 20.0), BOUNDS, world.clearance,
                               (10.0, 50.0, 15.0), np.random.default_rng(3))
    assert np.array_equal(crowd.at(7.3), again.at(7.3))


def test_movers_without_room_are_refused():
    with pytest.raises(ValueError, match="no room for mover 0"):
        draw_spline_movers(1, (60.0, 60.0), (1.0, 1.0), BOUNDS, World(BOUNDS).clearance,
                           (0.0, 0.0, 0.0), np.random.default_rng(0))


def test_scripted_movers_walk_straight_between_waypoints_and_stand_before_and_after():
    movers = PathMovers([np.array([[1.0, 0, 0], [3.0, 4, 0], [4.0, 4, 1]])], np.array([0.3]))
    assert movers.at(0.0).tolist() == [[0, 0]]
    assert movers.at(2.0).tolist() == [[2, 0]]
    assert movers.at(9.0).tolist() == [[4, 1]]
    assert movers.top_speed == 2.0


def walker(*rows):
    return np.array(rows, dtype=float)


def test_a_person_first_seen_inside_comes_from_the_edge_at_the_first_velocity():
    movers = recorded_movers([walker((10, 0, 0), (11, 1, 0), (12, 3, 0))], EDGE, NO_WALLS)
    assert movers.at(0.0).tolist() == [[-10, 0]]  # one metre a second, as in the first step
    assert movers.born[0] == -10.0
    assert movers.gone[0] == 12 + 17 / 2  # two metres a second, as in the last
    assert not movers.present(-11.0)[0]
    assert movers.top_speed == 2.0


def test_a_person_who_stands_when_first_seen_came_earlier_by_the_shortest_way():
    movers = recorded_movers([walker((100, 15, 0), (101, 15, 0), (102, 16, 0))], EDGE, NO_WALLS)
    assert movers.at(80.0).tolist() == [[15, 0]]  # stood for twenty seconds before
    assert movers.born[0] == pytest.approx(80 - 5 / 1.2)  # the edge is five metres away
    assert movers.at(movers.born[0])[0] == pytest.approx([20, 0])


def test_no_extension_passes_a_wall_and_whoever_can_turns_through_the_door():
    left, right = [4.0, -30.0, 4.0, -1.0], [4.0, 1.0, 4.0, 30.0]  # a door at x = 4, y in (-1, 1)
    walls = np.array([left, right])
    movers = recorded_movers([walker((0, 0, -2), (1, 1, -2), (2, 2, -2))], EDGE, walls, 0.25)
    times = np.linspace(2, 30, 2801)
    path = movers.positions(times)[:, 0]
    apart = geometry.point_to_segment(path[:, None], walls[:, :2], walls[:, 2:])
    assert apart.min() >= 0.25
    assert path[-1, 0] > 4.0
    assert movers.top_speed == pytest.approx(1.0)


def test_a_person_shut_in_stands_where_the_recording_ends():
    square = geometry.edges(np.array([[-3.0, -3], [3, -3], [3, 3], [-3, 3]]))
    movers = recorded_movers([walker((0, 0, 0), (1, 1, 0))], EDGE, square)
    assert movers.present(1e6)[0]
    assert movers.at(1e6).tolist() == [[1, 0]]


def test_a_recording_is_read_with_its_own_clock_and_columns(tmp_path):
    path = tmp_path / "obsmat.txt.gz"
    rows = "30 7 1.0 0 2.0 0 0 0\n45 7 2.0 0 2.0 0 0 0\n45 8 0 0 0 0 0 0\n"
    path.write_bytes(gzip.compress(rows.encode()))
    tracks = Recording(path=path, format="obsmat", clock=15.0).tracks()
    assert len(tracks) == 1  # who was seen once has no velocity to extend
    assert tracks[0].tolist() == [[2.0, 1.0, 2.0], [3.0, 2.0, 2.0]]
    with pytest.raises(ValueError, match="has 4 columns; got 8"):
        Recording(path=path, format="frame_id_x_y", clock=25.0).tracks()


def test_an_absent_recording_says_what_to_set(tmp_path):
    with pytest.raises(ValueError, match="PASSPMP_DATA"):
        Recording(path=tmp_path / "nothing.txt", format="obsmat", clock=15.0).tracks()


def test_clearance_is_the_distance_to_the_nearest_wall_and_nothing_inside():
    world = World(BOUNDS, [BLOCK], np.array([[0.0, 0.0, 100.0, 0.0]]))
    found = world.clearance(np.array([[50.0, 50.0], [50.0, 30.0], [20.0, 5.0]]))
    assert found.tolist() == [0.0, 10.0, 5.0]
