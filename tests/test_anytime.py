"""A cycle with a deadline: what is left of it is spent on the tree, and what ends it is kept back.

The clock is one that only moves when it is told to.
"""

import gc
import time

import numpy as np
import pytest
from oracle import exact

from passpmp_ti import CarLike, DifferentialDrive, FutureModel, Navigator, Settings
from passpmp_ti.bench import anytime
from passpmp_ti.bench.found import Options
from passpmp_ti.kernels.tree import grow_level
from passpmp_ti.planner import budget as budget_module
from passpmp_ti.planner import rehearsal
from passpmp_ti.planner.budget import DECAY, FACTOR, FIRST, LEAST, MOST, Budget, Reserve
from passpmp_ti.planner.guide import Guide
from passpmp_ti.planner.plan import still_clear
from passpmp_ti.planner.swarm import Swarm
from passpmp_ti.planner.tree import TreeGrower
from passpmp_ti.sim.scenario import load_scenario

CHAIR = DifferentialDrive()
DEADLINE = 0.08
SETTINGS = Settings.for_robot(
    CHAIR, object_speed=0.5, cell=0.1, capacity=400, particles=20, iterations=20, deadline=DEADLINE
)
OPEN = exact.world_of()
REST = np.zeros(5)


class Clock:
    """Stands still, but for what it is told to take."""

    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(time, "perf_counter", clock)
    return clock


def taking(monkeypatch, clock, owner, name, seconds):
    """Have a part of the planner take `seconds` on that clock whenever it is called."""
    really = getattr(owner, name)

    def slow(*given, **named):
        clock.now += seconds
        return really(*given, **named)

    monkeypatch.setattr(owner, name, classmethod(
        lambda _, *given, **named: slow(*given, **named)
    ) if owner is FutureModel else slow)  # fmt: skip


def scan_at(state, stamp):
    return exact.sweep(OPEN, tuple(float(v) for v in state[:3]), 360, 2 * np.pi, 6.0, stamp)


def drive(navigator, cycles, stamp=5.0, state=REST):
    """Follow the plan exactly; returns (next stamp, state then)."""
    for _ in range(cycles):
        before = navigator.held
        after = navigator.update(scan_at(state, stamp), state)
        stamp += SETTINGS.cycle
        state = (after if before is None else before).at(stamp)
    return stamp, state


# the reserve ------------------------------------------------------------------------------------


def test_a_reserve_begins_with_a_share_of_the_deadline():
    assert Reserve().seconds(0.1) == pytest.approx(FIRST * 0.1)


def test_a_reserve_grows_at_once_and_falls_slowly():
    reserve = Reserve()
    reserve.learn(0.02, 0.1)
    assert reserve.seconds(0.1) == pytest.approx(FACTOR * 0.02)
    reserve.learn(0.001, 0.1)
    assert reserve.seconds(0.1) == pytest.approx(FACTOR * DECAY * 0.02)


def test_a_reserve_is_bounded_below_and_above():
    reserve = Reserve()
    for _ in range(1000):
        reserve.learn(1e-6, 0.1)
    assert reserve.seconds(0.1) == LEAST
    reserve.learn(7.0, 0.1)
    assert reserve.seconds(0.1) == MOST * 0.1


def test_one_long_pause_is_forgotten_even_where_no_tree_is_grown_any_more(clock):
    reserve = Reserve()
    reserve.learn(7.0, DEADLINE)
    for _ in range(1000):
        budget = Budget(DEADLINE, reserve)
        budget.close()
    assert reserve.seconds(DEADLINE) == LEAST


def test_a_budget_without_a_deadline_is_never_over(clock):
    budget = Budget(None, Reserve())
    clock.now += 1e6
    assert budget.until is None
    assert not budget.explored()
    assert not budget.late()
    assert budget.left() == float("inf")


def test_a_tree_that_stops_late_counts_against_the_end(clock):
    reserve = Reserve()
    budget = Budget(DEADLINE, reserve)
    clock.now = budget.until + 0.015  # the grower overshot by that
    budget.grown()
    clock.now += 0.005
    budget.close()
    assert reserve.seconds(DEADLINE) == pytest.approx(FACTOR * 0.02)


# the cycle --------------------------------------------------------------------------------------


def test_a_cycle_in_time_plans_as_one_without_a_deadline(clock):
    hurried = Navigator(CHAIR, SETTINGS, (3.0, 0.0))
    at_leisure = Navigator(CHAIR, SETTINGS.changed(deadline=None), (3.0, 0.0))
    for navigator in (hurried, at_leisure):
        drive(navigator, 5)
    assert hurried.held.states.tobytes() == at_leisure.held.states.tobytes()
    assert hurried.record.time_left == pytest.approx(DEADLINE)
    assert at_leisure.record.time_left == float("inf")


def test_exploration_ends_when_the_reserve_begins(clock, monkeypatch):
    navigator = Navigator(CHAIR, SETTINGS, (3.0, 0.0))
    told = []
    really = TreeGrower.grow

    def grow(self, *given, until, weight):
        told.append(until - clock.now)
        clock.now = until + 1e-3
        return really(self, *given, until=until, weight=weight)

    monkeypatch.setattr(TreeGrower, "grow", grow)
    navigator.update(scan_at(REST, 5.0), REST)
    assert told == [pytest.approx((1 - FIRST) * DEADLINE)]
    record = navigator.record
    assert record.tree_stopped_by == "time"
    assert record.time_left == pytest.approx(FIRST * DEADLINE - 1e-3)


def test_after_a_slow_choice_more_is_kept_back(clock, monkeypatch):
    navigator = Navigator(CHAIR, SETTINGS, (3.0, 0.0))
    told = []
    really = TreeGrower.grow

    def grow(self, *given, until, weight):
        told.append(until - clock.now)
        return really(self, *given, until=until, weight=weight)

    monkeypatch.setattr(TreeGrower, "grow", grow)
    taking(monkeypatch, clock, Swarm, "choose", 0.018)
    drive(navigator, 2)
    assert told == [pytest.approx(DEADLINE * (1 - FIRST)), pytest.approx(DEADLINE - FACTOR * 0.018)]


def test_nothing_is_planned_where_the_model_took_too_long(clock, monkeypatch):
    navigator = Navigator(CHAIR, SETTINGS, (3.0, 0.0))
    stamp, state = drive(navigator, 6)
    held = navigator.held
    assert not CHAIR.at_rest(state)
    taking(monkeypatch, clock, FutureModel, "from_scan", 0.9 * DEADLINE)
    monkeypatch.setattr(TreeGrower, "grow", None)
    assert navigator.update(scan_at(state, stamp), state) is held
    record = navigator.record
    assert record.decision == "held"
    assert record.reason == "the model left no time to plan before the deadline"
    assert not record.fault
    assert record.tree is None
    assert record.time_left == pytest.approx(0.1 * DEADLINE)
    # and what is held stays verified by the new model
    assert record.held_clear
    assert still_clear(navigator.model, held, stamp + SETTINGS.cycle)


def test_nothing_is_grown_where_the_guide_took_too_long(clock, monkeypatch):
    navigator = Navigator(CHAIR, SETTINGS, (3.0, 0.0))
    stamp, state = drive(navigator, 6)
    held = navigator.held
    taking(monkeypatch, clock, Guide, "field", 0.9 * DEADLINE)
    monkeypatch.setattr(TreeGrower, "grow", None)
    assert navigator.update(scan_at(state, stamp), state) is held
    assert navigator.record.reason == "the guide left no time to plan before the deadline"
    assert not navigator.record.fault


def test_a_plan_that_is_late_all_the_same_is_dropped(clock, monkeypatch):
    navigator = Navigator(CHAIR, SETTINGS, (3.0, 0.0))
    taking(monkeypatch, clock, Swarm, "choose", 2 * DEADLINE)
    held = navigator.update(scan_at(REST, 5.0), REST)
    assert navigator.record.decision == "held"
    assert navigator.record.reason == "planning took longer than the deadline"
    assert navigator.record.time_left == pytest.approx(-DEADLINE)
    assert len(held.times) == 1


def test_the_robot_plans_again_when_the_machine_is_quick_again(clock, monkeypatch):
    navigator = Navigator(CHAIR, SETTINGS, (3.0, 0.0))
    with monkeypatch.context() as slow:
        taking(slow, clock, FutureModel, "from_scan", 0.9 * DEADLINE)
        stamp, state = drive(navigator, 5)
    assert CHAIR.at_rest(state)
    navigator.update(scan_at(state, stamp), state)
    assert navigator.record.decision == "new"


# what a deadline brings with it -----------------------------------------------------------------


def test_everything_that_a_cycle_may_need_is_rehearsed():
    decisions = []

    class Watched(Navigator):
        def update(self, *given, **named):
            answer = super().update(*given, **named)
            decisions.append((self.record.decision, self.record.fault))
            return answer

    for settings in (SETTINGS, SETTINGS.changed(object_radius=0.15, optimizer="exhaustive")):
        decisions.clear()
        rehearsal.rehearse(Watched, CHAIR, settings)
        assert decisions == [("new", ""), ("new", ""), ("brake", ""), ("held", "")]


def test_only_a_deadline_asks_for_a_rehearsal(monkeypatch):
    asked = []
    monkeypatch.setattr("passpmp_ti.planner.navigator.rehearse", lambda *given: asked.append(given))
    Navigator(CHAIR, SETTINGS.changed(deadline=None), (3.0, 0.0))
    assert not asked
    Navigator(CHAIR, SETTINGS, (3.0, 0.0))
    assert asked == [(Navigator, CHAIR, SETTINGS)]


def test_the_garbage_collector_waits_until_the_cycle_has_answered(monkeypatch):
    seen = []
    really = Guide.field

    def field(self, *given):
        seen.append(gc.isenabled())
        return really(self, *given)

    monkeypatch.setattr(Guide, "field", field)
    for deadline in (60.0, None):
        navigator = Navigator(CHAIR, SETTINGS.changed(deadline=deadline), (3.0, 0.0))
        seen.clear()
        navigator.update(scan_at(REST, 5.0), REST)
        assert seen == [deadline is None]
        assert gc.isenabled()


def test_a_collector_that_was_off_stays_off():
    gc.disable()
    try:
        with budget_module.without_collector(True):
            assert not gc.isenabled()
        assert not gc.isenabled()
    finally:
        gc.enable()


# the benchmark ----------------------------------------------------------------------------------


def test_a_hurried_scenario_has_cycles_of_whole_steps_and_a_tree_that_time_ends():
    settings = anytime.hurried(load_scenario("crowded"), 0.05).settings
    assert settings.deadline == settings.cycle == 0.05
    assert settings.capacity == anytime.CAPACITY
    assert settings.steps_of(settings.cycle) * settings.time_step == pytest.approx(0.05)


def test_the_benchmark_counts_every_cycle():
    found = anytime.measure(
        Options(cycles=3, deadline=30.0, scenario=load_scenario("corridor_person"))
    )
    (row,) = found.rows
    assert row["cycles"] == 3
    assert row["late"] == 0
    assert sum(found.details["ended by"].values()) == 3


@pytest.mark.parametrize("robot", [CarLike(), DifferentialDrive()])
def test_the_rehearsal_grows_trees_along_roads_and_without(robot, monkeypatch):
    grown = set()

    def watched(kind, by_roads, *rest):
        grown.add(by_roads)
        return grow_level(kind, by_roads, *rest)

    monkeypatch.setattr("passpmp_ti.planner.tree.grow_level", watched)
    rehearsal.rehearse(Navigator, robot, Settings.for_robot(robot))
    assert grown == {True, False}
