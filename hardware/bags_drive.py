"""Records a drive: scans, odometry, mounts and the map that was planned with."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hardware.bags import BagWriter
from hardware.base import Odometry
from hardware.ros_messages import Pose, laser_scan, map_message, odometry_message, transforms
from hardware.ros_port import GRID, ODOMETRY, SCAN, TRANSFORMS
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.scan import Scan

ODOM = "odom"
"""Frame of all that is written."""


class DriveWriter:
    """Records a drive: scans and odometry in the frame that was planned in."""

    def __init__(
        self,
        path: str | Path,
        mounts: Sequence[Pose],
        *,
        track: float,
        ahead: float,
        known: StaticMap | None = None,
    ) -> None:
        """
        Args:
            path: as for `BagWriter`.
            mounts: (x, y, theta) of each range finder on the robot.
            track: distance between the driven wheels [m].
            ahead: the wall clock's time less that of the scans' stamps [s].
            known: what the planner was told of what stays.
        """
        self._known = known
        self._bag = BagWriter(path)
        self._ahead, self._track = ahead, track
        self._frames = [f"laser_{n}" for n in range(len(mounts))]
        self._links = [("base_link", f, m) for f, m in zip(self._frames, mounts, strict=True)]
        self._begun = False

    def __enter__(self) -> DriveWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self._bag.close()

    def see(self, scans: Sequence[Scan], state: np.ndarray) -> None:
        """Write what was planned on: the scans of one instant, and the robot's state [5] then.

        They are told without a duration: `steady.py` has made of each sweep what one instant saw.
        """
        stamp = scans[0].stamp + self._ahead
        if not self._begun:
            self._begun = True
            links = transforms(self._links, stamp)
            self._bag.write("/tf_static", TRANSFORMS, links, stamp)
            if self._known is not None:
                tree = map_message(self._known, stamp, ODOM)
                self._bag.write("/map", GRID, tree, stamp)
        odometry = Odometry(scans[0].stamp, *(float(v) for v in state))
        tree = odometry_message(odometry, stamp, ODOM, "base_link", self._track)
        self._bag.write("/odom", ODOMETRY, tree, stamp)
        for n, (scan, frame) in enumerate(zip(scans, self._frames, strict=True)):
            topic = "/scan" if n == 0 else f"/scan_{n}"
            tree = laser_scan(scan, stamp, frame)
            self._bag.write(topic, SCAN, tree, stamp)
