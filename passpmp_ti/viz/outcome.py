"""What a run leaves in its folder: video, snapshots, summary and arrays."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from passpmp_ti.viz.canvas import Canvas
from passpmp_ti.viz.scene import Moment, draw_cycle
from passpmp_ti.viz.video import VideoWriter

if TYPE_CHECKING:
    from passpmp_ti.sim.episode import CycleInfo, Episode

SNAPSHOTS = 6
FINE, COARSE = 40_000, 20_000
"""States of the braking-ICS region in a snapshot and in a frame of the video."""
LEAST_FPS, MOST_FPS = 10, 60


class Outcome:
    """Watches a drive and writes what it saw; as a context manager it finishes whatever happens.

    The video runs in real time. Snapshots lie evenly over the run, however long it gets.
    """

    def __init__(
        self, folder: str | Path, heading: str, detail: str = "", *, video: bool = True
    ) -> None:
        """Make the folder.

        Args:
            folder: where everything goes; made where it does not exist.
            heading: of every picture.
            detail: beside it.
            video: write `video.mp4`.
        """
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self._heading, self._detail = heading, detail
        self._with_video = video
        self._canvas: Canvas | None = None
        self._writer: VideoWriter | None = None
        self._frames = 1  # of the video in a cycle
        self._trail: list[np.ndarray] = []
        self._count = 0
        self._stride = 1
        self._kept: list[tuple[float, np.ndarray]] = []
        self._last: Moment | None = None

    def see(self, info: CycleInfo) -> None:
        """Take in one cycle; to be called as, or from, `simulate`'s `on_cycle`."""
        self._trail.append(info.state[:2].copy())
        moment = moment_of(info, np.array(self._trail))
        if self._canvas is None:
            self._begin(info)
        assert self._canvas is not None
        chosen = self._count % self._stride == 0
        if chosen or self._writer is not None:
            image = draw_cycle(moment, self._canvas, region_states=FINE if chosen else COARSE)
            if chosen:
                self._keep(moment.time, image)
            if self._writer is not None:
                self._writer.write(image)
        self._last = moment
        self._count += 1
        self._go_on(info, moment)

    def _go_on(self, info: CycleInfo, moment: Moment) -> None:
        """Until the next cycle, where cycles are long: all moves on, the plan stays."""
        assert self._canvas is not None
        ahead = info.navigator.settings.cycle * np.arange(1, self._frames) / self._frames
        for seconds in ahead:
            time = info.time + float(seconds)
            state = info.executing.at(time)
            self._trail.append(state[:2])
            if self._writer is not None:
                between = replace(moment, time=time, state=state, trail=np.array(self._trail))
                image = draw_cycle(between, self._canvas, region_states=COARSE)
                self._writer.write(image)

    def finish(self, episode: Episode) -> dict[str, Any]:
        """Write `summary.json` and `episode.npz`; returns the summary."""
        summary = episode.summary()
        text = json.dumps(summary, indent=2, default=_plain) + "\n"
        (self.folder / "summary.json").write_text(text)
        episode.save(self.folder / "episode.npz")
        return summary

    @property
    def video(self) -> Path | None:
        """The video's file; None where there is none."""
        return None if self._writer is None else self._writer.path

    def close(self) -> None:
        """Write the snapshots and finish the video."""
        try:
            self._write_snapshots()
        finally:
            if self._writer is not None:
                self._writer.close()

    def __enter__(self) -> Outcome:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _begin(self, info: CycleInfo) -> None:
        self._canvas = Canvas(info.world.bounds)
        self._canvas.title(self._heading, self._detail)
        cycle = info.navigator.settings.cycle
        self._frames = math.ceil(cycle * LEAST_FPS - 1e-9)
        if self._with_video:
            fps = min(self._frames / cycle, MOST_FPS)
            self._writer = VideoWriter(self.folder / "video.mp4", self._canvas.layout.page, fps)

    def _keep(self, time: float, image: np.ndarray) -> None:
        self._kept.append((time, image))
        if len(self._kept) > 2 * SNAPSHOTS:
            # twice as many as needed: go on with every other one, and take half as many
            self._kept = self._kept[::2]
            self._stride *= 2

    def _write_snapshots(self) -> None:
        if self._last is None or self._canvas is None:
            return
        if self._kept[-1][0] < self._last.time:
            self._kept.append(
                (self._last.time, draw_cycle(self._last, self._canvas, region_states=FINE))
            )
        folder = self.folder / "snapshots"
        folder.mkdir(exist_ok=True)
        for old in folder.glob("t*.png"):
            old.unlink()
        count = min(SNAPSHOTS, len(self._kept))
        for n in np.unique(np.linspace(0, len(self._kept) - 1, count).round().astype(int)):
            time, image = self._kept[n]
            write_png(folder / f"t{time - self._kept[0][0]:06.1f}.png", image)


def moment_of(info: CycleInfo, trail: np.ndarray) -> Moment:
    """What a picture needs of a cycle; `trail` [n, 2]: where the robot has been [m]."""
    moving = sum(c.moving for c in info.contacts)
    return Moment(
        time=info.time,
        world=info.world,
        record=info.navigator.record,
        robot=info.navigator.robot,
        state=info.state,
        trail=trail,
        goals=tuple(info.navigator.goals),
        contacts_moving=moving,
        contacts_at_rest=len(info.contacts) - moving,
    )


def write_png(path: str | Path, image: np.ndarray) -> None:
    """Write a picture [H, W, 3] uint8 (red, green, blue).

    Raises:
        OSError: the file cannot be written.
    """
    done, data = cv2.imencode(".png", np.ascontiguousarray(image[:, :, ::-1]))
    if not done:
        raise OSError(f"{path}: the picture could not be encoded")
    Path(path).write_bytes(data.tobytes())


def _plain(value: object) -> object:
    """NumPy's numbers as Python's, for JSON."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} does not go into JSON")
