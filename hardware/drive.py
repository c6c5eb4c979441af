"""`passpmp drive`: its options, and what it prints. Heavy imports stand inside the functions."""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import json
import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passpmp_ti import door

if TYPE_CHECKING:
    from hardware.bags_drive import DriveWriter
    from hardware.ros_messages import Pose
    from hardware.twin import Chain, Look
    from hardware.twin_view import View
    from passpmp_ti.grid.static_map import StaticMap

EXAMPLE = """passpmp drive hardware/examples/emulated.yaml
  passpmp drive --twin corridor_person --cycle 0.1
  passpmp drive --twin dead_end --seed 3 --video out/dead_end.mp4 --live out/live
  passpmp drive --twin corridor_person --cycle 0.1 --bag out/drive.bag"""
FAILED, INTERRUPTED = 1, 130
"""Exit codes: something touched the twin while it moved, or a robot did not get to its goal;
Ctrl-C."""
PRIORITY = 1
"""Of the planner, of SCHED_FIFO where it is granted: below the executor's."""
CYCLE = 0.4
"""Of the planner on the twin, as in the paper [s]."""
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
    add("config", nargs="?", metavar="CONFIG", help="a robot's file, as hardware/examples has them")
    add(
        "--twin",
        metavar="SCENARIO",
        help="drive a wheelchair in MuJoCo through a shipped scenario or a file, in real time",
    )
    add(
        "--seconds",
        type=float,
        metavar="S",
        help="longest (default: with --twin the scenario's duration, else none)",
    )
    add("--seed", type=int, default=0, metavar="N", help="of everything random (default: 0)")
    add("--cycle", type=float, metavar="S", help="with --twin: of the planner (default: 0.4)")
    add(
        "--object-speed",
        type=float,
        metavar="V",
        help="with --twin: bound on the speed of objects [m/s]; faster movers are slowed down",
    )
    add("--threads", type=int, metavar="K", help="of the planner's kernels (default: all cores)")
    add("--out", metavar="FILE", help="write the summary here, as JSON")
    add(
        "--bag",
        metavar="FILE",
        help="record scans, odometry and map: a .bag of ROS 1, or an .mcap; for passpmp replay",
    )
    add("--video", metavar="FILE", help="with --twin: draw the drive when it is over")
    add(
        "--live",
        metavar="FOLDER",
        help="with --twin: show it as it goes, in a window, or where there is none as"
        " FOLDER/live.png",
    )


def run(given: argparse.Namespace) -> int:
    """Drive, and print what it came to; returns the exit code.

    Raises:
        ValueError: a bad option, a bad file, or MuJoCo is not installed.
    """
    if (given.config is None) == (given.twin is None):
        raise ValueError(
            "drive takes a robot's file or --twin SCENARIO, and not both; try"
            " hardware/examples/emulated.yaml"
        )
    return _on_robot(given) if given.twin is None else _on_twin(given)


def _on_robot(given: argparse.Namespace) -> int:
    for option in ("video", "live"):
        if getattr(given, option) is not None:
            raise ValueError(f"--{option} goes with --twin: only there it is known what really was")
    for option in ("cycle", "object_speed"):
        if getattr(given, option) is not None:
            raise ValueError(
                f"--{option.replace('_', '-')} goes with --twin; {given.config} has it as"
                f" planner.{option}, where its margins are checked with it"
            )
    from hardware.config_file import read_config

    config = read_config(Path(given.config))
    seconds = math.inf
    if given.seconds is not None:
        seconds = door.finite("drive", "seconds", given.seconds, above=0.0, unit="s")
    _start(given.threads)
    from hardware import driven, on_robot
    from hardware.priority import put_forward

    print("compiling, and waiting for the robot", file=sys.stderr)
    try:
        with contextlib.ExitStack() as open_:
            drive = on_robot.RobotDrive(config, seed=given.seed)
            record = None
            if given.bag is not None:
                mounts = [lidar.mount for lidar in config.lidars]
                known = drive.navigator.static_map
                bag = _recorder(given.bag, mounts, config.robot.track, known)
                record = open_.enter_context(bag).see
            open_.enter_context(drive)
            put_forward("the planner", PRIORITY)
            print("driving; Ctrl-C brings it to rest, a second one stops it", file=sys.stderr)
            found = drive.run(
                seconds, lambda look: print(driven.line(look), file=sys.stderr), record
            )
    except RuntimeError as trouble:
        print(f"passpmp: {trouble}", file=sys.stderr)
        return FAILED
    told = found.summary()
    print(driven.report(told))
    _write(given.out, told)
    if found.interrupted:
        return INTERRUPTED
    return 0 if found.reached else FAILED


def _on_twin(given: argparse.Namespace) -> int:
    if importlib.util.find_spec("mujoco") is None:
        raise ValueError(
            "--twin needs MuJoCo, which is not installed; pip install 'passpmp_ti[twin]'"
        )
    from hardware.twin import Chain

    print("compiling, and starting the twin", file=sys.stderr)
    cycle = CYCLE if given.cycle is None else given.cycle
    chain = Chain(
        given.twin, seed=given.seed, cycle=cycle, object_speed=given.object_speed,
        threads=given.threads, keeps_scans=given.bag is not None,
    )  # fmt: skip
    seconds = chain.scenario.duration if given.seconds is None else given.seconds
    door.finite("drive", "seconds", seconds, above=0.0, unit="s")
    try:
        with contextlib.ExitStack() as open_:
            record = None
            if given.bag is not None:
                mounts = [lidar.mount for lidar in chain.scenario.lidars]
                bag = _recorder(given.bag, mounts, chain.robot.track, chain.known)
                record = open_.enter_context(bag).see
            open_.enter_context(chain)
            if given.live is not None:
                open_.callback(_shown(chain, given.live).close)
            found = chain.run(seconds, lambda look: print(line(look), file=sys.stderr), record)
    except RuntimeError as trouble:
        print(f"passpmp: {trouble}", file=sys.stderr)
        return FAILED
    told = found.summary()
    print(report(told))
    _write(given.out, told)
    if given.video is not None:
        print(f"written to {chain.film(Path(given.video))}")
    if told["interrupted"]:
        return INTERRUPTED
    return FAILED if told["collisions_moving"] else 0


def _recorder(
    path: str, mounts: Sequence[Pose], track: float, known: StaticMap | None
) -> DriveWriter:
    from hardware.bags_drive import DriveWriter

    ahead = time.time() - time.monotonic()
    return DriveWriter(path, mounts, track=track, ahead=ahead, known=known)


def _shown(chain: Chain, folder: str) -> View:
    from hardware.twin_view import View, ViewConfig

    view = View(ViewConfig(twin=chain.config, begin=chain.twin.begin, folder=folder))
    print(f"shown in {view.where}", file=sys.stderr)
    return view


def _start(threads: int | None) -> None:
    """Start the kernels; Taichi greets on standard output, which belongs to the results."""
    from passpmp_ti import backend

    with contextlib.redirect_stdout(io.StringIO()):
        backend.init(threads=threads)


def _write(out: str | None, told: dict[str, Any]) -> None:
    if out:
        path = Path(out)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(told, indent=2) + "\n")
        print(f"written to {path}")


def line(look: Look) -> str:
    """One line of progress."""
    moving = sum(contact.moving for contact in look.contacts)
    decision = "" if look.record is None else look.record.decision
    return (
        f"t {look.time:6.1f} s   to goal {look.away:6.1f} m   speed {look.speed:6.2f} m/s  "
        f" {decision:<8} {look.state:<12} contacts moving {moving},"
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
