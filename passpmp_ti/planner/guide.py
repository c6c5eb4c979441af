"""What it still costs to reach the goal, from anywhere: the guide of the objective."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.grid.tubes import asked_speed
from passpmp_ti.kernels.eikonal import block, heap, lay_out, meet, point_ahead
from passpmp_ti.kernels.guide import guide_costs
from passpmp_ti.planner.eikonal import distances_to_zeros, solve
from passpmp_ti.planner.stall import Hill
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

MOST_CELLS = 35_000
"""Cells of the guide's grid: it is solved every cycle."""
CELL_SHARE = 0.125
"""Of the robot's disc, the side of a cell at least: finer ones tell it nothing."""
SLOWEST_SHARE = 1 / 12
"""Of the cruise speed, where something may step out at any moment."""
WALL_SHARE = 1 / 300
"""Of the cruise speed, inside walls: finite, so that every place has a way down."""
AROUND = 40
"""Cells about the robot in which the way ahead is worked out."""
AHEAD = 10
"""Cells down the field at which the way ahead is read."""


@dataclass(frozen=True, slots=True)
class GuideField:
    """Cost to go over the plane, as the tree's kernels read it."""

    time: device.Array
    """[J, I] float32: seconds to the goal from each cell's centre."""
    ahead: device.Array
    """[j, i, 2] float32: unit vectors along the way down, about the robot."""
    frame: device.Array
    """[11] float32, see kernels/guide.py."""
    anchor: tuple[float, float]

    def at(self, states: np.ndarray) -> np.ndarray:
        """[n] cost to go from states [n, 5]: seconds, or metres for the straight guide."""
        if not len(states):
            return np.zeros(0)
        places = np.empty((len(states), 4), dtype=np.float32)
        places[:, :2] = states[:, :2] - np.array(self.anchor)
        places[:, 2] = np.cos(states[:, 2])
        places[:, 3] = np.sin(states[:, 2])
        cost = device.empty((len(states),), np.float32)
        guide_costs(self.time, self.ahead, self.frame, device.put(places), cost)
        return device.host(cost).astype(np.float64)


class Guide:
    """Remembers the walls met on the way, and works out the cost to go each cycle."""

    def __init__(
        self,
        robot: Robot,
        settings: Settings,
        start: tuple[float, float],
        goals: list[tuple[float, float]],
        anchor: tuple[float, float],
        sensor_reach: float,
        static_map: StaticMap | None,
    ) -> None:
        self._robot = robot
        self._settings = settings
        self.anchor = anchor
        """World position of the device's origin [m]."""
        self._cruise = settings.cruise_speed or robot.top_speed
        places = np.array([start, *goals]) - np.array(anchor)
        pad = 0.4 * sensor_reach
        self._low = places.min(axis=0) - pad
        extent = places.max(axis=0) + pad - self._low
        self._cell = max(
            settings.cell,
            CELL_SHARE * robot.disc_radius,
            math.sqrt(float(extent.prod()) / MOST_CELLS),
        )
        columns, rows = (int(n) for n in np.ceil(extent / self._cell) + 1)
        self._shape = (rows, columns)
        self._walls = device.full(self._shape, 1, np.uint8)
        self._blocked = device.full(self._shape, 0, np.uint8)
        # the model keeps up to a cell more from a wall than the clearance
        rounding = settings.cell + 0.5 * self._cell
        self._kept = (settings.clearance(robot) + settings.guide_margin * rounding) / self._cell
        self._slowness = device.empty((rows, columns), np.float32)
        self._down = device.empty((rows, columns), np.int32)
        self._numbers = device.put(self._lay_out_numbers())
        if static_map is not None:
            cells = np.stack(self._cells(_map_points(static_map)), axis=1)
            walls = np.ones(self._shape, dtype=np.uint8)
            walls[cells[:, 0], cells[:, 1]] = 0
            self._walls = device.put(walls)
            met = np.argwhere(walls == 0).astype(np.int32)
            block(device.put(met), self._kept, self._blocked)

    def field(
        self,
        model: FutureModel,
        goal: tuple[float, float],
        position: np.ndarray,
        hill: Hill | None = None,
    ) -> GuideField:
        """The cost to go to `goal`, given what this cycle's model shows from `position` [2], and
        what is added about a place where the robot stalled."""
        frame = np.zeros(11, dtype=np.float32)
        local_goal = np.array(goal) - np.array(self.anchor)
        frame[:2] = self._low
        frame[2] = 1 / self._cell
        frame[3:5] = local_goal
        # a cost of zero in the middle of the tolerance, so that plans stop well inside it
        frame[6] = 0.4 * self._settings.goal_tolerance
        frame[10] = 1 / self._cruise
        frame[7] = self._settings.weight_turn * self._robot.turn_time
        if self._settings.guide == "euclidean":
            frame[5] = 1
            nothing = np.zeros((2, 2, 2), dtype=np.float32)
            return GuideField(
                device.put(nothing[0]), device.put(nothing), device.put(frame), self.anchor
            )
        rows, columns = self._shape
        j = int(np.clip((local_goal[1] - self._low[1]) / self._cell, 0, rows - 1))
        i = int(np.clip((local_goal[0] - self._low[0]) / self._cell, 0, columns - 1))
        time = device.empty(self._shape, np.float32)
        corners = self._meet(model)
        lay_out(
            self._numbers, self._blocked, distances_to_zeros(corners), j, i, self._slowness, time
        )
        solve(self._slowness, (j, i), time)
        if hill is not None:
            top = (np.array(hill.place) - np.array(self.anchor) - self._low) / self._cell
            numbers = np.array([*top, hill.reach / self._cell, hill.height], dtype=np.float32)
            heap(device.put(numbers), time)
        here = (np.asarray(position) - np.array(self.anchor) - self._low) / self._cell
        low = np.clip(np.floor(here - AROUND), 0, None).astype(int)
        high = np.minimum(np.ceil(here + AROUND), (columns, rows)).astype(int)
        frame[8:10] = low
        if (high > low).all():
            ahead = device.empty((int(high[1] - low[1]), int(high[0] - low[0]), 2), np.float32)
            point_ahead(time, AHEAD, int(low[1]), int(low[0]), self._down, ahead)
        else:
            ahead = device.put(np.zeros((1, 1, 2), dtype=np.float32))
        return GuideField(time, ahead, device.put(frame), self.anchor)

    def _meet(self, model: FutureModel) -> device.Array:
        """Remember the walls that a model shows; [J, I] uint8, 0 where something may step out."""
        corners = device.full(self._shape, 1, np.uint8)
        # where movers are now: nose to somebody who stands, a robot cannot even turn
        meet(
            model.marks, *self._lines(model), int(self._settings.guide_movers), self._kept,
            self._walls, self._blocked, corners,
        )  # fmt: skip
        return corners

    def _lines(self, model: FutureModel) -> tuple[device.Array, device.Array]:
        """([J] rows, [I] columns) int32 of this grid that the centres of a model's rows and columns
        lie in; -1: in none."""
        lines = []
        for axis in (1, 0):
            centres = model.origin[axis] + (np.arange(model.window.size) + 0.5) * model.cell
            line = np.floor((centres - (self.anchor[axis] + self._low[axis])) / self._cell)
            inside = (line >= 0) & (line < self._shape[1 - axis])
            lines.append(device.put(np.where(inside, line, -1).astype(np.int32)))
        return lines[0], lines[1]

    def _lay_out_numbers(self) -> np.ndarray:
        """[5] float32 that `lay_out` reads.

        What can step out from behind a standing thing at distance d leaves (d - lost) / v_b seconds
        to brake, less the cycle and the first primitive: v = a (...).
        """
        settings, robot, cell = self._settings, self._robot, self._cell
        lost = settings.clearance(robot) + settings.cell
        cruise = self._cruise / cell
        gain, loss = 0.0, -cruise
        # hidden movers that are faster are what a plan's risk pays for
        faced = settings.object_speed * asked_speed(settings)
        if faced > 0:
            gain = robot.deceleration / faced
            loss = gain * lost / cell + robot.deceleration * 2 * settings.cycle / cell
        return np.array(
            [WALL_SHARE * cruise, SLOWEST_SHARE * cruise, cruise, gain, loss], dtype=np.float32
        )

    def _cells(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(rows, columns) of the cells that hold world points [n, 2]; without those outside."""
        offset = np.array(self.anchor) + self._low
        cells = np.floor((points - offset) / self._cell).astype(int)
        rows, columns = self._shape
        inside = (cells >= 0).all(axis=1) & (cells[:, 0] < columns) & (cells[:, 1] < rows)
        i, j = cells[inside].T
        return j, i


def mean_cost(times: np.ndarray, costs: np.ndarray, horizon: float) -> float:
    """Cost to go averaged over `horizon` [s]; each value stands for the time before it, as in the
    tree, and the last one for what comes after as well.

    Args:
        times: [n] from the start of the plan [s].
        costs: [n] cost to go then.
    """
    spent = float(np.sum(np.diff(times) * costs[1:]))
    taken = float(times[-1] - times[0])
    span = max(horizon, taken)
    rest = span - taken
    return (
        (spent + rest * float(costs[-1])) / span if not math.isclose(span, 0) else float(costs[-1])
    )


def _map_points(static_map: StaticMap) -> np.ndarray:
    """[n, 2] world centres of the map's occupied cells [m]."""
    j, i = np.nonzero(static_map.occupied)
    x, y, yaw = static_map.origin
    u, v = (i + 0.5) * static_map.resolution, (j + 0.5) * static_map.resolution
    return np.stack(
        [x + u * math.cos(yaw) - v * math.sin(yaw), y + u * math.sin(yaw) + v * math.cos(yaw)],
        axis=1,
    )
