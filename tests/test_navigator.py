"""The cycle: what is held always ends at rest, whatever the world or the sensor does."""

import numpy as np
import pytest
from oracle import exact

from passpmp_ti import CarLike, DifferentialDrive, Navigator, Scan, Settings

CHAIR = DifferentialDrive()
SETTINGS = Settings.for_robot(
    CHAIR, object_speed=0.5, cell=0.1, capacity=400, particles=20, iterations=20
)
OPEN = exact.world_of()
REST = np.zeros(5)
CYCLE = SETTINGS.cycle


def scan_at(state, stamp, world=OPEN, **more):
    pose = tuple(float(v) for v in state[:3])
    return exact.sweep(world, pose, 360, 2 * np.pi, 6.0, stamp, **more)


def drive(navigator, seconds, world=OPEN, start=REST):
    """Follow the plan exactly; yields (stamp, state, held before, held after)."""
    state, stamp = np.array(start, dtype=float), 5.0
    for _ in range(round(seconds / navigator.settings.cycle)):
        before = navigator.held
        after = navigator.update(scan_at(state, stamp, world), state)
        yield stamp, state, before, after
        following = before if before is not None else after
        stamp += navigator.settings.cycle
        state = following.at(stamp)
        if navigator.reached:
            return


def same(a, b):
    return a.times.tobytes() == b.times.tobytes() and a.states.tobytes() == b.states.tobytes()


def underway(world=OPEN, goal=(4.0, 0.0), cycles=8, settings=SETTINGS):
    """(navigator that moves, its next stamp, its state then)."""
    navigator = Navigator(CHAIR, settings, goal)
    *_, (stamp, _, before, after) = drive(navigator, cycles * CYCLE, world)
    following = before if before is not None else after
    stamp += CYCLE
    state = following.at(stamp)
    assert not CHAIR.at_rest(state)
    return navigator, stamp, state


# driving --------------------------------------------------------------------------------------


@pytest.mark.parametrize("bound", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("goal", [(2.5, 1.0), (1.5, 0.0)])
def test_it_drives_to_its_goal_in_the_open_and_stops_there(bound, goal):
    navigator = Navigator(CHAIR, Settings.for_robot(CHAIR, object_speed=bound), goal)
    *_, (_, state, _, held) = drive(navigator, 10.0)
    assert navigator.reached
    assert navigator.record.decision == "arrived"
    assert CHAIR.at_rest(held.at(1e9))
    assert np.hypot(*(held.states[-1, :2] - goal)) <= navigator.settings.goal_tolerance
    assert CHAIR.at_rest(state)


def test_a_car_drives_to_its_goal_too():
    car, goal = CarLike(), (40.0, 5.0)
    settings = Settings.for_robot(car, object_speed=5.0, cell=0.5)
    navigator = Navigator(car, settings, goal)
    state, stamp = REST, 0.0
    for _ in range(200):
        before = navigator.held
        scan = exact.sweep(OPEN, tuple(state[:3]), 360, 2 * np.pi, 60.0, stamp)
        held = navigator.update(scan, state)
        stamp += settings.cycle
        state = (before or held).at(stamp)
        assert car.at_rest(held.states[-1])
        if navigator.reached:
            break
    assert navigator.reached
    assert np.hypot(*(state[:2] - goal)) <= settings.goal_tolerance


def test_several_goals_are_reached_in_turn():
    goals = [(2.5, 0.0), (2.5, 1.5)]
    navigator = Navigator(CHAIR, Settings.for_robot(CHAIR), goals)
    seen = [goals[0]]
    for _, state, _, _ in drive(navigator, 20.0):
        if navigator.goal != seen[-1]:
            seen.append(navigator.goal)
            assert np.hypot(*(state[:2] - goals[0])) <= navigator.settings.goal_tolerance
            assert CHAIR.at_rest(state)
    assert seen == goals
    assert navigator.reached


def test_the_first_cycle_needs_a_robot_at_rest():
    navigator = Navigator(CHAIR, SETTINGS, (3.0, 0.0))
    moving = np.array([0, 0, 0, 0.5, 0.5])
    with pytest.raises(ValueError, match="at rest"):
        navigator.update(scan_at(moving, 0.0), moving)
    with pytest.raises(ValueError, match="finite"):
        navigator.update(scan_at(REST, 0.0), np.full(5, np.nan))
    assert navigator.held is None


# the timeline ---------------------------------------------------------------------------------


def test_a_new_plan_starts_a_cycle_later_and_goes_on_from_the_held_one():
    navigator = Navigator(CHAIR, SETTINGS, (2.0, 0.8))
    new = 0
    for stamp, _, before, after in drive(navigator, 5.0):
        if navigator.record.decision != "new":
            continue
        new += 1
        assert after.start == pytest.approx(stamp + CYCLE, abs=1e-9)
        expected = before.at(after.start) if before is not None else REST
        assert after.states[0] == pytest.approx(expected, abs=1e-6)
    assert new > 3


def test_what_is_held_always_ends_at_rest_and_was_verified_whole():
    world = exact.world_of([exact.box(2.0, 0.4, 0.6, 0.6)], [(3.0, -0.8, 0.3)])
    navigator = Navigator(CHAIR, SETTINGS, (4.0, 0.0))
    for _, _, _, held in drive(navigator, 6.0, world):
        assert CHAIR.at_rest(held.states[-1])
        assert (np.diff(held.times) > 0).all()
        assert exact.box_distance(held.states[:, :2], world).min() > CHAIR.radius
        tail = held.states[held.brakes_from :]
        speed = np.abs(tail[:, 3:5]).max(axis=1)
        assert (np.diff(speed) <= 1e-6).all()


def test_the_held_plan_wins_ties():
    # where no plan is better than standing, nothing new is chosen
    walls = [exact.box(*at, *size) for at, size in (
        ((0.9, 0), (0.6, 3.0)), ((-0.9, 0), (0.6, 3.0)), ((0, 0.9), (3.0, 0.6)),
        ((0, -0.9), (3.0, 0.6)))]  # fmt: skip
    navigator = Navigator(CHAIR, SETTINGS.changed(guide="euclidean", weight_turn=0.0), (0.0, 5.0))
    for _ in drive(navigator, 1.0, exact.world_of(walls)):
        pass
    held = navigator.held
    for stamp in (20.0, 20.1):
        state = held.at(stamp)
        after = navigator.update(scan_at(state, stamp, exact.world_of(walls)), state)
        assert after is held
        assert navigator.record.decision == "held"
        assert "at least as good" in navigator.record.reason or "no safe" in navigator.record.reason


# trouble --------------------------------------------------------------------------------------


def test_a_scan_that_cannot_be_used_keeps_what_is_held():
    navigator, stamp, state = underway()
    held = navigator.held
    late = scan_at(state, stamp - 3 * CYCLE)
    apart = [scan_at(state, stamp), scan_at(state, stamp + 0.05)]
    for scans in (late, apart):
        assert navigator.update(scans, state) is held
        assert navigator.record.decision == "held"
        assert navigator.record.lost_scan
    for unknown in (np.full(5, np.nan), np.zeros(3), None):
        assert navigator.update(scan_at(state, stamp), unknown) is held
        assert "state" in navigator.record.lost_scan
    assert CHAIR.at_rest(held.states[-1])


def test_no_scan_at_all_keeps_what_is_held():
    navigator, _, state = underway()
    held = navigator.held
    assert navigator.update([], state) is held
    assert navigator.record.lost_scan


def test_garbage_ranges_are_an_unseen_world_and_the_robot_comes_to_rest():
    navigator, stamp, state = underway()
    generator = np.random.default_rng(0)
    for k in range(60):
        ranges = np.full(360, np.nan) if k % 2 else generator.uniform(-1, 0, 360)
        scan = Scan(ranges, -np.pi, 2 * np.pi / 360, 6.0, tuple(state[:3]), stamp)
        before = navigator.held
        held = navigator.update(scan, state)
        assert CHAIR.at_rest(held.states[-1])
        stamp += CYCLE
        state = before.at(stamp)
    assert CHAIR.at_rest(state)


def test_a_broken_premise_is_answered_by_braking():
    navigator, stamp, state = underway()
    ahead = state[:2] + 1.2 * np.array([np.cos(state[2]), np.sin(state[2])])
    born = exact.world_of([], [(*ahead, 0.3)])
    held = navigator.update(scan_at(state, stamp, born), state)
    assert navigator.record.decision == "brake"
    assert len(navigator.record.broken_premises) > 0
    assert "returns" in navigator.record.reason
    assert held.start == pytest.approx(stamp + CYCLE)
    speed = np.abs(held.states[:, 3:5]).max(axis=1)
    assert (np.diff(speed) <= 1e-6).all()
    assert speed[-1] == 0.0


def test_a_robot_off_its_plan_brakes_from_where_it_is():
    navigator, stamp, state = underway()
    off = state + np.array([0.0, 0.4, 0, 0, 0])
    held = navigator.update(scan_at(off, stamp), off)
    assert navigator.record.decision == "brake"
    assert "off its plan" in navigator.record.reason
    assert navigator.record.deviation == pytest.approx(0.4, abs=1e-6)
    assert CHAIR.at_rest(held.states[-1])


# the record -----------------------------------------------------------------------------------


def test_the_record_says_what_happened():
    navigator, stamp, state = underway()
    held = navigator.update(scan_at(state, stamp), state)
    record = navigator.record
    assert record.stamp == stamp
    assert record.decision in ("new", "held")
    assert bool(record.reason) == (record.decision == "held")
    assert {"model", "guide", "tree", "choice", "bookkeeping", "total"} <= set(record.timings)
    assert 0 < sum(v for k, v in record.timings.items() if k != "total") <= record.timings["total"]
    assert record.tree_nodes == record.tree.count > 1
    assert record.tree_depth >= 1
    assert record.tree_stopped_by in ("depth", "capacity", "time", "unsafe")
    assert record.cost == pytest.approx(min(record.cost_new, record.cost_held), abs=1e-4)
    assert record.plan_time == pytest.approx(held.end - stamp - CYCLE, abs=1e-6)
    assert record.decision_time > 0
    assert record.root_proved
    assert record.broken_premises.shape == (0, 2)
    assert record.deviation < 1e-6
    assert record.goal == (4.0, 0.0)
    assert record.chosen is held is navigator.held
    assert record.model is navigator.model
    assert len(record.particle_leaves) > 0
    assert all(path.shape[1] == 2 for path in record.particles)


def test_two_runs_are_the_same_byte_for_byte():
    world = exact.world_of([exact.box(2.0, 0.4, 0.6, 0.6)])
    runs = []
    for _ in range(2):
        navigator = Navigator(CHAIR, SETTINGS, (4.0, 0.0), seed=7)
        runs.append([held for *_, held in drive(navigator, 2.0, world)])
    assert all(same(a, b) for a, b in zip(*runs, strict=True))


def test_no_plan_of_the_swarm_is_better_than_the_exhaustive_one():
    world = exact.world_of([exact.box(2.0, 0.4, 0.6, 0.6)])
    found = {}
    for optimizer in ("pso", "exhaustive"):
        navigator = Navigator(
            CHAIR, SETTINGS.changed(optimizer=optimizer, particles=50, iterations=40), (4.0, 0.0)
        )
        navigator.update(scan_at(REST, 0.0, world), REST)
        found[optimizer] = navigator.record.cost_new
    assert found["exhaustive"] <= found["pso"] <= 1.05 * found["exhaustive"]


def test_goals_are_checked():
    for goal in ((), [(0.0, np.nan)], [(1.0, 2.0, 3.0)]):
        with pytest.raises(ValueError, match=r"Navigator\.goal"):
            Navigator(CHAIR, SETTINGS, goal)


def test_a_plan_that_comes_after_the_deadline_is_dropped():
    navigator = Navigator(CHAIR, SETTINGS.changed(deadline=0.0), (3.0, 0.0))
    held = navigator.update(scan_at(REST, 1.0), REST)
    assert navigator.record.decision == "held"
    assert "deadline" in navigator.record.reason
    assert CHAIR.at_rest(held.at(1e9))
    assert held.states[-1, :2].tolist() == [0.0, 0.0]
