"""What an executor's margins hold, each taken away once; sleep, sockets, and who is heard."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hardware.base import BaseLimits, Odometry
from hardware.base_link import BaseServer, RemoteBase
from hardware.executor import ADDRESS, Executor
from hardware.executor_process import ExecutorConfig, ExecutorProcess
from hardware.executor_settings import ExecutorSettings
from hardware.executor_trials import motion
from hardware.held import Held
from hardware.letterbox import Letterbox
from hardware.messages import Ask, Message, Offer, Source
from hardware.simulated_base import BaseNature, SimulatedBase
from hardware.sleep import Sleep, asleep
from hardware.status import Reason, State, Verdict
from passpmp_ti import DifferentialDrive, Settings

ROBOT = DifferentialDrive(wheel_speed=1.5)
LIMITS = BaseLimits()
HOME = str(Path(__file__).parents[1])


def resting(settings, now=50.0):
    """What is held by an executor that stands at the origin, and the time."""
    held = Held(ROBOT, LIMITS, settings, now)
    for _ in range(40):
        now += settings.period
        held.step(now, Odometry(now, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert held.state is State.RESTING
    return held, now


# the margin for what the robot does between a look and its effect ------------------------------


def test_a_robot_that_leaves_its_path_is_within_the_planners_margin_until_it_brakes():
    settings = ExecutorSettings()
    margin = settings.bound + settings.reaction
    worst = {}
    for leaving in (settings.leaving_speed, 1e-9):
        careful = ExecutorSettings(leaving_speed=leaving)
        held, began = resting(careful)
        now, off = began, 0.0
        # it drifts off sideways, and odometry is as late as it is believed
        while held.state is State.RESTING:
            now += careful.period
            seen = max(now - began - 0.9 * careful.feedback_timeout, 0.0)
            place = Odometry(now - 0.9 * careful.feedback_timeout, 0.0, 0.4 * seen, 0, 0, 0)
            held.step(now, place)
            # until the next order works
            off = 0.4 * (now + careful.follower.delay - began)
        worst[leaving] = off
    assert worst[settings.leaving_speed] <= margin
    # with no such speed declared it is noticed too late
    assert worst[1e-9] > margin


def test_a_planner_must_reckon_with_the_reaction_too():
    executor = ExecutorSettings()
    kept = executor.bound + executor.reaction
    settings = Settings.for_robot(ROBOT, tracking_error=kept, stamp_error=0.2)
    executor.check_margins(settings, scan_age=0.03)
    with pytest.raises(ValueError, match=r"tracking_error = 0.08 m.*raise tracking_error to 0.088"):
        executor.check_margins(settings.changed(tracking_error=executor.bound), scan_age=0.03)


def test_a_base_that_would_run_on_too_far_without_its_executor_is_refused():
    kept = ExecutorSettings(runs_on=0.5)
    Held(ROBOT, BaseLimits(command_timeout=0.25), kept, 0.0)
    with pytest.raises(ValueError, match=r"runs_on = 0.5 m.*command_timeout = 0.3 s"):
        Held(ROBOT, BaseLimits(command_timeout=0.3), kept, 0.0)


# sleep -----------------------------------------------------------------------------------------


def test_each_sleep_is_told_once_and_waiting_between_two_clocks_is_none():
    readings = iter([(7.0, 7.0), (7.0, 7.0), (5.0, 9.0), (37.0, 37.0), (37.0, 37.0)])
    sleep = Sleep(lambda: next(readings))
    assert [sleep.woke() for _ in range(4)] == [False, False, True, False]


def test_what_was_known_outlasts_a_reading_that_had_to_wait():
    readings = iter([(7.0, 7.0), (7.0, 9.0), (8.0, 8.0)])
    sleep = Sleep(lambda: next(readings))
    assert [sleep.woke() for _ in range(2)] == [False, True]


def test_this_machine_tells_for_how_long_it_slept():
    least, most = asleep()
    assert 0.0 <= most - least < 1.0
    assert not Sleep().woke()


class Woken:
    """An executor that follows a motion, on a clock and with a sleep that only this moves."""

    def __init__(self, directory):
        self.now, self.slept = 50.0, 0.0
        nature = BaseNature()
        self.base = SimulatedBase(nature, rng=np.random.default_rng(0), clock=lambda: self.now)
        self.executor = Executor(
            self.base, ROBOT, ExecutorSettings(), directory,
            clock=lambda: self.now, slept=lambda: (self.slept, self.slept),
        )  # fmt: skip
        self.run(0.5)
        self.start = self.now + 0.1
        self.motion = motion(ROBOT, np.zeros(5), self.start, np.random.default_rng(1))
        assert self.offer() is Verdict.TAKEN
        self.run(0.6)
        assert self.executor.held.state is State.FOLLOWING

    def offer(self, sequence=1):
        held = self.executor.held
        return held.offer(self.motion, (1, sequence), self.now, self.now)

    def run(self, seconds):
        for _ in range(round(seconds / 0.01)):
            self.now += 0.01
            for source in Source:
                self.executor.held.hear(source, self.now, self.now)
            self.executor.tick()


@pytest.mark.parametrize(("slept", "state"), [(3600.0, State.BRAKING), (0.0, State.FOLLOWING)])
def test_who_wakes_does_not_follow_what_was_verified_before(tmp_path, slept, state):
    woken = Woken(tmp_path)
    woken.slept += slept
    woken.now += 0.01
    woken.executor.tick()
    assert woken.executor.held.state is state
    if slept:
        assert woken.executor.held.reason is Reason.SLEPT
        woken.run(3.0)
        # it stands, and may be driven again
        assert woken.executor.held.state is State.RESTING
        assert woken.base.truth[4:] == (0.0, 0.0)
    woken.executor.close()


def test_what_is_heard_first_after_a_sleep_is_not_taken(tmp_path):
    woken = Woken(tmp_path)
    planner = Letterbox(tmp_path / "planner")
    later = motion(ROBOT, np.zeros(5), woken.now + 1.0, np.random.default_rng(2))
    planner.post(tmp_path / ADDRESS, Message(2, 1, woken.now, Offer(later)).encode())
    woken.slept += 60.0
    woken.executor.hear()
    assert woken.executor.held.verdict is Verdict.STOPPED
    assert woken.executor.held.state is State.BRAKING
    planner.close()
    woken.executor.close()


# who is heard ----------------------------------------------------------------------------------


def test_a_planner_that_was_replaced_keeps_nobody_alive():
    silent = {}
    for session in (4, 5):
        held, now = resting(ExecutorSettings())
        held.hear(Source.SENSOR, now, now)
        first = motion(ROBOT, np.zeros(5), now + 0.1, np.random.default_rng(3))
        assert held.offer(first, (5, 1), now, now) is Verdict.TAKEN
        for _ in range(50):
            now += 0.01
            held.hear(Source.SENSOR, now, now)
            held.hear(Source.PLANNER, now, now, session)
            place = held.at(now)
            held.step(now, Odometry(now, *place[:5]))
        silent[session] = held.state
    assert silent == {4: State.CARRYING_ON, 5: State.FOLLOWING}


def test_wheels_do_not_wait_for_talk(tmp_path):
    now = [50.0]

    def clock():
        now[0] += 1e-3  # every look at it takes a while, as letters do
        return now[0]

    base = SimulatedBase(BaseNature(), rng=np.random.default_rng(0), clock=lambda: now[0])
    executor = Executor(base, ROBOT, ExecutorSettings(), tmp_path, clock=clock)
    talker = Letterbox(tmp_path / "talker")
    many = 8  # systems queue little more
    for n in range(many):
        assert talker.post(tmp_path / ADDRESS, Message(1, n, now[0], Ask()).encode())
    due = now[0] + 0.01
    executor.hear(due)
    assert now[0] < due + 0.006
    answered = len(talker.collect())
    assert 1 <= answered < 5
    # one is heard however late it is, and the rest are there still
    executor.hear(due)
    assert len(talker.collect()) == 1
    executor.hear()
    assert len(talker.collect()) == many - answered - 1
    talker.close()
    executor.close()


# the base's own time-out -----------------------------------------------------------------------


class Served:
    """A base behind a socket, on a clock that only this moves."""

    def __init__(self, directory):
        self.now = 50.0
        self.base = SimulatedBase(
            BaseNature(), rng=np.random.default_rng(0), clock=lambda: self.now
        )
        self.server = BaseServer(self.base, directory / "base", clock=lambda: self.now)
        self.remote = RemoteBase(directory / "base", LIMITS, clock=lambda: self.now)

    def wait(self, seconds):
        for _ in range(round(seconds / 0.005)):
            self.now += 0.005
            self.server.step()

    def drive(self, seconds, speed=0.5):
        for _ in range(round(seconds / 0.01)):
            self.remote.drive(speed, speed)
            self.wait(0.01)


@pytest.fixture
def served(tmp_path):
    one = Served(tmp_path)
    yield one
    one.remote.close()
    one.server.close()


def test_an_order_holds_from_when_it_was_sent_however_late_it_came(served):
    served.drive(1.0)
    served.remote.drive(0.5, 0.5)
    sent = served.now
    # the server gets no time of the processor meanwhile
    served.now += 0.8 * LIMITS.command_timeout
    served.server.step()
    speed = 0.5
    while served.base.truth.right > speed - 0.01:
        served.wait(0.005)
    # 10 ms to see it by, and a step of the server
    assert served.now - sent <= LIMITS.command_timeout + 0.02


def test_a_fresh_order_lets_a_base_go_that_only_heard_nothing(served):
    served.drive(0.5)
    served.wait(LIMITS.command_timeout + 0.6)
    assert served.base.truth.right == 0.0
    served.drive(0.5)
    assert served.base.truth.right > 0.3


def test_no_order_lets_a_base_go_that_was_told_to_stop(served):
    served.drive(0.5)
    served.wait(LIMITS.command_timeout + 0.01)
    served.remote.stop()
    served.drive(1.0)
    assert served.base.truth.right == 0.0
    served.remote.reset()
    served.drive(0.5)
    assert served.base.truth.right > 0.3


def test_a_silence_does_not_make_a_base_forget_that_it_was_told_to_stop(served):
    served.drive(0.5)
    served.remote.stop()
    served.drive(0.1)
    served.wait(2 * LIMITS.command_timeout)
    served.drive(1.0)
    assert served.base.truth.right == 0.0
    served.remote.reset()
    served.drive(0.5)
    assert served.base.truth.right > 0.3


# the process -----------------------------------------------------------------------------------


def test_a_directory_that_others_may_enter_is_refused(tmp_path):
    open_to_all = tmp_path / "x"
    open_to_all.mkdir(mode=0o755)
    with pytest.raises(RuntimeError, match="chmod 700"):
        ExecutorProcess(ExecutorConfig(directory=open_to_all, base="hardware.simulated_base:build"))


def test_an_executor_whose_starter_died_while_it_started_ends(tmp_path):
    config = ExecutorConfig(directory=tmp_path / "x", base="hardware.simulated_base:build")
    # as its starter's number stands that of a process which is gone
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    orphan = subprocess.Popen(
        [sys.executable, "-m", "hardware.executor_process", config.to_json(), str(gone.pid)],
        env={**os.environ, "PYTHONPATH": HOME},
        stdout=subprocess.DEVNULL,
    )
    try:
        assert orphan.wait(20.0) == 0
    finally:
        if orphan.poll() is None:
            orphan.send_signal(signal.SIGKILL)
            orphan.wait()
