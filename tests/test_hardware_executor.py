"""What an executor holds and does about it, on a clock that only these tests move."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as searching
from hypothesis import strategies as st

from hardware.admission import judge
from hardware.base import BaseLimits, Odometry
from hardware.executor_settings import ExecutorSettings
from hardware.executor_trials import motion
from hardware.follower import error_of
from hardware.held import MOST_WAITING, OWN, TAKES, Held
from hardware.messages import Source
from hardware.path import Path
from hardware.simulated_base import BaseNature, SimulatedBase
from hardware.status import Reason, State, Verdict
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.trajectory import Trajectory

ROBOT = DifferentialDrive(wheel_speed=1.5)
SETTINGS = ExecutorSettings()
LIMITS = BaseLimits()
NATURE = BaseNature(
    limits=LIMITS, slip=0.05, pose_noise=0.001, heading_noise=0.001, speed_noise=0.003
)
CYCLE = 0.1
REST = 0.03
"""[m/s]"""
BRAKING = ROBOT.wheel_speed / LIMITS.acceleration
"""From top speed [s]."""


@dataclass
class Bench:
    """A base, what an executor holds, and a planner that sends a motion every cycle."""

    seed: int = 0
    now: float = 50.0
    session: int = 1
    sequence: int = 0
    planner: bool = True
    sensor: bool = True
    settings: ExecutorSettings = SETTINGS
    taken: list = field(default_factory=list)
    """What a bystander has to believe is held: (start, path)."""

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)
        self.base = SimulatedBase(NATURE, rng=self.rng.spawn(1)[0], clock=lambda: self.now)
        self.held = Held(ROBOT, LIMITS, self.settings, self.now)
        self.due = self.last = self.now
        self.stopping = False

    def plan(self, start=None, pieces=3):
        """A motion that joins what is held."""
        start = self.now + CYCLE if start is None else start
        before = self.held.at(start)[:5] if self.held.state in TAKES else np.zeros(5)
        return motion(ROBOT, np.array(before), start, self.rng, most_pieces=pieces)

    def send(self, trajectory, *, name=None, sent_at=None):
        """Send it; the verdict."""
        self.sequence += 1
        name = (self.session, self.sequence) if name is None else name
        sent_at = self.now if sent_at is None else sent_at
        verdict = self.held.offer(trajectory, name, sent_at, self.now)
        if verdict is Verdict.TAKEN:
            path = Path(trajectory)
            self.taken = [one for one in self.taken if one[0] < path.start] + [(path.start, path)]
        return verdict

    def tick(self, after=SETTINGS.period):
        """One tick, `after` the last [s]."""
        self.now += after
        if self.sensor:
            self.held.hear(Source.SENSOR, self.now, self.now)
        if self.planner:
            self.held.hear(Source.PLANNER, self.now, self.now)
            if self.now >= self.due:
                self.due = self.now + CYCLE
                self.send(self.plan())
        before = self.held.order
        order = self.held.step(self.now, self.base.odometry())
        self.check(before, self.now - self.last)
        self.last = self.now
        if order.stop:
            self.base.stop()
        elif self.stopping:
            self.base.reset()
        self.stopping = order.stop
        self.base.drive(order.right, order.left)

    def check(self, before, since):
        """An order follows what was taken, or is the one before, braked."""
        order, state = self.held.order, self.held.state
        assert all(map(math.isfinite, order))
        assert max(abs(order.right), abs(order.left)) <= LIMITS.wheel_speed
        if state in TAKES:
            s = self.settings.follower
            there = self.followed(self.now + s.delay)
            if there is None or there[3:] == (0.0, 0.0, 0.0, 0.0):
                assert order[:2] == (0.0, 0.0)
                return
            for ordered, speed, rate in (
                (order.right, there.right, there.right_rate),
                (order.left, there.left, there.left_rate),
            ):
                planned = speed + s.wheel_lag * rate
                # braking to rest never turns into a way back
                planned = 0.0 if planned * speed < 0.0 else planned
                assert abs(ordered - planned) <= s.most + 1e-9
            return
        self.taken = []
        fastest = max(abs(before.right), abs(before.left))
        left_over = max(fastest - LIMITS.acceleration * since, 0.0)
        assert max(abs(order.right), abs(order.left)) == pytest.approx(left_over, abs=1e-9)
        assert order.right * before.left == pytest.approx(order.left * before.right, abs=1e-9)

    def followed(self, time):
        """Where a bystander has to believe the robot should be."""
        begun = [path for start, path in self.taken if start <= time]
        return begun[-1].at(time) if begun else None

    def run(self, seconds):
        """Tick for so long."""
        for _ in range(round(seconds / SETTINGS.period)):
            self.tick()

    def run_until_moving(self, speed=0.5):
        """Tick until a wheel turns as fast, in truth."""
        for _ in range(3000):
            self.tick()
            if self.fastest > speed:
                return
        raise AssertionError(f"it does not move: {self.held.state!r} {self.held.reason!r}")

    @property
    def fastest(self):
        truth = self.base.truth
        return max(abs(truth.right), abs(truth.left))

    def time_to_rest(self, within=20.0):
        """[s] until the robot rests and stays so, as long as one looks."""
        began = moving = self.now
        while self.now < began + within:
            self.tick()
            if self.fastest > REST:
                moving = self.now
            elif self.now > moving + 0.5:
                break
        return moving - began


def moving(**options):
    bench = Bench(**options)
    bench.run_until_moving()
    return bench


def resting():
    bench = Bench(planner=False)
    bench.run(0.5)
    assert bench.held.state is State.RESTING
    return bench


# what it takes --------------------------------------------------------------------------------


def test_it_takes_what_joins_what_it_holds_and_follows_it():
    bench = resting()
    trajectory = bench.plan()
    assert bench.send(trajectory) is Verdict.TAKEN
    assert bench.held.newest == (1, 1)
    assert bench.held.held == OWN
    bench.run(CYCLE + 0.02)
    assert bench.held.held == (1, 1)
    assert bench.held.state in (State.FOLLOWING, State.CARRYING_ON)
    bench.run(trajectory.duration + 0.3)
    assert bench.held.state is State.RESTING
    assert bench.fastest < REST
    x, y, _ = trajectory.states[-1, :3]
    assert math.dist(bench.base.truth[1:3], (x, y)) < SETTINGS.bound


def changed(trajectory, row, column, value):
    states = trajectory.states.copy()
    states[row, column] = value
    return Trajectory(trajectory.times, states, trajectory.brakes_from)


def without_its_end(t):
    cut = max(2, t.brakes_from // 2)
    return Trajectory(t.times[:cut], t.states[:cut], cut - 1)


def back_in_time(t):
    return Trajectory(t.times[::-1].copy(), t.states, t.brakes_from)


def elsewhere(t):
    return Trajectory(t.times, np.add(t.states, [0.02, 0, 0, 0, 0]), t.brakes_from)


def turned(t):
    return Trajectory(t.times, np.add(t.states, [0, 0, 0.02, 0, 0]), t.brakes_from)


def sooner(t):
    return Trajectory(t.times - CYCLE - 0.001, t.states, t.brakes_from)


def later(t):
    return Trajectory(t.times + SETTINGS.ahead, t.states, t.brakes_from)


def sparse(t):
    return Trajectory(t.times * 20 - 19 * t.times[0], t.states, t.brakes_from)


def too_fast(t):
    """Twice the speed, and so twice the acceleration, on the same way."""
    return Trajectory(
        t.times[0] + (t.times - t.times[0]) / 2, t.states * [1, 1, 1, 2, 2], t.brakes_from
    )


def along_a_line(speeds, step, heading=0.0, sense=1.0):
    """Straight on from the origin at these speeds [m/s], `step` [s] apart; the body may look
    elsewhere, and the place may move the other way."""
    speeds = np.asarray(speeds)
    way = sense * np.concatenate([[0.0], np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * step)])
    still = 0.0 * way
    states = np.stack([way, still, still + heading, speeds, speeds], axis=1)
    return Trajectory(10.0 + step * np.arange(len(speeds)), states, 0)


HILL = np.concatenate([np.arange(20), np.arange(20, -1, -1)]) * 0.05


@pytest.mark.parametrize(
    ("trajectory", "verdict"),
    [
        (along_a_line(HILL, 0.05), Verdict.TAKEN),
        (along_a_line(HILL, 0.05, heading=math.pi / 2), Verdict.BEYOND_LIMITS),
        (along_a_line(HILL, 0.05, sense=-1.0), Verdict.BEYOND_LIMITS),
        # 5 m/s^2: each step within what rounding may do to one, not all of them together
        (along_a_line(HILL / 10, 0.001), Verdict.BEYOND_LIMITS),
        (along_a_line(HILL / 10, 0.005), Verdict.TAKEN),
    ],
)
def test_a_motion_goes_where_its_wheels_go_however_short_its_steps(trajectory, verdict):
    assert judge(trajectory, ROBOT) is verdict


@pytest.mark.parametrize("wheels", [(1.7e308, -1.7e308), (1.7e308, 1.7e308), (-1.7e308, 0.0)])
def test_odometry_with_numbers_that_are_too_great_makes_it_brake(wheels):
    bench = moving()
    there = bench.held.at(bench.now)
    bench.held.step(bench.now, Odometry(bench.now, *there[:3], *wheels))
    if bench.held.state is State.BRAKING:
        assert bench.held.reason is Reason.NO_ORDER
    assert all(map(math.isfinite, bench.held.order))


def test_a_path_that_hardly_moves_is_followed():
    bench = resting()
    place, start = bench.held.at(bench.now), bench.now + 0.05
    states = np.add([*place[:5]], [[0, 0, 0, v, v] for v in (0.0, 1e-200, 1e-200, 0.0)])
    assert bench.send(Trajectory(start + 0.05 * np.arange(4), states, 0)) is Verdict.TAKEN
    bench.run(0.5)
    assert bench.held.state is State.RESTING


@pytest.mark.parametrize(
    ("made", "verdict"),
    [
        (lambda t: t, Verdict.TAKEN),
        (lambda t: changed(t, 5, 0, math.nan), Verdict.NOT_WHOLE),
        (lambda t: changed(t, 5, 4, math.inf), Verdict.NOT_WHOLE),
        (lambda t: changed(t, -1, 3, 0.01), Verdict.NOT_WHOLE),
        (without_its_end, Verdict.NOT_WHOLE),
        (back_in_time, Verdict.NOT_WHOLE),
        (lambda t: changed(t, 5, 0, 1e300), Verdict.BEYOND_LIMITS),
        (lambda t: changed(t, 5, 3, 0.5), Verdict.BEYOND_LIMITS),
        (lambda t: changed(t, 5, 2, 0.1), Verdict.BEYOND_LIMITS),
        (sparse, Verdict.BEYOND_LIMITS),
        (too_fast, Verdict.BEYOND_LIMITS),
        (elsewhere, Verdict.DOES_NOT_JOIN),
        (turned, Verdict.DOES_NOT_JOIN),
        (sooner, Verdict.LATE),
        (later, Verdict.EARLY),
    ],
)
def test_it_takes_nothing_that_is_not_whole_in_time_and_where_the_robot_will_be(made, verdict):
    bench = resting()
    assert bench.send(made(bench.plan())) is verdict
    assert bench.held.taken == (verdict is Verdict.TAKEN)


def test_a_trajectory_that_comes_as_it_starts_is_in_time_and_a_moment_later_it_is_not():
    for late, verdict in ((0.0, Verdict.TAKEN), (1e-6, Verdict.LATE)):
        bench = resting()
        trajectory = bench.plan()
        bench.now = trajectory.start + late
        assert bench.send(trajectory) is verdict


def test_what_comes_again_or_out_of_order_is_not_taken_again():
    bench = resting()
    trajectory = bench.plan()
    assert bench.send(trajectory, name=(1, 7)) is Verdict.TAKEN
    assert bench.send(trajectory, name=(1, 7)) is Verdict.REPEATED
    assert bench.send(bench.plan(), name=(1, 6)) is Verdict.SUPERSEDED
    assert bench.held.newest == (1, 7)


def test_a_planner_that_wakes_up_after_another_took_over_is_not_heard():
    bench = resting()
    assert bench.send(bench.plan(), name=(2, 1)) is Verdict.TAKEN
    assert bench.send(bench.plan(bench.now + 0.2), name=(1, 900)) is Verdict.SUPERSEDED
    assert bench.send(bench.plan(bench.now + 0.2), name=(3, 1)) is Verdict.TAKEN


def test_what_was_sent_by_another_clock_is_not_taken():
    bench = resting()
    assert bench.send(bench.plan(), sent_at=bench.now + 0.01) is Verdict.WRONG_CLOCK
    assert bench.send(bench.plan(), sent_at=math.nan) is Verdict.WRONG_CLOCK
    assert bench.send(bench.plan(), sent_at=bench.now - 1.0) is Verdict.LATE


def test_a_newer_trajectory_replaces_one_that_has_not_begun():
    bench = resting()
    first = bench.plan()
    assert bench.send(first) is Verdict.TAKEN
    second = motion(ROBOT, first.at(bench.now + 0.05), bench.now + 0.05, bench.rng)
    assert bench.send(second) is Verdict.TAKEN
    bench.run(0.2)
    assert bench.held.held == (1, 2)


def test_replacing_what_has_not_begun_does_not_add_tolerance_to_tolerance():
    bench = resting()
    still = Trajectory.resting(np.array(bench.held.at(bench.now)[:5]), bench.now + 0.1)
    verdicts = []
    for n in range(1, 4):
        beside = Trajectory(still.times, np.add(still.states, [0.004 * n, 0, 0, 0, 0]), 0)
        verdicts.append(bench.send(beside))
    assert verdicts == [Verdict.TAKEN, Verdict.DOES_NOT_JOIN, Verdict.DOES_NOT_JOIN]


def test_only_so_many_may_wait_for_their_start():
    bench = resting()
    place = bench.held.at(bench.now)
    waiting = [
        Trajectory(np.array([bench.now + 0.1 * n]), np.array([place[:5]]), 0)
        for n in range(1, MOST_WAITING + 2)
    ]
    assert [bench.send(t) for t in waiting] == [Verdict.TAKEN] * MOST_WAITING + [Verdict.FULL]


# what it does when others fall silent ---------------------------------------------------------


@pytest.mark.parametrize(
    ("gone", "reason"),
    [("planner", Reason.PLANNER_SILENT), ("sensor", Reason.SENSOR_SILENT)],
)
def test_without_planner_or_sensor_it_carries_on_to_rest_on_what_it_holds(gone, reason):
    for seed in range(5):
        bench = moving(seed=seed)
        setattr(bench, gone, False)
        # a sensor's silence is noticed after its time-out, and what comes until then is taken
        bench.run(SETTINGS.sensor_timeout + 0.02)
        _, end = bench.held.last
        if bench.now < end:
            assert (bench.held.state, bench.held.reason) == (State.CARRYING_ON, reason)
        assert bench.now + bench.time_to_rest() <= end + SETTINGS.rest_late
        assert bench.held.state is State.RESTING
        setattr(bench, gone, True)
        bench.run_until_moving()


def test_trajectories_made_of_an_old_scan_are_not_taken():
    bench = moving()
    bench.sensor = False
    bench.run(SETTINGS.sensor_timeout + 0.02)
    assert bench.send(bench.plan()) is Verdict.SENSOR_SILENT
    # nor by the word of a clock that is ahead
    bench.held.hear(Source.SENSOR, bench.now + 5.0, bench.now)
    bench.held.hear(Source.SENSOR, math.nan, bench.now)
    assert bench.send(bench.plan()) is Verdict.SENSOR_SILENT


# what it does when it does not know where the robot is ----------------------------------------


@pytest.mark.parametrize(
    ("fault", "reason", "detection"),
    [
        ("silent", Reason.FEEDBACK_LOST, SETTINGS.feedback_timeout + 0.02),
        ("nan", Reason.FEEDBACK_BROKEN, 0.02),
        ("jump", Reason.OFF_ITS_PATH, 0.02),
    ],
)
def test_without_feedback_it_brakes_at_once(fault, reason, detection):
    for seed in range(5):
        bench = moving(seed=seed)
        speed = max(bench.fastest, *map(abs, bench.held.order[:2]))
        bench.base.inject(fault)
        bench.planner = False
        bench.run(detection)
        assert (bench.held.state, bench.held.reason) == (State.BRAKING, reason)
        took = detection + bench.time_to_rest()
        # it may have sped up until it was known
        assert took <= detection + speed / LIMITS.acceleration + detection + SETTINGS.rest_late


def test_after_that_it_drives_on_from_where_it_is_once_it_knows_where():
    for fault in ("silent", "nan", "jump"):
        bench = moving()
        bench.base.inject(fault)
        bench.run(3.0)
        held = bench.held
        if fault == "jump":
            # the place is a place: the robot rests there
            assert held.state in TAKES
        else:
            assert held.state is State.STOPPED
            assert bench.send(bench.plan()) is Verdict.STOPPED
        bench.planner = False
        bench.base.inject("")
        bench.run(1.5)
        assert held.state is State.RESTING
        assert held.newest == OWN
        place, _ = held.last
        assert math.dist(place[:2], bench.base.truth[1:3]) < 0.02
        bench.planner = True
        bench.run_until_moving()


def test_feedback_that_stands_still_while_the_robot_should_move_is_noticed():
    bench = moving()
    place = bench.base.truth
    bench.base.inject("frozen")
    bench.time_to_rest()
    assert bench.held.reason is Reason.OFF_ITS_PATH
    # the bound, what it was off before, and a wheel's way while it brakes
    way = BRAKING * ROBOT.wheel_speed / 2
    assert math.dist(bench.base.truth[1:3], place[1:3]) < 2 * SETTINGS.bound + 0.05 + way


def test_the_bound_decides_when_it_is_off_its_path():
    for aside, state in ((0.95, State.RESTING), (1.05, State.BRAKING)):
        bench = resting()
        place = bench.held.at(bench.now)
        pushed = Odometry(
            bench.now, place.x + aside * SETTINGS.bound, place.y, place.theta, 0.0, 0.0
        )
        bench.held.step(bench.now, pushed)
        assert bench.held.state is state


@pytest.mark.parametrize("older", [0.0, 0.9 * SETTINGS.feedback_timeout])
def test_the_error_is_that_at_the_time_when_the_place_was_measured(older):
    bench = moving()
    there = bench.held.at(bench.now - older)
    bench.held.step(bench.now, Odometry(bench.now - older, *there[:5]))
    assert bench.held.error < 1e-9


def test_a_base_that_does_not_obey_is_stopped_by_its_own_stop():
    bench = moving()
    bench.base.inject("deaf")
    bench.planner = False
    took = bench.time_to_rest()
    assert bench.base.truth[4:] == (0.0, 0.0)
    assert took < 5.0


def test_wheels_that_turn_though_the_robot_should_rest_are_braked():
    bench = resting()
    place = bench.held.at(bench.now)
    rolls = Odometry(bench.now, place.x, place.y, place.theta, 0.1, 0.1)
    bench.held.step(bench.now, rolls)
    assert (bench.held.state, bench.held.reason) == (State.BRAKING, Reason.ROLLING)


def test_an_executor_that_slept_finds_the_base_braking_and_takes_up_from_rest():
    bench = moving()
    bench.now += 2.0  # the base's own time-out has stopped it
    bench.tick(after=0.0)
    assert bench.held.state is State.BRAKING
    bench.run_until_moving()


def test_it_moves_nothing_before_it_knows_where_the_robot_is():
    held = Held(ROBOT, LIMITS, SETTINGS, 0.0)
    for n in range(100):
        order = held.step(0.01 * n, None)
        assert order[:2] == (0.0, 0.0)
    assert (held.state, held.reason) == (State.STOPPED, Reason.STARTING)
    assert order.stop


def test_without_the_time_out_a_silent_base_would_be_driven_blindly():
    for timeout, state in ((0.06, State.BRAKING), (10.0, State.FOLLOWING)):
        bench = moving(settings=ExecutorSettings(feedback_timeout=timeout))
        bench.base.inject("silent")
        bench.planner = False
        bench.run(0.08)
        assert bench.held.state is state


def test_without_the_bound_a_robot_off_its_path_would_be_steered_back_from_anywhere():
    for bound, state in ((0.08, State.BRAKING), (5.0, State.RESTING)):
        bench = Bench(planner=False, settings=ExecutorSettings(bound=bound))
        bench.run(0.5)
        bench.base.inject("jump")
        bench.run(0.02)
        assert bench.held.state is state


def test_without_the_join_the_robot_would_be_told_to_jump():
    loose = ExecutorSettings(bound=1.0, join=(0.5, 0.01, 0.02))
    for settings, verdict in ((SETTINGS, Verdict.DOES_NOT_JOIN), (loose, Verdict.TAKEN)):
        bench = Bench(planner=False, settings=settings)
        bench.run(0.5)
        assert bench.send(elsewhere(bench.plan())) is verdict


# the emergency stop ---------------------------------------------------------------------------


def test_an_emergency_stop_brakes_and_stays_until_it_is_let_go_at_rest():
    bench = moving()
    bench.held.stop()
    speed = max(bench.fastest, *map(abs, bench.held.order[:2]))
    bench.tick()
    assert bench.held.order.stop
    assert not bench.held.reset()
    took = bench.time_to_rest()
    assert took <= speed / LIMITS.acceleration + SETTINGS.rest_late
    bench.run(2.0)
    assert bench.held.state is State.EMERGENCY
    assert bench.fastest == 0.0
    assert bench.held.reset()
    bench.run_until_moving()


def test_faults_do_not_undo_an_emergency_stop():
    bench = moving()
    bench.held.stop()
    for fault in ("silent", "nan", "jump", ""):
        bench.base.inject(fault)
        bench.run(1.0)
        assert bench.held.state is State.EMERGENCY


def test_nobody_can_let_go_what_was_not_pressed():
    bench = moving()
    assert not bench.held.reset()
    assert bench.held.state in TAKES


# whatever happens -----------------------------------------------------------------------------

EVENTS = (
    "nothing", "silent", "nan", "frozen", "jump", "mend", "stop", "reset", "planner off",
    "planner on", "sensor off", "sensor on", "late", "early", "elsewhere", "torn", "old session",
    "new session", "again", "sleep", "jitter",
)  # fmt: skip


def happen(bench, event):
    """One event."""
    if event in ("silent", "nan", "frozen", "jump", "mend"):
        bench.base.inject("" if event == "mend" else event)
    elif event == "stop":
        bench.held.stop()
    elif event == "reset":
        bench.held.reset()
    elif event.startswith(("planner", "sensor")):
        who, what = event.split()
        setattr(bench, who, what == "on")
    elif event == "new session":
        bench.session += 1
    elif event == "sleep":
        bench.now += float(bench.rng.uniform(0.02, 1.0))
    elif event == "jitter":
        for _ in range(5):
            bench.tick(after=float(bench.rng.uniform(0.0, 0.05)))
    elif event == "old session":
        bench.send(bench.plan(), name=(bench.session - 1, 10**6))
    elif event == "again":
        bench.send(bench.plan(), name=bench.held.newest)
    elif event != "nothing":
        wrong = {"late": sooner, "early": later, "elsewhere": elsewhere, "torn": without_its_end}
        bench.send(wrong[event](bench.plan()))


def whatever_happens(seed, events):
    bench = Bench(seed=seed, session=5)
    honest = not {"frozen", "jump"} & {event for event, _ in events}
    for event, ticks in events:
        happen(bench, event)
        for _ in range(ticks):
            bench.tick()
            if honest and bench.held.state in TAKES and bench.held.error:
                truth = bench.base.truth
                off = error_of(truth, bench.held.at(truth.stamp), 0.0)
                # as far as the newest odometry was old, and its noise
                assert off <= SETTINGS.bound + 0.02
    # everybody falls silent: it is at rest by when what it holds is, or it brakes before
    bench.planner = bench.sensor = False
    _, end = bench.held.last
    end = max(end, bench.now + SETTINGS.feedback_timeout + 0.02 + BRAKING + 0.4 / 1.6)
    # a frozen place may be noticed as late as that, and then it brakes
    late = SETTINGS.rest_late + (0.0 if honest else BRAKING + 0.4 / 1.6)
    assert bench.now + bench.time_to_rest() <= end + late


EVENT_LISTS = st.lists(st.tuples(st.sampled_from(EVENTS), st.integers(0, 40)), max_size=8)


@searching(max_examples=20, deadline=None, derandomize=True, database=None)
@given(st.integers(0, 10**6), EVENT_LISTS)
def test_orders_follow_what_is_held_or_brake_and_silence_ends_at_rest(seed, events):
    whatever_happens(seed, events)


@pytest.mark.campaign
@searching(max_examples=2000, deadline=None, derandomize=True, database=None)
@given(st.integers(0, 10**6), EVENT_LISTS)
def test_the_same_at_length(seed, events):
    whatever_happens(seed, events)


def test_a_check_that_could_not_fail_would_be_none():
    bench = moving()
    bench.held.order = bench.held.order._replace(right=bench.held.order.right + 1.0)
    with pytest.raises(AssertionError):
        bench.check(bench.held.order, 0.01)
