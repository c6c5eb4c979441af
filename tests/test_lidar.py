"""The simulated range finder against plain geometry."""

import math

import numpy as np
import pytest

from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.movers import NoMovers, PathMovers
from passpmp_ti.sim.world import World

BOUNDS = (-50.0, -50.0, 50.0, 50.0)


def discs_at(*rows):
    """Standing discs, rows x, y, radius."""
    return PathMovers([np.array([[0.0, x, y]]) for x, y, _ in rows], np.array([r[2] for r in rows]))


def brute_force(world, pose, bearings):
    """Ranges by solving each ray against each surface in float64, another way than the kernel."""
    eye = np.array(pose[:2])
    found = np.full(len(bearings), np.inf)
    for k, bearing in enumerate(pose[2] + bearings):
        ray = np.array([math.cos(bearing), math.sin(bearing)])
        for x1, y1, x2, y2 in world.outline:
            matrix = np.array([[ray[0], x1 - x2], [ray[1], y1 - y2]])
            if abs(np.linalg.det(matrix)) > 1e-12:
                t, share = np.linalg.solve(matrix, np.array([x1, y1]) - eye)
                if t >= 0 and 0 <= share <= 1:
                    found[k] = min(found[k], t)
        for (x, y), r in zip(world.movers.at(0.0), world.movers.radius, strict=True):
            roots = np.roots([1.0, -2 * ray @ (np.array([x, y]) - eye),
                              (x - eye[0]) ** 2 + (y - eye[1]) ** 2 - r * r])
            real = roots[np.isreal(roots)].real
            if len(real) and real.min() > 0:
                found[k] = min(found[k], real.min())
    return found


def test_ranges_are_those_of_plain_geometry():
    polygon = np.array([[10, -5], [20, -5], [20, 8], [12, 6]])
    walls = np.array([[-30, -20, -30, 30], [-10, 25, 40, 30]])
    world = World(BOUNDS, [polygon], walls, discs_at((5, 9, 2), (-12, 3, 1), (0, -30, 4)))
    lidar = Lidar(range_max=80.0, beams=360)
    pose = (1.5, -2.5, 0.7)
    expected = brute_force(world, pose, lidar.bearings)
    ranges = lidar.scan(world, np.array(pose), 0.0).ranges
    assert np.array_equal(np.isfinite(ranges), np.isfinite(expected))
    hit = np.isfinite(expected)
    assert np.abs(ranges[hit] - expected[hit]).max() < 1e-3


def test_what_may_move_is_told_from_what_stays_if_the_sensor_can():
    world = World(BOUNDS, (), np.array([[5, -1, 5, 1]]), discs_at((-5, 0, 0.5)))
    sensor = Lidar(
        range_max=20.0, beams=3, field_of_view=2 * math.pi - 1e-3, labels="sensor"
    )
    told = sensor.scan(world, np.zeros(3), 0.0)  # looks back, ahead, back
    assert told.moving.tolist() == [True, False, True]
    assert told.ranges.round(2).tolist() == [4.5, 5.0, 4.5]
    untold = Lidar(range_max=20.0, beams=4).scan(world, np.zeros(3), 0.0)
    assert untold.moving is None


def test_nothing_within_range_is_infinite_and_not_lost():
    scan = Lidar(range_max=10.0, beams=8).scan(World(BOUNDS), np.zeros(3), 0.0)
    assert np.isinf(scan.ranges).all()
    assert not scan.lost.any()


def test_a_full_turn_has_no_beam_twice_and_less_has_one_at_either_end():
    turn = Lidar(range_max=10.0, beams=8)
    assert np.allclose(np.diff(turn.bearings), math.pi / 4)
    half = Lidar(range_max=10.0, beams=5, field_of_view=math.pi)
    assert np.allclose(half.bearings, np.linspace(-math.pi / 2, math.pi / 2, 5))


def test_the_mount_turns_and_shifts_with_the_robot():
    rear = Lidar(range_max=10.0, beams=3, field_of_view=1.0, mount=(-0.5, 0.2, math.pi))
    assert np.allclose(rear.pose(np.array([1.0, 2.0, math.pi / 2, 0, 0])),
                       (0.8, 1.5, 1.5 * math.pi))


@pytest.mark.parametrize("world", [
    World(BOUNDS, [np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])]),
    World(BOUNDS, (), np.zeros((0, 4)), discs_at((0.5, 0, 1.0))),
])
def test_a_sensor_inside_an_object_sees_nothing_rather_than_free_space(world):
    assert Lidar(range_max=10.0, beams=8).scan(world, np.zeros(3), 0.0).lost.all()


def test_errors_of_ranges_never_exceed_three_deviations():
    world = World(BOUNDS, (), np.array([[5, -40, 5, 40]]), NoMovers())
    exact = Lidar(range_max=40.0, beams=3000, field_of_view=2.0)
    noisy = Lidar(range_max=40.0, beams=3000, field_of_view=2.0, noise=0.02)
    true = exact.scan(world, np.zeros(3), 0.0).ranges
    seen = noisy.scan(world, np.zeros(3), 0.0, np.random.default_rng(0)).ranges
    error = seen - true
    assert np.abs(error).max() <= noisy.greatest_error == 0.06
    assert 0.018 < error.std() < 0.022


def test_noise_asks_for_a_generator():
    with pytest.raises(ValueError, match="needs a numpy Generator"):
        Lidar(range_max=10.0, beams=8, noise=0.1).scan(World(BOUNDS), np.zeros(3), 0.0)
