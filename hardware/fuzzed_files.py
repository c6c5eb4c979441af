"""Recordings and settings, as a fuzzer breaks them."""

from __future__ import annotations

import random
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from hardware.bags_drive import DriveWriter
from hardware.bags_recording import Recording
from hardware.broken_trees import broken_tree
from hardware.config_file import read_config
from hardware.findings import broken
from hardware.fuzzed_listeners import SETTINGS
from hardware.fuzzed_messages import KNOWN, NOW, SEEN
from hardware.replay import replay
from hardware.ros_settings import RosSettings, read_parameters
from hardware.ros_twin import RosTwinSettings

EXAMPLES = Path(__file__).parent / "examples"
REPLAYED = 0.3
"""Of the recordings that can be read, this share is planned on."""
ON_ROBOT: dict[str, Any] = {
    "scans": ["scan"], "base_frame": "base_link", "frame": "", "map": "", "range_max": 10.0,
    "beyond_is_free": False, "sweep": 0.02, "stamped": "first", "skew": 0.0, "oldest": 0.5,
    "apart": 0.01, "pose_error": 0.01, "heading_error": 0.01, "range_error": 0.04,
    "odometry_period": 0.02, "mode": "conservative", "cycle": 0.1, "object_speed": 1.0, "seed": 0,
    "directory": str(SETTINGS.directory), "backend": "cpu", "threads": 1, "show_every": 0.5,
    "show_cell": 0.1, "show_reach": 5.0,
    "robot": {"discs": [[0.0, 0.4]], "wheel_speed": 1.0, "acceleration": 1.0, "track": 0.54},
    "limits": {"wheel_speed": 1.2, "acceleration": 1.2, "track": 0.54, "command_timeout": 0.25},
    "settings": {"blind_speed": 0.0, "clear_radius": 0.8, "cell": 0.1, "particles": 20},
    "executor": {"period": 0.01, "join": [0.005, 0.01, 0.02], "follower": {"along": 2.5}},
}  # fmt: skip
"""Parameters of the nodes, as a file or a server has them."""
OF_TWIN: dict[str, Any] = {
    "scenario": "corridor_person", "seed": 3, "object_speed": 0.5, "chair": "plain",
    "greeting": 5.0, "summary": "",
}  # fmt: skip


class Folder:
    """Somewhere to write to, until it is closed."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="fuzz-"))

    def close(self) -> None:
        shutil.rmtree(self.path, ignore_errors=True)


class Recordings:
    """Recordings of either kind: their reader, and planning on what it makes of them."""

    refusal: type[Exception] = ValueError

    def __init__(self, draw: random.Random) -> None:
        self._draw = draw
        self._folder = Folder()
        self._right = []
        for suffix in (".bag", ".mcap"):
            path = self._folder.path / f"right{suffix}"
            _record(path)
            self._right.append((suffix, path.read_bytes()))
            # kernels are compiled before anything is timed
            self._read(path, plans=True)

    def made(self, draw: random.Random) -> tuple[str, bytes]:
        suffix, right = draw.choice(self._right)
        return suffix, broken([right], draw)

    def eat(self, data: tuple[str, bytes]) -> None:
        suffix, told = data
        path = self._folder.path / f"broken{suffix}"
        path.write_bytes(told)
        try:
            self._read(path, plans=self._draw.random() < REPLAYED)
        except ValueError as why:
            if str(path) not in str(why):
                raise AssertionError("a refusal that does not name the file") from why
            raise

    def close(self) -> None:
        self._folder.close()

    def _read(self, path: Path, *, plans: bool) -> None:
        recording = Recording(path, track=SETTINGS.robot.track)
        if not np.isfinite(recording.way.states).all():
            raise AssertionError("a robot that was at places that are none")
        instants = list(recording.instants())
        recording.static_map("map")
        if plans and recording.way.fastest <= SETTINGS.robot.wheel_speed:
            settings = SETTINGS.planner_settings()
            replay(instants, recording.way, SETTINGS.robot, settings)


class Configs:
    """The file of `passpmp drive`."""

    refusal: type[Exception] = ValueError

    def __init__(self, draw: random.Random) -> None:
        self._folder = Folder()
        self._path = self._folder.path / "robot.yaml"
        self._texts = [path.read_bytes() for path in sorted(EXAMPLES.glob("*.yaml"))]
        self._trees = [yaml.safe_load(text) for text in self._texts]

    def made(self, draw: random.Random) -> bytes:
        if draw.random() < 0.5:
            return broken(self._texts, draw)
        return _dumped(broken_tree(draw.choice(self._trees), draw))

    def eat(self, data: bytes) -> None:
        self._path.write_bytes(data)
        try:
            read_config(self._path)
        except ValueError as why:
            if str(self._path) not in str(why):
                raise AssertionError("a refusal that does not name the file") from why
            raise

    def close(self) -> None:
        self._folder.close()


class Parameters:
    """Parameters of the nodes of ROS."""

    refusal: type[Exception] = ValueError

    def __init__(self, draw: random.Random) -> None:
        self._folder = Folder()
        self._path = self._folder.path / "parameters.yaml"
        self._text = yaml.safe_dump(ON_ROBOT).encode()

    def made(self, draw: random.Random) -> Any:
        if draw.random() < 0.05:
            return broken([self._text], draw)
        return broken_tree(OF_TWIN if draw.random() < 0.1 else ON_ROBOT, draw)

    def eat(self, data: Any) -> None:
        if isinstance(data, bytes):
            self._path.write_bytes(data)
            data = read_parameters(self._path)
        if isinstance(data, dict) and "scenario" in data:
            RosTwinSettings.from_parameters(data)
            return
        settings = RosSettings.from_parameters(data)
        settings.executor_settings()
        settings.planner_settings()

    def close(self) -> None:
        self._folder.close()


def _record(path: Path) -> None:
    """A drive of half a second."""
    mounts, track = [(0.2, 0.0, 0.0)], SETTINGS.robot.track
    with DriveWriter(path, mounts, track=track, ahead=NOW, known=KNOWN) as bag:
        for k in range(4):
            state = np.array([0.05 * k, 0.0, 0.0, 0.3, 0.3])
            bag.see([replace(SEEN, stamp=0.1 * k)], state)


def _dumped(tree: Any) -> bytes:
    try:
        return yaml.safe_dump(tree).encode("utf-8", "surrogatepass")
    except yaml.YAMLError:  # a thing that YAML does not have
        return b""
