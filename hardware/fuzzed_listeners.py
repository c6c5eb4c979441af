"""Those who listen to ROS, without a middleware, as a fuzzer feeds them."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from hardware.base import FARTHEST, BaseLimits, wheels_of
from hardware.broken_trees import as_message, broken_tree
from hardware.fuzzed_messages import MOVED, NOW, RIGHT
from hardware.ros_base import RosBase, placer
from hardware.ros_clock import RosClock
from hardware.ros_frames import MOST_FRAMES, Frames
from hardware.ros_messages import Tree, stop_of, transforms_of
from hardware.ros_planner import MOST_REASONS, Planner
from hardware.ros_port import BOOL, GRID, ODOMETRY, POSE, SCAN, TRANSFORMS
from hardware.ros_settings import RosSettings
from hardware.status import Reason, State, Status, Verdict
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.trajectory import Trajectory

SETTINGS = RosSettings(
    robot=DifferentialDrive(wheel_speed=1.0), object_speed=0.5, oldest=10.0, map="map",
    settings={"particles": 20, "iterations": 10, "capacity": 300, "deadline": None},
)  # fmt: skip
TOPICS = {
    "scan": SCAN, "odom": ODOMETRY, "/tf": TRANSFORMS, "/tf_static": TRANSFORMS, "map": GRID,
    "/move_base_simple/goal": POSE,
}  # fmt: skip
CYCLES = 0.03
"""After this share of the messages a cycle is planned ..."""
TOLD = 0.97
"""... before which each kind of message is told aright, mostly."""
RENEWED = 1000
"""A planner is a new one after so many messages: much is only heard at first."""
WHEELS = (math.nan, math.inf, -math.inf, 0.0, 0.5, -0.5, 5.0, -1e30, 1e308, -1e308)
FIRST = 0.9
"""Of the planners hear right odometry first."""
PLACES = (*(1.0,) * 20, 1.1, -5.0, 1e5, 0.999 * FARTHEST)
"""Where the executor has the robot: mostly it stays there [m]."""
AGES = (-1e9, -20.0, -0.5, -1e-3, 0.0, 0.0, 0.0, 0.0, 1e-3, 0.5, 20.0, 1e9)
"""Of stamps; below 0: of the future [s]."""


class StubPort:
    """Keeps what hears, and forgets what is said."""

    def __init__(self) -> None:
        self.hears: dict[str, Callable[[Any], None]] = {}

    def publisher(
        self, topic: str, kind: str, *, latched: bool = False
    ) -> Callable[[Tree], None]:
        return lambda tree: None

    def subscribe(
        self, topic: str, kind: str, hear: Callable[[Any], None], *, latched: bool = False
    ) -> None:
        self.hears[topic] = hear


class StubLink:
    """An executor that stands, or rolls, at a place."""

    def __init__(self) -> None:
        self.state = np.array([1.0, 2.0, 0.3, 0.0, 0.0])
        self.ready, self.following = True, None
        self.status = _status(State.RESTING)

    def roll(self, *, rolls: bool, x: float = 1.0) -> None:
        """Begin to roll, or stand, at a place."""
        self.state[0] = x
        self.state[3:] = 0.2 if rolls else 0.0
        self.status = _status(State.FOLLOWING if rolls else State.RESTING)

    def poll(self, timeout: float = 0.0) -> None:
        pass

    def state_at(self, when: float) -> np.ndarray:
        return self.state.copy()

    state_between = state_at

    def beat(self, stamp: float) -> None:
        if not stamp <= time.monotonic():
            raise AssertionError(f"a scan of {stamp} s, which is later than now")

    def offer(self, trajectory: Trajectory) -> bool:
        if not np.isfinite(trajectory.states).all():
            raise AssertionError("a trajectory through places that are none")
        return True


class Planners:
    """The planner's node."""

    refusal = ()

    def __init__(self, draw: random.Random) -> None:
        self._draw = draw
        self._topics = list(TOPICS)
        self._renew()
        # kernels are compiled before anything is timed
        for rolls in (False, False, True):
            self._tell(list(TOPICS))
            self._plan(rolls=rolls, shows=True)
        self._renew()

    def made(self, draw: random.Random) -> tuple[str, Any]:
        topic = draw.choice(self._topics)
        now = time.time() - draw.choice(AGES)
        return topic, as_message(broken_tree(RIGHT[TOPICS[topic]](now), draw))

    def eat(self, data: tuple[str, Any]) -> None:
        self._port.hears[data[0]](data[1])
        self._heard += 1
        if self._draw.random() < CYCLES:
            self._cycle()
        if self._heard == RENEWED:
            self._renew()

    def close(self) -> None:
        pass

    def _renew(self) -> None:
        self._port, self._link = StubPort(), StubLink()
        self.planner = Planner(self._port, SETTINGS)
        self._heard = 0
        if self._draw.random() < FIRST:
            # whose frame is planned in for good
            self._port.hears["odom"](as_message(RIGHT[ODOMETRY](time.time())))

    def _cycle(self) -> None:
        draw = self._draw
        told = [topic for topic in TOPICS if draw.random() < TOLD and topic != "scan"]
        self._tell([*told, "scan"])  # a cycle without a scan would wait for one
        self._plan(rolls=draw.random() < 0.3, shows=draw.random() < 0.1, x=draw.choice(PLACES))

    def _tell(self, topics: list[str]) -> None:
        """What is right."""
        for topic in topics:
            self._port.hears[topic](as_message(RIGHT[TOPICS[topic]](time.time())))

    def _plan(self, *, rolls: bool, shows: bool, x: float = 1.0) -> None:
        planner = self.planner
        self._link.roll(rolls=rolls, x=x)
        planner.cycle(self._link, 0.0)  # type: ignore[arg-type]
        if planner.navigator.record.fault:
            raise AssertionError(f"a cycle that failed: {planner.navigator.record.fault}")
        if shows:
            planner.show()
            planner.tell(self._link)  # type: ignore[arg-type]
        if len(planner.unseen) > MOST_REASONS + 1:
            raise AssertionError(f"{len(planner.unseen)} reasons are remembered")


class Bases:
    """The base's node: odometry, frames and the emergency stop in, cmd_vel out."""

    refusal = ()

    def __init__(self, draw: random.Random) -> None:
        self._draw = draw
        self._now = 1000.0
        self._frames = Frames()
        times = RosClock(wall=lambda: self._now + NOW, clock=self._clock)
        self._base = RosBase(
            BaseLimits(), self._ordered, self._stopped, times=times, child="base_link",
            place=placer(self._frames, "map"), clock=self._clock,
        )  # fmt: skip

    def made(self, draw: random.Random) -> tuple[str, Any]:
        kind = draw.choice((ODOMETRY, ODOMETRY, TRANSFORMS, BOOL))
        now = self._now + NOW - draw.choice(AGES)
        return kind, as_message(broken_tree(RIGHT[kind](now), draw))

    def eat(self, data: tuple[str, Any]) -> None:
        kind, message = data
        base, draw = self._base, self._draw
        self._now += draw.choice((0.0, 0.001, 0.02, 0.3))
        if kind == ODOMETRY:
            base.hear(message)
        elif kind == TRANSFORMS:
            self._frames.hear(transforms_of(message))
        else:
            base.press(pressed=stop_of(message))
        base.drive(*(draw.choice(WHEELS) for _ in range(2)))
        if draw.random() < 0.1:
            draw.choice((base.stop, base.reset))()
        base.watch()
        told = base.odometry()
        if told is not None and not told.stamp <= self._now:
            raise AssertionError(f"odometry of {told.stamp} s, which is later than now")
        if len(base.refused) > MOST_REASONS or len(self._frames) > MOST_FRAMES:
            raise AssertionError("more is remembered with each message")

    def close(self) -> None:
        pass

    def _clock(self) -> float:
        return self._now

    def _ordered(self, order: Tree) -> None:
        limits = BaseLimits()
        speed, turn = order["linear"]["x"], order["angular"]["z"]
        for wheel in wheels_of(speed, turn, limits.track):
            # the wheels' speeds come back from speed and turn rate with float64's rounding
            if not abs(wheel) <= limits.wheel_speed * (1 + 1e-12):
                raise AssertionError(f"cmd_vel says {order}")

    def _stopped(self, told: Tree) -> None:
        if not isinstance(told["data"], bool):
            raise AssertionError(f"stop says {told}")


def _status(state: State) -> Status:
    return Status(
        stamp=0.0, state=state, reason=Reason.NONE, held=(0, 0), newest=(0, 0),
        rests=(1.0, 2.0, 0.3), rests_from=0.0, judged=(0, 0), verdict=Verdict.NONE, error=0.0,
        worst_error=0.0, right=0.0, left=0.0, taken=0, refused=0, garbled=0, overruns=0,
        odometry=(MOVED,),
    )  # fmt: skip
