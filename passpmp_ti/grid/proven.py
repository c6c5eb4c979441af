"""What the scans and memory prove: from labelled returns to arrival times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.arrival import arrival, rasterised
from passpmp_ti.grid.memory import Memory
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.grid.view import Labels, Views, views_of
from passpmp_ti.grid.window import Window
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings


@dataclass(frozen=True, slots=True)
class Ground:
    """What a proof starts from, whatever is taken for a source."""

    labels: Labels
    empty_discs: Sequence[tuple[float, float, float]]
    """(x, y, radius) of discs known to be empty [m]."""
    window: Window
    base_ticks: int
    """From which ticks count [ms]."""
    robot: Robot
    settings: Settings
    static_map: StaticMap | None


@dataclass(frozen=True, slots=True)
class Proven:
    """Arrival times, and what they come from; arrays as in `FutureModel`."""

    ticks: device.Array
    seen: device.Array
    marks: device.Array
    views: Views
    broken: np.ndarray


def proven(
    ground: Ground, memory: Memory | None, owners: Sequence[np.ndarray] | None = None
) -> Proven:
    """When something could first be where.

    Args:
        ground: what the scans met.
        memory: what the model before proved of the same sources; arrivals are never earlier.
        owners: for each scan [n] the tracked mover that a return belongs to, which is then no
            source; -1: none. None: all are sources.
    """
    window, robot, settings = ground.window, ground.robot, ground.settings
    views = views_of(
        ground.labels, ground.empty_discs, settings, window.anchor, ground.static_map, owners
    )
    seen, marks = rasterised(views, window, settings)
    ticks, marks, broken = arrival(
        views, seen, marks, window, ground.base_ticks, robot, settings, memory
    )
    return Proven(ticks, seen, marks, views, broken)
