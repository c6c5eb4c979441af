"""The physics twin as a process of its own: chair, people and range finders, in real time.

    python -m hardware.twin_process '{"directory": "/run/passpmp", "scenario": "corridor_person"}'

It stands for the world, which is never late: it asks for a priority below the executor's. Where it
is late all the same it catches up, and every stamp stays true: a range finder waits for the
physics.
"""

from __future__ import annotations

import dataclasses
import gc
import json
import os
import select
import signal
import struct
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import numpy as np

from hardware.base import Odometry
from hardware.base_link import BaseServer
from hardware.chair_lidar import ChairLidar
from hardware.chair_model import ChairNature
from hardware.child import ended, main_of, started
from hardware.letterbox import Letterbox
from hardware.mujoco_chair import MujocoChair
from hardware.priority import put_forward
from hardware.scip_device import Device
from hardware.scip_emulator import Emulator
from hardware.scip_rotor import Nature
from hardware.twin_settings import on_chair
from passpmp_ti import door
from passpmp_ti.sim.scenario import Scenario, load_scenario

LOOK = 0.002
"""It looks for commands, and moves on, this often [s]."""
GREETING = 3.0
"""People begin to walk this long after the process has started [s]: by then all is connected."""
PRIORITY = 5
"""Of SCHED_FIFO, where the system grants it."""
SWITCH = 5e-4
"""A range finder's rays hold up the chair for this long at the most [s]."""
ROW = struct.Struct(f"<{len(Odometry._fields) + 2}d")
"""A row of the truth: the chair's, how far it leans [rad], and how late the twin is [s]."""
BASE, TRUTH, ORDERS = "base", "truth", "twin-orders"
"""Names of the base's socket, the truth's file and the socket for orders in the directory."""
BOOT = 5.0
"""A lidar that restarts is silent for so long [s]: longer than any plan that is held."""
MANY = 1 << 30
"""Sweeps that go wrong until it is mended."""
WRONGS = ("cable", "frozen", "reboot", "silent", "")
"""Orders: no sweep of any lidar comes; all tell what they told; all restart; no odometry comes; all
is well."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinConfig:
    """All that a twin's process needs to know."""

    directory: Path
    """Of its socket and of the truth."""
    scenario: str
    """A shipped name, or a file."""
    seed: int = 0
    """Of the scenario's world, of the chair, and of all noise."""
    object_speed: float | None = None
    """Bound on the speed of objects [m/s]; faster movers are slowed down. None: the scenario's."""
    ahead: float = 0.0
    """The scenario has gone on for so long when the chair begins [s]."""
    obeys: bool = False
    """Whether it can be told to go wrong: by what is put into the box `ORDERS`."""

    def __post_init__(self) -> None:
        door.whole("TwinConfig", "seed", self.seed, least=0)
        door.finite("TwinConfig", "ahead", self.ahead, least=0.0, unit="s")

    def to_json(self) -> str:
        """As the process is told it."""
        return json.dumps(dataclasses.asdict(self) | {"directory": str(self.directory)})

    @classmethod
    def from_json(cls, text: str) -> TwinConfig:
        """As `to_json` wrote it.

        Raises:
            ValueError: a field is missing, unknown, or out of its range.
        """
        try:
            given = json.loads(text)
            return cls(directory=Path(given.pop("directory")), **given)
        except (KeyError, TypeError, AttributeError) as cause:
            raise ValueError(f"no configuration of a twin: {cause!r}") from cause

    def load(self) -> Scenario:
        """The scenario.

        Raises:
            ValueError: there is none of that name, something is wrong with it, or no chair can
                drive it.
        """
        return on_chair(load_scenario(self.scenario).changed(object_speed=self.object_speed))

    def nature(self) -> ChairNature:
        """The chair that this seed draws."""
        return ChairNature.drawn(np.random.default_rng([self.seed, 2]))


class TruthReader:
    """Reads what a twin writes down."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._read = 0

    def new(self) -> np.ndarray:
        """[n, 8] what really was since the last call: stamp, x, y, theta, right and left over
        ground, lean, lateness."""
        with self._path.open("rb") as file:
            file.seek(self._read)
            data = file.read()
        whole = len(data) // ROW.size * ROW.size
        self._read += whole
        return np.frombuffer(data[:whole], dtype="<f8").reshape(-1, ROW.size // 8)


class TwinProcess:
    """Starts a twin and looks after it."""

    def __init__(self, config: TwinConfig, *, within: float = 120.0) -> None:
        """
        Args:
            config: what it is told.
            within: time to start [s].

        Raises:
            RuntimeError: it did not start; says why.
        """
        self._truth = TruthReader(config.directory / TRUTH)
        self.process, told = started("hardware.twin_process", config.to_json(), within)
        heard = json.loads(told)
        self.ports: list[int] = heard["ports"]
        """Of its range finders, in the scenario's order."""
        self.begin: float = heard["begin"]
        """The world's time is this much ahead of the clock's [s]."""

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self.process.poll() is None

    def truth(self) -> np.ndarray:
        """[n, 8] what really was since the last call, as `TruthReader.new`."""
        return self._truth.new()

    def close(self, within: float = 10.0) -> str:
        """End it. Returns what it complained of."""
        return ended(self.process, within)


def run(config: TwinConfig, parent: int) -> None:
    """Be a twin, until a signal or the death of whoever started this process ends it.

    Args:
        config: what it is.
        parent: number of who started it.

    Raises:
        ValueError: the configuration makes no sense.
    """
    scenario = config.load()
    world, state, start_time = scenario.build(config.seed)
    asked: list[int] = []

    def leave(number: int, frame: FrameType | None) -> None:
        asked.append(number)

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, leave)
    put_forward("the twin", PRIORITY)
    sys.setswitchinterval(SWITCH)
    log = os.open(config.directory / TRUTH, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    rng = np.random.default_rng([config.seed, 3])
    own, *others = rng.spawn(1 + len(scenario.lidars))
    x, y, theta = (float(v) for v in state[:3])
    begin = start_time + config.ahead - (time.monotonic() + GREETING)
    rows = bytearray()

    def note(truth: Odometry) -> None:
        late = time.monotonic() - truth.stamp
        rows.extend(ROW.pack(*truth, chair.tilt, late))

    chair = MujocoChair(world, config.nature(), rng=own, pose=(x, y, theta), begin=begin, log=note)
    server = BaseServer(chair, config.directory / BASE)
    emulators = [
        _emulated(chair, mount, generator)
        for mount, generator in zip((d.mount for d in scenario.lidars), others, strict=True)
    ]
    orders = Letterbox(config.directory / ORDERS) if config.obeys else None
    gc.collect()
    gc.freeze()
    gc.disable()
    told = {"ports": [emulator.address[1] for emulator in emulators], "begin": begin}
    os.write(sys.stdout.fileno(), json.dumps(told).encode() + b"\n")
    try:
        while not asked and os.getppid() == parent:
            select.select([server], [], [], LOOK)
            server.step()
            chair.advance()
            if orders is not None:
                for order, _ in orders.collect():
                    _obey(order.decode(), chair, emulators)
            os.write(log, rows)
            rows.clear()
    finally:
        for emulator in emulators:
            emulator.close()
        if orders is not None:
            orders.close()
        server.close()
        os.close(log)


def _obey(order: str, chair: MujocoChair, emulators: Sequence[Emulator]) -> None:
    """Go wrong, as one of `WRONGS`."""
    chair.silent = order == "silent"
    for emulator in emulators:
        emulator.inject("drop", MANY if order == "cable" else 0)
        emulator.inject("freeze", MANY if order == "frozen" else 0)
        if order == "reboot":
            emulator.reboot()


def _emulated(
    chair: MujocoChair, mount: tuple[float, float, float], rng: np.random.Generator
) -> Emulator:
    """A range finder on its port, with a clock and a mirror of its own."""
    rate = 1.0 + float(rng.uniform(-5e-5, 5e-5))
    start, uneven = int(rng.integers(1 << 24)), float(rng.uniform(-2e-3, 2e-3))
    nature = Nature(
        clock_start=start, clock_rate=rate, unevenness=uneven, boot_time=BOOT
    )
    source = ChairLidar(chair, mount, rng)

    def make(now: float, source: Callable[[float], np.ndarray] = source) -> Device:
        return Device(source, now, nature)

    return Emulator(make)


def main() -> int:
    return main_of("hardware.twin_process", TwinConfig.from_json, run)


if __name__ == "__main__":
    sys.exit(main())
