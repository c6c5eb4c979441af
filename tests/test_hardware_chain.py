"""The loop between range finders and executor, with neither."""

import time

import numpy as np
import pytest

from hardware.chain import PlannerLoop
from passpmp_ti import Scan, Trajectory


class Eyes:
    """A range finder that always has a scan."""

    link = None

    def __init__(self, lost=False):
        self.lost = lost

    def read(self, timeout):
        if self.lost:
            return None
        return Scan(np.full(9, 3.0), -1.0, 0.25, 10.0, pose=(0, 0, 0), stamp=time.monotonic())


class Legs:
    """A way to an executor that takes everything."""

    ready, following, status = True, None, None

    def __init__(self):
        self.sent, self.beats = [], []

    def poll(self, timeout=0.0):
        return None

    def state_at(self, when):
        return np.zeros(5)

    def beat(self, stamp):
        self.beats.append(stamp)

    def offer(self, trajectory):
        self.sent.append(trajectory)
        return True


class Head:
    """A planner that stands."""

    def __init__(self):
        self.planned, self.meanwhile = 0, lambda: None

    def update(self, scans, state, following):
        self.planned += 1
        self.meanwhile()
        return Trajectory.resting(np.zeros(5), scans[0].stamp + 0.1)


@pytest.fixture
def loop():
    slept, head, legs = [5.0], Head(), Legs()
    made = PlannerLoop(
        head, legs, [Eyes()], cycle=0.02, apart=0.0, slept=lambda: (slept[0], slept[0])
    )
    return made, head, legs, slept


def test_a_round_is_a_scan_a_plan_and_its_way(loop):
    loop, head, legs, _ = loop
    done = [loop.round() for _ in range(3)]
    assert head.planned == len(legs.sent) == len(legs.beats) == 3
    assert all(one.took is not None and one.took >= 0.0 for one in done)
    assert done[0].sent.stamp <= done[0].sent.arrived <= done[0].sent.at
    assert done[1].sent.stamp > done[0].sent.stamp


def test_who_slept_plans_no_more(loop):
    loop, head, legs, slept = loop
    loop.round()
    slept[0] += 3600.0
    for _ in range(3):
        done = loop.round()
        assert (done.took, done.sent) == (None, None)
    assert loop.slept
    # nor does the executor hear that anybody lives
    assert head.planned == len(legs.sent) == len(legs.beats) == 1


def test_what_was_planned_across_a_sleep_is_not_sent(loop):
    loop, head, legs, slept = loop

    def sleep():
        slept[0] += 60.0

    head.meanwhile = sleep
    assert loop.round().sent is None
    assert head.planned == 1
    assert legs.sent == legs.beats == []


def test_without_a_scan_nothing_is_planned_and_nobody_beats(loop, monkeypatch):
    monkeypatch.setattr("hardware.chain.WAIT", 0.02)
    loop, head, legs, _ = loop
    loop._clients[0].lost = True
    done = loop.round()
    assert done == (None, None, None)
    assert head.planned == 0
    assert legs.beats == []
