"""A live view of the twin, as a process of its own: it reads what twin and planner write down, and
holds up neither.

    python -m hardware.twin_view '{"twin": {...}, "begin": 12.5, "folder": "out/live"}'

A window where there is a display and OpenCV can open one; else a picture in a folder, made anew a
few times a second.
"""

from __future__ import annotations

import dataclasses
import json
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from hardware.child import ended, started
from hardware.twin_cycles import CycleReader
from hardware.twin_film import moment_at
from hardware.twin_picture import Picture
from hardware.twin_planner import CYCLES
from hardware.twin_process import TRUTH, TruthReader, TwinConfig

PACE = 0.2
"""From one picture to the next [s]."""
NICE = 10
"""It works when nobody else wants to."""
PICTURE = "live.png"


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewConfig:
    """What a view is told."""

    twin: TwinConfig
    begin: float
    """The world's time is this much ahead of the clock's [s]."""
    folder: str
    """Of the picture, where there is no window."""

    def to_json(self) -> str:
        """As the process is told it."""
        told = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return json.dumps(told | {"twin": json.loads(self.twin.to_json())})

    @classmethod
    def from_json(cls, text: str) -> ViewConfig:
        """As `to_json` wrote it."""
        given = json.loads(text)
        return cls(twin=TwinConfig.from_json(json.dumps(given.pop("twin"))), **given)


class View:
    """Starts one and looks after it."""

    def __init__(self, config: ViewConfig, *, within: float = 60.0) -> None:
        """
        Raises:
            RuntimeError: it did not start; says why.
        """
        self._process, told = started("hardware.twin_view", config.to_json(), within)
        self.where = told.decode().strip()
        """Where it shows what it shows."""

    def close(self) -> str:
        """End it. Returns what it complained of."""
        return ended(self._process, 2.0)


def run(config: ViewConfig, parent: int) -> None:
    """Show it until whoever started this process is gone."""
    os.nice(NICE)
    scenario = config.twin.load()
    world, _, _ = scenario.build(config.twin.seed)
    picture = Picture(scenario.name, world, scenario.robot)
    window = _has_window(scenario.name)
    folder = Path(config.folder)
    folder.mkdir(parents=True, exist_ok=True)
    where = "a window" if window else str(folder / PICTURE)
    os.write(sys.stdout.fileno(), where.encode() + b"\n")
    directory = config.twin.directory
    cycles, truth = CycleReader(directory / CYCLES), TruthReader(directory / TRUTH)
    done, rows = [], np.zeros((0, 8))
    while os.getppid() == parent:
        done += cycles.new()
        rows = np.concatenate([rows, truth.new()])
        if len(rows):
            stamp = float(rows[-1, 0])
            moment = moment_at(
                stamp, rows, done, scenario.goals, config.begin, float(rows[0, 0])
            )
            _show(picture.of(moment), scenario.name if window else "", folder)
        time.sleep(PACE)


def _has_window(name: str) -> bool:
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    try:
        cv2.namedWindow(name)
    except cv2.error:  # built without windows
        return False
    return True


def _show(image: np.ndarray, window: str, folder: Path) -> None:
    turned = np.ascontiguousarray(image[:, :, ::-1])
    if window:
        cv2.imshow(window, turned)
        cv2.waitKey(1)
        return
    # there whole or not at all: somebody else reads it at any moment
    beside = folder / f"new-{PICTURE}"
    cv2.imwrite(str(beside), turned)
    beside.replace(folder / PICTURE)


def main() -> int:
    if len(sys.argv) not in (2, 3):
        print("example: python -m hardware.twin_view CONFIGURATION", file=sys.stderr)
        return 2
    parent = int(sys.argv[2]) if len(sys.argv) == 3 else os.getppid()
    run(ViewConfig.from_json(sys.argv[1]), parent)
    return 0


if __name__ == "__main__":
    sys.exit(main())
