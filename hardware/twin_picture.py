"""A moment on the twin from above: walls, people, the chair as it truly stands, what it means to
do, and what its lidars see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.robots import Robot
from passpmp_ti.sim.world import World
from passpmp_ti.viz import palette, text
from passpmp_ti.viz.actors import draw_body, draw_outline, draw_world
from passpmp_ti.viz.plot import Plot

LONGEST = 1200
"""Of the picture's sides [px]."""
HEAD = 58
"""Height of the heading [px]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """What a picture shows."""

    time: float
    """In the world [s]."""
    since: float
    """Since the drive began [s]."""
    state: np.ndarray
    """[5] the chair's, in truth."""
    trail: np.ndarray
    """[n, 2] where it was [m]."""
    plan: np.ndarray
    """[n, 2] what is held [m]."""
    seen: np.ndarray
    """[n, 2] returns [m]."""
    goal: tuple[float, float]
    """[m]."""
    note: str
    """What goes on."""


class Picture:
    """Draws one scenario's moments."""

    def __init__(self, name: str, world: World, robot: Robot) -> None:
        """
        Args:
            name: above the picture.
            world: what stands and who walks.
            robot: who drives.
        """
        low_x, low_y, high_x, high_y = world.bounds
        across, up = high_x - low_x, high_y - low_y
        scale = LONGEST / max(across, up)
        # video codecs ask for even sides
        size = (2 * round(across * scale / 2), 2 * round(up * scale / 2))
        self._plot = Plot(world.bounds, size)
        self._name, self._world, self._robot = name, world, robot

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) [px]."""
        height, width = self._plot.sheet.shape[:2]
        return width, height + HEAD

    def of(self, moment: Moment) -> np.ndarray:
        """[h, w, 3] uint8 (red, green, blue)."""
        plot = self._plot
        plot.clear()
        draw_world(self._world, moment.time, plot)
        plot.line(moment.trail, palette.EXECUTED, 2)
        draw_body(self._robot, moment.state, plot)
        for place in moment.seen:
            plot.dot(place, 1.5, palette.PARTICLE)
        plot.line(moment.plan, palette.CHOICE, 3)
        draw_outline(self._robot, moment.state, plot)
        plot.star(np.asarray(moment.goal), 10, palette.GOAL)
        page = np.full((plot.sheet.shape[0] + HEAD, plot.sheet.shape[1], 3), palette.PAGE, np.uint8)
        page[HEAD:] = plot.sheet
        # a zero has no sign here
        speed = round(float(self._robot.speed(moment.state)), 2) + 0.0
        text.draw(page, self._name, (8, 22), palette.INK, 19, weight=text.HEADING)
        text.draw(
            page, f"{moment.since:.1f} s, {speed:.2f} m/s   {moment.note}", (8, 46), palette.INK, 16
        )
        return page
