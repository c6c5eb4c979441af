"""A scene as a drawing, in the language of Figs. 8, 10, 12: one panel of a figure."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from passpmp_ti.compare.svg import Drawing
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.reproduce.runs import Glimpse, Run
from passpmp_ti.robots import Robot
from passpmp_ti.sim.world import Bounds, World
from passpmp_ti.viz.region import Region, braking_ics

SIDE = 300.0
"""Width of a panel [px]."""
HEAD = 22.0
"""Room for its title [px]."""
ROUND = 16
"""Corners of what is drawn as a disc."""
LEAST = 3.0
"""Least radius of a disc [px]."""
STATES = 6_000
"""Of a region."""
CRAWLS = 0.1
"""Slower than this, a robot has no braking ICS worth drawing [m/s]."""
TAIL, TAIL_POINTS = 1.2, 5
"""Length of the trail behind what moves [s], and points of it."""


class Scene:
    """A part of the plane, drawn from the ground up."""

    def __init__(self, bounds: Bounds, title: str, width: float = SIDE) -> None:
        """Nothing yet; `bounds` [m]."""
        self._low, self._high = np.array(bounds[:2]), np.array(bounds[2:])
        across, up = self._high - self._low
        self.scale = width / float(across)
        self._title = title
        self._drawing = Drawing((width, HEAD + round(float(up) * self.scale)), title)

    def region(self, region: Region) -> None:
        """The braking-ICS states of one heading and speed."""
        for low, high in _rectangles(~region.safe):
            a, b = (np.array(region.origin) + region.cell * np.array(p) for p in (low, high))
            self._area([(a[0], a[1]), (b[0], a[1]), (b[0], b[1]), (a[0], b[1])], "ics")

    def world(self, world: World) -> None:
        """What stays."""
        for polygon in world.polygons:
            self._area(polygon, "stays")
        for x1, y1, x2, y2 in world.segments:
            self.line([(x1, y1), (x2, y2)], "wall")

    def movers(self, world: World, time: float) -> None:
        """What moves, where it is and where it came from."""
        movers = world.movers
        present = movers.present(time)
        if not np.any(present):
            return
        ages = np.linspace(TAIL, 0, TAIL_POINTS)
        tails = np.stack([movers.at(time - age) for age in ages], axis=1)[present]
        for tail in tails:
            self.line(tail, "trail")
        for place, radius in zip(movers.at(time)[present], movers.radius[present], strict=True):
            self.disc(place, float(radius), "mover")

    def line(self, points: Iterable, kind: str) -> None:
        """A way through the world [m]."""
        self._drawing.line([self._at(p) for p in points], kind)

    def lines(self, ways: Iterable, kind: str) -> None:
        """Several ways."""
        for way in ways:
            self.line(way, kind)

    def disc(self, place: np.ndarray, radius: float, kind: str) -> None:
        """[m]; never smaller than can be seen."""
        radius = max(radius, LEAST / self.scale)
        turn = 2 * math.pi * np.arange(ROUND) / ROUND
        rim = np.asarray(place) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        self._area(rim, kind)

    def robot(self, robot: Robot, state: np.ndarray) -> None:
        """Its discs, with a line to its front where there is room for one."""
        ahead = np.array([math.cos(state[2]), math.sin(state[2])])
        for offset, radius in robot.discs:
            self.disc(state[:2] + offset * ahead, radius, "robot")
        if robot.radius * self.scale > 2 * LEAST:
            self.line([state[:2], state[:2] + robot.radius * ahead], "front")

    def goal(self, place: tuple[float, float]) -> None:
        """A cross."""
        x, y = place
        arm = 5 / self.scale
        self.line([(x - arm, y - arm), (x + arm, y + arm)], "particle")
        self.line([(x - arm, y + arm), (x + arm, y - arm)], "particle")

    def drawing(self) -> Drawing:
        """With its title and its frame."""
        wide, high = self._drawing.size
        self._drawing.area([(0, 0), (wide, 0), (wide, HEAD), (0, HEAD)], "floor")
        edge = [(0, HEAD), (wide, HEAD), (wide, high), (0, high), (0, HEAD)]
        self._drawing.line(edge, "frame")
        self._drawing.words((2, 15), self._title, "tick")
        return self._drawing

    def _area(self, points: Iterable, kind: str) -> None:
        self._drawing.area([self._at(p) for p in points], kind)

    def _at(self, point: Iterable[float]) -> tuple[float, float]:
        x, y = point
        low, high = self._low, self._high
        return (
            float((x - low[0]) * self.scale),
            HEAD + float((high[1] - y) * self.scale),
        )


def thinned(way: np.ndarray, step: int = 5) -> np.ndarray:
    """One point in `step` of a way [n, 2], and its last."""
    return np.concatenate([way[:-1:step], way[-1:]])


def snapshot(
    run: Run, glimpse: Glimpse, title: str, bounds: Bounds, width: float = SIDE, ics: bool = False
) -> Drawing:
    """A moment of a drive: where the robot was, is, and means to go.

    Args:
        run: the drive.
        glimpse: of its cycle.
        title: above the picture.
        bounds: of the picture [m].
        width: of the picture [px].
        ics: draw the braking ICS of the heading and speed in which the plan begins, by the model
            of that scan alone; a robot at rest has none.
    """
    scene = Scene(bounds, title, width)
    robot, settings = run.scenario.robot, run.scenario.settings
    speed = float(robot.speed(glimpse.root))
    if ics and abs(speed) > CRAWLS:
        x, y, theta = (float(v) for v in glimpse.state[:3])
        model = FutureModel.from_scan(glimpse.scans, robot, settings, position=(x, y, theta))
        start = glimpse.time + settings.cycle
        scene.region(braking_ics(model, bounds, float(glimpse.root[2]), speed, start, STATES))
    scene.world(run.world)
    scene.movers(run.world, glimpse.time)
    scene.line(thinned(run.trail_until(glimpse.time)), "driven")
    scene.robot(robot, glimpse.state)
    scene.line(thinned(glimpse.plan), "choice")
    for goal in run.scenario.goals:
        scene.goal(goal)
    return scene.drawing()


def _rectangles(mask: np.ndarray) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Rectangles (i, j) to (i, j) that cover a mask [J, I]: runs of a row, over equal rows."""
    found = []
    open_: dict[tuple[int, int], int] = {}
    for j in range(len(mask) + 1):
        row = mask[j] if j < len(mask) else np.zeros(mask.shape[1], dtype=bool)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
        runs = {(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)}
        for run in [run for run in open_ if run not in runs]:
            found.append(((run[0], open_.pop(run)), (run[1], j)))
        for run in runs:
            open_.setdefault(run, j)
    return sorted(found)
