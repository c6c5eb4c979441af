import json
import subprocess

import cv2
import numpy as np
import pytest

from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.robots import CarLike
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.sim.episode import simulate
from passpmp_ti.sim.scenario import load_scenario
from passpmp_ti.sim.world import World
from passpmp_ti.viz import palette
from passpmp_ti.viz.branches import branches_of
from passpmp_ti.viz.canvas import Canvas
from passpmp_ti.viz.layout import lay_out, ticks
from passpmp_ti.viz.outcome import Outcome
from passpmp_ti.viz.region_map import region_map
from passpmp_ti.viz.scene import Moment, draw_cycle
from passpmp_ti.viz.video import VideoWriter, ffmpeg

BOUNDS = (-30.0, -30.0, 30.0, 30.0)


def has(image, colour):
    return (image == np.array(colour, dtype=np.uint8)).all(axis=-1)


@pytest.fixture(scope="module")
def cycle():
    """A car that starts in the middle of 20 m of free space."""
    settings = Settings.for_robot(CarLike(), object_speed=2.0, capacity=300, cell=0.5)
    scan = Scan(np.full(720, 20.0), -np.pi, 2 * np.pi / 720, 20.0, (0.0, 0.0, 0.0), 0.0)
    navigator = Navigator(CarLike(), settings, goal=(12.0, 4.0))
    state = np.zeros(5)
    navigator.update(scan, state)
    return Moment(time=0.0, world=World(BOUNDS), record=navigator.record, robot=navigator.robot,
                  state=state, goals=((12.0, 4.0),), trail=np.array([[-9.0, 0.0], [-6.0, 0.0]]))


def test_a_world_point_lies_where_the_axes_say():
    canvas = Canvas((0.0, 0.0, 20.0, 10.0), (800, 800))
    x, y, w, h = canvas.layout.plot
    canvas.disc(np.array([15.0, 2.5]), 0.5, palette.ROBOT)
    rows, columns = np.nonzero(has(canvas.image(), palette.ROBOT))
    # pixel k covers [k, k + 1)
    assert columns.mean() + 0.5 == pytest.approx(x + 0.75 * w, abs=0.3)
    assert rows.mean() + 0.5 == pytest.approx(y + 0.75 * h, abs=0.3)


@pytest.mark.parametrize("bounds", [(0, 0, 180, 180), (-2, -2, 16, 2), (-8, -4, 16, 14)])
def test_pages_have_even_sizes_and_fit(bounds):
    page = lay_out(bounds, (1280, 1024)).page
    assert page[0] % 2 == page[1] % 2 == 0
    assert page[0] <= 1280
    assert page[1] <= 1024


def test_ticks_are_round_numbers():
    assert ticks(-3.0, 7.0, 400).tolist() == [-2, 0, 2, 4, 6]


def test_a_grid_is_painted_where_it_lies():
    canvas = Canvas((0.0, 0.0, 10.0, 10.0))
    cells = np.zeros((8, 8), dtype=bool)
    cells[4:8, 0:4] = True  # rows upwards: 2 m by 2 m, its lowest corner at (2, 6)
    canvas.region(cells, (2.0, 4.0), 0.5, palette.ICS)
    painted = has(canvas.sheet, palette.ICS)
    for point, inside in (((3.0, 7.0), True), ((2.1, 6.5), True), ((1.9, 7.0), False),
                          ((3.0, 5.9), False), ((4.1, 7.0), False)):
        column, row = canvas.pixels(np.array(point)).round().astype(int)
        assert painted[row, column] == inside
    assert painted.sum() == pytest.approx((2 * canvas.scale) ** 2, rel=0.05)


def test_a_cycle_is_drawn_in_the_papers_colours(cycle):
    canvas = Canvas(BOUNDS)
    image = draw_cycle(cycle, canvas)
    assert image.shape == (*canvas.layout.page[::-1], 3)
    plot = canvas.sheet

    def colour_at(x, y):
        column, row = canvas.pixels(np.array([x, y])).round().astype(int)
        return tuple(int(v) for v in plot[row, column])

    assert colour_at(-8.0, 0.0) == palette.EXECUTED
    assert colour_at(12.0, 4.0) == palette.GOAL
    assert colour_at(19.0, -1.0) == palette.ICS  # at the edge of what is seen
    assert colour_at(28.0, 28.0) in (palette.UNSEEN, palette.UNSEEN_HATCH)
    for colour in (palette.CHOICE, palette.SAFE, palette.ROBOT):
        assert has(plot, colour).any()


def test_branches_are_the_trees_own_primitives(cycle):
    tree = cycle.record.tree
    branches = branches_of(tree)
    assert len(branches.rejected) == len(tree.rejected)
    assert len(branches.safe) + len(branches.braking) == tree.count - 1
    for node, line in zip(branches.nodes[:20], branches.safe, strict=False):
        own = tree.primitive(int(node))
        np.testing.assert_allclose(line[[0, -1]], own[[0, -1]], atol=1e-6)


def test_a_video_holds_every_frame(tmp_path):
    with VideoWriter(tmp_path / "v.mp4", (64, 48), 10) as video:
        for shade in range(0, 250, 25):
            video.write(np.full((48, 64, 3), shade, dtype=np.uint8))
    assert video.frames == 10
    film = cv2.VideoCapture(str(video.path))
    shades = []
    while True:
        more, frame = film.read()
        if not more:
            break
        shades.append(int(frame.mean()))
    np.testing.assert_allclose(shades, range(0, 250, 25), atol=4)


@pytest.mark.skipif(ffmpeg() is None, reason="no ffmpeg here")
def test_a_video_is_of_the_kind_that_browsers_play(tmp_path):
    with VideoWriter(tmp_path / "v.mp4", (64, 48), 10) as video:
        video.write(np.zeros((48, 64, 3), dtype=np.uint8))
    told = subprocess.run([ffmpeg(), "-i", video.path], capture_output=True, text=True).stderr
    assert "h264" in told
    assert "yuv420p" in told


def test_without_ffmpeg_a_video_is_webm(tmp_path, monkeypatch):
    monkeypatch.setattr("passpmp_ti.viz.video.ffmpeg", lambda: None)
    with VideoWriter(tmp_path / "v.mp4", (64, 48), 10) as video:
        video.write(np.zeros((48, 64, 3), dtype=np.uint8))
    assert video.path.suffix == ".webm"
    assert cv2.VideoCapture(str(video.path)).read()[0]


def test_frames_of_another_size_are_refused(tmp_path):
    with (
        VideoWriter(tmp_path / "v.mp4", (64, 48), 10) as video,
        pytest.raises(ValueError, match=r"uint8 \(48, 64, 3\)"),
    ):
        video.write(np.zeros((48, 66, 3), dtype=np.uint8))
    with pytest.raises(ValueError, match="even"):
        VideoWriter(tmp_path / "w.mp4", (65, 48), 10)


class _EnoughError(Exception):
    pass


def test_a_run_cut_short_still_leaves_its_pictures(tmp_path):
    scenario = load_scenario("dead_end")
    seen = []

    def see(info):
        seen.append(info.time)
        outcome.see(info)
        if len(seen) == 20:
            raise _EnoughError

    with Outcome(tmp_path, "dead_end") as outcome, pytest.raises(_EnoughError):
        simulate(scenario, on_cycle=see)
    assert len(list((tmp_path / "snapshots").glob("*.png"))) == 6
    assert (tmp_path / "video.mp4").stat().st_size > 1000


def test_a_whole_run_leaves_numbers_that_can_be_read_again(tmp_path):
    from dataclasses import replace

    scenario = replace(load_scenario("dead_end"), duration=0.5)
    with Outcome(tmp_path, "dead_end", video=False) as outcome:
        summary = outcome.finish(simulate(scenario, on_cycle=outcome.see))
    assert json.loads((tmp_path / "summary.json").read_text()) == summary
    with np.load(tmp_path / "episode.npz") as arrays:
        assert arrays["states"].shape[1] == 5
    assert not (tmp_path / "video.mp4").exists()


def test_faster_objects_leave_fewer_states_safe():
    scenario = load_scenario("simple")
    shares = [
        region_map(scenario.changed(object_speed=v), 10.0).share_in_range for v in (2.0, 8.0, 20.0)
    ]
    assert shares[0] > shares[1] > shares[2] > 0
