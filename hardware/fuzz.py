"""Throws broken input at everything that reads bytes from outside.

    python -m hardware.fuzz --inputs 1000000

An input is right, then broken: bytes are changed, left out, doubled, cut and joined, or it is
noise from the start; half of the broken replies get right check sums again, which leads farther in.
Nothing but a `ScipError` may be raised, no input may take long, and nothing may keep more than a
bounded number of bytes. The same seed makes the same inputs. The exit code is 1 if anything failed.
"""

from __future__ import annotations

import contextlib
import random
import socket
import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from hardware.findings import Findings, broken, carry_out
from hardware.scip import (
    END,
    Garbled,
    ScipError,
    decode_block,
    decode_info,
    decode_reply,
    summed,
)
from hardware.scip_client import ScipClient
from hardware.scip_commands import Command, Measure, Plain, decode_command
from hardware.scip_device import MOST_UNSENT, REBOOT_DELAY, Device
from hardware.scip_emulator import Emulator
from hardware.scip_rotor import Nature
from hardware.scip_session import Session
from hardware.scip_settings import ScipSettings
from hardware.scip_sweep import Parameters, decode_sweep, encode_sweep
from hardware.scip_wire import Wire

PATIENCE = 10.0
"""[s] that a socket may keep another waiting: a busy machine is not a hang."""
SMALL = Parameters(
    model="small", nearest=20, farthest=30000, steps_per_turn=80, first=0, last=60, front=30,
    speed=2400,
)  # fmt: skip
ASKED = Measure("MD", 0, 60)
SHARES = {"reply": 0.45, "command": 0.4, "device": 0.1, "session": 0.0495, "network": 0.0005}
"""Of the inputs; those over real sockets take the longest."""


def _source(_: float) -> np.ndarray:
    return np.linspace(0.01, 12.0, SMALL.steps)


def _device(now: float) -> Device:
    return Device(_source, now, Nature(parameters=SMALL))


def _right_replies() -> list[bytes]:
    device = _device(0.0)
    device.connect(0.0)
    lines = [b"VV", b"PP", b"II", b"%ST", b"TM0", b"TM1", b"TM2", b"BM", b"QT", b"XX"]
    device.receive(b"\n".join([*lines, ASKED.encode(), b""]), 0.0)
    told = device.advance(0.2) + device.advance(0.4)
    return [frame + END for frame in told.split(END) if frame]


def _right_commands() -> list[bytes]:
    plain = [Plain(n) for n in ("VV", "PP", "II", "BM", "QT", "RS", "RT", "RB", "%ST", "%SL")]
    adjusting = [Plain("TM", c) for c in "0123"]
    others = [Plain("SS", "019200"), Plain("CR", "00"), Plain("VV", text="hello")]
    measuring = [
        Measure(kind, start, end, cluster, skip, count)
        for kind in ("GD", "GE", "GS", "MD", "ME", "MS")
        for start, end in ((0, 60), (10, 20), (30, 9))
        for cluster, skip, count in ((1, 0, 0), (4, 2, 3))
    ]
    commands: list[Command] = [*plain, *adjusting, *others, *measuring]
    return [command.encode() + b"\n" for command in commands]


def with_sums(data: bytes) -> bytes:
    """Every line but the first of each reply with a check sum that is right."""
    frames = []
    for frame in data.split(END):
        echo, *lines = frame.split(b"\n")
        frames.append(b"\n".join((echo, *(summed(line[:-1]) for line in lines))))
    return END.join(frames)


class Replies:
    """The host's codec."""

    right = _right_replies()
    sums = True

    def eat(self, data: bytes, draw: random.Random) -> None:
        reply = decode_reply(data.removesuffix(END))
        for decode in (decode_info, decode_block):
            with contextlib.suppress(Garbled):
                decode(reply.lines)
        sweep = decode_sweep(ASKED, reply)
        # whatever is taken for a sweep is one
        if decode_sweep(ASKED, encode_sweep(ASKED, sweep)).stamp != sweep.stamp:
            raise AssertionError("a sweep that is not what it was read from")


class Commands:
    """The device's codec."""

    right = _right_commands()
    sums = False

    def eat(self, data: bytes, draw: random.Random) -> None:
        command = decode_command(data.rstrip(b"\n"))
        if decode_command(command.encode()) != command:
            raise AssertionError("a command that is not what it was read from")


class Devices:
    """An emulated device with a host that says anything."""

    right = Commands.right
    sums = False

    def __init__(self) -> None:
        self._now = 0.0
        self._device = _device(0.0)
        self._device.connect(0.0)

    def eat(self, data: bytes, draw: random.Random) -> None:
        self._now += draw.choice((0.0, 0.001, 0.03))
        self._device.receive(data, self._now)
        told = self._device.advance(self._now)
        if len(told) > 2 * MOST_UNSENT:
            raise AssertionError(f"{len(told)} bytes at once")
        if not self._device.is_up(self._now):
            self._now += 3.0
            self._device.connect(self._now)


class Sessions:
    """A host's session with a device that says anything."""

    right = Replies.right
    sums = True

    def __init__(self) -> None:
        self._now = 0.0
        self._open()

    def _open(self) -> None:
        settings = ScipSettings(host="127.0.0.1", garbled_most=50)
        self._session = Session(settings, self._now)
        wire = Wire(self._session, _device(self._now), self._now)
        # some are met while they are still opening
        wire.run(0.1 if int(self._now * 1000) % 4 else 1e-6)
        self._now = wire.now

    def eat(self, data: bytes, draw: random.Random) -> None:
        self._now += 0.001
        try:
            self._session.receive(data, self._now)
            self._session.check(self._now)
        except ScipError:
            self._open()
            raise
        if len(self._session.take()) > 1000:
            raise AssertionError("a session that talks without end")


class Network:
    """The emulator's socket and the client's, with a peer that says anything."""

    right = Commands.right + Replies.right
    sums = False

    def __init__(self) -> None:
        self._emulator = Emulator(_device, second="steal")
        self._peer = socket.create_server(("127.0.0.1", 0))
        self._peer.settimeout(PATIENCE)
        self._client = ScipClient(
            ScipSettings(
                host="127.0.0.1", port=self._peer.getsockname()[1], retry_first=0.001,
                retry_most=0.001,
            )
        )  # fmt: skip

    def eat(self, data: bytes, draw: random.Random) -> None:
        self._answers(data)
        self._client.step()
        time.sleep(0.001)
        self._client.step()
        device, _ = self._peer.accept()
        with device:
            device.sendall(data)
            for _ in range(4):
                self._client.read(0.0)
        self._client.close()

    def close(self) -> None:
        self._client.close()
        self._peer.close()
        # it may have been told to reboot
        until = time.monotonic() + 2 * (Nature().boot_time + REBOOT_DELAY)
        while not self._answers(b"") and time.monotonic() < until:
            time.sleep(0.05)
        answers = self._answers(b"")
        self._emulator.close()
        if not answers:
            raise AssertionError("the emulator does not answer any more")

    def _answers(self, data: bytes) -> bool:
        """Whether the emulator still answers a plain question after `data`."""
        heard, wanted = b"", b"VV\n00P\n"
        try:
            with socket.create_connection(self._emulator.address, timeout=PATIENCE) as host:
                host.sendall(data + b"\nTM2\nQT\nVV\n")
                while wanted not in heard:
                    piece = host.recv(4096)
                    if not piece:
                        return False
                    heard = heard[-len(wanted) :] + piece
        except ConnectionError:
            return False
        return True


TARGETS: dict[str, Callable[[], Replies | Commands | Devices | Sessions | Network]] = {
    "reply": Replies,
    "command": Commands,
    "device": Devices,
    "session": Sessions,
    "network": Network,
}


def _made(right: list[bytes], draw: random.Random, *, sums: bool) -> bytes:
    """An input that was right, once; where there are check sums half of them are right again."""
    data = broken(right, draw)
    return with_sums(data) if sums and draw.random() < 0.5 else data


def fuzz(inputs: int, draw: random.Random, targets: dict[str, float] = SHARES) -> Findings:
    """Try `inputs` inputs.

    Args:
        inputs: how many, of all targets together.
        draw: decides what they are.
        targets: share of each target.
    """
    findings = Findings()
    for name, share in targets.items():
        target = TARGETS[name]()
        made = partial(_made, target.right, draw, sums=target.sums)
        eat = partial(target.eat, draw=draw)
        findings.throw(name, round(inputs * share), made, eat, ScipError)
        if isinstance(target, Network):
            target.close()
    return findings


def main() -> int:
    """Throw broken input at the codec, the client and the emulator of range finders."""
    return carry_out(
        "Throw broken input at everything that reads bytes from outside.", "hardware.fuzz", fuzz
    )


if __name__ == "__main__":
    sys.exit(main())
