"""What the measurements of the swarm say; not how fast anything is."""

import json

import numpy as np
import pytest

from passpmp_ti.bench import swarm
from passpmp_ti.bench.gap import measure_gap
from passpmp_ti.bench.swarm import CHUNK, DenseSwarm, compiled_moves, measure_swarm
from passpmp_ti.bench.trees import random_tree
from passpmp_ti.kernels.tree import CHILDREN, FIRST, PARENT
from passpmp_ti.settings import Settings


@pytest.mark.parametrize("nodes", [2, 3, 13, 237, 5000])
def test_a_random_tree_is_one(nodes):
    tree = random_tree(nodes, np.random.default_rng(nodes))
    depth = np.zeros(nodes, dtype=int)
    for n in range(1, nodes):
        parent = tree.link[n, PARENT]
        assert parent < n
        assert 0 <= n - tree.link[parent, FIRST] < tree.link[parent, CHILDREN] <= 9
        depth[n] = depth[parent] + 1
    assert tree.link[:, CHILDREN].sum() == nodes - 1
    assert (tree.count, tree.depth) == (nodes, depth.max())


def test_every_measured_size_has_its_row_and_ratios(monkeypatch):
    monkeypatch.setattr(swarm, "ENOUGH", 0)  # how fast it is does not matter here
    told = []
    result = measure_swarm(particles=(4,), nodes=(13, 500), progress=told.append)
    assert json.loads(json.dumps(result)) == result
    assert [(row["particles"], row["nodes"]) for row in result["rows"]] == [(4, 13), (4, 500)]
    assert all(row["swarm_seconds"] > 0 and row["numpy_ratio"] > 0 for row in result["rows"])
    assert len(told) == 2


def test_a_measurement_that_will_not_fit_is_refused():
    with pytest.raises(ValueError, match="take fewer"):
        measure_swarm(particles=(1000,), nodes=(1_000_000,))


def test_the_dense_swarm_moves_every_priority_and_keeps_it_in_bounds():
    dense = DenseSwarm(2, CHUNK + 5, Settings(), seed=1)
    before = dense.position.copy()
    dense.iterate()
    assert (dense.position != before).mean() > 0.99
    assert (dense.position[:, -5:] != before[:, -5:]).any()
    assert dense.position.min() >= 0.0
    assert dense.position.max() <= 1.0
    assert np.abs(dense.velocity).max() <= Settings().velocity_max


@pytest.mark.parametrize("cores", ["one", "all"])
def test_numba_moves_every_priority_and_keeps_it_in_bounds(cores):
    pytest.importorskip("numba")
    moves = dict(zip(("one", "all"), compiled_moves(), strict=True))[cores]
    dense = DenseSwarm(2, 1000, Settings(), seed=1)
    before = dense.position.copy()
    one, two = np.float32(1.0), np.float32(2.0)
    moves(dense.position, dense.velocity, dense.best, dense.of_group, np.uint32(3), one, two, two)
    assert (dense.position != before).mean() > 0.99
    assert dense.position.min() >= 0.0
    assert dense.position.max() <= 1.0
    assert np.abs(dense.velocity).max() <= 1.0


def test_the_gap_is_nothing_in_small_trees_and_never_negative():
    result = measure_gap(nodes=(13, 3000), runs=5)
    assert json.loads(json.dumps(result)) == result
    small, large = result["rows"]
    assert (small["missed"], small["excess_worst"], small["share_worst"]) == (0.0, 0.0, 0.0)
    assert large["leaves"] > small["leaves"]
    assert large["excess_worst"] >= large["excess_mean"] >= 0.0
