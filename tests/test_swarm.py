"""The swarm against the optimum over all leaves (Sec. 5.1.3: found in 100 % of runs), and against
Algorithm 3 as it is written."""

import numpy as np
import pytest
from oracle import dense_swarm
from oracle.bare_tree import BareTree, random_tree

from passpmp_ti import CarLike, device
from passpmp_ti.grid.model import TICK
from passpmp_ti.kernels.swarm import EMPTY
from passpmp_ti.kernels.tree import CHILDREN, PARENT
from passpmp_ti.kernels.tree import TICK as TICK_COLUMN
from passpmp_ti.planner.objective import horizon
from passpmp_ti.planner.swarm import Swarm, best_leaf, leaf_costs, table_size
from passpmp_ti.settings import Settings

ROBOT = CarLike()
LAST_STATE = Settings(
    distance="final", weight_time=0.0, particles=20, sub_swarms=2, iterations=25, capacity=64
)
"""A leaf costs what the tree's cost[:, 1] says."""


def seed_of(generator_seed):
    """What a swarm draws first from a generator of this seed."""
    return int(np.random.default_rng(generator_seed).integers(2**32))


def on_device(tree):
    return BareTree(device.put(tree.link), device.put(tree.cost), tree.count, tree.depth)


@pytest.mark.parametrize("nodes", [13, 40, 135, 176, 237])
@pytest.mark.parametrize("particles", [20, 50, 100])
def test_the_swarm_finds_the_optimum_in_99_of_100_runs(nodes, particles):
    generator = np.random.default_rng(nodes * 1000 + particles)
    settings = LAST_STATE.changed(particles=particles, sub_swarms=1, capacity=nodes, iterations=200)
    swarm = Swarm(ROBOT, settings)
    found = 0
    for _ in range(100):
        tree = random_tree(nodes, generator)
        leaf, _, _ = swarm.choose(tree, generator)
        found += tree.cost[leaf, 1] == tree.cost[best_leaf(tree, ROBOT, settings)[0], 1]
    assert found >= 99


@pytest.mark.parametrize("sub_swarms", [1, 2, 5])
@pytest.mark.parametrize("nodes", [2, 13, 60, 241, 3000])
def test_the_swarm_walks_as_if_every_priority_had_been_there_from_the_start(nodes, sub_swarms):
    settings = LAST_STATE.changed(sub_swarms=sub_swarms)
    swarm = Swarm(ROBOT, settings)
    for seed in range(2):
        tree = random_tree(nodes, np.random.default_rng(seed), fans=(1, 10))
        leaf, leaves, cost = swarm.choose(tree, np.random.default_rng(seed))
        dense = dense_swarm.search(tree, tree.cost[:, 1], seed_of(seed), settings)
        assert (leaf, cost, leaves) == dense


@pytest.mark.parametrize("iterations", [1, 7, 8, 30])
@pytest.mark.parametrize("nodes", [13, 241, 3000])
def test_particles_side_by_side_end_where_sub_swarms_side_by_side_do(nodes, iterations):
    settings = LAST_STATE.changed(iterations=iterations)
    tree = random_tree(nodes, np.random.default_rng(nodes), fans=(1, 10))
    here = Swarm(ROBOT, settings).choose(tree, np.random.default_rng(1))
    with device.forced():
        there = Swarm(ROBOT, settings).choose(on_device(tree), np.random.default_rng(1))
    assert here == there


def test_tables_are_as_large_as_walks_can_fill_and_stay_half_empty():
    # 26 walks over at most 6 parents of 9 children: 312 slots are twice what they can meet
    assert table_size(25, 6, 10**7, 9) == (512, 3 * 26 * 6 * 9)
    assert table_size(25, 6, 512, 9) == (512, 3 * 512)
    assert table_size(25, 6, 100, 9) == (128, 3 * 100)
    assert table_size(1, 1, 1, 9) == (1, 3)


def test_what_a_search_takes_does_not_grow_with_nodes_that_no_particle_visits():
    tree = random_tree(1 + 9 * 3333, np.random.default_rng(3), fans=(9, 10))
    swarm = Swarm(ROBOT, LAST_STATE)
    swarm.choose(tree, np.random.default_rng(3))
    assert tree.depth >= len(LAST_STATE.levels)
    slots, room = table_size(LAST_STATE.iterations, tree.depth, tree.count, 9)
    assert slots < tree.count / 50
    assert swarm._keys.shape == (22 * slots, 2)
    assert swarm._state.shape == (22 * room,)
    for row, keys in enumerate(swarm._keys.reshape(22, slots, 2)):
        met, places = keys[keys[:, 0] != EMPTY].T
        assert len(met) <= slots / 2
        assert len(np.unique(met)) == len(met)
        assert (tree.link[met, CHILDREN] > 0).all()
        assert np.isin(tree.link[met[met > 0], PARENT], met).all()
        # nine children's three numbers after the other, in the row's own stretch
        assert sorted(places) == [row * room + 27 * i for i in range(len(met))]
        assert 27 * len(met) <= room


def test_searches_do_not_remember_each_other():
    swarm = Swarm(ROBOT, LAST_STATE)
    trees = [random_tree(n, np.random.default_rng(n)) for n in (237, 13, 4000, 40, 237)]
    one_after_another = [swarm.choose(t, np.random.default_rng(9)) for t in trees]
    afresh = [Swarm(ROBOT, LAST_STATE).choose(t, np.random.default_rng(9)) for t in trees]
    assert one_after_another == afresh


def test_rows_behind_the_last_node_are_never_looked_at():
    bare = random_tree(240, np.random.default_rng(4))
    longer = random_tree(240, np.random.default_rng(4), spare=100)
    longer.link[:240], longer.cost[:240] = bare.link, bare.cost
    assert best_leaf(bare, ROBOT, LAST_STATE) == best_leaf(longer, ROBOT, LAST_STATE)
    chosen = [Swarm(ROBOT, LAST_STATE).choose(t, np.random.default_rng(4)) for t in (bare, longer)]
    assert chosen[0] == chosen[1]


def cost_by_definition(tree, settings):
    """[n] eq. 5 in float64; inf where no plan ends."""
    link, cost = tree.link[: tree.count], tree.cost[: tree.count].astype(np.float64)
    elapsed = (link[:, TICK_COLUMN] - link[0, TICK_COLUMN]) * TICK
    distance = cost[:, 1]
    if settings.distance == "mean":
        span = horizon(settings, ROBOT)
        rest = np.maximum(span - elapsed - cost[:, 4], 0.0)
        distance = (cost[:, 0] + cost[:, 2] + rest * cost[:, 3]) / span
        elapsed = span
    f = settings.weight_distance * distance + settings.weight_time * elapsed
    return np.where(link[:, CHILDREN] == 0, f, np.inf)


@pytest.mark.parametrize("distance", ["mean", "final"])
@pytest.mark.parametrize("nodes", [2, 40, 5000])
def test_the_cheapest_leaf_is_the_cheapest_by_definition(nodes, distance):
    settings = LAST_STATE.changed(distance=distance, weight_distance=0.7, weight_time=0.3)
    tree = random_tree(nodes, np.random.default_rng(nodes), spare=7)
    costs = cost_by_definition(tree, settings)
    leaf, cost = best_leaf(tree, ROBOT, settings)
    assert leaf in tree.leaves
    assert cost == pytest.approx(costs[leaf], rel=1e-6)
    assert cost == pytest.approx(costs.min(), rel=1e-6)
    every = leaf_costs(tree, ROBOT, settings)
    np.testing.assert_allclose(every, costs, rtol=1e-6)
    assert (leaf, cost) == (np.argmin(every), every.min())
    with device.forced():
        assert best_leaf(on_device(tree), ROBOT, settings) == (leaf, cost)


@pytest.mark.parametrize("distance", ["mean", "final"])
def test_the_swarm_and_the_search_over_all_leaves_judge_a_leaf_alike_to_the_bit(distance):
    settings = LAST_STATE.changed(distance=distance, weight_time=0.3, iterations=60)
    swarm = Swarm(ROBOT, settings)
    same = 0
    for seed in range(20):
        tree = random_tree(40, np.random.default_rng(seed))
        leaf, _, cost = swarm.choose(tree, np.random.default_rng(seed))
        best, least = best_leaf(tree, ROBOT, settings)
        assert least <= cost
        if leaf == best:
            assert least == cost
            same += 1
    assert same >= 15


def test_the_first_of_equal_leaves_is_chosen():
    for nodes in (40, 5000):
        tree = random_tree(nodes, np.random.default_rng(nodes))
        tree.cost[:, 1] = 2.0
        tree.cost[tree.leaves[3::5], 1] = 1.0
        assert best_leaf(tree, ROBOT, LAST_STATE) == (tree.leaves[3], 1.0)


def test_where_every_plan_costs_infinitely_much_the_robot_stays():
    tree = random_tree(40, np.random.default_rng(0))
    tree.cost[:, 1] = np.inf
    assert best_leaf(tree, ROBOT, LAST_STATE) == (0, np.inf)
    leaf, _, cost = Swarm(ROBOT, LAST_STATE).choose(tree, np.random.default_rng(0))
    assert (leaf, cost) == (0, np.inf)


def test_a_swarm_that_no_kernel_could_address_is_refused():
    with pytest.raises(ValueError, match="fewer particles or fewer iterations"):
        Swarm(
            ROBOT,
            LAST_STATE.changed(particles=100_000, iterations=10_000, capacity=1_000_000),
        )
