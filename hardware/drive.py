"""`passpmp drive`: its options, and what it prints. Heavy imports stand inside the functions."""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passpmp_ti import door

if TYPE_CHECKING:
    from hardware.twin import Look

EXAMPLE = """passpmp drive --twin corridor_person --cycle 0.1
  passpmp drive --twin dead_end --seed 3 --seconds 60 --out out/dead_end.json
  passpmp drive --twin corridor_person --bag out/drive.bag"""
FAILED, INTERRUPTED = 1, 130
"""Exit codes: something touched the robot while it moved, Ctrl-C."""
ROWS = (
    ("scan's stamp to its arrival", "scan_age"),
    ("scan's arrival to new trajectory", "to_trajectory"),
    ("scan's arrival to executor", "to_executor"),
    ("scan's arrival to wheels", "to_wheels"),
)
"""(name, key of the summary)."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What `drive` takes."""
    add = parser.add_argument
    add(
        "--twin",
        required=True,
        metavar="SCENARIO",
        help="drive a wheelchair in MuJoCo through a shipped scenario or a file, in real time",
    )
    add("--seconds", type=float, metavar="S", help="longest (default: the scenario's duration)")
    add("--seed", type=int, default=0, metavar="N", help="of everything random (default: 0)")
    add("--cycle", type=float, default=0.4, metavar="S", help="of the planner (default: 0.4)")
    add(
        "--object-speed",
        type=float,
        metavar="V",
        help="bound on the speed of objects [m/s]; faster movers are slowed down",
    )
    add("--threads", type=int, metavar="K", help="of the planner's kernels (default: all cores)")
    add("--out", metavar="FILE", help="write the summary here, as JSON")
    add("--bag", metavar="FILE", help="record scans and odometry: a .bag of ROS 1, or an .mcap")


def run(given: argparse.Namespace) -> int:
    """Drive, and print what it came to; returns the exit code.

    Raises:
        ValueError: a bad option, or MuJoCo is not installed.
    """
    if importlib.util.find_spec("mujoco") is None:
        raise ValueError(
            "--twin needs MuJoCo, which is not installed; pip install 'passpmp_ti[twin]'"
        )
    from passpmp_ti import backend

    with contextlib.redirect_stdout(io.StringIO()):
        backend.init(threads=given.threads)
    from hardware.twin import Chain

    print("compiling, and starting the twin", file=sys.stderr)
    chain = Chain(given.twin, seed=given.seed, cycle=given.cycle, object_speed=given.object_speed)
    seconds = chain.scenario.duration if given.seconds is None else given.seconds
    door.finite("drive", "seconds", seconds, above=0.0, unit="s")
    with contextlib.ExitStack() as open_:
        record = None
        if given.bag:
            from hardware.bags_drive import DriveWriter

            mounts = [lidar.mount for lidar in chain.scenario.lidars]
            ahead = time.time() - time.monotonic()
            writer = DriveWriter(
                given.bag, mounts, track=chain.robot.track, ahead=ahead,
                known=chain.navigator.static_map,
            )  # fmt: skip
            record = open_.enter_context(writer).see
        open_.enter_context(chain)
        found = chain.run(seconds, lambda look: print(line(look), file=sys.stderr), record)
    told = found.summary()
    print(report(told))
    if given.out:
        path = Path(given.out)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(told, indent=2) + "\n")
        print(f"written to {path}")
    if told["interrupted"]:
        return INTERRUPTED
    return FAILED if told["collisions_moving"] else 0


def line(look: Look) -> str:
    """One line of progress."""
    moving = sum(contact.moving for contact in look.contacts)
    return (
        f"t {look.time:6.1f} s   to goal {look.away:6.1f} m   speed {look.speed:6.2f} m/s  "
        f" {look.record.decision:<8} {look.state:<12} contacts moving {moving},"
        f" at rest {len(look.contacts) - moving}"
    )


def report(told: dict[str, Any]) -> str:
    """The summary as text."""
    from passpmp_ti.viz.report import summary_table, table

    latencies = [["[ms]", "median", "99 %"]]
    for name, key in ROWS:
        values = [told[f"{key}_{share}"] for share in ("median", "p99")]
        latencies.append([name, *("-" if v is None else f"{1e3 * v:.1f}" for v in values)])
    states = ", ".join(f"{name} {100 * v:.0f} %" for name, v in told["executor_states"].items())
    return (
        f"\n{told['scenario']} on the twin, cycle {told['cycle']:g} s, objects of at most"
        f" {told['object_speed']:g} m/s\n{summary_table([told])}\n\n{table(latencies)}\n\n"
        f"trajectories: {told['sent']} sent, {told['refused']} of them not taken;"
        f" {told['idle']} cycles without a scan or a known pose\n"
        f"executor: {states}; off its path by {1e3 * told['worst_error']:.0f} mm at the most\n"
        f"twin: 99 % of it within {1e3 * told['twin_late']:.0f} ms of its time"
    )
