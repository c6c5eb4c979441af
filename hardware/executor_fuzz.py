"""Throws broken messages at everything that the executor, the base and the planner's link read.

    python -m hardware.executor_fuzz --inputs 1000000

As `hardware.fuzz`: an input is right, then broken; half of them get a right sum again, which leads
farther in. Nothing but a `MessageError` may be raised by the codec, and nothing at all by who
listens; no order may be anything but a number within the base's limits; memory stays bounded. The
same seed makes the same inputs. The exit code is 1 if anything failed.
"""

from __future__ import annotations

import math
import random
import shutil
import sys
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hardware.base import BaseLimits, Odometry
from hardware.base_link import BaseServer, RemoteBase
from hardware.executor import ADDRESS, BUTTON, Executor
from hardware.executor_settings import ExecutorSettings
from hardware.executor_trials import motion
from hardware.findings import Findings, broken, carry_out
from hardware.letterbox import Letterbox
from hardware.link import PlannerLink
from hardware.messages import (
    HEADER,
    SUM,
    Ask,
    Beat,
    Body,
    Drive,
    Message,
    MessageError,
    Offer,
    Reset,
    Source,
    Stop,
    decode,
)
from hardware.simulated_base import SimulatedBase
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.trajectory import Trajectory

ROBOT = DifferentialDrive(wheel_speed=1.0)
SHARES = {"codec": 0.9, "executor": 0.06, "base": 0.02, "link": 0.02}
"""Of the inputs; those over sockets take longer."""
NOW = 1000.0
"""[s]; where the clock stands at first."""


def right_messages(now: float = NOW) -> list[bytes]:
    """One of each kind, and a trajectory that would be taken."""
    rng = np.random.default_rng(0)
    rest = Trajectory.resting(np.zeros(5), now + 0.1)
    with Chain(random.Random(0)) as chain:
        status = chain.executor.status()
    bodies: list[Body] = [
        Offer(motion(ROBOT, np.zeros(5), now + 0.1, rng)), Offer(rest),
        Beat(Source.PLANNER, now), Beat(Source.SENSOR, now), Ask(), Stop(), Reset(),
        Drive(0.5, -0.5), Odometry(now, 1.0, 2.0, 0.5, 0.1, 0.1), status,
    ]  # fmt: skip
    return [Message(1, n + 1, now, body).encode() for n, body in enumerate(bodies)]


def summed(data: bytes) -> bytes:
    """With the length and the sum that a message of these bytes has."""
    if len(data) < HEADER.size + SUM.size:
        return data
    head, body = bytearray(data[: HEADER.size]), data[HEADER.size : -SUM.size]
    head[8:12] = len(body).to_bytes(4, "little")
    whole = bytes(head) + body
    return whole + SUM.pack(zlib.crc32(whole))


class Codec:
    """Bytes to messages and back."""

    def __init__(self, draw: random.Random) -> None:
        pass

    def eat(self, data: bytes) -> None:
        message = decode(data)
        again = decode(message.encode())
        if (again.session, again.sequence) != (message.session, message.sequence):
            raise AssertionError("a message that is another once it is written again")

    def close(self) -> None:
        pass


class Chain:
    """A base, an executor and a planner's link in one thread, on a clock of their own."""

    def __init__(self, draw: random.Random) -> None:
        self.now = NOW
        self.directory = Path(tempfile.mkdtemp(prefix="fuzz-"))
        rng = np.random.default_rng(draw.randrange(1 << 30))
        self.base = SimulatedBase(rng=rng, clock=self.clock)
        self.server = BaseServer(self.base, self.directory / "base", clock=self.clock)
        self.remote = RemoteBase(self.directory / "base", BaseLimits(), clock=self.clock)
        self.executor = Executor(
            self.remote, ROBOT, ExecutorSettings(), self.directory, clock=self.clock
        )
        self.link = PlannerLink(self.directory, track=ROBOT.track, clock=self.clock)
        self.stranger = Letterbox(self.directory / "stranger")
        for _ in range(40):
            self.tick()

    def __enter__(self) -> Chain:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def clock(self) -> float:
        return self.now

    def tick(self) -> None:
        """A period of all of them."""
        self.now += 0.01
        self.server.step()
        self.executor.hear_button()
        self.executor.hear()
        self.executor.tick()
        self.link.beat(self.now)
        self.link.poll()
        order = self.executor.held.order
        most = self.remote.limits.wheel_speed
        if not all(math.isfinite(o) and abs(o) <= most for o in order[:2]):
            raise AssertionError(f"the base is told {order}")
        if not all(map(math.isfinite, self.base.truth)):
            raise AssertionError(f"the base is at {self.base.truth}")

    def close(self) -> None:
        for one in (self.link, self.executor, self.server, self.stranger):
            one.close()
        shutil.rmtree(self.directory, ignore_errors=True)


class Listener:
    """One of the chain's sockets, to which a stranger talks."""

    def __init__(self, draw: random.Random, of: str) -> None:
        self._chain = Chain(draw)
        self._draw = draw
        d = self._chain.directory
        link = next(d.glob("planner-*"))
        remote = next(d.glob("base-*"))
        self._to = {
            "executor": [d / ADDRESS, d / BUTTON], "base": [d / "base", remote], "link": [link],
        }[of]  # fmt: skip

    def eat(self, data: bytes) -> None:
        self._chain.stranger.post(self._draw.choice(self._to), data)
        self._chain.tick()
        self._chain.stranger.collect()

    def close(self) -> None:
        self._chain.close()


TARGETS: dict[str, Callable[[random.Random], Codec | Listener]] = {
    "codec": Codec,
    "executor": lambda draw: Listener(draw, "executor"),
    "base": lambda draw: Listener(draw, "base"),
    "link": lambda draw: Listener(draw, "link"),
}


def fuzz(inputs: int, draw: random.Random) -> Findings:
    """Try `inputs` inputs.

    Args:
        inputs: how many, of all targets together.
        draw: decides what they are.
    """
    findings, right = Findings(), right_messages()

    def made() -> bytes:
        data = broken(right, draw)
        return summed(data) if draw.random() < 0.5 else data

    for name, share in SHARES.items():
        target = TARGETS[name](draw)
        findings.throw(name, round(inputs * share), made, target.eat, MessageError)
        target.close()
    return findings


def main() -> int:
    """Throw broken messages at the executor, its base and the planner's link."""
    return carry_out(
        "Throw broken messages at everything that reads them.", "hardware.executor_fuzz", fuzz
    )


if __name__ == "__main__":
    sys.exit(main())
