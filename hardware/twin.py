"""The whole chain on a physics twin: lidars, TCP, client, planner, executor, wheels, people.

All between the rays and the wheels is what runs on a chair: nothing here knows what is true but
the judge.
"""

from __future__ import annotations

import math
import shutil
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hardware.base import check_fits
from hardware.chain import PlannerLoop, Sent, poser
from hardware.chair_model import WALL_HALF, ChairNature
from hardware.executor_process import ExecutorConfig, ExecutorProcess
from hardware.link import PlannerLink
from hardware.margins import APART, executor_settings
from hardware.merge import check_stamp_error
from hardware.priority import put_forward
from hardware.scip_client import ScipClient
from hardware.scip_settings import ScipSettings
from hardware.twin_figures import Chained, latencies, shares, ticks_of
from hardware.twin_process import BASE, TwinConfig, TwinProcess
from hardware.twin_settings import settings_of
from passpmp_ti import door
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.sim.contacts import Contact
from passpmp_ti.sim.drive import Drive
from passpmp_ti.sim.episode import episode_of

STANDING = 0.01
"""Wheels that go no faster over ground than this are at rest, to the judge [m/s]: a chair that
stands on tyres is never quite still."""
PRIORITY = 1
"""Of the planner, of SCHED_FIFO where it is granted: below the twin's and the executor's."""
TELL = 1.0
"""From one look at the truth to the next [s]."""
REST = 1.0
"""After the goal is reached it is watched for so much longer [s]."""


@dataclass(frozen=True, slots=True)
class Look:
    """What a watcher is shown now and then."""

    time: float
    """Since the drive began [s]."""
    record: Any
    """The navigator's last."""
    speed: float
    """In truth [m/s]."""
    away: float
    """From the goal, in truth [m]."""
    state: str
    """What the executor does."""
    contacts: tuple[Contact, ...]


class Chain:
    """All of it, running: twin, executor, clients and navigator."""

    def __init__(
        self,
        scenario: str,
        *,
        seed: int = 0,
        cycle: float = 0.4,
        object_speed: float | None = None,
    ) -> None:
        """
        Args:
            scenario: a shipped name, or a file, with a differential drive and lidars that turn 270
                degrees.
            seed: of everything random.
            cycle: of the planner [s].
            object_speed: bound on the speed of objects [m/s], also of the scenario's movers; None:
                the scenario's.

        Raises:
            ValueError: no such scenario, or one that no chair can drive.
            RuntimeError: a process did not start.
        """
        directory = Path(tempfile.mkdtemp(prefix="twin-"))
        self._config = TwinConfig(
            directory=directory, scenario=scenario, seed=seed, object_speed=object_speed
        )
        self.directory, self.scenario, self.seed = directory, self._config.load(), seed
        robot = self.scenario.robot
        if not isinstance(robot, DifferentialDrive):
            raise ValueError(
                f"twin: scenario {self.scenario.name!r} drives a {type(robot).__name__}; the twin"
                " is a wheelchair: take one with `robot: {type: differential}`"
            )
        self.cycle = door.finite("twin", "cycle", cycle, above=0.05, unit="s")
        self._limits = ChairNature().limits
        check_fits(self._limits, robot)
        self.robot = robot
        self.world, state, self.start_time = self.scenario.build(seed)
        self.settings = settings_of(self.scenario, cycle, self._config.nature())
        self._executor_settings = executor_settings(cycle)
        self._executor_settings.check_margins(
            self.settings, scan_age=self.settings.stamp_error - self._executor_settings.rest_late
        )
        self.log = self.directory / "ticks"
        # scans from the wire do not tell what stays: the map does, as on a chair that has one
        known = self.scenario.static_map
        if known is None and len(self.world.outline):
            known = StaticMap.from_segments(self.world.outline, thickness=2 * WALL_HALF)
        # kernels are compiled before the world begins to turn
        self.navigator = Navigator(
            robot, self.settings, goal=self.scenario.goals, static_map=known, seed=seed
        )
        self.drive = Drive(self.scenario, self.world, state, self.start_time)
        self._last: np.ndarray | None = None  # the newest row of the truth
        self._rows: list[np.ndarray] = []  # of lean and lateness
        self._open = ExitStack()

    def __enter__(self) -> Chain:
        with ExitStack() as open_:
            open_.callback(shutil.rmtree, self.directory, ignore_errors=True)
            self.twin = TwinProcess(self._config)
            open_.callback(self.twin.close)
            self.executor = ExecutorProcess(
                ExecutorConfig(
                    directory=self.directory,
                    base="hardware.base_link:build",
                    base_options={
                        "address": str(self.directory / BASE),
                        **asdict(self._limits),
                    },
                    robot=self.robot,
                    settings=self._executor_settings,
                    log=self.log,
                )
            )
            open_.callback(self.executor.close)
            self.link = open_.enter_context(PlannerLink(self.directory, track=self.robot.track))
            self.clients = [
                open_.enter_context(
                    ScipClient(
                        ScipSettings(
                            host="127.0.0.1", port=port, range_max=lidar.range_max,
                        ),
                        pose_at=poser(self.link, lidar.pose),
                    )
                )
                for port, lidar in zip(self.twin.ports, self.scenario.lidars, strict=True)
            ]  # fmt: skip
            check_stamp_error(self.settings, [c.settings for c in self.clients], APART)
            # its kernels have threads of their own
            put_forward("the planner", PRIORITY)
            self._open = open_.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def run(self, seconds: float, see: Callable[[Look], None] | None = None) -> Chained:
        """Drive until the goal is reached, or the time is over, or Ctrl-C.

        Args:
            seconds: longest [s].
            see: is shown how it goes, about once a second.
        """
        loop = PlannerLoop(self.navigator, self.link, self.clients, cycle=self.cycle, apart=APART)
        sent: list[Sent] = []
        idle = 0
        began = time.monotonic()
        told_at, reached_at = began, None
        interrupted = False
        try:
            while time.monotonic() < began + seconds:
                done = loop.round()
                if done.sent is not None:
                    sent.append(done.sent)
                if done.took is None:
                    idle += 1
                else:
                    self.drive.note(self.navigator.record, done.took)
                now = time.monotonic()
                if now - told_at >= TELL:
                    told_at = now
                    self._judge()
                    if see is not None:
                        see(self._look(now - began))
                if self.navigator.reached and reached_at is None:
                    reached_at = now
                if reached_at is not None and now > reached_at + REST:
                    break
        except KeyboardInterrupt:
            interrupted = True
        self._judge()
        return self._chained(sent, idle, reached_at, interrupted)

    def _judge(self) -> None:
        """Take note of what really happened since."""
        rows = self.twin.truth()
        if not len(rows):
            return
        rows = rows if self._last is None else np.concatenate([self._last[None], rows])
        self._rows.append(rows[:, 6:])
        self._last = rows[-1]
        if len(rows) < 2:
            return
        states = rows[:, 1:6].copy()
        states[:, 2] = np.unwrap(states[:, 2])
        still = np.abs(states[:, 3:]).max(axis=1) <= STANDING
        states[still, 3:] = 0.0
        self.drive.follow(rows[:, 0] + self.twin.begin, states)

    def _look(self, time: float) -> Look:
        """How it goes."""
        x, y = self.drive.states[-1][-1, :2]
        goal = self.navigator.record.goal or self.navigator.goal
        status = self.link.status
        return Look(
            time=time,
            record=self.navigator.record,
            speed=float(self.robot.speed(self.drive.states[-1][-1])),
            away=math.hypot(goal[0] - x, goal[1] - y),
            state="silent" if status is None else status.state.name.lower(),
            contacts=tuple(self.drive.judge.contacts),
        )

    def _chained(
        self, sent: list[Sent], idle: int, reached_at: float | None, interrupted: bool
    ) -> Chained:
        """What it came to."""
        ticks = ticks_of(self.log)
        to_executor, to_wheels, refused = latencies(sent, ticks)
        body = np.concatenate(self._rows) if self._rows else np.zeros((1, 2))
        at = None if reached_at is None else reached_at + self.twin.begin
        episode = episode_of(self.drive, self.settings, self.seed, at, interrupted)
        status = self.link.status
        return Chained(
            episode=episode,
            to_trajectory=np.array([one.at - one.arrived for one in sent]),
            to_executor=to_executor,
            to_wheels=to_wheels,
            scan_age=np.array([one.arrived - one.stamp for one in sent]),
            refused=refused,
            idle=idle,
            worst_error=math.nan if status is None else status.worst_error,
            worst_lean=float(body[:, 0].max()),
            twin_late=float(np.quantile(body[:, 1], 0.99)),
            executor_states=shares(ticks),
            lidars=tuple(client.counters for client in self.clients),
        )
