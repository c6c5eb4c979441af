"""One seed in all variants, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from passpmp_ti import backend
from passpmp_ti.compare.job import ONE_AT_A_TIME, Job
from passpmp_ti.compare.workers import Workers
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.sim.episode import CycleInfo, simulate
from passpmp_ti.viz import palette, text
from passpmp_ti.viz.actors import draw_body, draw_outline, draw_world, shade_unseen
from passpmp_ti.viz.plot import Bounds, Plot
from passpmp_ti.viz.video import VideoWriter

STEP, RATE = 0.1, 20.0
"""Simulated time between frames [s], and frames a second: twice as fast as it happened."""
LINGER = 1.0
"""The last picture stays for so long [s]."""
WIDE = 1.5
"""Scenes at least this much wider than high stand one above the other."""
ACROSS, UP = 1680, 1000
"""The picture's greatest width and height [px]."""
LARGEST = 640
"""Of a panel [px]."""
HEAD, GAP = 58, 8
"""Height of a panel's heading, and room about each [px]."""


@dataclass(frozen=True, kw_only=True)
class Reel:
    """A variant's frames, as PNG: drawings are small then, and several reels fit into memory."""

    variant: str
    frames: tuple[bytes, ...]


def reel_of(job: Job, panels: int) -> Reel:
    """Drive an episode and draw it; `panels`: how many are shown at once."""
    with ONE_AT_A_TIME:
        backend.init("cpu", threads=1)
        camera = _Camera(job.variant.name, job.loaded().bounds, panels)
        if simulate(job.loaded(), seed=job.seed, on_cycle=camera.see).interrupted:
            raise KeyboardInterrupt
        return Reel(variant=job.variant.name, frames=tuple(camera.frames))


@dataclass(frozen=True)
class Shoot:
    """Makes a reel of a job; a class, since what goes to another process must be picklable."""

    panels: int

    def __call__(self, job: Job) -> Reel:
        return reel_of(job, self.panels)


def film(jobs: Sequence[Job], workers: Workers, path: Path) -> Path:
    """Write the video of one seed.

    Args:
        jobs: of one scenario and seed, one a variant, in the order of the panels.
        workers: draw the reels.
        path: of the video; see `VideoWriter` for its suffix.

    Returns:
        What was written.

    Raises:
        RuntimeError: no video can be written here.
    """
    reels: dict[str, Reel] = {}
    with closing(workers.each(Shoot(len(jobs)), jobs)) as found:
        for reel in found:
            reels[reel.variant] = reel
    ordered = [reels[job.variant.name] for job in jobs]
    beside = not _stands_above(jobs[0].loaded().bounds)
    size = _joined([_decoded(r.frames[0]) for r in ordered], beside).shape[1::-1]
    with VideoWriter(path.with_stem("unfinished"), (size[0], size[1]), RATE) as writer:
        count = max(len(r.frames) for r in ordered) + round(LINGER * RATE)
        for n in range(count):
            frames = [_decoded(r.frames[min(n, len(r.frames) - 1)]) for r in ordered]
            writer.write(_joined(frames, beside))
    # there whole or not at all: a video that is there is not made again
    return writer.path.replace(path.with_suffix(writer.path.suffix))


def filmed(folder: Path, jobs: Sequence[Job]) -> Path:
    """Where the video of jobs of one scenario and seed lies, or is to lie."""
    scenario, _, seed = jobs[0].key
    stem = "-".join([scenario, f"seed-{seed}", *(job.variant.name for job in jobs)])
    there = [folder / f"{stem}{suffix}" for suffix in (".mp4", ".webm")]
    return next((path for path in there if path.exists()), there[0])


class _Camera:
    """Draws an episode at even times."""

    def __init__(self, name: str, bounds: Bounds, panels: int) -> None:
        self.frames: list[bytes] = []
        self._name = name
        self._plot = Plot(bounds, _size(bounds, panels))
        self._trail: list[np.ndarray] = []
        self._start: float | None = None

    def see(self, info: CycleInfo) -> None:
        """Take the pictures that are due in one cycle of `simulate`."""
        if self._start is None:
            self._start = info.time
        end = info.time + info.navigator.settings.cycle - 1e-9
        while (time := self._start + STEP * len(self.frames)) < end:
            state = info.executing.at(time)
            self._trail.append(state[:2])
            self._paint(info, time, state)
            self.frames.append(_encoded(self._headed(info, time - self._start, state)))
            if info.navigator.reached:
                break

    def _paint(self, info: CycleInfo, time: float, state: np.ndarray) -> None:
        """Everything that has a place in the world, the nearest to the eye last."""
        plot, record, robot = self._plot, info.navigator.record, info.navigator.robot
        plot.clear()
        if isinstance(record.model, FutureModel):
            shade_unseen(record.model, plot)
        draw_world(info.world, time, plot)
        plot.line(np.array(self._trail), palette.EXECUTED, 2)
        draw_body(robot, state, plot)
        if record.chosen is not None:
            plot.line(record.chosen.states[:, :2], palette.CHOICE, 3)
        draw_outline(robot, state, plot)
        plot.star(np.asarray(record.goal), 10, palette.GOAL)

    def _headed(self, info: CycleInfo, elapsed: float, state: np.ndarray) -> np.ndarray:
        """[h, w, 3] the picture under a heading: variant, time, speed, contacts."""
        sheet = self._plot.sheet
        page = np.full((sheet.shape[0] + HEAD, sheet.shape[1], 3), palette.PAGE, np.uint8)
        page[HEAD:] = sheet
        moving = sum(c.moving for c in info.contacts)
        speed = float(info.navigator.robot.speed(state))
        now = "at the goal" if info.navigator.reached else f"{speed:.1f} m/s"
        text.draw(page, self._name, (4, 22), palette.INK, 19, weight=text.HEADING)
        text.draw(page, f"{elapsed:.1f} s, {now}", (4, 46), palette.INK, 16)
        colour = palette.EXECUTED if moving else palette.MUTED
        text.draw(page, f"contacts while moving: {moving}", (sheet.shape[1] - 4, 46), colour, 16,
                  align=1.0)  # fmt: skip
        return page


def _stands_above(bounds: Bounds) -> bool:
    return bounds[2] - bounds[0] >= WIDE * (bounds[3] - bounds[1])


def _size(bounds: Bounds, panels: int) -> tuple[int, int]:
    """(width, height) of the plot of one of several panels, both even [px]."""
    across, up = bounds[2] - bounds[0], bounds[3] - bounds[1]
    if _stands_above(bounds):
        room = (2 * LARGEST, UP // panels - HEAD - GAP)
    else:
        room = (min(ACROSS // panels - GAP, LARGEST), UP - HEAD - GAP)
    scale = min(room[0] / across, room[1] / up)
    return (2 * round(across * scale / 2), 2 * round(up * scale / 2))


def _joined(frames: Sequence[np.ndarray], beside: bool) -> np.ndarray:
    """Panels in a row, or one above the other, with room about each."""
    framed = [
        cv2.copyMakeBorder(f, GAP, GAP, GAP, GAP, cv2.BORDER_CONSTANT, value=palette.PAGE)
        for f in frames
    ]
    return np.concatenate(framed, axis=1 if beside else 0)


def _encoded(image: np.ndarray) -> bytes:
    done, data = cv2.imencode(".png", image[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 3])
    assert done
    return data.tobytes()


def _decoded(frame: bytes) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(frame, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return np.ascontiguousarray(image[:, :, ::-1])
