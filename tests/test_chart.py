"""Charts: marks at round numbers, gaps where nothing was measured, lines where they belong."""

import math

import numpy as np
import pytest

from passpmp_ti.viz import palette
from passpmp_ti.viz.chart import Chart, Line, chart_page, runs_of, y_ticks


@pytest.mark.parametrize(
    ("most", "ticks"),
    [(1.0, [0, 0.2, 0.4, 0.6, 0.8, 1.0]), (105, [0, 20, 40, 60, 80, 100]), (7.4, list(range(8)))],
)
def test_marks_are_even_and_round(most, ticks):
    np.testing.assert_allclose(y_ticks(most), ticks)


@pytest.mark.parametrize("most", [0.0, -1.0, math.nan, math.inf])
def test_an_axis_that_ends_nowhere_is_refused(most):
    with pytest.raises(ValueError, match="above 0"):
        y_ticks(most)


def test_what_was_not_measured_leaves_a_gap():
    nothing = math.nan
    points = [(1, nothing), (2, 5.0), (3, 6.0), (4, nothing), (5, 7.0)]
    assert runs_of(points) == [[(2, 5.0), (3, 6.0)], [(5, 7.0)]]
    assert runs_of([(1, nothing)]) == []


def test_a_page_holds_its_panels_and_higher_values_lie_higher():
    line = Line(label="speed", colour=palette.ROBOT, points=[(0.1, 2.0), (1.0, 8.0)])
    chart = Chart(
        title="speed", x_label="cycle [s]", x_ticks=[(0.1, "0.1"), (1.0, "1")], lines=[line],
        y_most=10.0,
    )  # fmt: skip
    page = chart_page([chart, chart, chart], 2, (300, 260))
    assert page.shape[1] == 600
    assert page.shape[0] > 520
    j, i = np.nonzero((page[:260, :300] == palette.ROBOT).all(axis=2))
    assert j[i == i.max()].mean() < j[i == i.min()].mean()
