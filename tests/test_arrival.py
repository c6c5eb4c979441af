"""Arrival times of random marks, against SciPy's distances."""

import numpy as np
import pytest
import taichi as ti
from scipy.ndimage import binary_dilation, distance_transform_edt

from passpmp_ti import device
from passpmp_ti.grid.arrival import _scratch, _unseen_square
from passpmp_ti.kernels.arrival import LATEST, NEVER, SAMPLING, arrival_times
from passpmp_ti.kernels.beams import SLACK
from passpmp_ti.kernels.spread import PARTS, evens_first, spread, spread_over

SIZE, CELL, CLEARANCE = 96, 0.1, 0.43
SPEED, BLIND_SPEED = 1.5, 0.7
NOTHING = np.zeros((1, 1), dtype=np.uint16)


def apart(marked):
    """[J, I] distance [cells] between any points of a cell and of the nearest that is marked."""
    if not marked.any():
        return np.full(marked.shape, 1e6)
    return distance_transform_edt(~binary_dilation(marked, np.ones((3, 3))))


def expected(seen, marks, left, blind_speed):
    """[J, I] ticks [ms], not yet rounded down."""
    free = apart(seen == 0) * CELL - 1e-3 * CELL - SLACK > CLEARANCE
    ticks = np.full(seen.shape, float(NEVER))
    for kind, speed in ((0, SPEED), (1, blind_speed)):
        if speed > 0:
            away = np.maximum(apart(marks[kind] == 0), apart(left[kind] == 0))
            away = away * CELL - 1e-3 * CELL - SLACK - SAMPLING * CELL - CLEARANCE
            ticks = np.minimum(ticks, np.clip(1000 * away / speed - 0.05, 0, LATEST))
    return np.where(free, ticks, 0)


def found(seen, marks, left, blind_speed):
    ticks = np.empty(seen.shape, dtype=np.uint16)
    arrival_times(
        seen, marks, left, NOTHING, 0, 0, -1, 1, _unseen_square(CELL, CLEARANCE),
        int(left is not marks), CELL, CLEARANCE, SPEED, blind_speed, 0.0, device.share(),
        *_scratch(SIZE), ticks,
    )  # fmt: skip
    return ticks


def random_marks(generator, share):
    """[5, J, I] uint8, some of 0."""
    marks = np.ones((5, SIZE, SIZE), dtype=np.uint8)
    marks[:2] = generator.random((2, SIZE, SIZE)) > share
    return marks


@pytest.mark.parametrize("blind_speed", [0.0, BLIND_SPEED])
@pytest.mark.parametrize("opened", [False, True])
@pytest.mark.parametrize("share", [0.0, 0.0005, 0.02])
def test_arrival_times_are_those_of_exact_distances(share, opened, blind_speed):
    generator = np.random.default_rng(5)
    for holes in (0, 1, 12):
        seen = np.ones((SIZE, SIZE), dtype=np.uint8)
        for j, i, side in generator.integers(1, SIZE - 10, (holes, 3)):
            seen[j : j + side % 9, i : i + side % 7] = 0
        marks = random_marks(generator, share)
        left = random_marks(generator, 0.5 * share) if opened else marks
        wanted = expected(seen, marks, left, blind_speed)
        ticks = found(seen, marks, left, blind_speed)
        assert ((wanted == 0) <= (ticks == 0)).all()
        # to a tick, by single precision
        assert np.abs(ticks - np.floor(wanted)).max() <= 1


def test_nothing_is_free_where_nothing_is_seen():
    marks = random_marks(np.random.default_rng(1), 0.01)
    assert not found(np.zeros((SIZE, SIZE), dtype=np.uint8), marks, marks, 0.0).any()


@ti.kernel
def count_pieces(counts: ti.types.ndarray(dtype=ti.i32, ndim=1)):
    for index in range(spread_over(counts.shape[0])):
        piece = spread(index, counts.shape[0])
        if piece < counts.shape[0]:
            counts[piece] += 1
    for index in range(counts.shape[0]):
        counts[evens_first(index, counts.shape[0])] += 1


@pytest.mark.parametrize("count", [1, PARTS - 1, PARTS, PARTS + 1, 1000])
def test_work_in_another_order_is_done_once(count):
    counts = np.zeros(count, dtype=np.int32)
    count_pieces(counts)
    assert (counts == 2).all()
