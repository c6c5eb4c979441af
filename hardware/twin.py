"""The whole chain on a physics twin: lidars, TCP, client, planner, executor, wheels, people.

All between the rays and the wheels is what runs on a chair: nothing here knows what is true but
the judge. Twin, planner and executor are processes; this one starts them, starts a planner that
died again, and judges.
"""

from __future__ import annotations

import math
import shutil
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hardware.base import check_fits
from hardware.chair_model import ChairNature
from hardware.executor_process import ExecutorConfig, ExecutorProcess
from hardware.status import State
from hardware.twin_cycles import Cycle, CycleReader
from hardware.twin_figures import Chained, chained, last_tick
from hardware.twin_film import film
from hardware.twin_picture import Picture
from hardware.twin_planner import CYCLES, PlannerConfig, PlannerProcess, known_map, tell_ports
from hardware.twin_process import BASE, TwinConfig, TwinProcess
from hardware.twin_settings import executor_of, settings_of
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.scan import Scan
from passpmp_ti.sim.contacts import Contact
from passpmp_ti.sim.drive import Drive
from passpmp_ti.sim.episode import episode_of

STANDING = 0.01
"""Wheels that go no faster over ground than this are at rest, to the judge [m/s]: a chair that
stands on tyres is never quite still."""
TELL = 1.0
"""From one line of progress to the next [s]."""
PACE = 0.2
"""From one look at what was done to the next [s]."""
REST = 1.0
"""After the goal is reached it is watched for so much longer [s]."""


@dataclass(frozen=True, slots=True)
class Look:
    """What a watcher is shown now and then."""

    time: float
    """Since the drive began [s]."""
    record: Any
    """The navigator's last; None before the first."""
    speed: float
    """In truth [m/s]."""
    away: float
    """From the goal, in truth [m]."""
    state: str
    """What the executor does."""
    contacts: tuple[Contact, ...]


class Chain:
    """All of it, running: twin, executor and planner."""

    def __init__(
        self,
        scenario: str,
        *,
        seed: int = 0,
        cycle: float = 0.4,
        object_speed: float | None = None,
        threads: int | None = None,
        goals: tuple[tuple[float, float], ...] | None = None,
        ahead: float = 0.0,
        obeys: bool = False,
        keeps_scans: bool = False,
    ) -> None:
        """
        Args:
            scenario: a shipped name, or a file, with a differential drive and lidars that turn 270
                degrees.
            seed: of everything random.
            cycle: of the planner [s].
            object_speed: bound on the speed of objects [m/s], also of the scenario's movers; None:
                the scenario's.
            threads: of the planner's kernels; None: one for each core.
            goals: to be reached one after the other [m]; None: the scenario's.
            ahead: the scenario has gone on for so long when the chair begins [s].
            obeys: whether twin and planner can be told to go wrong.
            keeps_scans: whether a drive can be recorded, see `run`.

        Raises:
            ValueError: no such scenario, or one that no chair can drive.
        """
        directory = Path(tempfile.mkdtemp(prefix="twin-"))
        self.config = TwinConfig(
            directory=directory, scenario=scenario, seed=seed, object_speed=object_speed,
            ahead=ahead, obeys=obeys,
        )  # fmt: skip
        self.directory, self.scenario, self.seed = directory, self.config.load(), seed
        robot = self.scenario.robot
        assert isinstance(robot, DifferentialDrive)  # or it would not have been loaded
        self.limits = ChairNature().limits
        check_fits(self.limits, robot)
        self.robot, self.cycle = robot, cycle
        self.goals = self.scenario.goals if goals is None else goals
        self._threads, self._obeys, self._keeps_scans = threads, obeys, keeps_scans
        self.world, state, _ = self.scenario.build(seed)
        self.settings = settings_of(self.scenario, self.world, cycle, self.config.nature())
        self.executor_settings = executor_of(cycle)
        self.executor_settings.check_margins(
            self.settings, scan_age=self.settings.stamp_error - self.executor_settings.rest_late
        )
        self.log = self.directory / "ticks"
        self._state = state
        self.cycles: list[Cycle] = []
        """What the planner did."""
        self.rows: list[np.ndarray] = []
        """The truth, as `TwinProcess.truth` tells it, piece by piece."""
        self.revived = 0
        """Planners that were started because one had died."""
        self._record: Callable[[tuple[Scan, ...], np.ndarray], None] | None = None
        self._goals_before = 0  # reached by planners that are gone
        self._goals_now = 0  # by the one that there is
        self._heard = CycleReader(directory / CYCLES)
        self._open = ExitStack()

    def __enter__(self) -> Chain:
        """
        Raises:
            RuntimeError: a process did not start.
        """
        with ExitStack() as open_:
            open_.callback(shutil.rmtree, self.directory, ignore_errors=True)
            # kernels are compiled before the world begins to turn
            self.planner = self.start_planner()
            open_.callback(lambda: self.planner.close())
            self.twin = TwinProcess(self.config)
            open_.callback(self.twin.close)
            self.executor = ExecutorProcess(
                ExecutorConfig(
                    directory=self.directory,
                    base="hardware.base_link:build",
                    base_options={
                        "address": str(self.directory / BASE),
                        **asdict(self.limits),
                    },
                    robot=self.robot,
                    settings=self.executor_settings,
                    log=self.log,
                )
            )
            open_.callback(self.executor.close)
            # what went before, while all was being started, is no part of the drive
            self.twin.truth()
            start = time.monotonic() + self.twin.begin
            self.drive = Drive(self.scenario, self.world, self._state, start)
            tell_ports(self.directory, self.twin.ports)
            self._open = open_.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    @property
    def known(self) -> StaticMap | None:
        """What the planner is told of what stays."""
        return known_map(self.scenario, self.world)

    @property
    def goals_reached(self) -> int:
        """How many of them, so far."""
        return self._goals_before + self._goals_now

    def start_planner(self) -> PlannerProcess:
        """One for the goals that are left.

        Raises:
            RuntimeError: it did not start; says why.
        """
        left = self.goals[self.goals_reached :] or self.goals[-1:]
        return PlannerProcess(
            PlannerConfig(
                twin=self.config, cycle=self.cycle, goals=left, threads=self._threads,
                obeys=self._obeys, keeps_scans=self._keeps_scans,
            )
        )  # fmt: skip

    def revive(self) -> None:
        """Start a planner in the place of one that is gone.

        Raises:
            RuntimeError: it did not start; says why.
        """
        self.planner.close()
        self.see()  # all that it wrote
        self._goals_before, self._goals_now = self.goals_reached, 0
        self.planner = self.start_planner()
        self.revived += 1

    def run(
        self,
        seconds: float,
        see: Callable[[Look], None] | None = None,
        record: Callable[[tuple[Scan, ...], np.ndarray], None] | None = None,
    ) -> Chained:
        """Drive until the goal is reached, or the time is over, or Ctrl-C.

        Args:
            seconds: longest [s].
            see: is shown how it goes, about once a second.
            record: is shown the scans and the state that each cycle planned on, where the chain
                keeps scans.

        Raises:
            RuntimeError: twin or executor are gone, or a planner that died could not be started
                again.
        """
        self._record = record
        began = time.monotonic()
        told_at, reached_at = began, None
        interrupted = False
        try:
            while (now := time.monotonic()) < began + seconds:
                time.sleep(PACE)
                for name, process in (("twin", self.twin), ("executor", self.executor)):
                    if not process.alive:
                        raise RuntimeError(f"the {name} is gone: {process.close(1.0)}")
                if not self.planner.alive:
                    self.revive()
                self.see()
                if see is not None and now - told_at >= TELL:
                    told_at = now
                    see(self.look(now - began))
                if reached_at is None and self.goals_reached >= len(self.goals):
                    reached_at = self.cycles[-1].at
                if reached_at is not None and now > reached_at + REST:
                    break
        except KeyboardInterrupt:
            interrupted = True
        self.see()
        at = None if reached_at is None else reached_at + self.twin.begin
        episode = episode_of(self.drive, self.settings, self.seed, at, interrupted)
        return chained(episode, self.cycles, self.log, np.concatenate(self.rows), self.revived)

    def film(self, path: Path) -> Path:
        """Draw what was driven, once it is over. Returns what was written.

        Raises:
            RuntimeError: no video can be written here.
        """
        picture = Picture(self.scenario.name, self.world, self.robot)
        truth = np.concatenate(self.rows)
        return film(path, picture, truth, self.cycles, self.goals, self.twin.begin)

    def see(self) -> None:
        """Take note of what was done, and of what really happened, since."""
        for cycle in self._heard.new():
            if self._record is not None and cycle.state is not None:
                self._record(cycle.scans, cycle.state)
            # a long drive's scans are too many to be kept here
            self.cycles.append(replace(cycle, scans=()))
            self._goals_now = cycle.goals_reached
            if cycle.record is not None and cycle.took is not None:
                self.drive.note(cycle.record, cycle.took)
        rows = self.twin.truth()
        if not len(rows):
            return
        before = self.rows[-1][-1:] if self.rows else rows[:0]
        self.rows.append(rows)
        rows = np.concatenate([before, rows])
        if len(rows) < 2:
            return
        states = rows[:, 1:6].copy()
        states[:, 2] = np.unwrap(states[:, 2])
        still = np.abs(states[:, 3:]).max(axis=1) <= STANDING
        states[still, 3:] = 0.0
        self.drive.follow(rows[:, 0] + self.twin.begin, states)

    def look(self, time: float) -> Look:
        """How it goes, `time` after it began [s]."""
        x, y = self.drive.states[-1][-1, :2]
        goal = self.goals[min(self.goals_reached, len(self.goals) - 1)]
        tick = last_tick(self.log)
        return Look(
            time=time,
            record=next((c.record for c in reversed(self.cycles) if c.record), None),
            speed=float(self.robot.speed(self.drive.states[-1][-1])),
            away=math.hypot(goal[0] - x, goal[1] - y),
            state="silent" if tick is None else State(int(tick.state)).name.lower(),
            contacts=tuple(self.drive.judge.contacts),
        )
