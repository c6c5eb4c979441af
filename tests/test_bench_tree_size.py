"""What the studies of tree size rest on: kept runs, situations, trees filled by other rules."""

import json
from dataclasses import replace

import numpy as np
import pytest

from passpmp_ti.bench.kept import kept
from passpmp_ti.bench.quality import by_size, costs_as_leaves, filled_by, level_edges
from passpmp_ti.bench.situations import situations_of
from passpmp_ti.kernels.tree import CHILDREN, FIRST, PARENT
from passpmp_ti.planner.objective import objective_numbers
from passpmp_ti.planner.swarm import leaf_costs
from passpmp_ti.planner.tree import TreeGrower
from passpmp_ti.sim.scenario import load_scenario

SIZES = (13, 40, 240, 1200)


@pytest.fixture(scope="module")
def scenario():
    return replace(load_scenario("simple"), duration=1.3)


@pytest.fixture(scope="module")
def situation(scenario):
    return situations_of(scenario, every=0.5, most=5)[-1]


def test_a_run_is_done_once_and_then_read(tmp_path):
    done = []

    def run():
        done.append(1)
        return {"speed": 2.5}

    first = kept(tmp_path / "out", "crowded-0", {"seed": 0}, run)
    assert first == {"seed": 0, "speed": 2.5}
    assert kept(tmp_path / "out", "crowded-0", {"seed": 0}, run) == first
    assert len(done) == 1
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["crowded-0.json"]


def test_a_file_that_answers_something_else_is_run_anew(tmp_path):
    kept(tmp_path, "run", {"seed": 0, "levels": (1, 2)}, lambda: {"speed": 1.0})
    again = kept(tmp_path, "run", {"seed": 1, "levels": (1, 2)}, lambda: {"speed": 3.0})
    assert again == {"seed": 1, "levels": [1, 2], "speed": 3.0}


def test_a_run_that_is_stopped_leaves_no_file(tmp_path):
    def stopped():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        kept(tmp_path, "run", {"seed": 0}, stopped)
    assert list(tmp_path.iterdir()) == []


def test_situations_are_taken_at_an_even_pace_from_proven_states(scenario):
    found = situations_of(scenario, every=0.5, most=5)
    stamps = [s.start - scenario.settings.cycle for s in found]
    np.testing.assert_allclose(stamps, [0.5, 1.0], atol=1e-9)
    for s in found:
        assert s.model.stamp == pytest.approx(s.start - scenario.settings.cycle)
        assert s.model.proving_brakes(s.root[None], np.array([s.start]))[0] >= 0
    assert len(situations_of(scenario, every=0.3, most=2)) == 2


def test_the_levels_of_a_tree_follow_each_other():
    # the root has three children, of which the first has two and the last one child
    link = np.zeros((7, 8), dtype=np.int32)
    link[:, CHILDREN] = [3, 2, 0, 1, 0, 0, 0]
    link[:, FIRST] = [1, 4, -1, 6, -1, -1, -1]
    link[:, PARENT] = [-1, 0, 0, 0, 1, 1, 3]
    assert level_edges(link) == [0, 1, 4, 7]


def test_costs_in_numpy_are_those_of_the_kernel(situation, scenario):
    settings = scenario.settings
    tree = situation.grow(TreeGrower(scenario.robot, settings))
    ours = leaf_costs(tree, scenario.robot, settings)
    leaves = np.isfinite(ours)
    costs = costs_as_leaves(tree.link, tree.cost, objective_numbers(settings, scenario.robot))
    np.testing.assert_allclose(costs[leaves], ours[leaves], rtol=1e-5)


def test_costs_in_numpy_are_refused_for_the_last_state_alone(scenario):
    settings = scenario.settings.changed(distance="final")
    numbers = objective_numbers(settings, scenario.robot)
    with pytest.raises(ValueError, match="mean"):
        costs_as_leaves(np.zeros((1, 8), np.int32), np.zeros((1, 5), np.float32), numbers)


def test_filled_in_order_is_what_the_planner_grows(situation, scenario):
    settings = scenario.settings
    whole = situation.grow(TreeGrower(scenario.robot, settings.changed(capacity=5000)))
    assert whole.count > SIZES[-1]
    filled = filled_by(whole, scenario.robot, settings, SIZES, "order")
    rows = by_size(situation, settings, SIZES, searches=1)
    np.testing.assert_allclose(filled, [row["best"] for row in rows], rtol=1e-5)


@pytest.mark.parametrize("rule", ["order", "spread", "cheapest"])
def test_a_whole_tree_is_the_same_by_every_rule(situation, scenario, rule):
    settings = scenario.settings
    tree = situation.grow(TreeGrower(scenario.robot, settings))
    (cost,) = filled_by(tree, scenario.robot, settings, (tree.count,), rule)
    assert cost == pytest.approx(leaf_costs(tree, scenario.robot, settings).min(), rel=1e-5)


def test_an_unknown_rule_is_refused(situation, scenario):
    tree = situation.grow(TreeGrower(scenario.robot, scenario.settings))
    with pytest.raises(ValueError, match="rule must be one of order"):
        filled_by(tree, scenario.robot, scenario.settings, (40,), "fairly")


def test_every_size_has_its_row_and_the_swarm_never_beats_all_leaves(situation, scenario):
    rows = by_size(situation, scenario.settings, (*SIZES, 20_000, 50_000), searches=2)
    assert json.loads(json.dumps(rows)) == rows
    assert [row["capacity"] for row in rows] == [*SIZES, 20_000, 50_000]
    for row in rows:
        assert row["nodes"] <= row["capacity"]
        assert min(row["swarm"]) >= row["best"]
    assert not rows[0]["whole"]
    assert rows[-1]["whole"]
    assert rows[-1]["nodes"] == rows[-2]["nodes"]
