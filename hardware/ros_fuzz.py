"""Throws broken input at what hears ROS, and at what reads recordings and settings.

    python -m hardware.ros_fuzz --inputs 1000000

As `hardware.fuzz`: an input is right, then broken. Messages are broken as objects, which is more
than a middleware lets through, and as bytes. Readers may raise the error that they tell of, those
who listen nothing at all, and no cycle may end because of what was heard; no order may be anything
but a number within the base's limits; nothing may take long or keep more than a bounded number of
bytes. The same seed makes the same inputs, but for stamps that are of now. The exit code is 1 if
anything failed.

What is not installed is left out and said so: ROS 1's bytes need rospy, ROS 2's cyclonedds,
recordings rosbags.
"""

from __future__ import annotations

import importlib.util
import random
import sys
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from hardware import ros1
from hardware.findings import Findings, carry_out
from hardware.fuzzed_files import Configs, Parameters, Recordings
from hardware.fuzzed_listeners import TOPICS, Bases, Planners
from hardware.fuzzed_messages import Readers
from hardware.fuzzed_wires import dds_wire, ros1_wire

SHARES = {
    "reader": 0.5, "planner": 0.25, "base": 0.1, "ros1": 0.05, "dds": 0.05, "recording": 0.005,
    "config": 0.02, "parameters": 0.025,
}  # fmt: skip
"""Of the inputs; files take the longest."""


class Target(Protocol):
    """Something that is fed."""

    @property
    def refusal(self) -> type[Exception] | tuple[()]:
        """What it may raise; (): nothing."""

    def made(self, draw: random.Random) -> Any:
        """An input that was right, once."""

    def eat(self, data: Any) -> None:
        """Let it have the input."""

    def close(self) -> None:
        """It is fed no more."""


TARGETS: dict[str, Callable[[random.Random], Target]] = {
    "reader": Readers,
    "planner": Planners,
    "base": Bases,
    "ros1": ros1_wire,
    "dds": dds_wire,
    "recording": Recordings,
    "config": Configs,
    "parameters": Parameters,
}


def missing() -> dict[str, str]:
    """{target: what it needs} of those that cannot be tried here."""
    found = {}
    for package in ("rospy", *sorted({kind.partition("/")[0] for kind in TOPICS.values()})):
        if not ros1.there(package):
            found["ros1"] = package
    for name, package in (("dds", "cyclonedds"), ("recording", "rosbags")):
        if importlib.util.find_spec(package) is None:
            found[name] = package
    return found


def fuzz(inputs: int, draw: random.Random, shares: dict[str, float] = SHARES) -> Findings:
    """Try `inputs` inputs.

    Args:
        inputs: how many, of all targets together.
        draw: decides what they are.
        shares: of each target. Those that cannot be tried are left out.
    """
    findings, left_out = Findings(), missing()
    for name, share in shares.items():
        if name in left_out:
            continue
        target = TARGETS[name](draw)
        made = partial(target.made, draw)
        findings.throw(name, round(inputs * share), made, target.eat, target.refusal)
        target.close()
    return findings


def main() -> int:
    """Throw broken input at what hears ROS, and at what reads recordings and settings."""
    from passpmp_ti import backend

    backend.init("cpu", threads=1)
    for name, package in missing().items():
        print(f"{name:8s} left out: {package} is not installed")
    return carry_out(
        "Throw broken input at what hears ROS, and at what reads recordings and settings.",
        "hardware.ros_fuzz", fuzz,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
