"""What a scan shows, drawn: seen cells, surfaces, and where something may come from."""

import numpy as np
import pytest
from oracle import exact
from scipy.ndimage import distance_transform_edt

from passpmp_ti import DifferentialDrive, FutureModel, Scan, Settings, StaticMap
from passpmp_ti.grid import distance
from passpmp_ti.robots import cover_rectangle

ROBOT = DifferentialDrive(discs=((0.0, 0.3),))
COARSE = Settings(cell=0.25, object_width=0.5, object_speed=1.0, window=32)
FINE = Settings(cell=0.05, object_width=0.5, object_speed=1.0)
ORIGIN = (0.0, 0.0, 0.0)
WALL = exact.box(1.4, 0.0, 0.5, 6.0)
ROUND = 2 * np.pi


def scan_of(boxes=(), discs=(), beams=720, fov=ROUND, range_max=2.2, pose=ORIGIN, **more):
    return exact.sweep(exact.world_of(boxes, discs), pose, beams, fov, range_max, **more)


def changed(scan, **fields):
    own = dict(
        ranges=scan.ranges, angle_min=scan.angle_min, angle_increment=scan.angle_increment,
        range_max=scan.range_max, pose=scan.pose, stamp=scan.stamp, moving=scan.moving,
    )  # fmt: skip
    return Scan(**{**own, **fields})


def model_of(scans, settings=COARSE, robot=ROBOT, **more):
    return FutureModel.from_scan(scans, robot, settings, **more)


def picture(mask, rows=slice(6, 26), columns=slice(6, 26)):
    """Rows of text, north at the top: `#` where the mask holds."""
    return ["".join(".#"[int(c)] for c in row[columns]) for row in mask[rows][::-1]]


def cell_of(model, x, y):
    """(j, i) of the cell that holds (x, y)."""
    i, j = np.floor((np.array([x, y]) - model.origin) / model.cell).astype(int)
    return int(j), int(i)


def arrival(model, x, y):
    """Seconds after the base at which a robot at (x, y) may first be touched."""
    return model.ticks[cell_of(model, x, y)] / 1000


def emits_near(model, x, y, within):
    """Whether something may come out within a distance of (x, y)."""
    j, i = np.nonzero(model.sources)
    centres = np.array(model.origin) + (np.stack([i, j], axis=1) + 0.5) * model.cell
    return bool((np.hypot(*(centres - [x, y]).T) <= within).any())


# pictures -------------------------------------------------------------------------------------


def test_an_open_place_is_seen_up_to_the_range_and_emits_from_there():
    model = model_of(scan_of(range_max=1.5))
    assert picture(model.seen, slice(8, 24), slice(8, 24)) == [
        "................",
        "................",
        "................",
        ".....######.....",
        "....########....",
        "...##########...",
        "...##########...",
        "...##########...",
        "...##########...",
        "...##########...",
        "...##########...",
        "....########....",
        ".....######.....",
        "................",
        "................",
        "................",
    ]
    assert not model.static.any()
    assert not model.movable.any()
    j, i = np.nonzero(model.sources)
    away = np.hypot((i - 15.5) * 0.25, (j - 15.5) * 0.25)
    assert (np.abs(away - 1.5) < 0.25).all()
    # all the way round: a source in every direction
    assert len(np.unique(np.round(np.arctan2(j - 15.5, i - 15.5) / (np.pi / 8)))) >= 16


def test_a_wall_hides_but_does_not_emit():
    model = model_of(scan_of([WALL]))
    assert picture(model.static)[2:18] == ["..............#....."] * 16
    assert not picture(model.seen)[9][14:].count("#")
    assert not emits_near(model, 1.2, 0.0, 1.0)
    assert emits_near(model, -2.2, 0.0, 0.3)


def test_an_unlabelled_wall_emits():
    model = model_of(scan_of([WALL], labelled=False))
    assert picture(model.movable)[2:18] == ["..............#....."] * 16
    assert not model.static.any()
    for y in np.arange(-1.2, 1.3, 0.2):
        assert emits_near(model, 1.15, y, 0.3)


@pytest.mark.parametrize(("gap", "open_"), [(0.8, True), (0.3, False)])
def test_walls_emit_from_a_gap_that_objects_fit_through(gap, open_):
    # nothing shows behind a gap that no beam goes through, so beams are few there
    half = 3.0
    walls = [exact.box(1.4, s * (half + gap) / 2, 0.5, half) for s in (1, -1)]
    beams = 720 if open_ else 24
    pose = (0.0, 0.0, 0.0 if open_ else np.pi / 24)
    model = model_of(scan_of(walls, beams=beams, pose=pose), FINE)
    assert emits_near(model, 1.3, 0.0, 0.6) == open_


def test_a_shadow_emits_from_its_edges():
    model = model_of(scan_of([exact.box(1.2, 0.0, 0.6, 0.6)], range_max=2.2), FINE)
    # the box is static: its face lets nothing through, both edges of its shadow do
    assert not emits_near(model, 0.9, 0.0, 0.15)
    for side in (1, -1):
        assert emits_near(model, 1.5, side * 0.5, 0.12)
    assert not model.seen[cell_of(model, 1.8, 0.0)]


def test_lost_beams_are_unseen():
    scan = scan_of()
    ranges = scan.ranges.copy()
    north = np.abs(scan.bearings - np.pi / 2) < 0.4
    ranges[north] = np.nan
    model = model_of(changed(scan, ranges=ranges))
    assert not model.seen[cell_of(model, 0.05, 1.5)]
    assert model.seen[cell_of(model, 0.05, -1.5)]
    for lost in (0.0, -1.0, np.nan):
        ranges[north] = lost
        again = model_of(changed(scan, ranges=ranges))
        assert (again.ticks == model.ticks).all()


def test_a_single_lost_beam_is_bridged_only_as_far_as_an_object_is_wide():
    scan = scan_of(beams=60, range_max=4.0)
    ranges = scan.ranges.copy()
    beam = int(np.argmin(np.abs(scan.bearings - 0.4)))
    ranges[beam] = np.nan
    model = model_of(changed(scan, ranges=ranges), FINE)
    bearing = scan.bearings[beam]
    # two increments are 0.209 rad: 0.5 m wide at 2.39 m, less half of that for a corner
    c, s = np.cos(bearing), np.sin(bearing)
    assert model.seen[cell_of(model, 2.0 * c, 2.0 * s)]
    assert not model.seen[cell_of(model, 2.3 * c, 2.3 * s)]
    whole = model_of(scan, FINE)
    assert whole.seen[cell_of(whole, 2.3 * c, 2.3 * s)]


def test_a_corner_behind_lost_beams_stands_out_of_what_is_called_seen():
    # beams lost over an angle a, met at r on both sides: a right angle between them comes as
    # near as r (cos a/2 - sin a/2), which is less than r (1 - a/2)
    settings = Settings(cell=0.01, object_width=0.81, object_speed=0.0, window=512)
    corner = 1.565
    box = exact.box(corner + 0.6 * np.sqrt(2), 0.0, 1.2, 1.2, np.pi / 4)
    scan = scan_of([box], range_max=2.4)
    ranges = scan.ranges.copy()
    ranges[np.abs(scan.bearings) < 0.2] = np.nan
    model = model_of(changed(scan, ranges=ranges), settings)
    assert model.seen[cell_of(model, corner - 0.05, 0.0)]
    assert not model.seen[cell_of(model, corner + 0.015, 0.0)]


def test_a_world_of_lost_beams_is_occupied_everywhere():
    scan = scan_of()
    model = model_of(changed(scan, ranges=np.full(720, np.nan)))
    points = np.random.default_rng(0).uniform(-3, 3, (200, 2))
    assert model.occupied(points, np.full(200, model.stamp)).all()
    moving = np.array([[0, 0, 0, 0.5, 0.5]])
    assert not model.passively_safe(moving, [model.stamp]).any()


# the same world told in another way -----------------------------------------------------------


def random_scan(seed, **more):
    generator = np.random.default_rng(seed)
    boxes = [
        exact.box(*generator.uniform(-3, 3, 2), 0.8, 0.6, generator.random()) for _ in range(2)
    ]
    discs = [(*generator.uniform(-3, 3, 2), 0.3) for _ in range(3)]
    away = [b for b in boxes if exact.box_distance(np.zeros((1, 2)), exact.world_of([b]))[0] > 0.5]
    return scan_of(away, [d for d in discs if np.hypot(*d[:2]) > 0.8], range_max=4.0, **more)


@pytest.mark.parametrize("seed", range(3))
def test_a_scan_given_twice_shows_what_it_shows_once(seed):
    scan = random_scan(seed)
    once, twice = model_of(scan, FINE), model_of([scan, scan], FINE)
    assert (twice.seen == once.seen).all()
    assert (twice.ticks == once.ticks).all()


@pytest.mark.parametrize("seed", range(3))
def test_it_does_not_matter_which_beam_comes_first(seed):
    scan = random_scan(seed)
    turned = changed(
        scan, ranges=np.roll(scan.ranges, -100), moving=np.roll(scan.moving, -100),
        angle_min=scan.angle_min + 100 * scan.angle_increment,
    )  # fmt: skip
    a, b = model_of(scan, FINE), model_of(turned, FINE)
    # bearings are rounded elsewhere: a border cell may fall either way
    assert (a.seen != b.seen).mean() < 1e-3
    apart = np.abs(a.ticks.astype(int) - b.ticks.astype(int))
    assert (apart > 60).mean() < 1e-3


def test_somebody_who_leans_on_a_mapped_wall_is_no_wall_wherever_the_scan_begins():
    # a part of somebody is within the map's tolerance of the wall
    wall = exact.box(2.03, 0.0, 0.4, 6.0)
    somebody = [(1.75, 0.2, 0.3)]
    known = StaticMap.from_segments(np.array([[1.83, -3.0, 1.83, 3.0]]), 0.05)
    marked = []
    for first in (0, 345, 354, 360, 390, 393, 396, 400):
        scan = scan_of([wall], somebody, range_max=4.0, labelled=False)
        scan = changed(
            scan, ranges=np.roll(scan.ranges, -first),
            angle_min=scan.angle_min + first * scan.angle_increment,
        )  # fmt: skip
        marked.append(model_of(scan, FINE, static_map=known).movable)
    for other in marked[1:]:
        assert (other != marked[0]).sum() <= 2


def test_front_and_rear_lidars_are_united():
    front = scan_of([WALL], fov=1.5 * np.pi, pose=(0.2, 0.0, 0.0))
    rear = scan_of([WALL], fov=1.5 * np.pi, pose=(-0.2, 0.0, np.pi))
    both = model_of([front, rear], position=ORIGIN)
    for one in (front, rear):
        assert (both.seen | ~model_of(one, position=ORIGIN).seen).all()
    assert both.seen[cell_of(both, -1.5, 0.0)]
    assert both.seen[cell_of(both, 0.8, 0.0)]
    assert not emits_near(both, 0.0, 0.6, 0.4)
    assert not emits_near(both, 0.0, -0.6, 0.4)


def test_scans_of_different_instants_are_refused():
    with pytest.raises(ValueError, match="one stamp"):
        model_of([scan_of(), scan_of(stamp=1.0)])


# arrival times --------------------------------------------------------------------------------


def test_arrival_is_distance_over_speed():
    model = model_of(scan_of(range_max=3.0), FINE)
    # from the range limit, 3 m, less the robot's clearance, at 1 m/s; early by a few cells at most
    free = 3.0 - FINE.clearance(ROBOT)
    assert free - 4 * 0.05 < arrival(model, 0.02, 0.02) <= free
    assert free - 1.0 - 4 * 0.05 < arrival(model, 0.72, 0.72) <= free - 1.0


def test_layers_and_ticks_agree():
    model = model_of(random_scan(1, stamp=12.3456), FINE.changed(layer_length=0.25))
    layers = model.layers(12)
    assert layers.shape == (12, *model.shape)
    j, i = np.mgrid[0 : model.shape[0], 0 : model.shape[1]]
    points = np.stack([i, j], axis=-1).reshape(-1, 2)
    points = np.array(model.origin) + (points + 0.5) * model.cell
    for index, layer in enumerate(layers):
        assert (layer == model.layer(index)).all()
        assert (layer == ((model.ticks < (index + 1) * 250) & (model.ticks != 65535))).all()
        end = model.base + (index + 1) * 0.25
        taken = model.occupied(points, np.full(len(points), end - 0.001)).reshape(model.shape)
        assert (layer == taken).all()
        inside = np.full(len(points), max(end - 0.2, model.stamp))
        assert not (model.occupied(points, inside).reshape(model.shape) & ~layer).any()


def test_layers_only_grow():
    layers = model_of(random_scan(2), FINE).layers()
    assert len(layers) >= 10
    assert not (layers[:-1] & ~layers[1:]).any()
    assert layers[-1].sum() > layers[0].sum()


def test_where_nothing_moves_what_is_free_stays_free():
    model = model_of(random_scan(0), FINE.changed(object_speed=0.0))
    assert set(np.unique(model.ticks)) == {0, 65535}
    assert model.passively_safe(np.array([[0.0, 0, 0, 0.2, 0.2]]), [1e5]).all()
    layers = model.layers(5)
    assert (layers == layers[0]).all()


def test_the_robots_own_body_is_empty():
    robot = DifferentialDrive(discs=cover_rectangle(0.8, 0.4, 0.7, 2))
    pose = (3.3, -1.2, 0.7)
    scan = scan_of(pose=pose)
    blind = changed(scan, ranges=np.full(720, np.nan))
    model = model_of(blind, FINE, robot=robot, position=pose)
    for centre in exact.disc_centres(robot, np.array(pose)):
        assert model.seen[cell_of(model, *centre)]
    assert model.seen.sum() * 0.05**2 == pytest.approx(2 * np.pi * robot.disc_radius**2, rel=0.5)


# blind bearings -------------------------------------------------------------------------------


def test_nothing_may_move_where_a_blind_sector_begins_at_the_skin():
    model = model_of(scan_of(fov=1.5 * np.pi, range_max=4.0), FINE)
    for v in (0.2, -0.2):
        assert not model.passively_safe(np.array([[0.0, 0, 0, v, v]]), [model.stamp]).any()


def test_a_declared_clearing_and_still_blind_bearings_let_it_move():
    settings = FINE.changed(blind_speed=0.0, clear_radius=1.0)
    model = model_of(scan_of(fov=1.5 * np.pi, range_max=4.0), settings)
    for v in (0.4, -0.2):
        assert model.passively_safe(np.array([[0.0, 0, 0, v, v]]), [model.stamp]).all()
    # what was never seen, behind the clearing, stands still, but it stands
    assert model.occupied(np.array([[-1.5, 0.0]]), [model.stamp]).all()


def test_a_clearing_beyond_the_window_is_no_proof_that_nothing_comes_in():
    settings = Settings(cell=0.05, window=64, object_speed=1.0, object_width=0.4, clear_radius=3.0)
    model = model_of(scan_of(range_max=1.0), settings)
    # the window ends 1.6 m from the robot: something may come from there
    assert arrival(model, 0.02, 0.02) <= 1.6


# questions refused ----------------------------------------------------------------------------


def test_the_past_is_not_spoken_of():
    model = model_of(scan_of(stamp=5.0))
    with pytest.raises(ValueError, match="before the scan"):
        model.occupied(np.zeros((1, 2)), [4.99])
    with pytest.raises(ValueError, match="before the scan"):
        model.passively_safe(np.zeros((1, 5)), [4.99])


def test_states_beyond_the_robots_limits_are_refused():
    model = model_of(scan_of())
    fast = np.zeros((3, 5))
    fast[1, 3] = ROBOT.wheel_speed + 0.01
    with pytest.raises(ValueError, match=r"states\[1\].*v_r.*beyond the robot's limit"):
        model.passively_safe(fast, np.ones(3))
    with pytest.raises(ValueError, match="finite"):
        model.passively_safe(np.full((1, 5), np.nan), [1.0])
    with pytest.raises(ValueError, match="shape"):
        model.passively_safe(np.zeros((1, 4)), [1.0])
    with pytest.raises(ValueError, match="2 elements for 1 points"):
        model.occupied(np.zeros((1, 2)), [1.0, 2.0])


def test_nothing_is_proven_outside_the_grid():
    model = model_of(scan_of())
    assert model.occupied(np.array([[50.0, 0.0], [-1e6, 3.0]]), np.ones(2)).all()


# distances ------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(1, 1), (7, 31), (64, 64), (50, 211)])
def test_both_distance_transforms_agree_with_scipys(shape):
    generator = np.random.default_rng(shape[1])
    for share in (0.3, 0.02, 0.002):
        mask = (generator.random(shape) > share).astype(np.uint8)
        mask.flat[generator.integers(mask.size)] = 0
        true = distance_transform_edt(mask)
        assert distance.distance_to_zeros(mask) == pytest.approx(true, abs=1e-3)
        assert distance.distance_without_opencv(mask) == pytest.approx(true, abs=1e-3)


def test_distance_between_cells_is_that_of_their_nearest_points():
    mask = np.ones((9, 9), dtype=np.uint8)
    mask[4, 4] = 0
    j, i = np.mgrid[0:9, 0:9]
    dx, dy = np.maximum(np.abs(i - 4) - 1, 0), np.maximum(np.abs(j - 4) - 1, 0)
    assert distance.distance_between_cells(mask) == pytest.approx(np.hypot(dx, dy), abs=1e-3)


def test_where_nothing_is_marked_everything_is_far():
    assert (distance.distance_to_zeros(np.ones((4, 4), dtype=np.uint8)) > 1e5).all()
