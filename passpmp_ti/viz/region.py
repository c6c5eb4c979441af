"""The braking-ICS region of one heading and speed, on a lattice of states."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from passpmp_ti import door
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.robots import CAR, Robot
from passpmp_ti.viz.plot import Bounds


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """Which of the states (x, y, heading, speed) are p-safe, x and y on a lattice."""

    safe: np.ndarray
    """[J, I] bool, rows upwards."""
    seen: np.ndarray
    """[J, I] bool: the model has seen the place."""
    origin: tuple[float, float]
    """World position of the outer corner of cell [0, 0] [m]."""
    cell: float
    """Side of a cell [m]; states stand at the middles of the cells."""
    heading: float
    """[rad]."""
    speed: float
    """[m/s]."""

    def places(self) -> np.ndarray:
        """[J, I, 2] world positions of the states [m]."""
        return lattice(self.origin, self.cell, (self.safe.shape[0], self.safe.shape[1]))

    def share(self, among: np.ndarray | None = None) -> float:
        """Share of p-safe states among all, or among those of a mask [J, I]; 0 where none is."""
        chosen = self.safe if among is None else self.safe[among]
        return float(chosen.mean()) if chosen.size else 0.0


def braking_ics(
    model: FutureModel, bounds: Bounds, heading: float, speed: float, time: float, count: int
) -> Region:
    """Check the states of one heading and speed all over a view, in one launch.

    Args:
        model: of the future.
        bounds: of the view [m].
        heading: [rad].
        speed: [m/s], within the robot's limits.
        time: absolute [s], not before the model's stamp.
        count: about how many states.

    Raises:
        ValueError: a heading or speed that is not finite or beyond the robot's limits, a time
            before the scan.
    """
    heading = door.finite("braking_ics", "heading", heading, unit="rad")
    speed = door.finite("braking_ics", "speed", speed, unit="m/s")
    across, up = bounds[2] - bounds[0], bounds[3] - bounds[1]
    cell = math.sqrt(across * up / count)
    shape = (max(1, math.ceil(up / cell)), max(1, math.ceil(across / cell)))
    origin = (bounds[0], bounds[1])
    points = lattice(origin, cell, shape).reshape(-1, 2)
    states = states_at(model.robot, points, heading, speed)
    safe = model.passively_safe(states, np.full(len(points), float(time)))
    seen = seen_at(model, points)
    return Region(safe.reshape(shape), seen.reshape(shape), origin, cell, heading, speed)


def states_at(robot: Robot, points: np.ndarray, heading: float, speed: float) -> np.ndarray:
    """[n, 5] states at points [n, 2] that drive straight along `heading` at `speed`."""
    last = 0.0 if robot.kind == CAR else speed
    rest = np.broadcast_to(np.array([heading, speed, last]), (len(points), 3))
    return np.concatenate([points, rest], axis=1)


def seen_at(model: FutureModel, points: np.ndarray) -> np.ndarray:
    """[n] bool: whether the model has seen the places [n, 2]."""
    cells = np.floor((points - np.array(model.origin)) / model.cell).astype(int)
    height, width = model.shape
    inside = ((cells >= 0) & (cells < (width, height))).all(axis=1)
    seen = np.zeros(len(points), dtype=bool)
    seen[inside] = model.seen[cells[inside, 1], cells[inside, 0]]
    return seen


def lattice(origin: tuple[float, float], cell: float, shape: tuple[int, int]) -> np.ndarray:
    """[J, I, 2] middles of the cells of a grid [m]."""
    x = origin[0] + (np.arange(shape[1]) + 0.5) * cell
    y = origin[1] + (np.arange(shape[0]) + 0.5) * cell
    return np.stack(np.meshgrid(x, y), axis=-1)
