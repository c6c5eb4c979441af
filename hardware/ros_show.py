"""What a planner's node shows: hidden and unsafe regions, plan, markers, diagnostics. As trees."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hardware.ros_messages import Pose, Tree, header, occupancy_grid, pose_tree
from hardware.status import State, Status
from passpmp_ti import device
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.robots import Robot
from passpmp_ti.trajectory import Trajectory
from passpmp_ti.viz.region import braking_ics

OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostic_msgs/DiagnosticStatus."""
CUBES, LINE, CYLINDER, POINTS = 6, 4, 3, 8
"""Types of visualization_msgs/Marker."""
HIDDEN, UNSAFE, PLAN, REST, GOAL, BROKEN = (
    (0.35, 0.35, 0.4, 0.6), (0.8, 0.3, 0.2, 0.6), (0.1, 0.7, 0.2, 1.0),
    (0.1, 0.7, 0.2, 0.4), (0.9, 0.7, 0.0, 1.0), (1.0, 0.0, 0.0, 1.0),
)  # fmt: skip
"""Colours (red, green, blue, opacity)."""
MOST_STATES = 40
"""Of a plan that is shown."""


@dataclass(frozen=True, slots=True, eq=False)
class Area:
    """Cells that are, or are not, something."""

    cells: np.ndarray
    """[J, I] bool, rows upwards."""
    origin: tuple[float, float]
    """Outer corner of cell [0, 0] [m]."""
    cell: float
    """Side of a cell [m]."""

    def grid(self, stamp: float, frame: str) -> Tree:
        """As nav_msgs/OccupancyGrid; `stamp` is wall clock [s]."""
        return occupancy_grid(self.cells, self.origin, self.cell, stamp, frame)

    def rim(self) -> np.ndarray:
        """[n, 2] middles of the cells that border on others [m]."""
        ringed = np.pad(self.cells, 1, constant_values=True)
        inside = ringed[:-2, 1:-1] & ringed[2:, 1:-1] & ringed[1:-1, :-2] & ringed[1:-1, 2:]
        j, i = np.nonzero(self.cells & ~inside)
        return np.array(self.origin) + (np.stack([i, j], axis=1) + 0.5) * self.cell


def hidden_area(model: FutureModel, least_cell: float) -> Area:
    """Where somebody may be at the model's stamp, unseen; coarse cells are hidden if any part is.

    Args:
        model: of this cycle.
        least_cell: side of a cell, at least [m].
    """
    ticks = device.host(model.ticks)
    hidden = ~(model.seen | (ticks > model.ticks_of(model.stamp)))
    each = max(1, math.ceil(least_cell / model.cell - 1e-9))
    pad = -hidden.shape[0] % each
    padded = np.pad(hidden, ((0, pad), (0, pad)), constant_values=True)
    blocks = padded.reshape(padded.shape[0] // each, each, padded.shape[1] // each, each)
    return Area(np.asarray(blocks.any(axis=(1, 3))), model.origin, each * model.cell)


def unsafe_area(
    model: FutureModel, root: np.ndarray, time: float, reach: float, cell: float
) -> Area:
    """The ICS^b region (eq. 7) of the heading and speed of a state, about it.

    Args:
        model: of this cycle.
        root: [5] the state.
        time: of all states [s].
        reach: half the side of the region [m].
        cell: side of a cell, about [m].
    """
    x, y, heading = (float(v) for v in root[:3])
    bounds = (x - reach, y - reach, x + reach, y + reach)
    speed = float(model.robot.speed(root))
    region = braking_ics(model, bounds, heading, speed, time, math.ceil((2 * reach / cell) ** 2))
    return Area(~region.safe, region.origin, region.cell)


def root_of(chosen: Trajectory, robot: Robot) -> np.ndarray:
    """[5] the state whose region tells something: the plan's first, at the plan's top speed where
    that is at rest, since who rests is safe everywhere."""
    root = np.array(chosen.states[0])
    speeds = np.abs(robot.speed(chosen.states))
    if robot.at_rest(root):
        fastest = float(speeds.max())
        root[3:] = fastest
    return root


def thinned(trajectory: Trajectory) -> Trajectory:
    """At most `MOST_STATES` of its states, the last among them."""
    if len(trajectory.times) <= MOST_STATES:
        return trajectory
    kept = np.linspace(0, len(trajectory.times) - 1, MOST_STATES).round().astype(int)
    return Trajectory(trajectory.times[kept], trajectory.states[kept], MOST_STATES - 1)


def markers(
    record: CycleRecord,
    robot: Robot,
    hidden: Area,
    unsafe: Area | None,
    stamp: float,
    frame: str,
) -> Tree:
    """visualization_msgs/MarkerArray: rims of both regions, plan, where it rests, goal, places
    where a return stood in space proven free."""
    chosen = record.chosen
    told = [
        _points("hidden", CUBES, hidden.rim(), hidden.cell, HIDDEN),
        _points(
            "icsb", CUBES, np.zeros((0, 2)) if unsafe is None else unsafe.rim(),
            hidden.cell if unsafe is None else unsafe.cell, UNSAFE,
        ),
        _points("broken", POINTS, record.broken_premises, 0.1, BROKEN),
        _disc("goal", (*record.goal, 0.0), 0.3, GOAL),
    ]  # fmt: skip
    if chosen is not None:
        told.append(_points("plan", LINE, thinned(chosen).states[:, :2], 0.05, PLAN))
        x, y, theta = (float(v) for v in chosen.states[-1][:3])
        told.append(_disc("rest", (x, y, theta), 2 * robot.radius, REST))
    for marker in told:
        marker["header"] = header(stamp, frame)
    return {"markers": told}


def diagnostics(
    name: str, level: int, message: str, values: Mapping[str, object], stamp: float
) -> Tree:
    """diagnostic_msgs/DiagnosticArray of one status."""
    told = [{"key": key, "value": _text(value)} for key, value in values.items()]
    return {
        "header": header(stamp, ""),
        "status": [
            {"level": level, "name": name, "message": message, "hardware_id": "", "values": told}
        ],
    }


def health(status: Status | None, waiting_for: str) -> tuple[int, str]:
    """(level, message) of a planner's node: what keeps the robot from driving, if anything."""
    if status is None:
        return ERROR, "the executor is silent"
    if status.state is State.EMERGENCY:
        return ERROR, "emergency stop"
    if status.state in (State.BRAKING, State.STOPPED):
        return ERROR, f"{status.state.name.lower()}: {status.reason.name.lower()}"
    if waiting_for:
        return WARN, waiting_for
    return OK, status.state.name.lower()


def _points(
    space: str, kind: int, places: np.ndarray, size: float, colour: tuple[float, ...]
) -> Tree:
    marker = _marker(space, kind, (0.0, 0.0, 0.0), (size, size, size), colour)
    marker["points"] = [{"x": float(x), "y": float(y), "z": 0.0} for x, y in places]
    if not len(places):
        marker["action"] = 2  # nothing to show: what was shown goes
    return marker


def _disc(space: str, pose: Pose, size: float, colour: tuple[float, ...]) -> Tree:
    return _marker(space, CYLINDER, pose, (size, size, 0.05), colour)


def _marker(
    space: str, kind: int, pose: Pose, scale: tuple[float, ...], colour: tuple[float, ...]
) -> Tree:
    return {
        "ns": space, "id": 0, "type": kind, "action": 0, "pose": pose_tree(pose),
        "scale": dict(zip("xyz", scale, strict=True)),
        "color": dict(zip("rgba", colour, strict=True)),
        "points": [],
    }  # fmt: skip


def _text(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
