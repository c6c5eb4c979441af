"""Frames of tf in the plane: who is mounted where on whom."""

from __future__ import annotations

import math
from collections.abc import Iterable

from hardware.ros_messages import Pose

MOST_LINKS = 64
"""Of a chain of frames; a loop is no chain."""
MOST_FRAMES = 4096
"""That are remembered. Names come from outside: who makes them up must not fill the memory."""


class Frames:
    """The newest pose of each frame in its parent; old ones are not kept."""

    def __init__(self) -> None:
        self._links: dict[str, tuple[str, Pose]] = {}

    def __len__(self) -> int:
        return len(self._links)

    def hear(self, links: Iterable[tuple[str, str, Pose]]) -> None:
        """Take in (parent, child, pose of the child in the parent). Once `MOST_FRAMES` are known
        there are no new ones."""
        for parent, child, pose in links:
            child = _plain(child)
            known = child in self._links or len(self._links) < MOST_FRAMES
            if known and all(map(math.isfinite, pose)):
                self._links[child] = (_plain(parent), pose)

    def pose(self, target: str, source: str) -> Pose | None:
        """The source frame's pose in the target frame; None where nothing joins them."""
        above = self._chain(_plain(target))
        for frame, up in self._chain(_plain(source)).items():
            if frame in above:
                return compose(inverse(above[frame]), up)
        return None

    def _chain(self, frame: str) -> dict[str, Pose]:
        """Pose of `frame` in itself, in its parent, and so on to the root."""
        pose: Pose = (0.0, 0.0, 0.0)
        chain = {frame: pose}
        while frame in self._links and len(chain) < MOST_LINKS:
            frame, step = self._links[frame]
            pose = compose(step, pose)
            if frame in chain:
                break
            chain[frame] = pose
        return chain


def compose(first: Pose, then: Pose) -> Pose:
    """The pose `then`, told in a frame at `first`, in that frame's parent."""
    c, s = math.cos(first[2]), math.sin(first[2])
    return (
        first[0] + c * then[0] - s * then[1],
        first[1] + s * then[0] + c * then[1],
        first[2] + then[2],
    )


def inverse(pose: Pose) -> Pose:
    """The parent's pose in a frame at `pose`."""
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    return (-c * x - s * y, s * x - c * y, -theta)


def _plain(frame: str) -> str:
    return frame.lstrip("/")
