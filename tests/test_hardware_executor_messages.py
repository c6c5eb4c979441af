"""Messages, letterboxes, and executor and link joined by them in one thread."""

import math
import random
import time
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as searching
from hypothesis import strategies as st
from oracle import exact

from hardware.base import Odometry
from hardware.executor import ADDRESS, BUTTON, Executor
from hardware.executor_fuzz import NOW, ROBOT, Chain, fuzz, right_messages
from hardware.executor_settings import ExecutorSettings
from hardware.executor_trials import motion
from hardware.held import OWN
from hardware.letterbox import LONGEST_NAME, MOST_AT_ONCE, Letterbox
from hardware.link import PlannerLink
from hardware.messages import (
    LONGEST,
    MAGIC,
    MOST_STATES,
    Ask,
    Beat,
    Drive,
    Message,
    MessageError,
    Offer,
    Reset,
    Source,
    Stop,
    Torn,
    decode,
)
from hardware.simulated_base import SimulatedBase
from hardware.status import Reason, State, Status, Verdict
from hardware.stop_button import StopButton
from passpmp_ti import Navigator, Settings, Trajectory

NUMBERS = st.floats(allow_nan=False, width=64)
STATUS = Status(
    stamp=1.5, state=State.FOLLOWING, reason=Reason.NONE, held=(2**63, 7), newest=(2**63, 8),
    rests=(1.0, 2.0, 3.0), rests_from=9.0, judged=(2**63, 9), verdict=Verdict.LATE, error=0.01,
    worst_error=0.02, right=0.5, left=-0.5, taken=4, refused=5, garbled=6, overruns=7,
    odometry=(Odometry(1, 2, 3, 4, 5, 6), Odometry(7, 8, 9, 10, 11, 12)),
)  # fmt: skip


# the codec ------------------------------------------------------------------------------------


@searching(max_examples=60, deadline=None, derandomize=True, database=None)
@given(
    st.integers(0, 2**64 - 1),
    st.integers(0, 2**32 - 1),
    NUMBERS,
    st.one_of(
        st.builds(Beat, st.sampled_from(Source), NUMBERS),
        st.builds(Drive, NUMBERS, NUMBERS),
        st.builds(Odometry, *[NUMBERS] * 6),
        st.just(Ask()),
        st.just(Stop()),
        st.just(Reset()),
        st.just(STATUS),
    ),
)
def test_what_is_sent_is_what_arrives(session, sequence, sent_at, body):
    message = Message(session, sequence, sent_at, body)
    assert decode(message.encode()) == message


def test_a_trajectory_arrives_to_the_last_bit():
    sent = motion(ROBOT, np.zeros(5), 12.3, np.random.default_rng(1))
    got = decode(Message(1, 2, 3.0, Offer(sent)).encode()).body.trajectory
    assert got.times.tobytes() == sent.times.tobytes()
    assert got.states.tobytes() == sent.states.tobytes()
    assert got.brakes_from == sent.brakes_from


def test_what_is_torn_anywhere_or_has_a_wrong_bit_is_no_message():
    for whole in right_messages()[1:]:
        for end in range(len(whole)):
            with pytest.raises(MessageError):
                decode(whole[:end])
        for at in range(8 * len(whole)):
            wrong = bytearray(whole)
            wrong[at // 8] ^= 1 << at % 8
            with pytest.raises(MessageError):
                decode(bytes(wrong))
        with pytest.raises(Torn):
            decode(whole + b"\0")


def test_without_its_sum_a_wrong_number_would_pass(monkeypatch):
    whole = bytearray(Message(1, 2, 3.0, Drive(0.5, 0.5)).encode())
    whole[-12] ^= 0x10
    with pytest.raises(Torn, match="sum"):
        decode(bytes(whole))
    monkeypatch.setattr("zlib.crc32", lambda data: int.from_bytes(whole[-4:], "little"))
    assert decode(bytes(whole)).body != Drive(0.5, 0.5)


def test_the_longest_trajectory_goes_through_a_letterbox_and_a_longer_one_is_refused(tmp_path):
    rest = np.zeros((MOST_STATES, 5))
    longest = Trajectory(np.arange(MOST_STATES) * 0.01, rest, 0)
    data = Message(1, 1, 0.0, Offer(longest)).encode()
    assert len(data) == LONGEST
    box, other = Letterbox(tmp_path / "box"), Letterbox(tmp_path / "other")
    assert other.post(box.address, data)
    assert box.collect() == [(data, str(other.address))]
    longer = Trajectory(np.arange(MOST_STATES + 1) * 0.01, np.zeros((MOST_STATES + 1, 5)), 0)
    with pytest.raises(ValueError, match=str(MOST_STATES)):
        Message(1, 1, 0.0, Offer(longer)).encode()
    box.close()
    other.close()


def test_broken_messages_break_nothing():
    findings = fuzz(4000, random.Random(3))
    assert findings.failures == []
    assert findings.refused > 1000


# letterboxes ----------------------------------------------------------------------------------


def test_a_full_letterbox_and_one_that_is_gone_keep_nobody_waiting(tmp_path):
    box, other = Letterbox(tmp_path / "box"), Letterbox(tmp_path / "other")
    sent = [other.post(box.address, b"x" * 1000) for _ in range(5000)]
    assert sent[0]
    assert not sent[-1]
    assert 0 < len(box.collect()) <= MOST_AT_ONCE
    box.close()
    assert not other.post(box.address, b"x")
    other.close()


def test_a_letterbox_takes_over_from_one_that_was_killed(tmp_path):
    killed = Letterbox(tmp_path / "box")
    box, other = Letterbox(tmp_path / "box"), Letterbox(tmp_path / "other")
    assert other.post(tmp_path / "box", b"x")
    assert box.collect() == [(b"x", str(other.address))]
    assert killed.collect() == []
    for one in (box, other):
        one.close()


def test_a_letterbox_that_closes_leaves_its_successors_alone(tmp_path):
    old = Letterbox(tmp_path / "box")
    box, other = Letterbox(tmp_path / "box"), Letterbox(tmp_path / "other")
    old.close()
    assert other.post(tmp_path / "box", b"x")
    box.close()
    assert not (tmp_path / "box").exists()
    other.close()


def test_a_name_that_is_too_long_for_a_socket_is_refused(tmp_path):
    with pytest.raises(ValueError, match="directory"):
        Letterbox(tmp_path / ("x" * LONGEST_NAME))


# executor and link ----------------------------------------------------------------------------


@pytest.fixture
def chain():
    with Chain(random.Random(0)) as chain:
        yield chain


def a_motion(chain, seed=0):
    """A motion that joins what the executor holds; the link sends it."""
    start = chain.now + 0.1
    state = chain.link.following.at(start)
    return motion(ROBOT, state, start, np.random.default_rng(seed))


def test_the_planner_hears_what_became_of_its_trajectory_and_knows_it_again(chain):
    link = chain.link
    assert link.ready
    assert link.following.at(chain.now)[3:].tolist() == [0.0, 0.0]
    trajectory = a_motion(chain)
    assert link.offer(trajectory)
    for _ in range(2):
        chain.tick()
    assert link.following is trajectory
    assert link.status.verdict is Verdict.TAKEN
    # it is not sent twice
    assert not link.offer(trajectory)


def test_what_was_not_taken_is_not_what_is_followed(chain):
    before = chain.link.following
    late = a_motion(chain)
    chain.now += 0.2
    chain.link.offer(late)
    for _ in range(4):
        chain.tick()
    assert chain.link.status.verdict is Verdict.LATE
    assert chain.link.following is before


def test_rest_of_the_executors_own_is_one_and_the_same_object_while_it_lasts(chain):
    before = chain.link.following
    chain.tick()
    assert chain.link.following is before


def test_a_second_planner_waits_until_the_robot_has_come_to_rest(chain):
    trajectory = a_motion(chain)
    chain.link.offer(trajectory)
    for _ in range(3):
        chain.tick()
    with PlannerLink(chain.directory, track=ROBOT.track, clock=chain.clock) as other:
        while chain.now < trajectory.end - 0.02:
            other.poll()
            chain.tick()
            other.poll()
            assert not other.ready
        for _ in range(20):
            other.poll()
            chain.tick()
        other.poll()
        assert other.ready
        assert np.allclose(other.following.at(chain.now)[:3], trajectory.states[-1, :3])
        # from then on the first one is not heard
        start = chain.now + 0.1
        planned = motion(ROBOT, other.following.at(start), start, np.random.default_rng(1))
        other.offer(planned)
        chain.link.offer(a_motion(chain))
        for _ in range(2):
            chain.tick()
        assert chain.executor.held.newest[0] == other.session
        assert chain.executor.held.verdict is Verdict.SUPERSEDED


def test_the_robots_state_is_told_for_the_time_of_a_scan(chain):
    chain.link.offer(a_motion(chain, seed=5))
    asked = 0
    for _ in range(150):
        chain.tick()
        time_ = chain.now - 0.027
        state = chain.link.state_at(time_)
        truth = chain.base.truth
        ahead = chain.link.state_at(chain.now)
        assert np.abs(ahead[:2] - truth[1:3]).max() < 0.01
        if chain.executor.held.taken and time_ > 1000.5:
            asked += 1
            there = chain.executor.held.at(time_)
            assert math.dist(state[:2], there[:2]) < 0.02
            assert np.abs(state[3:] - there[3:5]).max() < 0.1
    assert asked > 50
    assert chain.link.state_at(chain.now + 1.0) is None
    assert chain.link.state_at(0.0) is None


@contextmanager
def guessing(chain, guess):
    """(a link of its own that guesses for so long, the stamp of the newest odometry it knows)."""
    with PlannerLink(chain.directory, track=ROBOT.track, guess=guess, clock=chain.clock) as link:
        link.poll()
        chain.tick()
        link.poll()
        yield link, link.status.odometry[-1].stamp


def test_no_state_is_guessed_for_longer_than_the_margins_hold(chain):
    with guessing(chain, 0.03) as (link, newest):
        assert link.state_at(newest + 0.029) is not None
        assert link.state_at(newest + 0.031) is None


def test_a_sensors_place_is_told_from_odometry_before_and_after_and_never_guessed(chain):
    with guessing(chain, 0.03) as (link, newest):
        assert link.state_at(newest + 0.001) is not None
        assert np.array_equal(link.state_between(newest - 0.004), link.state_at(newest - 0.004))
        chain.now = newest + 0.031  # nothing is on its way any more
        assert link.state_between(newest + 0.001) is None
        chain.tick()
        assert link.state_between(newest + 0.001) is not None
    with PlannerLink(chain.directory, track=ROBOT.track, clock=chain.clock) as deaf:
        assert deaf.state_between(0.0) is None


def test_without_an_executor_nothing_is_known_and_nothing_raises(tmp_path):
    with PlannerLink(tmp_path, track=ROBOT.track) as link:
        link.beat(1.0)
        assert link.poll(timeout=0.01) is None
        assert link.following is None
        assert not link.ready
        assert link.state_at(0.0) is None
        assert not link.offer(Trajectory.resting(np.zeros(5), 0.0))


def test_an_executor_that_fell_silent_is_not_believed_to_follow_still(chain):
    assert chain.link.ready
    chain.now += 1.0
    assert not chain.link.ready
    chain.tick()
    chain.tick()
    assert chain.link.status.stamp > chain.now - 0.1


def test_a_flood_keeps_the_executor_from_nothing(chain):
    chain.link.offer(a_motion(chain))
    for _ in range(60):
        while chain.stranger.post(chain.directory / ADDRESS, MAGIC + b"x" * 100):
            pass
        chain.tick()
    assert chain.executor.garbled > 300
    assert chain.executor.held.state in (State.FOLLOWING, State.CARRYING_ON)
    assert chain.executor.held.error < 0.02


def tell_button(chain, body, sent_at=None):
    """As the emergency stop's button; the executor hears it."""
    sent_at = chain.now if sent_at is None else sent_at
    assert chain.stranger.post(chain.directory / BUTTON, Message(1, 1, sent_at, body).encode())
    chain.executor.hear_button()


def another_executor(chain):
    return Executor(chain.remote, ROBOT, ExecutorSettings(), chain.directory, clock=chain.clock)


def test_an_executor_that_is_started_again_knows_of_the_emergency_stop(chain):
    tell_button(chain, Stop())
    again = another_executor(chain)
    assert again.held.state is State.EMERGENCY
    chain.executor, old = again, chain.executor
    for _ in range(50):
        chain.tick()
    assert again.held.state is State.EMERGENCY
    tell_button(chain, Reset())
    assert again.held.state is State.STOPPED
    assert another_executor(chain).held.state is State.STOPPED
    old.close()


def test_a_reset_that_lay_about_lets_nothing_go(chain):
    tell_button(chain, Stop())
    for sent_at in (chain.now - 1.1, chain.now + 5.0, math.nan):
        tell_button(chain, Reset(), sent_at)
        assert chain.executor.held.state is State.EMERGENCY
    tell_button(chain, Reset())
    assert chain.executor.held.state is State.STOPPED


def test_pressing_often_does_not_put_the_next_ticks_off(tmp_path):
    ticks, calls, now = [], 0, NOW
    base = SimulatedBase(rng=np.random.default_rng(0), clock=lambda: now)
    executor = Executor(
        base, ROBOT, ExecutorSettings(), tmp_path, clock=lambda: now, log=ticks.append
    )
    finger = Letterbox(tmp_path / "finger")

    def leave():
        nonlocal calls, now
        now, calls = now + 0.005, calls + 1
        for body in (Stop(), Reset()) if calls <= 100 else ():
            finger.post(tmp_path / BUTTON, Message(1, 1, now, body).encode())
        finger.collect()
        return calls > 200

    executor.run(leave)
    executor.close()
    finger.close()
    pressed = sum(tick.time <= NOW + 0.5 for tick in ticks)
    assert pressed > 90
    assert len(ticks) - pressed > 40


def test_a_press_that_finds_the_box_full_is_pressed_again(chain, monkeypatch):
    monkeypatch.setattr("hardware.stop_button.PATIENCE", 20.0)
    monkeypatch.setattr(chain.executor, "_clock", time.monotonic)
    with StopButton(chain.directory) as button:
        posts, post = [], button._box.post

        def full_at_first(to, data):
            posts.append(data)
            arrives = len(posts) > 2 and post(to, data)
            chain.executor.hear_button()
            return arrives

        monkeypatch.setattr(button._box, "post", full_at_first)
        assert button.press()
    assert len(posts) == 3


def test_who_drives_is_not_decided_by_what_is_no_order(chain):
    stray = Message(2**63, 1, chain.now, Ask()).encode()
    assert chain.stranger.post(chain.server._box.address, stray)
    trajectory = a_motion(chain)
    chain.link.offer(trajectory)
    while chain.now < trajectory.start + 0.5:
        chain.tick()
    assert chain.executor.held.state in (State.FOLLOWING, State.CARRYING_ON)


def test_no_wall_clock_is_read(chain, monkeypatch):
    def none():
        raise AssertionError("somebody looked at the wall clock")

    monkeypatch.setattr(time, "time", none)
    monkeypatch.setattr(time, "time_ns", none)
    chain.link.offer(a_motion(chain))
    for _ in range(30):
        chain.tick()
    assert chain.executor.held.newest != OWN
    with PlannerLink(chain.directory, track=ROBOT.track) as other:
        other.poll(timeout=0.001)


def test_a_base_that_slept_does_not_do_what_it_was_told_before(chain):
    chain.remote.reset()
    chain.remote.drive(0.5, 0.5)
    chain.now += chain.base.limits.command_timeout + 0.01
    chain.server.step()
    chain.now += 0.1
    assert chain.base.truth[4:] == (0.0, 0.0)


# with the planner -----------------------------------------------------------------------------


def test_a_planners_trajectories_are_taken_and_followed_within_its_margins(chain):
    executor = ExecutorSettings()
    settings = Settings.for_robot(
        ROBOT, object_speed=0.5, cell=0.1, capacity=400, particles=20, iterations=20,
        tracking_error=executor.bound + executor.reaction,
        stamp_error=executor.rest_late,
    )  # fmt: skip
    executor.check_margins(settings, scan_age=0.0)
    navigator = Navigator(ROBOT, settings, goal=(3.0, 0.5))
    world, link, taken = exact.world_of(), chain.link, []
    for cycle in range(15):
        stamp = chain.now
        pose = chain.base.truth[1:4]
        scan = exact.sweep(world, pose, 360, 2 * np.pi, 6.0, stamp)
        trajectory = navigator.update(scan, link.state_at(stamp), following=link.following)
        # at first the executor's own rest is what is followed
        assert navigator.record.not_taken == (cycle == 0)
        assert navigator.record.deviation < executor.bound
        link.beat(stamp)
        if link.offer(trajectory):
            chain.tick()
            chain.tick()
            taken.append(link.status.verdict)
            assert link.following is trajectory
        while chain.now < stamp + settings.cycle - 0.001:
            chain.tick()
    assert taken == [Verdict.TAKEN] * len(taken)
    assert len(taken) > 5
    assert chain.base.truth.x > 0.3
    assert chain.executor.held.worst_error < 0.02
