"""The planner of the twin's chain as a process of its own, which can die and be started again.

    python -m hardware.twin_planner '{"twin": {...}, "cycle": 0.1, "goals": [[10, 0]]}'
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import os
import signal
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

import numpy as np

from hardware.chain import NOWHERE, PlannerLoop, Round, poser
from hardware.chair_model import WALL_HALF
from hardware.child import ended, main_of, started
from hardware.link import PlannerLink
from hardware.margins import APART
from hardware.merge import check_stamp_error
from hardware.priority import put_forward
from hardware.scip_client import ScipClient
from hardware.steady import SteadyClient
from hardware.twin_cycles import Cycle, CycleWriter
from hardware.twin_process import TwinConfig
from hardware.twin_settings import guess_of, scip_settings, settings_of, unforeseen_of
from hardware.twin_wrong import ORDERS, WrongLink
from passpmp_ti import door
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.sim.scenario import Scenario
from passpmp_ti.sim.world import World

READY = b"ready\n"
CYCLES, PORTS = "cycles", "ports"
"""Names of what it did, and of the file that tells it where the lidars are, in the directory."""
PRIORITY = 1
"""Of SCHED_FIFO, where the system grants it: below the twin's and the executor's."""
SPARSE = 4
"""Every so many a return is kept, for pictures."""
LOOK = 0.02
"""[s] between two looks for the file with the ports."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannerConfig:
    """All that a planner's process needs to know."""

    twin: TwinConfig
    cycle: float
    """[s]."""
    goals: tuple[tuple[float, float], ...]
    """To be reached one after the other [m]."""
    threads: int | None = None
    """Of its kernels; None: one for each core."""
    obeys: bool = False
    """Whether it can be told to go wrong, see `twin_wrong.py`."""
    keeps_scans: bool = False
    """Whether all that it planned on is written down."""

    def __post_init__(self) -> None:
        door.finite("twin", "cycle", self.cycle, above=0.05, unit="s")

    def to_json(self) -> str:
        """As the process is told it."""
        told = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return json.dumps(told | {"twin": json.loads(self.twin.to_json())})

    @classmethod
    def from_json(cls, text: str) -> PlannerConfig:
        """As `to_json` wrote it.

        Raises:
            ValueError: a field is missing, unknown, or out of its range.
        """
        try:
            given = json.loads(text)
            twin = TwinConfig.from_json(json.dumps(given.pop("twin")))
            goals = tuple((float(x), float(y)) for x, y in given.pop("goals"))
            return cls(twin=twin, goals=goals, **given)
        except (KeyError, TypeError, AttributeError) as cause:
            raise ValueError(f"no configuration of a planner: {cause!r}") from cause


class PlannerProcess:
    """Starts a planner and looks after it. It is ready once its kernels are compiled, and drives
    once it is told where the lidars are (`tell_ports`), by whoever was told so first."""

    def __init__(self, config: PlannerConfig, *, within: float = 300.0) -> None:
        """
        Args:
            config: what it is told.
            within: time to compile [s].

        Raises:
            RuntimeError: it did not start; says why.
        """
        self.process, told = started("hardware.twin_planner", config.to_json(), within)
        if told != READY:
            raise RuntimeError(f"the planner did not start: {ended(self.process, 1.0)}")

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self.process.poll() is None

    def close(self, within: float = 5.0) -> str:
        """End it. Returns what it complained of."""
        return ended(self.process, within)


def tell_ports(directory: Path, ports: list[int]) -> None:
    """Tell planners, those that start later too, where the lidars are."""
    beside = directory / f"{PORTS}.new"
    beside.write_text(json.dumps(ports))
    beside.rename(directory / PORTS)


def known_map(scenario: Scenario, world: World) -> StaticMap | None:
    """Scans from the wire do not tell what stays: the map does, as on a chair that has one."""
    if scenario.static_map is not None or not len(world.outline):
        return scenario.static_map
    return StaticMap.from_segments(world.outline, thickness=2 * WALL_HALF)


def run(config: PlannerConfig, parent: int) -> None:
    """Be a planner, until a signal or the death of whoever started this process ends it.

    Args:
        config: all else.
        parent: process number of whoever started this one.

    Raises:
        ValueError: the configuration makes no sense.
    """
    asked: list[int] = []

    def leave(number: int, frame: FrameType | None) -> None:
        asked.append(number)

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, leave)
    # from the start: one that takes another's place is to be ready soon; threads of kernels inherit
    put_forward("the planner", PRIORITY)
    navigator = _navigator(config)
    os.write(sys.stdout.fileno(), READY)
    directory = config.twin.directory

    def leaving() -> bool:
        return bool(asked) or os.getppid() != parent

    while not (directory / PORTS).exists():
        if leaving():
            return
        time.sleep(LOOK)
    ports: list[int] = json.loads((directory / PORTS).read_text())
    with ExitStack() as open_:
        link = open_.enter_context(_link(config, navigator))
        clients = [
            open_.enter_context(client) for client in _clients(config, navigator, link, ports)
        ]
        check_stamp_error(navigator.settings, [c.settings for c in clients], APART)
        loop = PlannerLoop(navigator, link, clients, cycle=config.cycle, apart=APART)
        cycles = CycleWriter(directory / CYCLES)
        open_.callback(cycles.close)
        while not leaving():
            done = loop.round()
            cycle = _cycle(done, navigator, link, clients)
            if config.keeps_scans and done.took is not None and done.scans is not None:
                state = link.state_at(done.scans[0].stamp)
                cycle = replace(cycle, scans=done.scans, state=state)
            cycles.add(cycle)


def _navigator(config: PlannerConfig) -> Navigator:
    from passpmp_ti import backend

    with contextlib.redirect_stdout(io.StringIO()):
        backend.init(threads=config.threads)
    scenario, seed = config.twin.load(), config.twin.seed
    world, _, _ = scenario.build(seed)
    return Navigator(
        scenario.robot, settings_of(scenario, world, config.cycle, config.twin.nature()),
        goal=config.goals, static_map=known_map(scenario, world), seed=seed,
    )  # fmt: skip


def _link(config: PlannerConfig, navigator: Navigator) -> PlannerLink:
    directory, nature = config.twin.directory, config.twin.nature()
    track, guess = nature.limits.track, guess_of(config.cycle, nature)
    if config.obeys:
        return WrongLink(directory, track=track, guess=guess, orders=directory / ORDERS)
    return PlannerLink(directory, track=track, guess=guess)


def _clients(
    config: PlannerConfig, navigator: Navigator, link: PlannerLink, ports: list[int]
) -> list[SteadyClient]:
    nature = config.twin.nature()
    track = nature.limits.track
    turned = 2.0 * unforeseen_of(config.cycle, nature) / track
    return [
        SteadyClient(
            scip_settings(port, lidar.range_max),
            state_at=link.state_at, pose_at=poser(link, lidar.pose), track=track,
            arm=float(np.hypot(*lidar.mount[:2])), heading_error=nature.heading_error + turned,
        )
        for port, lidar in zip(ports, config.twin.load().lidars, strict=True)
    ]  # fmt: skip


def _cycle(
    done: Round, navigator: Navigator, link: PlannerLink, clients: Sequence[ScipClient]
) -> Cycle:
    """What is kept of a cycle; the answer is out already."""
    record, plan = None, np.zeros((0, 2), dtype=np.float32)
    if done.took is not None:
        record = replace(
            navigator.record, model=None, tree=None, particle_leaves=(), chosen=None
        )
    if navigator.held is not None:
        plan = navigator.held.states[:: 2 * SPARSE, :2].astype(np.float32)
    points = [scan.points()[::SPARSE] for scan in done.scans or () if scan.pose != NOWHERE]
    reached = len(navigator.goals) if navigator.reached else navigator.goals.index(navigator.goal)
    status = link.status
    return Cycle(
        at=time.monotonic(), record=record, took=done.took, sent=done.sent,
        goals_reached=reached, plan=plan,
        seen=np.concatenate([np.zeros((0, 2)), *points]).astype(np.float32),
        worst_error=float("nan") if status is None else status.worst_error,
        lidars=tuple(client.counters for client in clients),
    )  # fmt: skip


def main() -> int:
    return main_of("hardware.twin_planner", PlannerConfig.from_json, run)


if __name__ == "__main__":
    sys.exit(main())
