"""A drive on the twin as a video: the truth, as it was recorded, and what was planned then."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hardware.twin_cycles import Cycle
from hardware.twin_picture import Moment, Picture
from passpmp_ti.viz.video import VideoWriter

STEP, RATE = 0.1, 20.0
"""Time between frames [s], and frames a second: twice as fast as it happened."""
LINGER = 1.0
"""The last picture stays for so long [s]."""


def moment_at(
    stamp: float,
    truth: np.ndarray,
    cycles: Sequence[Cycle],
    goals: Sequence[tuple[float, float]],
    begin: float,
    began: float,
) -> Moment:
    """What was so at a time.

    Args:
        stamp: the time, on the monotonic clock [s].
        truth: [n, 8] rows of the twin; n >= 1.
        cycles: of the planner, in order.
        goals: of the drive.
        begin: the world's time is this much ahead of the clock's [s].
        began: when the drive did, on the clock [s].
    """
    count = max(int(np.searchsorted(truth[:, 0], stamp, side="right")), 1)
    before = cycles[: int(np.searchsorted([c.at for c in cycles], stamp, side="right"))]
    last = before[-1] if before else None
    record = None if last is None else last.record
    # one in 20 rows draws the way well enough
    trail = truth[:count:20, 1:3]
    return Moment(
        time=stamp + begin, since=stamp - began, state=truth[count - 1, 1:6].copy(), trail=trail,
        plan=np.zeros((0, 2)) if last is None else last.plan,
        seen=np.zeros((0, 2)) if last is None else last.seen,
        goal=goals[-1] if record is None else record.goal,
        note="" if record is None else record.decision,
    )  # fmt: skip


def film(
    path: Path,
    picture: Picture,
    truth: np.ndarray,
    cycles: Sequence[Cycle],
    goals: Sequence[tuple[float, float]],
    begin: float,
) -> Path:
    """Write the video of a drive; see `moment_at` for the rest.

    Args:
        path: its suffix is replaced by that of the format.

    Returns:
        What was written.

    Raises:
        RuntimeError: no video can be written here.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    began, end = float(truth[0, 0]), float(truth[-1, 0])
    with VideoWriter(path, picture.size, RATE) as writer:
        for stamp in np.arange(began, end, STEP):
            image = picture.of(moment_at(float(stamp), truth, cycles, goals, begin, began))
            writer.write(image)
        for _ in range(round(LINGER * RATE)):
            writer.write(image)
    return writer.path
