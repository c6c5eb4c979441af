"""The tree in probabilistic mode: no plan of it risks more than is allowed."""

from __future__ import annotations

import numpy as np
import pytest

import passpmp_ti as pti
from passpmp_ti.planner.plan import trajectory_to
from passpmp_ti.planner.risk import allowed_risk, risk_of, safety_weight
from passpmp_ti.planner.tree import ROOT
from passpmp_ti.sim.episode import simulate

CYCLES = 26
WEIGHT = 5


def records_of(changes, cycles=CYCLES):
    """What a few cycles towards somebody in a corridor saw."""
    records = []

    def see(info):
        records.append(info.navigator.record)
        if len(records) >= cycles:
            raise KeyboardInterrupt

    scenario = pti.load_scenario("corridor_person").changed(
        {"mode": "probabilistic", "capacity": 150, **changes}
    )
    simulate(scenario, seed=1, on_cycle=see)
    return records


@pytest.fixture(scope="module")
def weighed():
    return records_of({})


def leaves_of(tree):
    return [n for n in range(1, tree.count) if not tree.link[n, 6] and n != ROOT]


def test_plans_risk_no_more_than_is_allowed(weighed):
    judged, risky = 0, 0
    for record in weighed[2::4]:
        tree = record.tree
        for leaf in leaves_of(tree)[::7]:
            plan = trajectory_to(tree, leaf)
            told = 1 - 1 / tree.cost[leaf, WEIGHT]
            settings = record.model.settings
            assert told <= allowed_risk(settings, plan.duration) + 1e-5
            # looked at more finely the same motion risks about as much, and never much more
            again = risk_of(record.model, plan, tree.start)
            assert again <= 1.1 * told + 1e-4
            judged += 1
            risky += told > 1e-3
    assert judged > 40
    assert risky > 5


def test_less_allowed_risk_leaves_fewer_nodes(weighed):
    careful = records_of({"allowed_risk": 0.001, "allowed_risk_rate": 0.001}, cycles=3)
    assert careful[2].tree_nodes < weighed[2].tree_nodes


def test_certain_movers_at_the_bound_leave_no_node_that_the_strict_mode_refuses():
    certain = {"emergence": 1.0, "hidden_speeds": (1.0,)}
    for record in records_of(certain, cycles=4)[1:]:
        tree, model = record.tree, record.model
        assert not len(model.tracks)
        proven = model._proved_on(
            model.hidden_ticks, model.hidden_spans, model.robot.within_limits(tree.states.T).T,
            model.ticks_of(tree.times),
        )  # fmt: skip
        assert (proven[1:] >= 0).all()
        assert tree.count > 2


def test_risks_are_promised_and_weigh():
    settings = pti.Settings(mode="probabilistic", allowed_risk=0.1, allowed_risk_rate=0.05)
    assert safety_weight(settings, 0.05, 2.0) == pytest.approx(1 / 0.95)
    assert np.isinf(safety_weight(settings, 0.06, 0.5))
    assert np.isinf(safety_weight(settings, 0.11, 9.0))
    printed = settings.changed(risk="paper")
    assert safety_weight(printed, 0.05, 2.0) == 0.05
    assert safety_weight(settings.changed(mode="hybrid"), 0.9, 2.0) == 1.0


def test_as_printed_every_plan_weighs_next_to_nothing():
    records = records_of({"risk": "paper"}, cycles=12)
    weights = np.concatenate([r.tree.cost[1:, WEIGHT] for r in records[2:]])
    assert (weights >= 0).all()
    assert np.median(weights) < 1e-6


def test_what_is_held_is_judged_anew(weighed):
    assert all(0 <= r.risk <= 1 and 0 <= r.held_risk <= 1 for r in weighed)
    assert any(r.held_risk > 0 for r in weighed)
    assert {r.decision for r in weighed} <= {"new", "held", "brake"}
