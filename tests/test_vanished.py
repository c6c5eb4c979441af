"""Who is asked whether he can be gone, and what returns break a premise, told plainly."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from passpmp_ti import Settings, device
from passpmp_ti.grid.memory import broken_premises
from passpmp_ti.grid.window import Window
from passpmp_ti.kernels.visibility import MOVABLE_CELLS, STATIC_CELLS
from passpmp_ti.planner.vanished import FEWEST, LEAST_SHARE, surfaces, vanished

SIZE, CELL = 48, 0.1
SETTINGS = Settings(cell=CELL, object_width=0.4, object_speed=3.0)


def window_at(corner):
    return Window(SIZE, CELL, corner, (0.0, 0.0))


def random_pair(seed):
    """Two models of which most is seen, but for blots, and whose surfaces lie about."""
    generator = np.random.default_rng(seed)
    seen = np.ones((SIZE, SIZE), dtype=bool)
    for j, i in generator.integers(0, SIZE, (int(generator.integers(1, 25)), 2)):
        seen[max(j - 2, 0) : j + 3, max(i - 1, 0) : i + 2] = False
    surfaces = generator.random((2, SIZE, SIZE)) < generator.choice([0.002, 0.01, 0.05])
    marks = np.ones((5, SIZE, SIZE), dtype=np.uint8)
    marks[[STATIC_CELLS, MOVABLE_CELLS]] = ~surfaces
    before = SimpleNamespace(
        static=surfaces[0], movable=surfaces[1], marks=marks, window=window_at((5, -3)), stamp=1.0
    )
    shift = generator.integers(-6, 7, 2)
    corner = (5 + int(shift[0]), -3 + int(shift[1]))
    now = SimpleNamespace(
        seen=seen, seen_cells=seen.astype(np.uint8), window=window_at(corner), cell=CELL,
        stamp=1.1, settings=SETTINGS,
    )
    return before, now


def vanished_plainly(before, now, timeless):
    settings = now.settings
    margin = 2 * (settings.range_noise + settings.localisation_error) + 2 * CELL
    asked = gone = 0
    for mask, speed in ((before.static, 0.0), (before.movable, settings.object_speed)):
        if timeless and speed > 0:
            continue
        age = now.stamp - before.stamp + settings.stamp_error
        reach = math.ceil((speed * age + margin) / CELL) + 1
        for j, i in zip(*np.nonzero(mask), strict=True):
            i += before.window.corner[0] - now.window.corner[0]
            j += before.window.corner[1] - now.window.corner[1]
            if min(i, j) < reach or max(i, j) >= SIZE - reach:
                continue
            asked += 1
            gone += now.seen[j - reach : j + reach + 1, i - reach : i + reach + 1].all()
    return f"{gone} of {asked} " if gone >= max(FEWEST, LEAST_SHARE * asked) else ""


@pytest.mark.parametrize("timeless", [False, True])
def test_those_are_gone_whose_whole_square_is_empty(timeless):
    answers = set()
    for seed in range(150):
        before, now = random_pair(seed)
        wanted = vanished_plainly(before, now, timeless)
        given = vanished(before, now, timeless=timeless)
        assert surfaces(before) == np.count_nonzero(before.marks == 0)
        assert given.startswith(wanted)
        assert bool(given) == bool(wanted)
        with device.forced():
            assert vanished(before, now, timeless=timeless) == given
        answers.add(bool(given))
    assert answers == {True, False}


def broken_plainly(points, previous, age, radius):
    """A return nearer than `radius` to the centre of a cell that nobody can have reached yet."""
    j, i = np.nonzero(previous.ticks.astype(int) > age + 2)
    i0, j0 = previous.window.corner
    cells = np.stack([i + i0, j + j0], axis=1).astype(np.float32)
    centres = (cells + np.float32(0.5)) * np.float32(CELL)
    away = np.abs(centres[None] - points.astype(np.float32)[:, None])
    r = np.float32(radius)
    return ((away**2).sum(axis=2) < r * r).any(axis=1)


def test_returns_break_a_premise_where_memory_has_a_free_cell_in_reach():
    robot = SimpleNamespace(disc_radius=0.5)
    radius = 0.5 - SETTINGS.range_noise - 2 * SETTINGS.localisation_error - CELL
    window = window_at((5, -3))
    both = set()
    for seed in range(60):
        generator = np.random.default_rng(seed)
        ticks = np.where(generator.random((SIZE, SIZE)) < 0.97, 90, 400).astype(np.uint16)
        ticks[generator.random((SIZE, SIZE)) < 0.005] = 65535
        points = generator.uniform((-0.5, -1.3), (6.5, 5.7), (200, 2))
        previous = SimpleNamespace(ticks=ticks, window=window)
        views = SimpleNamespace(untracked=lambda anchor, points=points: points)
        given = broken_premises(previous, views, window, 100, robot, SETTINGS)
        wanted = broken_plainly(points, previous, 100, radius)
        assert np.array_equal(given, points[wanted])
        both |= set(wanted)
    assert both == {True, False}
