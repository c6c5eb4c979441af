"""`passpmp replay`: its options, and what it prints. Heavy imports stand inside the functions."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hardware.bags_recording import Recording
    from hardware.replay import Cycle
    from hardware.ros_settings import RosSettings
    from passpmp_ti.grid.static_map import StaticMap

EXAMPLE = """passpmp replay drive.bag --config launch/wheelchair.yaml --out out/replay
  passpmp replay drive.mcap --map /map --object-speed 0.5 --cycle 0.2
  passpmp replay drive.bag --scan /front --set blind_speed=0 --set clear_radius=0.8"""
INTERRUPTED = 130
"""Exit code: Ctrl-C."""
EVERY = 5.0
"""Seconds of the recording between two lines of progress."""
FASTER = 1.05
"""Where nobody says how fast the robot is: so much faster than it was."""
ROWS = (
    ("recorded", "recorded", "s", 1.0, 1),
    ("driven", "distance", "m", 1.0, 1),
    ("cycles", "cycles", "", 1.0, 0),
    ("a new plan", "share_plan", "%", 100.0, 0),
    ("rest is all there is", "share_rest", "%", 100.0, 0),
    ("the robot moved", "share_moving", "%", 100.0, 0),
    ("  and could have braked in time", "recorded_motion_clear", "%", 100.0, 0),
    ("p-safe share of what is seen, median", "safe_share", "%", 100.0, 0),
    ("  while it moved", "safe_share_moving", "%", 100.0, 0),
    ("cycles with broken premises", "broken_premises", "", 1.0, 0),
    ("cycles without a scan that can be used", "lost_scans", "", 1.0, 0),
    ("nodes of the tree, median", "tree_nodes", "", 1.0, 0),
    ("cycle time, median", "cycle_time_median", "ms", 1e3, 1),
    ("cycle time, 99 %", "cycle_time_p99", "ms", 1e3, 1),
)
"""(name, key of the summary, unit, factor, digits)."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What `replay` takes, but for the changes of the settings."""
    add = parser.add_argument
    add("bag", metavar="BAG", help="a ROS 1 bag, an MCAP file, or the folder of a ROS 2 recording")
    add("--config", metavar="FILE", help="the robot, as the nodes of ROS read it (docs/ros.md)")
    add("--scan", action="append", metavar="TOPIC", help="a range finder (default: all there are)")
    add("--odom", default="", metavar="TOPIC", help="(default: the first odometry, or tf)")
    add(
        "--mount",
        type=float,
        nargs=3,
        metavar=("X", "Y", "DEG"),
        help="of the range finders on the robot (default: as tf says)",
    )
    add(
        "--map",
        metavar="MAP",
        help="of what stays, in the frame of the poses: a topic, or a map_server's YAML file"
        " (default: none, and every wall may walk)",
    )
    add(
        "--goal",
        type=float,
        nargs=2,
        metavar=("X", "Y"),
        help="[m] (default: where the robot was 8 s later)",
    )
    add("--seconds", type=float, default=math.inf, metavar="S", help="of the recording, at most")
    add("--threads", type=int, metavar="K", help="of the planner's kernels (default: all cores)")
    add("--out", metavar="DIR", help="leave video, snapshots and summary here")
    add("--no-video", action="store_true", help="with --out: no video")


def run(given: argparse.Namespace, changes: Mapping[str, Any]) -> int:
    """Replay, and print what it came to; returns the exit code.

    Args:
        given: the options.
        changes: fields of `Settings`.

    Raises:
        ValueError: a bad option, or a recording that cannot be read.
    """
    from hardware.bags import check_installed
    from hardware.bags_recording import Recording
    from hardware.ros_settings import RosSettings

    check_installed()
    if not given.seconds > 0:
        raise ValueError(f"replay.seconds must be > 0 [s]; got {given.seconds!r}")
    settings, told = _configured(given, changes)
    mount = given.mount and (given.mount[0], given.mount[1], math.radians(given.mount[2]))
    recording = Recording(
        given.bag, track=settings.robot.track, scans=given.scan or told.get("scans", ()),
        odometry=given.odom, base_frame=settings.base_frame, mount=mount,
    )  # fmt: skip
    if "robot" not in told:
        robot = replace(
            settings.robot,
            wheel_speed=max(settings.robot.wheel_speed, FASTER * recording.way.fastest),
        )
        limits = replace(settings.limits, wheel_speed=robot.wheel_speed)
        settings = RosSettings.from_parameters(
            told | {"robot": _plain(robot), "limits": _plain(limits)}
        )
    if len(recording.topics) != len(settings.scans):
        settings = replace(settings, scans=recording.topics)
    return _replay(given, settings, recording)


def _configured(
    given: argparse.Namespace, changes: Mapping[str, Any]
) -> tuple[RosSettings, dict[str, Any]]:
    """Settings as file and command line say, and the values that they are made of."""
    from hardware.ros_settings import RosSettings, read_parameters

    told = read_parameters(given.config) if given.config else {}
    changed = dict(changes)
    changed["object_speed"] = given.object_speed
    for name in ("mode", "cycle", "object_speed"):
        value = changed.pop(name, None)
        if value is not None:
            told[name] = value
    # what is wrong in the file is told of before it is mixed with what else is given
    RosSettings.from_parameters(told)
    told["settings"] = {**told.get("settings", {}), **changed}
    return RosSettings.from_parameters(told), told


def _replay(given: argparse.Namespace, settings: RosSettings, recording: Recording) -> int:
    from hardware.replay import replay
    from passpmp_ti import backend

    with contextlib.redirect_stdout(io.StringIO()):
        backend.init(threads=given.threads)
    # nothing is decided by a clock: the recording does not wait
    planner = settings.planner_settings().changed(deadline=None)
    instants = recording.instants(
        range_max=settings.range_max, beyond_is_free=settings.beyond_is_free,
        apart=settings.apart, moments=settings.moments, steadied=settings.steadied,
    )  # fmt: skip
    length = min(recording.way.times[-1], given.seconds)
    progress = Progress(float(length))
    with contextlib.ExitStack() as open_:
        watchers: list[Callable[[Any], None]] = [progress.see]
        if given.out:
            from passpmp_ti.viz.outcome import Outcome

            detail = f"objects ≤ {planner.object_speed:.3g} m/s · cycle {planner.cycle:g} s"
            outcome = Outcome(given.out, recording.path.stem, detail, video=not given.no_video)
            watchers.append(open_.enter_context(outcome).see)

        def see(cycle: Cycle) -> None:
            for watcher in watchers:
                watcher(cycle)

        found = replay(
            instants, recording.way, settings.robot, planner,
            goal=tuple(given.goal) if given.goal else None,
            static_map=_map(given.map, recording), seconds=given.seconds, seed=given.seed, see=see,
        )  # fmt: skip
    if not found.records:
        raise ValueError(
            f"{given.bag}: nothing to plan on; what was left out:"
            f" {'; '.join(f'{why} ({n})' for why, n in recording.trouble.items()) or 'nothing'}"
        )
    told = found.summary() | {
        "bag": str(given.bag), "topics": list(recording.topics), "mode": planner.mode,
        "object_speed": planner.object_speed, "cycle": planner.cycle,
        "trouble": dict(recording.trouble),
    }  # fmt: skip
    print(report(told))
    if given.out:
        path = Path(given.out) / "summary.json"
        path.write_text(json.dumps(told, indent=2) + "\n")
        print(f"\nwritten to {given.out}")
    return INTERRUPTED if found.interrupted else 0


def _map(given: str | None, recording: Recording) -> StaticMap | None:
    if not given:
        return None
    if Path(given).suffix in (".yaml", ".yml"):
        from passpmp_ti.grid.static_map import StaticMap

        return StaticMap.load(given)
    return recording.static_map(given)


class Progress:
    """A line now and then."""

    def __init__(self, length: float) -> None:
        self._length, self._next = length, 0.0

    def see(self, cycle: Cycle) -> None:
        """Tell of a cycle."""
        if cycle.time < self._next:
            return
        self._next = cycle.time + EVERY
        record = cycle.navigator.record
        print(
            f"t {cycle.time:6.1f} of {self._length:.1f} s   speed"
            f" {float(cycle.navigator.robot.speed(cycle.state)):6.2f} m/s   {record.decision:<8}"
            f" p-safe {100 * cycle.share:3.0f} %   {record.lost_scan or record.reason}",
            file=sys.stderr,
        )


def report(told: Mapping[str, Any]) -> str:
    """The summary as text."""
    from passpmp_ti.viz.report import table

    rows = []
    for name, key, unit, factor, digits in ROWS:
        value = told[key]
        rows.append((name, unit, "-" if value is None else f"{factor * value:.{digits}f}"))
    notes = "".join(f"\n{why}: {count} times" for why, count in told["trouble"].items())
    return (
        f"\n{told['bag']}: {', '.join(told['topics'])}, {told['mode']}, objects of at most"
        f" {told['object_speed']:g} m/s, cycle {told['cycle']:g} s\n{table(rows, left=2)}{notes}"
    )


def _plain(made: Any) -> dict[str, Any]:
    """Fields of a robot or of limits as plain values."""
    return {
        name: getattr(made, name) for name, field in made.__dataclass_fields__.items() if field.init
    }
