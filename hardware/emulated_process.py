"""Emulated devices as a process of their own: range finders on loopback, and wheels that are none.

    python -m hardware.emulated_process '{"directory": "/run/passpmp", "scenario": "corridor", ...}'

It is to a robot's file what the twin is to a scenario, without physics.
"""

from __future__ import annotations

import dataclasses
import json
import os
import select
import signal
import sys
import threading
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from hardware.base import BaseLimits
from hardware.base_link import BaseServer
from hardware.child import ended, main_of, started
from hardware.emulated_lidar import EmulatedLidar, Track
from hardware.priority import put_forward
from hardware.scip_device import Device
from hardware.scip_emulator import Emulator
from hardware.scip_rotor import Nature
from hardware.simulated_base import BaseNature, SimulatedBase
from passpmp_ti.sim.scenario import load_scenario

LOOK = 0.002
"""It looks for commands this often [s]."""
GREETING = 3.0
"""Movers set out this long after the process has started [s]: by then all is connected."""
PRIORITY = 5
"""Of SCHED_FIFO, where the system grants it: below the executor's."""
BASE = "base"
"""Name of the base's socket in the directory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EmulatedConfig:
    """All that the process needs to know."""

    directory: Path
    """Of its base's socket."""
    scenario: str
    """A shipped name, or a file."""
    seed: int = 0
    """Of everything random."""
    mounts: tuple[tuple[float, float, float], ...]
    """(x, y, theta) of each range finder on the robot [m, m, rad]."""
    noise: float = 0.01
    """Standard deviation of a range, cut at three of them [m]."""
    limits: BaseLimits = field(default_factory=BaseLimits)
    """Of the base."""
    pose_noise: float = 0.0
    """Standard deviation of x and of y as they are told [m]."""

    def to_json(self) -> str:
        """As the process is told it."""
        return json.dumps(dataclasses.asdict(self) | {"directory": str(self.directory)})

    @classmethod
    def from_json(cls, text: str) -> EmulatedConfig:
        """As `to_json` wrote it.

        Raises:
            ValueError: a field is missing, unknown, or out of its range.
        """
        try:
            given: dict[str, Any] = json.loads(text)
            return cls(
                directory=Path(given.pop("directory")),
                mounts=tuple(tuple(mount) for mount in given.pop("mounts")),
                limits=BaseLimits(**given.pop("limits")),
                **given,
            )
        except (KeyError, TypeError, AttributeError) as cause:
            raise ValueError(f"no configuration of emulated devices: {cause!r}") from cause


class EmulatedProcess:
    """Starts emulated devices and looks after them."""

    def __init__(self, config: EmulatedConfig, *, within: float = 30.0) -> None:
        """
        Args:
            config: what it is told.
            within: time to start [s].

        Raises:
            RuntimeError: it did not start; says why.
        """
        self.process, told = started("hardware.emulated_process", config.to_json(), within)
        self.ports: list[int] = json.loads(told)
        """Of its range finders, in their order."""

    def close(self, within: float = 10.0) -> str:
        """End it. Returns what it complained of."""
        return ended(self.process, within)


def run(config: EmulatedConfig, parent: int) -> None:
    """Be the devices, until a signal or the death of whoever started this process ends it.

    Raises:
        ValueError: the configuration makes no sense.
    """
    world, state, start_time = load_scenario(config.scenario).build(config.seed)
    asked: list[int] = []

    def leave(number: int, frame: FrameType | None) -> None:
        asked.append(number)

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, leave)
    own, *others = np.random.default_rng([config.seed, 4]).spawn(1 + len(config.mounts))
    x, y, theta = (float(v) for v in state[:3])
    track, lock = Track(), threading.Lock()
    nature = BaseNature(limits=config.limits, pose_noise=config.pose_noise)
    base = SimulatedBase(nature, rng=own, pose=(x, y, theta), log=track.note)
    ahead = start_time - (time.monotonic() + GREETING)
    with ExitStack() as open_:
        server = BaseServer(base, config.directory / BASE)
        open_.callback(server.close)
        ports = []
        for mount, rng in zip(config.mounts, others, strict=True):
            see = EmulatedLidar(world, track, mount, rng, ahead=ahead, noise=config.noise)
            emulator = open_.enter_context(Emulator(_maker(see, lock, rng)))
            ports.append(emulator.address[1])
        # of all its threads: range finders and wheels keep their own time on a robot
        put_forward("what is emulated", PRIORITY)
        os.write(sys.stdout.fileno(), json.dumps(ports).encode() + b"\n")
        while not asked and os.getppid() == parent:
            select.select([server], [], [], LOOK)
            with lock:
                server.step()
                base.advance()


def _maker(see: EmulatedLidar, lock: threading.Lock, rng: np.random.Generator) -> Any:
    """A range finder with a clock and a mirror of its own."""
    nature = Nature(
        clock_start=int(rng.integers(1 << 24)), clock_rate=1.0 + float(rng.uniform(-5e-5, 5e-5))
    )

    def seen(begin: float) -> np.ndarray:
        with lock:
            return see(begin)

    return lambda now: Device(seen, now, nature)


def main() -> int:
    return main_of("hardware.emulated_process", EmulatedConfig.from_json, run)


if __name__ == "__main__":
    sys.exit(main())
