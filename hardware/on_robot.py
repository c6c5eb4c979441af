"""A robot from its file: devices, executor, planner, and a drive to its goals."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np

from hardware.button_device import READY
from hardware.chain import PlannerLoop, poser
from hardware.child import Child, ended, started
from hardware.complaints import advice
from hardware.config import DriveConfig
from hardware.devices import devices
from hardware.driven import Driven, Look
from hardware.executor_process import ExecutorConfig, ExecutorProcess, check_private
from hardware.interrupts import Interrupts, interrupts
from hardware.link import PlannerLink
from hardware.scip_client import wait
from hardware.scip_session import Unfit
from hardware.status import State
from hardware.steady import SteadyClient
from hardware.stop_button import StopButton
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.scan import Scan
from passpmp_ti.sim.scenario import load_scenario

START = 10.0
"""[s] for range finders and base to answer."""
TELL = 1.0
"""From one line of progress to the next [s]."""
LOOK = 0.05
"""[s] between two looks at a robot that comes to rest."""
LONGEST_REST = 20.0
"""[s] after which a robot that should have come to rest is stopped by the button."""

STANDS = (State.RESTING, State.STOPPED, State.EMERGENCY)
"""States in which nothing that the executor holds moves the robot."""


class RobotDrive:
    """All of it, running: devices where they are emulated, executor, range finders, navigator.

    with RobotDrive(read_config(path)) as drive:
        print(drive.run().summary())
    """

    def __init__(self, config: DriveConfig, *, seed: int = 0) -> None:
        """
        Args:
            config: of the robot.
            seed: of the planner.

        Raises:
            ValueError: the map cannot be read.
        """
        self.config = config
        # kernels are compiled before anything waits for them
        self.navigator = Navigator(
            config.robot, config.planner_settings, goal=config.goals,
            static_map=_known(config), seed=seed,
        )  # fmt: skip
        self._button: Child | None = None
        self._open = ExitStack()

    def __enter__(self) -> RobotDrive:
        """
        Raises:
            ValueError: the directory is not private.
            RuntimeError: a process does not start, or a device does not answer.
        """
        config = self.config
        with ExitStack() as open_:
            config.directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            check_private(config.directory)
            settings, build, options = open_.enter_context(devices(config))
            self.executor = ExecutorProcess(
                ExecutorConfig(
                    directory=config.directory,
                    base=build,
                    base_options=options,
                    robot=config.robot,
                    settings=config.executor_settings,
                )
            )
            open_.callback(self.executor.close)
            if config.button is not None:
                told = {"directory": str(config.directory), "device": str(config.button)}
                self._button, said = started("hardware.button_device", json.dumps(told), START)
                open_.callback(ended, self._button, 1.0)
                if said != READY:
                    raise RuntimeError(f"the stop button did not start: {said!r}")
            self.link = open_.enter_context(
                PlannerLink(config.directory, track=config.robot.track, guess=config.guess)
            )
            self.clients = [
                open_.enter_context(
                    SteadyClient(
                        one,
                        state_at=self.link.state_at,
                        pose_at=poser(self.link, lidar.pose),
                        track=config.robot.track,
                        arm=math.hypot(*lidar.mount[:2]),
                        heading_error=config.heading_error,
                    )
                )
                for one, lidar in zip(settings, config.lidars, strict=True)
            ]
            self._await_devices()
            self._open = open_.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def run(
        self,
        seconds: float = math.inf,
        see: Callable[[Look], None] | None = None,
        record: Callable[[tuple[Scan, ...], np.ndarray], None] | None = None,
    ) -> Driven:
        """Drive until the last goal is reached, the time is over, or Ctrl-C.

        The first Ctrl-C lets the robot come to rest on what it holds, as the end of the time does;
        the second one presses the emergency stop, which stays pressed until it is reset.

        Args:
            seconds: longest [s].
            see: is shown how it goes, about once a second.
            record: is shown what each cycle planned on, scans and the robot's state [5] then, once
                the answer is sent.
        """
        loop = PlannerLoop(
            self.navigator, self.link, self.clients,
            cycle=self.config.planner.cycle, apart=self.config.apart,
        )  # fmt: skip
        cycles = sent = 0
        took: list[float] = []
        decisions: Counter[str] = Counter()
        began = told_at = time.monotonic()
        with interrupts() as heard:
            why = ""
            while not why:
                try:
                    done = loop.round()
                except Unfit as cause:  # another device answers at that address now
                    why = f"a range finder cannot do what its section asks: {cause}"
                    break
                cycles += 1
                sent += done.sent is not None
                if done.took is not None:
                    took.append(done.took)
                    decisions[self.navigator.record.decision] += 1
                    if record is not None and done.scans is not None:
                        state = self.link.state_at(done.scans[0].stamp)
                        if state is not None:
                            record(done.scans, state)
                now = time.monotonic()
                why = self._ends(loop, heard, now - began, seconds)
                if see is not None and now - told_at >= TELL:
                    told_at = now
                    see(self._look(now - began))
            why = self._to_rest(why, heard)
        status = self.link.status
        return Driven(
            name=self.config.name, reached=self.navigator.reached,
            interrupted=heard.count > 0, why=why,
            seconds=time.monotonic() - began, cycle=self.config.planner.cycle,
            rounds=cycles, idle=cycles - len(took), sent=sent,
            refused=0 if status is None else status.refused,
            took=np.array(took),
            decisions=dict(decisions),
            worst_error=math.nan if status is None else status.worst_error,
            lost={
                lidar.name: client.counters.lost
                for lidar, client in zip(self.config.lidars, self.clients, strict=True)
            },
        )  # fmt: skip

    def _await_devices(self) -> None:
        """Wait until all of them answer.

        Raises:
            RuntimeError: one does not; says which, and what to look at.
        """
        until = time.monotonic() + START
        missing = True
        while missing and time.monotonic() < until:
            for client in self.clients:
                client.read(0.0)
            wait(self.clients, LOOK)
            self.link.poll()
            missing = bool(self._silent()) or not self.link.ready
        if silent := self._silent():
            raise RuntimeError("\n".join(silent))
        if missing:
            raise RuntimeError(self._base_trouble())

    def _silent(self) -> tuple[str, ...]:
        told = []
        for lidar, client in zip(self.config.lidars, self.clients, strict=True):
            if client.streaming:
                continue
            s = client.settings
            trouble = client.trouble or "no answer yet"
            told.append(
                f"range finder {lidar.name!r} at {s.host}:{s.port}: {trouble}; {advice(s, trouble)}"
            )
        return tuple(told)

    def _base_trouble(self) -> str:
        status, base = self.link.status, self.config.base
        where = base.made_by.reach(base.fields)
        if status is None:
            return f"the executor does not answer in {self.config.directory}"
        if status.state is State.EMERGENCY:
            return (
                "the emergency stop is pressed; let go of it with"
                f" python -m hardware.stop_button {self.config.directory} --reset"
            )
        return (
            f"the base ({base.kind}, {where}) does not say where it stands, at rest"
            f" ({status.reason.name.lower()}): is what serves it running, does odometry come, do"
            " its wheels rest?"
        )

    def _ends(self, loop: PlannerLoop, heard: Interrupts, since: float, seconds: float) -> str:
        """Why the drive is over; "" where it is not."""
        if heard.count:
            return "interrupted"
        if self.navigator.reached:
            return "the goal is reached"
        if since > seconds:
            return "the time is over"
        if loop.slept:
            return "the machine was asleep, and what was seen before holds no more"
        if not self.executor.alive:
            return "the executor is gone; the base brakes by itself"
        if self._button is not None and self._button.poll() is not None:
            # it presses as it goes, unless it was killed
            return f"the stop button is gone; {self._press()}"
        return ""

    def _to_rest(self, why: str, heard: Interrupts) -> str:
        """Nothing more is planned: wait until the robot rests on what is held."""
        until = time.monotonic() + LONGEST_REST
        while self.executor.alive:
            if heard.count > 1 or time.monotonic() > until:
                return f"{why}; {self._press()}"
            self.link.poll(timeout=LOOK)
            status = self.link.status
            if status is not None and status.state in STANDS:
                return why
            time.sleep(LOOK)
        return why

    def _press(self) -> str:
        """Stop for good, and tell of it."""
        directory = self.config.directory
        with StopButton(directory) as button:
            if not button.press():
                return "the emergency stop was pressed, and the executor does not obey"
        return (
            "the emergency stop is pressed; let go of it with"
            f" python -m hardware.stop_button {directory} --reset"
        )

    def _look(self, since: float) -> Look:
        status = self.link.status
        here = None if status is None or not status.odometry else status.odometry[-1]
        goal = self.navigator.goal
        return Look(
            time=since,
            record=self.navigator.record,
            away=math.nan if here is None else math.hypot(goal[0] - here.x, goal[1] - here.y),
            speed=math.nan if here is None else 0.5 * (here.right + here.left),
            status=status,
            silent=self._silent(),
        )


def _known(config: DriveConfig) -> StaticMap | None:
    """What is known to stay."""
    if config.map is not None:
        return StaticMap.load(config.map)
    if config.emulated is None or not config.emulated.walls_known:
        return None
    world, _, _ = load_scenario(config.emulated.scenario).build(config.emulated.seed)
    return StaticMap.from_segments(world.outline)
