"""A base, an executor's process and a planner's process, to be tormented together."""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np

from hardware.base import Odometry
from hardware.base_link import BaseServer
from hardware.executor import ADDRESS, Tick
from hardware.executor_process import ROW, ExecutorConfig, ExecutorProcess
from hardware.executor_settings import ExecutorSettings
from hardware.executor_trials import ORDERS
from hardware.letterbox import Letterbox
from hardware.simulated_base import BaseNature, SimulatedBase
from hardware.stop_button import StopButton
from passpmp_ti.robots import DifferentialDrive

LOOK = 0.002
"""The base's server looks for commands this often [s]."""
NATURE = BaseNature(slip=0.05, pose_noise=0.002, heading_noise=0.002, speed_noise=0.004)
"""A base on a hard floor."""


class Rig:
    """All of it, running. The base's truth and the executor's ticks are kept."""

    def __init__(
        self,
        rng: np.random.Generator,
        *,
        settings: ExecutorSettings | None = None,
        wheel_speed: float = 1.5,
    ) -> None:
        """
        Args:
            rng: decides noise, slip and motions.
            settings: of the executor.
            wheel_speed: greatest, of the motions [m/s].
        """
        self.robot = DifferentialDrive(wheel_speed=wheel_speed)
        self.settings = ExecutorSettings() if settings is None else settings
        self.truth: list[Odometry] = []
        self.directory = Path(tempfile.mkdtemp(prefix="executor-"))
        self._wheel_speed = wheel_speed
        self._rng = rng
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._base = SimulatedBase(NATURE, rng=rng.spawn(1)[0], log=self.truth.append)
        self._server = BaseServer(self._base, self.directory / "base")
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        self.log = self.directory / "log"
        self.orders = Letterbox(self.directory / "rig")
        self.executor = self.start_executor()
        self.planner = self.start_planner()

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start_executor(self) -> ExecutorProcess:
        """A new one; its ticks go on in a new log."""
        self.log = self.log.with_name(f"log-{time.monotonic_ns()}")
        config = ExecutorConfig(
            directory=self.directory, base="hardware.base_link:build",
            base_options={"address": str(self.directory / "base"), **asdict(NATURE.limits)},
            robot=self.robot, settings=self.settings, log=self.log,
        )  # fmt: skip
        return ExecutorProcess(config)

    def start_planner(self) -> subprocess.Popen[bytes]:
        """A new one."""
        seed = str(self._rng.integers(1 << 30))
        command = [sys.executable, "-m", "hardware.executor_trials", str(self.directory)]
        home = str(Path(__file__).parents[1])
        return subprocess.Popen(
            [*command, "--seed", seed, "--wheel-speed", str(self._wheel_speed)],
            env={**os.environ, "PYTHONPATH": home},
        )

    def ticks(self) -> list[Tick]:
        """What the executor that runs now did."""
        data = self.log.read_bytes()
        return [Tick(*row) for row in ROW.iter_unpack(data[: len(data) // ROW.size * ROW.size])]

    @property
    def fastest(self) -> float:
        """Ground speed of the faster wheel, in truth [m/s]."""
        return max(abs(self.truth[-1].right), abs(self.truth[-1].left)) if self.truth else 0.0

    def wait(self, condition: Callable[[], bool], within: float) -> bool:
        """Whether it came to hold within a time [s]."""
        until = time.monotonic() + within
        while not condition():
            if time.monotonic() > until:
                return False
            time.sleep(0.005)
        return True

    def inject(self, fault: str) -> None:
        """As `SimulatedBase.inject`."""
        with self._lock:
            self._base.inject(fault)

    def order(self, wrong: str) -> None:
        """Have the planner go wrong, as `Rover.wrong`."""
        self.orders.post(self.directory / ORDERS, wrong.encode())

    def cut(self, *, cut: bool) -> None:
        """Take the executor's address away, or give it back."""
        here, away = self.directory / ADDRESS, self.directory / "cut"
        with contextlib.suppress(FileNotFoundError):
            os.rename(*((here, away) if cut else (away, here)))

    def press(self) -> bool:
        """Press the emergency stop; whether it was obeyed."""
        with StopButton(self.directory) as button:
            return button.press()

    def release(self) -> bool:
        """Let it go; whether the robot may drive."""
        with StopButton(self.directory) as button:
            return button.release()

    def close(self) -> None:
        """End all of it."""
        with contextlib.suppress(ProcessLookupError):
            self.planner.send_signal(signal.SIGKILL)
        self.planner.wait()
        self.executor.close()
        self._closed.set()
        self._thread.join()
        self.orders.close()
        shutil.rmtree(self.directory, ignore_errors=True)

    def _serve(self) -> None:
        while not self._closed.is_set():
            select.select([self._server], [], [], LOOK)
            with self._lock:
                self._server.step()
        self._server.close()
