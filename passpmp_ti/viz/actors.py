"""What acts in a scene: the robot, what moves, what stays, and what nobody has seen."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from passpmp_ti import device
from passpmp_ti.robots import Robot
from passpmp_ti.viz import palette
from passpmp_ti.viz.plot import Plot

if TYPE_CHECKING:
    from passpmp_ti.grid.model import FutureModel
    from passpmp_ti.sim.world import World

TAIL, TAIL_POINTS = 1.2, 9
"""Length of the trail of a moving object [s], and points of it."""
LEAST_ROBOT, LARGE_ROBOT = 5.0, 14.0
"""The robot is drawn at least this large, and pale from there on [px]."""


def shade_unseen(model: FutureModel, plot: Plot) -> None:
    """Hatch what the scan did not see and memory does not know to be free."""
    known = model.seen | (device.host(model.ticks) > model.ticks_of(model.stamp))
    plot.shade(~plot.sampled(known, model.origin, model.cell))


def draw_world(world: World, time: float, plot: Plot) -> None:
    """The things that stay, and those that move at `time` [s] with where they came from."""
    for polygon in world.polygons:
        plot.fill(polygon, palette.STATIC)
    plot.lines(world.segments.reshape(-1, 2, 2), palette.STATIC, 2)
    movers = world.movers
    present = movers.present(time)
    if not np.any(present):
        return
    tails = np.stack([movers.at(time - TAIL * s) for s in np.linspace(1, 0, TAIL_POINTS)], axis=1)
    plot.lines(tails[present], palette.TRAIL, 3)
    for centre, radius in zip(movers.at(time)[present], movers.radius[present], strict=True):
        plot.disc(centre, float(radius), palette.MOVER)


def draw_robot(robot: Robot, state: np.ndarray, plot: Plot) -> None:
    """The robot as a red disc with a mark towards its front."""
    draw_body(robot, state, plot)
    draw_outline(robot, state, plot)


def _is_large(robot: Robot, plot: Plot) -> bool:
    return robot.radius * plot.scale > LARGE_ROBOT


def _discs(robot: Robot, state: np.ndarray, plot: Plot) -> list[tuple[np.ndarray, float]]:
    ahead = np.array([math.cos(state[2]), math.sin(state[2])])
    least = LEAST_ROBOT / plot.scale
    return [(state[:2] + offset * ahead, max(radius, least)) for offset, radius in robot.discs]


def draw_body(robot: Robot, state: np.ndarray, plot: Plot) -> None:
    """What lies under the tree: the pale body of a robot that would hide it."""
    if _is_large(robot, plot):
        for centre, radius in _discs(robot, state, plot):
            plot.disc(centre, radius, palette.ROBOT_PALE)


def draw_outline(robot: Robot, state: np.ndarray, plot: Plot) -> None:
    """What lies over the tree: the rim and mark of a large robot, all of a small one."""
    pixel = 1.0 / plot.scale
    ahead = np.array([math.cos(state[2]), math.sin(state[2])])
    discs, ink = _discs(robot, state, plot), palette.FLOOR
    size, middle = max(robot.radius, LEAST_ROBOT * pixel), state[:2]
    if _is_large(robot, plot):
        ink, size = palette.ROBOT, LARGE_ROBOT * pixel
        middle = middle + (robot.radius - size) * ahead
        for centre, radius in discs:
            plot.disc(centre, radius, palette.ROBOT, width=2)
    else:
        for centre, radius in discs:
            plot.disc(centre, radius + 1.5 * pixel, palette.FLOOR)
        for centre, radius in discs:
            plot.disc(centre, radius, palette.ROBOT)
    aside = np.array([-ahead[1], ahead[0]])
    mark = np.stack(
        [0.75 * ahead, -0.45 * ahead + 0.45 * aside, -0.2 * ahead, -0.45 * ahead - 0.45 * aside]
    )
    plot.fill(middle + size * mark, ink)
