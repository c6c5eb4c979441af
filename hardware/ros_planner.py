"""The planner's node, whatever the middleware: messages in, trajectories to the executor.

It plans in the odometry's frame, which moves without jumps (REP 105), or in the map's; goals of
other frames are brought into it in every cycle. Scans, goals and transforms come from threads of
the middleware and wait here; everything else is one loop.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from hardware import ros_show
from hardware.chain import Planning, known_state
from hardware.executor_process import ExecutorConfig, ExecutorProcess
from hardware.link import PlannerLink
from hardware.merge import Pairing
from hardware.priority import put_forward
from hardware.ros_base import SOCKET
from hardware.ros_clock import RosClock
from hardware.ros_frames import Frames, compose
from hardware.ros_messages import (
    Sweep,
    Untrusted,
    motion_of,
    path,
    place_of,
    stamp_of,
    static_map_of,
    sweep_of,
    transforms_of,
)
from hardware.ros_port import (
    DIAGNOSTICS,
    GRID,
    MARKERS,
    ODOMETRY,
    PATH,
    POSE,
    SCAN,
    TRANSFORMS,
    Port,
)
from hardware.ros_settings import RosSettings
from hardware.sleep import Slept, asleep
from hardware.status import State
from passpmp_ti.grid.model import check_door
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.scan import Scan
from passpmp_ti.trajectory import Trajectory

PATIENCE = 0.25
"""For scans after a cycle is due [s]; then it is tried again."""
MOST_WAITING = 8
"""Scans of a stream that wait; older ones are passed over."""
MOVED_GOAL = 0.05
"""A goal that moves by less than this, as localisation does, is the same goal [m]."""
MOST_REASONS = 40
"""That are told apart."""
LONGEST_REASON = 400
"""[letters]"""
PRIORITY = 1
"""Of SCHED_FIFO, where it is granted: below the base's and the executor's."""
TELL = 1.0
"""Time from one diagnostics to the next [s]."""


class Planner:
    """Hears scans, frames and goals; plans; shows what it does."""

    def __init__(
        self, port: Port, settings: RosSettings, *, slept: Callable[[], Slept] = asleep
    ) -> None:
        """Compiles the kernels, which takes seconds.

        Args:
            port: to the middleware.
            settings: all of them.
            slept: tells for how long the machine has slept.

        Raises:
            ValueError: settings that do not fit each other.
        """
        self.settings = settings
        self.navigator = Navigator(
            settings.robot, settings.planner_settings(), goal=(0.0, 0.0), seed=settings.seed
        )
        self._planning = Planning(self.navigator, slept)
        self.unseen: Counter[str] = Counter()
        """Messages and cycles of which nothing could be made, by reason."""
        self.cycles = 0
        self._times = RosClock(oldest=settings.oldest, skew=settings.skew)
        self._frames = Frames()
        self._frame = settings.frame.lstrip("/")  # that is planned in; empty: not heard of yet
        self._map: tuple[str, StaticMap] | None = None
        self._goal: tuple[str, float, float] | None = None
        self._news = threading.Event()
        self._waiting: list[deque[tuple[Sweep, float, float]]] = [
            deque(maxlen=MOST_WAITING) for _ in settings.scans
        ]
        self._newest = [-math.inf] * len(settings.scans)
        self._pairing = Pairing(len(settings.scans), apart=settings.apart)
        self._begun = False
        self._lateness: deque[float] = deque(maxlen=100)
        self._plan = port.publisher("plan", PATH)
        self._hidden = port.publisher("hidden", GRID)
        self._icsb = port.publisher("icsb", GRID)
        self._markers = port.publisher("markers", MARKERS)
        self._diagnostics = port.publisher("/diagnostics", DIAGNOSTICS)
        for stream, topic in enumerate(settings.scans):
            port.subscribe(topic, SCAN, partial(self._hear_scan, stream))
        port.subscribe("odom", ODOMETRY, self._hear_odometry)
        port.subscribe("/tf", TRANSFORMS, self._hear_frames)
        port.subscribe("/tf_static", TRANSFORMS, self._hear_frames, latched=True)
        if settings.map:
            port.subscribe(settings.map, GRID, self._hear_map, latched=True)
        port.subscribe("/move_base_simple/goal", POSE, self._hear_goal)

    def run(self, leave: Callable[[], bool]) -> None:
        """Start an executor and drive, until `leave` says so.

        Raises:
            RuntimeError: the executor did not start, or ended; or the machine was asleep.
        """
        settings = self.settings
        config = ExecutorConfig(
            directory=settings.directory,
            base="hardware.base_link:build",
            base_options={
                "address": str(settings.directory / SOCKET), **asdict(settings.limits)
            },
            robot=settings.robot,
            settings=settings.executor_settings(),
        )  # fmt: skip
        with ExitStack() as open_:
            executor = open_.enter_context(ExecutorProcess(config))
            link = open_.enter_context(
                PlannerLink(
                    settings.directory, track=settings.robot.track, guess=settings.guess
                )
            )
            put_forward("the planner", PRIORITY)
            due = told_at = shown_at = time.monotonic()
            while not leave():
                if not executor.alive:
                    raise RuntimeError(f"the executor ended: {executor.close()}")
                chosen = self.cycle(link, due)
                if self._planning.slept:
                    raise RuntimeError(
                        "the machine was asleep, and what was seen before holds no more; start"
                        " the node again"
                    )
                due = max(due + settings.cycle, time.monotonic() - settings.cycle)
                now = time.monotonic()
                if chosen is not None and now - shown_at >= settings.show_every:
                    shown_at = now
                    self.show()
                if now - told_at >= TELL:
                    told_at = now
                    self.tell(link)

    def cycle(self, link: PlannerLink, due: float) -> Trajectory | None:
        """Plan once, and send it.

        Args:
            link: to the executor.
            due: scans that came before this are passed over, by the monotonic clock [s].

        Returns:
            What was planned; None where there was nothing to plan from.
        """
        scans = self._scans(link, due)
        arrived = time.monotonic()
        link.poll(timeout=0.02)
        self._times.look()
        if scans is None:
            self._count("no scans of one instant came")
            return None
        status, state = link.status, known_state(link, scans[0].stamp)
        if state is None or status is None or not link.ready or not self._frame:
            self._count("the executor tells of no motion to plan from")
            return None
        if status.state is not State.RESTING and not self._begun:
            self._count("the robot moves already")
            return None
        if not self._begun and self.settings.map:
            if self._map is None or self._map[0].lstrip("/") != self._frame:
                self._count(f"no map in {self._frame} on {self.settings.map} yet")
                return None
            self.navigator.static_map = self._map[1]
        self._aim(state)
        took = self._planning.round(link, scans, state, arrived).took
        answer = self.navigator.held
        if took is None or answer is None:
            return None
        self._begun = True
        self.cycles += 1
        self._lateness.append(took)
        stamps = [self._times.theirs(float(t)) for t in ros_show.thinned(answer).times]
        self._plan(path(ros_show.thinned(answer), stamps, self._wall(), self._frame))
        return answer

    def _scans(self, link: PlannerLink, due: float) -> tuple[Scan, ...] | None:
        """The first scans of one instant that come after `due`; None where none come."""
        until = max(due, time.monotonic()) + PATIENCE
        while True:
            self._news.clear()
            found = None
            for stream, waiting in enumerate(self._waiting):
                while waiting:
                    scan = self._placed(link, *waiting.popleft())
                    pair = None if scan is None else self._pairing.add(stream, scan)
                    found = pair or found
            now = time.monotonic()
            if found is not None and now >= due:
                return found
            if now >= until:
                return None
            link.poll()
            self._news.wait(min(until - now, max(due - now, 0.0) or PATIENCE))

    def _placed(
        self, link: PlannerLink, sweep: Sweep, stamp: float, middle: float
    ) -> Scan | None:
        """A scan with its stamp, where its sensor was in its middle; None where that is not
        known."""
        mount = self._frames.pose(self.settings.base_frame, sweep.frame)
        if mount is None:
            self._count(f"no upright {sweep.frame} on {self.settings.base_frame} in tf")
            return None
        state = link.state_between(middle)
        if state is None:
            self._count("no odometry from after a scan's time")
            return None
        x, y, theta = (float(v) for v in state[:3])
        try:
            scan = sweep.at(compose((x, y, theta), mount), stamp)
            return self.settings.steadied(scan, state, mount)
        except ValueError as why:
            self._count(str(why))
            return None

    def _aim(self, state: np.ndarray) -> None:
        """Drive to the goal, where it lies now in the frame that is planned in; without one, to
        where the robot stands first."""
        if self._goal is None:
            if not self._begun:
                self.navigator.head_for((float(state[0]), float(state[1])))
            return
        frame, x, y = self._goal
        origin = self._frames.pose(self._frame, frame or self._frame)
        if origin is None:
            self._count(f"a goal in {frame}, which tf does not join with {self._frame}")
            return
        goal = compose(origin, (x, y, 0.0))[:2]
        if not all(map(math.isfinite, goal)):
            self._count(f"a goal in {frame}, which tf puts beyond all numbers")
            return
        if math.dist(goal, self.navigator.goal) > MOVED_GOAL:
            self.navigator.head_for(goal)

    def show(self) -> None:
        """Hidden region, ICS^b region, markers."""
        record, settings = self.navigator.record, self.settings
        model, chosen = record.model, record.chosen
        if model is None or not self._frame:
            return
        stamp, frame = self._times.theirs(record.stamp), self._frame
        hidden = ros_show.hidden_area(model, settings.show_cell)
        unsafe = None
        if chosen is not None:
            root = ros_show.root_of(chosen, settings.robot)
            when = max(chosen.start, model.stamp)
            unsafe = ros_show.unsafe_area(
                model, root, when, settings.show_reach, settings.show_cell
            )
            self._icsb(unsafe.grid(stamp, frame))
        self._hidden(hidden.grid(stamp, frame))
        self._markers(ros_show.markers(record, settings.robot, hidden, unsafe, stamp, frame))

    def tell(self, link: PlannerLink) -> None:
        """Diagnostics."""
        record, status = self.navigator.record, link.status
        unseen = dict(self.unseen)  # at once: other threads count on
        waiting_for = ""
        if not self._begun:
            waiting_for = "; ".join(unseen) or "no scan came yet"
        elif self._goal is None:
            waiting_for = "no goal yet"
        level, message = ros_show.health(status, waiting_for)
        took = np.array(self._lateness or [math.nan])
        values: dict[str, object] = {
            "cycles": self.cycles, "decision": record.decision, "reason": record.reason,
            "goal reached": self._goal is not None and self.navigator.reached,
            "goal": "({:.2f}, {:.2f})".format(*self.navigator.goal),
            "cycle, median [ms]": 1e3 * float(np.median(took)),
            "cycle, worst of the last 100 [ms]": 1e3 * float(took.max()),
            "broken premises": len(record.broken_premises),
            "wall clock set": self._times.jumps,
        }  # fmt: skip
        if status is not None:
            values |= {
                "executor": status.state.name.lower(), "why": status.reason.name.lower(),
                "off its path, worst [mm]": 1e3 * status.worst_error,
                "trajectories taken": status.taken, "refused": status.refused,
            }  # fmt: skip
        values |= {f"unseen: {why}": count for why, count in unseen.items()}
        self._diagnostics(
            ros_show.diagnostics("passpmp planner", level, message, values, self._wall())
        )

    def _wall(self) -> float:
        return self._times.theirs(time.monotonic())

    def _count(self, why: str) -> None:
        # reasons may hold names from outside: who makes them up must not fill the memory
        why = why[:LONGEST_REASON]
        known = why in self.unseen or len(self.unseen) < MOST_REASONS
        self.unseen[why if known else "other reasons"] += 1

    # from the middleware's threads -----------------------------------------------------------

    def _hear_scan(self, stream: int, message: Any) -> None:
        settings = self.settings
        try:
            stamp = self._times.ours(stamp_of(message))
            sweep = sweep_of(
                message, range_max=settings.range_max, beyond_is_free=settings.beyond_is_free
            )
            stamp, middle = settings.moments(stamp, sweep.lasts)
            now = time.monotonic()
            if stamp > now + self._times.error:
                raise Untrusted("a scan that came before its last beam")
            stamp = min(stamp, now)
            if stamp <= self._newest[stream]:
                raise Untrusted("a scan no newer than the one before")
        except Untrusted as why:
            self._count(str(why))
            return
        self._newest[stream] = stamp
        self._waiting[stream].append((sweep, stamp, middle))
        self._news.set()

    def _hear_odometry(self, message: Any) -> None:
        if self._frame:
            return
        try:
            motion = motion_of(message)
            if motion.child.lstrip("/") != self.settings.base_frame.lstrip("/"):
                # one frame is planned in for good: whoever else is about must not name it
                raise Untrusted(f"odometry of a frame that is not {self.settings.base_frame}")
            self._frame = motion.frame.lstrip("/")
        except Untrusted as why:
            self._count(str(why))

    def _hear_frames(self, message: Any) -> None:
        self._frames.hear(transforms_of(message))

    def _hear_map(self, message: Any) -> None:
        try:
            found = static_map_of(message)
            check_door(self.navigator.settings, found[1].resolution)
        except ValueError as why:
            self._count(str(why))
        else:
            self._map = found

    def _hear_goal(self, message: Any) -> None:
        try:
            self._goal = place_of(message)
        except Untrusted as why:
            self._count(str(why))
