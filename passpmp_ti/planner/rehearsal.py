"""What a robot with a deadline does before it drives: every kernel of a cycle is compiled, once.

Compiling takes seconds. Without a rehearsal the first cycles would be late, and so would, under
way, the first broken premise.
"""

from __future__ import annotations

import gc
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from passpmp_ti.grid.model import FutureModel
from passpmp_ti.planner.guide import Guide
from passpmp_ti.planner.tree import TreeGrower
from passpmp_ti.robots import Robot
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings

if TYPE_CHECKING:
    from passpmp_ti.planner.navigator import Navigator

BEAMS = 180
NODES = 200
"""Nodes of the tree that is rehearsed with."""
ALMOST_STILL = 1e-3
"""Speed of objects [m/s]: everything is safe, so that there is a tree to choose from."""
WIDE = 4000
"""Nodes of the trees of which one is grown along roads: its levels have to be wide enough."""
ALWAYS = 1e-9
"""Nodes for each gait from which on roads are laid, where they always are."""
ACROSS = 60
"""Cells from the robot to the wall about it."""


def rehearse(make: Callable[..., Navigator], robot: Robot, settings: Settings) -> None:
    """Drive a navigator of its own through a round room, until somebody stands where nobody can be.

    Afterwards what the process holds is taken out of the garbage collector's rounds (`gc.freeze`):
    a full one would take as long as a cycle does.

    Args:
        make: makes navigators.
        robot: who will drive.
        settings: with which.
    """
    quick = settings.changed(
        deadline=None, exploration_time=None, capacity=min(settings.capacity, NODES), window=None,
        object_speed=min(settings.object_speed, ALMOST_STILL), blind_speed=None,
        patience=0.5 * settings.cycle,
    )  # fmt: skip
    room = 2 * robot.radius + 2 * settings.object_radius + ACROSS * settings.cell
    navigator = make(robot, quick, (0.6 * room, 0.0))
    state = np.zeros(5)
    walls = np.full(BEAMS, room)
    walls[::7] = np.inf
    # last, somebody a little farther than the robot's own skin; and then nothing any more
    close, nothing = np.full(BEAMS, 1.5 * robot.radius + 4 * settings.cell), np.full(BEAMS, np.inf)
    for k, ranges in enumerate((walls, walls, close, nothing)):
        stamp = k * settings.cycle
        scan = Scan(
            ranges,
            angle_min=-math.pi,
            angle_increment=2 * math.pi / BEAMS,
            range_max=1.5 * room,
            pose=(float(state[0]), float(state[1]), float(state[2])),
            stamp=stamp,
            moving=np.arange(BEAMS) % 2 == 0,
        )
        held = navigator.update(scan, state)
        if k == 0:
            assert navigator.model is not None
            _grow_both_ways(navigator.model, robot, quick, state)
        state = held.at(stamp + settings.cycle)
    gc.collect()
    gc.freeze()


def _grow_both_ways(
    model: FutureModel, robot: Robot, settings: Settings, state: np.ndarray
) -> None:
    """Grow a tree along roads and one without: which of them a drive needs, and when, nobody
    knows."""
    straight = settings.changed(guide="euclidean", capacity=WIDE)
    window = model.window
    guide = Guide(robot, straight, (0.0, 0.0), [(1.0, 0.0)], window.anchor, 1.0, None)
    field = guide.field(model, (1.0, 0.0), np.zeros(2))
    for worth in (ALWAYS, math.inf):
        grower = TreeGrower(robot, straight, worth=worth)
        grower.grow(model, field, state, model.stamp + settings.cycle, 0)
