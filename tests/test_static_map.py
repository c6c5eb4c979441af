"""Maps of what stays: read as map_server writes them, asked where a surface is known."""

import gzip
import math

import numpy as np
import pytest

from passpmp_ti.grid.static_map import StaticMap

HEADER = "resolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"


def write_map(folder, pixels, yaml="image: map.pgm\n" + HEADER, zipped=False):
    """A P5 image and its YAML; pixels top row first, as in the file."""
    rows = np.array(pixels, dtype=np.uint8)
    data = b"P5\n# a comment\n%d %d\n255\n" % rows.shape[::-1] + rows.tobytes()
    name = "map.pgm.gz" if zipped else "map.pgm"
    (folder / name).write_bytes(gzip.compress(data) if zipped else data)
    (folder / "map.yaml").write_text(yaml)
    return folder / "map.yaml"


def picture(map_):
    """Rows from the highest y down, as one would draw it."""
    return ["".join(".#"[int(c)] for c in row) for row in map_.occupied[::-1]]


@pytest.mark.parametrize("zipped", [False, True])
def test_black_is_occupied_and_grey_is_not_known_to_be(tmp_path, zipped):
    path = write_map(tmp_path, [[0, 254, 205], [254, 254, 0]], zipped=zipped)
    assert picture(StaticMap.load(path)) == ["#..", "..#"]


def test_negate_turns_black_and_white(tmp_path):
    yaml = "image: map.pgm\n" + HEADER.replace("negate: 0", "negate: 1")
    path = write_map(tmp_path, [[0, 255]], yaml)
    assert picture(StaticMap.load(path)) == [".#"]


def test_plain_text_pgm_of_any_depth_is_read(tmp_path):
    (tmp_path / "map.pgm").write_text("P2 3 1 1000\n0 # black\n1000 340\n")
    (tmp_path / "map.yaml").write_text("image: map.pgm\n" + HEADER)
    assert picture(StaticMap.load(tmp_path / "map.yaml")) == ["#.#"]


def test_png_colours_are_averaged_and_clear_pixels_are_unknown(tmp_path):
    cv2 = pytest.importorskip("cv2")
    pixels = np.array([[[0, 0, 0, 255], [0, 0, 0, 0], [255, 0, 0, 255]]], dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "map.png"), pixels)
    (tmp_path / "map.yaml").write_text("image: map.png\n" + HEADER)
    assert picture(StaticMap.load(tmp_path / "map.yaml")) == ["#.#"]


def test_a_map_may_be_shifted_and_turned():
    # two cells in a row, the second occupied, turned a quarter to the left about (10, 20)
    map_ = StaticMap(np.array([[False, True]]), 1.0, (10.0, 20.0, math.pi / 2))
    found = map_.contains(np.array([[9.5, 21.5], [9.5, 20.5], [10.5, 21.5]]))
    assert found.tolist() == [True, False, False]
    assert np.allclose(map_.segments().reshape(-1, 2).min(axis=0), [9, 21])
    assert np.allclose(map_.segments().reshape(-1, 2).max(axis=0), [10, 22])


def test_a_point_is_never_called_static_further_away_than_the_tolerance():
    occupied = np.zeros((40, 40), dtype=bool)
    occupied[20, 20] = True  # the square [2.0, 2.1] x [2.0, 2.1]
    map_ = StaticMap(occupied, 0.1)
    points = np.random.default_rng(0).uniform(1.0, 3.0, (4000, 2))
    gap = np.maximum(np.abs(points - 2.05) - 0.05, 0.0)
    apart = np.hypot(*gap.T)
    found = map_.contains(points, 0.3)
    assert apart[found].max() <= 0.3
    assert found[apart < 0.3 - 0.1 * math.sqrt(2)].all()


def test_outline_of_two_cells_in_a_row_is_a_rectangle_of_four_lines():
    map_ = StaticMap(np.array([[True, True, False]]), 0.5, (1.0, 1.0, 0.0))
    assert sorted(map(tuple, map_.segments().tolist())) == [
        (1.0, 1.0, 1.0, 1.5), (1.0, 1.0, 2.0, 1.0), (1.0, 1.5, 2.0, 1.5), (2.0, 1.0, 2.0, 1.5),
    ]


def test_cells_that_touch_at_a_corner_keep_their_own_outlines():
    map_ = StaticMap(np.array([[True, False], [False, True]]), 1.0)
    assert len(map_.segments()) == 8


def test_walls_drawn_from_lines_hold_every_point_of_the_lines():
    lines = np.array([[0.0, 0.0, 3.0, 1.0], [3.0, 1.0, 3.0, 4.0]])
    map_ = StaticMap.from_segments(lines, 0.05)
    share = np.linspace(0, 1, 500)[:, None]
    on_lines = np.concatenate([a + share * (b - a) for a, b in lines.reshape(-1, 2, 2)])
    assert map_.contains(on_lines, 0.05).all()
    assert not map_.contains(np.array([[1.0, 0.6], [2.0, 3.0]]), 0.1).any()


def test_a_thick_wall_reaches_half_its_thickness_to_either_side():
    map_ = StaticMap.from_segments(np.array([[0.0, 0.0, 2.0, 0.0]]), 0.05, thickness=0.4)
    assert map_.contains(np.array([[1.0, 0.15], [1.0, -0.15]])).all()
    assert not map_.contains(np.array([[1.0, 0.3], [1.0, -0.3]])).any()


@pytest.mark.parametrize(("change", "told"), [
    (("resolution: 0.5", "resolution: -1"), "resolution"),
    (("resolution: 0.5", "resolutoin: 0.5"), "did you mean 'resolution'"),
    (("origin: [0, 0, 0]", "origin: [0, 0]"), "origin"),
    (("occupied_thresh: 0.65", "occupied_thresh: 7"), "occupied_thresh"),
    (("free_thresh: 0.2", "free_thresh: 0.9"), "free_thresh"),
    (("negate: 0", "mode: raw"), "mode must be 'trinary'"),
    (("map.pgm", "other.pgm"), "no such file"),
])
def test_a_bad_map_file_is_refused_by_file_key_and_rule(tmp_path, change, told):
    yaml = ("image: map.pgm\n" + HEADER).replace(*change)
    path = write_map(tmp_path, [[0, 255]], yaml)
    with pytest.raises(ValueError, match=told) as refusal:
        StaticMap.load(path)
    assert str(path) in str(refusal.value)


def test_a_cut_image_is_refused(tmp_path):
    path = write_map(tmp_path, [[0, 255]])
    (tmp_path / "map.pgm").write_bytes(b"P5 30 30 255\nabc")
    with pytest.raises(ValueError, match="must hold 900 values; got 3"):
        StaticMap.load(path)
