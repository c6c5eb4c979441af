"""The planner's node without its middleware: messages in by hand, trees out."""

import math
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from hardware import ros_messages as ros
from hardware import ros_planner
from hardware.base import Odometry
from hardware.ros_clock import JUMP
from hardware.ros_planner import MOST_REASONS, Planner
from hardware.ros_settings import RosSettings
from hardware.ros_twin import RosTwin, RosTwinSettings
from hardware.status import Reason, State
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings

HOME = Path(__file__).parents[1]
ROOM = Scan(np.full(180, 5.0), -math.pi, math.tau / 180, 8.0, pose=(0, 0, 0), stamp=0.0)
SMALL = {"particles": 20, "iterations": 10, "capacity": 300, "deadline": None}
SETTINGS = RosSettings(
    robot=DifferentialDrive(wheel_speed=1.0), object_speed=0.5, settings=SMALL, oldest=10.0
)


class Port:
    """Keeps what is published, and has messages heard."""

    def __init__(self):
        self.said, self.hears = {}, {}

    def publisher(self, topic, kind, *, latched=False):
        said = self.said[topic] = []
        return said.append

    def subscribe(self, topic, kind, hear, *, latched=False):
        self.hears[topic] = hear

    def tell(self, topic, tree):
        self.hears[topic](message(tree))


class Link:
    """An executor that rests at a place."""

    def __init__(self, state):
        self.state, self.ready, self.following = np.array(state), True, None
        self.offered, self.beats = [], []
        self.status = SimpleNamespace(
            state=State.RESTING, reason=Reason.NONE, worst_error=0.0, taken=0, refused=0
        )

    def poll(self, timeout=0.0):
        return None

    def state_at(self, when):
        return self.state.copy()

    state_between = state_at

    def beat(self, stamp):
        self.beats.append(stamp)

    def offer(self, trajectory):
        self.offered.append(trajectory)
        return True


def message(tree):
    if isinstance(tree, dict):
        return SimpleNamespace(**{name: message(value) for name, value in tree.items()})
    return [message(part) for part in tree] if isinstance(tree, list) else tree


@pytest.fixture
def node():
    port = Port()
    planner = Planner(port, SETTINGS)
    time.sleep(0.05)  # stamps of before it began to look are not believed
    port.tell(
        "odom", ros.odometry_message(Odometry(0, 1, 2, 0, 0, 0), 0.0, "odom", "base_link", 0.54)
    )
    return planner, port, Link([1.0, 2.0, 0.0, 0.02, -0.02])


def scan(port, age=0.01):
    port.tell("scan", ros.laser_scan(ROOM, time.time() - age, "laser"))


def mount(port):
    port.tell("/tf_static", ros.transforms([("base_link", "laser", (0.2, 0.0, 0.0))], 0.0))


def test_a_scan_and_a_goal_in_become_a_plan_and_pictures_out(node):
    planner, port, link = node
    mount(port)
    scan(port)
    assert planner.cycle(link, 0.0) is not None
    assert planner.navigator.reached  # without a goal it stays where it is
    # the goal lies in the map's frame, and that 1 m to the right of the odometry's
    port.tell("/tf", ros.transforms([("map", "odom", (1.0, 0.0, 0.0))], 0.0))
    port.tell("/move_base_simple/goal", ros.pose_stamped((5.0, 2.0, 0.0), 0.0, "map"))
    time.sleep(0.03)
    before = time.monotonic()
    scan(port)
    heard = time.monotonic()
    answer = planner.cycle(link, 0.0)
    assert planner.navigator.goal == pytest.approx((4.0, 2.0))
    assert answer.states[-1][0] > 1.1
    assert link.offered[-1] is answer
    assert len(link.beats) == 2
    # it beats with the scan's stamp, 10 ms before it came
    assert before - 0.02 < link.beats[-1] < heard
    planner.show()
    planner.tell(link)
    assert len(port.said["plan"]) == 2
    assert port.said["plan"][-1]["header"]["frame_id"] == "odom"
    for topic in ("hidden", "icsb", "markers"):
        assert len(port.said[topic]) == 1
    (told,) = port.said["/diagnostics"][-1]["status"]
    assert told["level"] == 0
    assert {"key": "cycles", "value": "2"} in told["values"]


def test_what_cannot_be_believed_is_counted_and_nothing_is_planned(node):
    planner, port, link = node
    scan(port)  # nobody knows where the range finder sits
    assert planner.cycle(link, 0.0) is None
    mount(port)
    scan(port, age=20.0)
    scan(port, age=-2.0)
    assert planner.cycle(link, 0.0) is None
    link.ready = False  # the executor brakes
    time.sleep(0.03)
    scan(port)
    assert planner.cycle(link, 0.0) is None
    assert not link.offered
    assert not link.beats
    reasons = " ".join(planner.unseen)
    for said in ("no upright laser", "too old", "of the future", "no motion to plan from"):
        assert said in reasons
    planner.tell(link)
    assert port.said["/diagnostics"][-1]["status"][0]["level"] == 1


def test_of_a_robot_that_turned_less_is_taken_for_seen(node):
    planner, port, link = node
    mount(port)
    ranges = np.full(180, 5.0)
    ranges[90:] = 2.0
    told = []
    for wheels in ((0.5, 0.5), (0.5, -0.5)):
        link.state[3:] = wheels
        time.sleep(0.03)
        sweep = replace(ROOM, ranges=ranges)
        port.tell("scan", ros.laser_scan(sweep, time.time() - 0.01, "laser"))
        told += planner._scans(link, 0.0)
    straight, turning = told
    # beside the edge at beam 90 a beam of 5 m may have looked to where another met something
    assert np.flatnonzero(straight.lost & (ranges == 5.0)).size > 0
    assert turning.lost.sum() > straight.lost.sum()
    assert (turning.ranges <= straight.ranges).all()
    # without this, all would be believed as it came
    assert straight.ranges[45] == pytest.approx(5.0, abs=0.01)


def test_after_the_machine_slept_nothing_is_planned_and_the_node_ends(monkeypatch):
    slept = [5.0]
    port = Port()
    planner = Planner(port, SETTINGS, slept=lambda: (slept[0], slept[0]))
    time.sleep(0.05)
    odometry = Odometry(0, 1, 2, 0, 0, 0)
    port.tell("odom", ros.odometry_message(odometry, 0.0, "odom", "base_link", 0.54))
    link = Link([1.0, 2.0, 0.0, 0.0, 0.0])
    mount(port)
    scan(port)
    assert planner.cycle(link, 0.0) is not None
    slept[0] += 3600.0
    time.sleep(0.03)
    scan(port)
    assert planner.cycle(link, 0.0) is None
    assert len(link.beats) == len(link.offered) == 1
    running = nullcontext(SimpleNamespace(alive=True))
    monkeypatch.setattr(ros_planner, "ExecutorProcess", lambda config: running)
    monkeypatch.setattr(ros_planner, "put_forward", lambda who, priority: None)
    monkeypatch.setattr(ros_planner, "PlannerLink", lambda *_, **__: nullcontext(link))
    with pytest.raises(RuntimeError, match="asleep"):
        planner.run(lambda: False)


def test_scans_of_the_chair_without_physics_are_believed_as_they_come():
    port = Port()
    given = yaml.safe_load((HOME / "launch" / "twin.yaml").read_text())
    settings = RosSettings.from_parameters(given)
    twin = RosTwin(port, RosTwinSettings(chair="plain"))
    twin._tell_scan(0, twin._eyes[0], time.monotonic())
    sweep = ros.sweep_of(message(port.said["scan"][-1]), range_max=10.0)
    over, _ = settings.moments(sweep.stamp, sweep.lasts)
    assert 0.0 < over - sweep.stamp < JUMP
    # one that tells nothing is taken to last for longer than it takes to come
    assert settings.moments(sweep.stamp, 0.0)[0] - sweep.stamp > JUMP


def test_names_from_outside_do_not_fill_the_memory(node):
    planner, port, link = node
    mount(port)
    for n in range(MOST_REASONS + 8):
        time.sleep(0.001)  # stamps increase
        port.tell("scan", ros.laser_scan(ROOM, time.time(), f"laser_{n}"))
        if n % 6 == 5:
            time.sleep(0.001)
            scan(port, age=0.0)  # a good one, so that no cycle waits
            planner.cycle(link, 0.0)
    assert len(planner.unseen) <= MOST_REASONS + 1


def test_another_goal_keeps_what_is_known_and_held():
    robot = DifferentialDrive(wheel_speed=1.0)
    settings = Settings.for_robot(robot, object_speed=0.5, **{**SMALL, "cycle": 0.1})
    navigator = Navigator(robot, settings, goal=(3.0, 0.0))
    state = np.zeros(5)
    held = navigator.update(ROOM, state)
    model = navigator.model
    navigator.head_for((0.0, 3.0))
    assert navigator.goal == (0.0, 3.0)
    assert navigator.held is held
    assert navigator.model is model
    with pytest.raises(ValueError, match="goal"):
        navigator.head_for((math.nan, 0.0))
    assert navigator.goal == (0.0, 3.0)
    # the very same state one cycle later: it turns to the new goal
    later = Scan(ROOM.ranges, ROOM.angle_min, ROOM.angle_increment, 8.0, (0, 0, 0), stamp=0.1)
    answer = navigator.update(later, held.at(0.1))
    assert navigator.record.goal == (0.0, 3.0)
    assert answer.states[-1][2] > held.states[-1][2]
