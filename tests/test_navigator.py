"""The cycle: what is held always ends at rest, whatever the world or the sensor does."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from oracle import exact

from passpmp_ti import CarLike, DifferentialDrive, Navigator, Scan, Settings, Trajectory
from passpmp_ti.faults.kinds import INSIDE, broken_inside
from passpmp_ti.planner import navigator as cycle
from passpmp_ti.planner.coast import decision_time
from passpmp_ti.planner.place import only_fits_now

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


def on(navigator, stamp, state, cycles, world=OPEN, shift=0.0):
    """Follow what is held for some cycles, stamps off by `shift`; yields each record."""
    held_shift = 0.0
    for _ in range(cycles):
        before = navigator.held
        after = navigator.update(scan_at(state, stamp + shift, world), state)
        yield navigator.record, state
        stamp += CYCLE
        if after is not before:
            state, held_shift = before.at(stamp + held_shift), shift
            assert after.at(stamp + shift) == pytest.approx(state, abs=1e-6)
        else:
            state = before.at(stamp + held_shift)


@pytest.mark.parametrize(
    "rubbish", [None, 3, "scan", [None], [np.zeros(3)], object(), (), np.zeros(4)]
)
def test_what_is_no_scan_is_no_scan(rubbish):
    navigator, stamp, state = underway()
    held = navigator.held
    assert navigator.update(rubbish, state) is held
    assert "no scan" in navigator.record.lost_scan
    navigator.update(scan_at(state, stamp), state)
    assert not navigator.record.lost_scan
    with pytest.raises(ValueError, match="needs a scan"):
        Navigator(CHAIR, SETTINGS, (1.0, 0.0)).update(rubbish, REST)


@pytest.mark.parametrize("stamp", [1e300, -1e300, 1e15])
def test_a_stamp_that_no_clock_says_is_not_used(stamp):
    navigator, now, state = underway()
    held = navigator.held
    assert navigator.update(scan_at(state, stamp), state) is held
    assert "clock" in navigator.record.lost_scan
    navigator.update(scan_at(state, now), state)
    assert not navigator.record.lost_scan


def test_a_scan_that_comes_late_is_planned_with_while_it_is_news():
    # by the best plan of each cycle, whatever the swarm draws: the seventh has a new one
    navigator, stamp, state = underway(cycles=7, settings=SETTINGS.changed(optimizer="exhaustive"))
    held, late = navigator.held, stamp - 0.4 * CYCLE
    then = held.at(late) if held.start <= late else None
    assert then is None  # what is held begins after that scan: the road before it is remembered
    navigator.update(scan_at(state, stamp), state)
    # a plan chosen just now begins at the cycle's end: until then what was held is followed
    middle = held.at(stamp + 0.6 * CYCLE)
    navigator.update(scan_at(middle, stamp + 0.6 * CYCLE), middle)
    assert not navigator.record.lost_scan
    assert navigator.record.deviation < 0.01


def test_an_old_scan_in_between_changes_nothing_where_the_robots_place_tells_the_time():
    navigator, stamp, state = underway()
    held = navigator.held
    old = scan_at(state, stamp - 3 * CYCLE)
    assert navigator.update(old, state) is held
    assert "not newer" in navigator.record.lost_scan
    for record, _ in on(navigator, stamp, state, 3):
        assert not record.lost_scan
        assert not record.forgot


def test_an_old_scan_before_a_robot_at_rest_costs_its_memory():
    # nobody can tell whether the clock was put back and has caught up
    navigator = Navigator(CHAIR, SETTINGS, (0.0, 0.0))
    for stamp in (1.0, 1.1, 1.05):
        navigator.update(scan_at(REST, stamp), REST)
    assert navigator.record.lost_scan
    navigator.update(scan_at(REST, 1.2), REST)
    assert "put back" in navigator.record.forgot
    navigator.update(scan_at(REST, 1.3), REST)
    assert not navigator.record.forgot


def test_a_clock_that_is_put_back_brings_the_robot_to_rest_and_is_believed_then():
    navigator, stamp, state = underway(goal=(40.0, 0.0))
    records = list(on(navigator, stamp, state, 60, shift=-300.0))
    rested = [k for k, (_, at) in enumerate(records) if CHAIR.at_rest(at)]
    believed = [k for k, (record, _) in enumerate(records) if not record.lost_scan]
    assert all("clock" in record.lost_scan for record, _ in records[: believed[0]])
    assert rested[0] <= believed[0]
    assert "clock" in records[believed[0]][0].forgot
    assert not any(record.lost_scan for record, _ in records[believed[0] :])
    assert not CHAIR.at_rest(records[-1][1])


def test_a_clock_that_jumps_forward_is_answered_from_where_the_robot_is():
    for jump in (0.35, 3.0, 300.0):
        navigator, stamp, state = underway()
        records = [record for record, _ in on(navigator, stamp, state, 40, shift=jump)]
        assert records[0].decision == "brake" or "clock" in records[0].lost_scan
        assert not records[-1].lost_scan


def test_a_long_pause_at_rest_is_no_jump():
    navigator = Navigator(CHAIR, SETTINGS, (3.0, 0.0))
    navigator.update(scan_at(REST, 0.0), REST)
    still = Navigator(CHAIR, SETTINGS, (0.0, 0.0))
    still.update(scan_at(REST, 0.0), REST)
    still.update(scan_at(REST, 30.0), REST)
    assert not still.record.lost_scan
    assert not still.record.forgot
    still.update(scan_at(REST, 130.0), REST)
    assert "long ago" in still.record.forgot


@pytest.mark.parametrize("jump", [(0.0, 3.0, 0.0), (-2.0, 1.0, 2.0), (0.0, 0.0, 0.4)])
def test_a_pose_that_jumps_costs_the_memory_and_the_robot_brakes_from_where_it_will_be(jump):
    navigator, stamp, state = underway()
    going = navigator.held
    off = state + np.array([*jump, 0.0, 0.0])
    held = navigator.update(scan_at(off, stamp), off)
    assert navigator.record.decision == "brake"
    assert "off its plan" in navigator.record.reason
    assert "off its plan" in navigator.record.forgot
    assert held.start == pytest.approx(stamp + CYCLE)
    # the robot's own motion is what it was: a cycle of what it followed, laid at the new place
    c, s = np.cos(jump[2]), np.sin(jump[2])
    way = going.at(stamp + CYCLE)[:2] - going.at(stamp)[:2]
    there = off[:2] + np.array([c * way[0] - s * way[1], s * way[0] + c * way[1]])
    assert held.states[0, :2] == pytest.approx(there, abs=1e-5)
    assert held.states[0, 3:] == pytest.approx(going.at(stamp + CYCLE)[3:], abs=1e-5)
    after = held.at(stamp + CYCLE)
    navigator.update(scan_at(after, stamp + CYCLE), after)
    assert not navigator.record.forgot
    assert navigator.record.deviation < 1e-6


def test_a_sensor_that_is_not_where_it_sits_is_not_used():
    navigator, stamp, state = underway()
    held = navigator.held
    for off in ([1.0, 0, 0], [0, 0, 0.5]):
        elsewhere = state + np.array([*off, 0, 0])
        assert navigator.update(scan_at(elsewhere, stamp), state) is held
        assert "does not fit" in navigator.record.lost_scan
        assert navigator.update(scan_at(state, stamp), elsewhere) is held
        assert "does not fit" in navigator.record.lost_scan
    far = state + np.array([5e3, 0, 0, 0, 0])
    assert navigator.update(scan_at(far, stamp), far) is held
    assert "cannot be" in navigator.record.lost_scan


def test_a_sensor_that_sees_nothing_any_more_is_not_believed():
    world = exact.world_of([exact.box(3.5, y, 1.0, 1.0) for y in (-3.0, -1.5, 1.5, 3.0)])
    navigator, stamp, state = underway(world, goal=(2.0, 0.0))
    held, model = navigator.held, navigator.model
    blind = Scan(np.full(360, 1e9), -np.pi, 2 * np.pi / 360, 6.0, tuple(state[:3]), stamp)
    assert navigator.update(blind, state) is held
    assert "are gone" in navigator.record.lost_scan
    assert navigator.model is model
    stamp += CYCLE
    state = held.at(stamp)
    navigator.update(scan_at(state, stamp, world), state)
    assert not navigator.record.lost_scan


def test_such_a_sensor_is_believed_in_the_end_when_the_robot_is_long_at_rest():
    world = exact.world_of([exact.box(3.5, y, 1.0, 1.0) for y in (-3.0, -1.5, 1.5, 3.0)])
    navigator, stamp, state = underway(world, goal=(2.0, 0.0))
    held, first = navigator.held, stamp
    for _ in range(60):
        state = held.at(stamp)
        blind = Scan(np.full(360, 1e9), -np.pi, 2 * np.pi / 360, 6.0, tuple(state[:3]), stamp)
        after = navigator.update(blind, state)
        if not navigator.record.lost_scan:
            break
        assert after is held
        stamp += CYCLE
    assert "for long" in navigator.record.forgot
    assert CHAIR.at_rest(state)
    assert stamp - first > 4.5


def test_a_blind_sensor_is_not_believed_because_the_clock_was_put_back():
    box = exact.world_of([exact.box(3.5, y, 1.0, 1.0) for y in (-3.0, -1.5, 1.5, 3.0)])
    still = Navigator(CHAIR, SETTINGS, (0.0, 0.0))
    for stamp in (1.0, 1.1, 1.05, 1.2):
        scan = scan_at(REST, stamp, box)
        stays = np.zeros(360, dtype=bool)
        ranges = np.full(360, 1e9) if stamp == 1.2 else scan.ranges
        still.update(Scan(ranges, scan.angle_min, scan.angle_increment, 6.0, scan.pose, stamp,
                          moving=stays), REST)  # fmt: skip
    assert "are gone" in still.record.lost_scan


def test_the_place_tells_the_time_only_where_no_other_time_fits():
    times = 0.1 * np.arange(21)
    states = np.zeros((21, 5))
    states[:, 0] = np.minimum(times, 1.5)
    road = Trajectory(times, states, 0)
    near = (0.01, 0.1)
    assert only_fits_now(road, road.at(1.0), 1.0, near, 0.05)
    assert not only_fits_now(road, road.at(1.0), 0.5, near, 0.05)  # it is not there
    assert not only_fits_now(road, road.at(1.495), 1.495, near, 0.05)  # there it will stay
    assert not only_fits_now(road, road.at(1.0), 1.0, (0.2, 0.1), 0.05)  # too wide to tell


@pytest.mark.parametrize("where", list(INSIDE))
def test_a_planner_that_raises_has_found_no_plan(where):
    navigator, stamp, state = underway()
    for _ in range(8):  # until there is a new plan that could raise
        held, model = navigator.held, navigator.model
        with broken_inside(where, np.random.default_rng(0)):
            after = navigator.update(scan_at(state, stamp), state)
        assert after is held
        if navigator.record.fault:
            break
        stamp += CYCLE
        state = held.at(stamp)
    assert "fault harness" in navigator.record.fault
    assert navigator.record.decision == "held"
    assert navigator.record.timings["total"] > 0
    if where in ("model", "second check"):
        assert navigator.model is model
    else:
        assert navigator.model.stamp == stamp
    stamp += CYCLE
    state = held.at(stamp)
    navigator.update(scan_at(state, stamp), state)
    assert not navigator.record.fault
    assert navigator.record.deviation < 1e-6


def test_an_answer_that_was_not_taken_is_forgotten():
    navigator, stamp, state = underway()
    taken = navigator.held
    for _ in range(8):  # until an answer is another one
        dropped = navigator.update(scan_at(state, stamp), state)
        stamp += CYCLE
        if dropped is not taken:
            break
        state = taken.at(stamp)
    assert dropped is not taken
    state = taken.at(stamp)
    navigator.update(scan_at(state, stamp), state, following=taken)
    assert navigator.record.not_taken
    assert navigator.record.deviation < 1e-6
    assert navigator.held.start in (taken.start, pytest.approx(stamp + CYCLE))
    navigator.update(scan_at(state, stamp + CYCLE), state, following="nothing")
    assert "Trajectory" in navigator.record.fault


def test_the_clear_disc_is_declared_about_the_start_only():
    settings = SETTINGS.changed(clear_radius=1.0)
    navigator = Navigator(CHAIR, settings, (0.0, 0.0))

    def seen_behind(state, stamp):
        scan = exact.sweep(OPEN, tuple(state[:3]), 180, np.pi, 6.0, stamp)
        navigator.update(scan, state)
        model = navigator.model
        j, i = np.floor((state[1::-1] - np.array(model.origin)[::-1]) / model.cell).astype(int)
        return model.seen[j, i - 7]

    assert seen_behind(REST, 0.0)
    elsewhere = REST + np.array([0, 30.0, 0, 0, 0])
    assert not seen_behind(elsewhere, 0.1)
    assert "off its plan" in navigator.record.forgot


# the record -----------------------------------------------------------------------------------


def test_the_decision_time_is_worked_out_when_somebody_asks(monkeypatch):
    asked = []
    monkeypatch.setattr(
        cycle, "decision_time", lambda *given: asked.append(given) or decision_time(*given)
    )
    navigator, stamp, state = underway()
    navigator.update(scan_at(state, stamp), state)
    record = navigator.record
    assert not asked
    packed = pickle.dumps(record)
    assert asked == [(record.model, record.chosen, stamp, stamp + CYCLE)]
    expected = decision_time(*asked[0])
    assert record.decision_time == pickle.loads(packed).decision_time == expected
    # what is kept of it holds on to no model
    assert replace(record, model=None, chosen=None).decision_time == expected
    assert len(asked) == 1


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


# what the executor says ------------------------------------------------------------------------


def bad_followings(navigator):
    held = navigator.held
    n = len(held.times)
    beyond, unfinished = held.states.copy(), held.states.copy()
    beyond[:, 3] = 100.0
    unfinished[-1, 3:] = 0.2
    return [
        "nothing", Trajectory(np.zeros(0), np.zeros((0, 5)), 0),
        Trajectory(held.times, held.states[:, :4], 0), Trajectory(held.times, beyond, 0),
        Trajectory(held.times, np.full((n, 5), np.nan), 0), Trajectory(held.times, unfinished, 0),
        Trajectory(held.times[::-1], held.states, 0),
    ]  # fmt: skip


@pytest.mark.parametrize("number", range(7))
def test_what_nobody_can_follow_is_answered_by_braking(number):
    navigator, stamp, state = underway()
    answer = navigator.update(
        scan_at(state, stamp), state, following=bad_followings(navigator)[number]
    )
    assert navigator.record.decision == "brake"
    assert "said to follow" in navigator.record.fault
    assert CHAIR.at_rest(answer.states[-1])
    # the next cycle goes on as if nothing had been
    stamp += CYCLE
    navigator.update(scan_at(answer.at(stamp), stamp), answer.at(stamp))
    assert not navigator.record.fault


def test_a_path_with_a_gap_is_not_taken_for_clear():
    navigator, stamp, state = underway()
    held = navigator.held
    assert not CHAIR.at_rest(held.at(stamp + CYCLE))
    sparse = Trajectory(held.times[[0, -1]], held.states[[0, -1]], 0)
    navigator.update(scan_at(state, stamp), state, following=sparse)
    assert navigator.record.decision == "brake"


def test_a_disc_is_declared_clear_at_the_start_and_then_only():
    settings = Settings.for_robot(
        CHAIR, object_speed=0.5, cell=0.1, blind_speed=0.0, clear_radius=1.5, capacity=100,
        particles=10, iterations=5,
    )  # fmt: skip

    def half(state, stamp):
        pose = tuple(float(v) for v in state[:3])
        return exact.sweep(OPEN, pose, 180, np.pi, 6.0, stamp)

    behind = np.array([[-0.8, 0.0]])
    prompt = Navigator(CHAIR, settings, (3.0, 0.0))
    prompt.update(half(REST, 0.0), REST)
    assert not prompt.model.occupied(behind, [0.1]).any()
    late = Navigator(CHAIR, settings, (3.0, 0.0))
    late.update([half(REST, 0.0), half(REST, 0.01)], REST)  # of different instants: not used
    late.update(half(REST, 0.1), REST)
    assert late.model.occupied(behind, [0.2]).any()


def test_a_silent_sensor_is_no_blind_sector():
    settings = Settings.for_robot(
        CHAIR, object_speed=0.5, cell=0.1, blind_speed=0.0, clear_radius=1.5, capacity=100,
        particles=10, iterations=5,
    )  # fmt: skip
    navigator = Navigator(CHAIR, settings, (3.0, 0.0))

    def both(stamp):
        return [
            exact.sweep(OPEN, (x, 0.0, way), 180, 0.9 * np.pi, 6.0, stamp)
            for x, way in ((0.1, 0.0), (-0.1, np.pi))
        ]

    navigator.update(both(0.0), REST)
    assert not navigator.record.lost_scan
    navigator.update(both(0.1)[:1], REST)
    assert "silent" in navigator.record.lost_scan
