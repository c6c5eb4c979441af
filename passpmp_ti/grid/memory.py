"""What the model before proves of now: nothing that it proved is lost while its premises hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.distance import distance_between_cells
from passpmp_ti.grid.view import Views
from passpmp_ti.grid.window import Window
from passpmp_ti.kernels.arrival import cap_memory, contradicted
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

if TYPE_CHECKING:
    from passpmp_ti.grid.model import FutureModel


def check_previous(previous: FutureModel, robot: Robot, settings: Settings, stamp: float) -> None:
    """Refuse a memory that proves too much: newer, of another robot or grid, or of assumptions
    weaker than today's.

    Raises:
        ValueError: what is wrong, and that a start without memory mends it.
    """
    owner = "FutureModel.from_scan.previous"
    if previous.stamp > stamp:
        raise ValueError(
            f"{owner} is of {previous.stamp:.6f} s, after the scan's {stamp:.6f} s; drop the scan"
        )
    if previous.robot != robot:
        raise ValueError(f"{owner} was made for another robot; start without memory")
    if previous.cell != settings.cell:
        raise ValueError(
            f"{owner} has cells of {previous.cell:g} m, settings.cell is {settings.cell:g} m;"
            " start without memory"
        )
    if previous.settings.tracks and not settings.tracks:
        raise ValueError(
            f"{owner} left out the movers that it tracked (mode = {previous.settings.mode!r}), and"
            f" settings.mode is {settings.mode!r} now; start without memory"
        )
    weaker = [
        name
        for name, before, now in _assumptions(previous.settings, settings, robot)
        if before < now - 1e-12
    ]
    if weaker:
        raise ValueError(
            f"{owner} assumed less of the world than settings now do ({', '.join(weaker)}); what"
            " it proved does not hold any more: start without memory"
        )


def _assumptions(before: Settings, now: Settings, robot: Robot) -> list[tuple[str, float, float]]:
    """(name, then, now) of what a model rests on; memory of a smaller value proves too much."""
    return [
        ("object_speed", before.object_speed, now.object_speed),
        ("blind_speed", before.unseen_speed, now.unseen_speed),
        ("object_radius", -before.object_radius, -now.object_radius),
        ("object_width", -before.object_width, -now.object_width),
        ("range_noise", before.range_noise, now.range_noise),
        ("stamp_error", before.stamp_error, now.stamp_error),
        ("map_tolerance", -before.map_tolerance, -now.map_tolerance),
        ("clearance", before.clearance(robot), now.clearance(robot)),
    ]


def remembered_ticks(previous: FutureModel | None) -> device.Array:
    """What a model remembers: [J, I] uint16; one empty cell where there is no model."""
    if previous is None:
        return device.put(np.zeros((1, 1), dtype=np.uint16))
    return device.put(previous.hidden_ticks)


def broken_premises(
    previous: FutureModel,
    views: Views,
    window: Window,
    age: int,
    robot: Robot,
    settings: Settings,
) -> np.ndarray:
    """[n, 2] returns [m] where memory says that nothing can be yet."""
    # who is tracked has no cone in memory: he stands where it knows of nobody
    returns = views.untracked(window.anchor)
    # Memory's margins were against errors that this return may have too, and it speaks of a
    # cell's every point while the return is compared with its centre.
    radius = robot.disc_radius - settings.range_noise - 2 * settings.localisation_error
    radius -= window.cell
    if not len(returns) or radius <= 0:
        return np.zeros((0, 2))
    broken = device.empty((len(returns),), np.int32)
    contradicted(
        device.put((returns - np.array(previous.window.anchor)).astype(np.float32)),
        previous.hidden_ticks, age, *previous.window.corner, window.cell, radius, broken,
    )  # fmt: skip
    return returns[device.host(broken) == 1]


def without_intruders(
    previous: FutureModel, broken: np.ndarray, age: int, clearance: float, settings: Settings
) -> device.Array:
    """Memory capped by cones from the places where a premise broke."""
    window = previous.window
    mask = np.ones(previous.shape, dtype=np.uint8)
    cells = np.floor((broken - np.array(window.origin)) / window.cell).astype(int)
    inside = ((cells >= 0) & (cells < window.size)).all(axis=1)
    mask[cells[inside, 1], cells[inside, 0]] = 0
    remembered = device.empty(previous.shape, np.uint16)
    # whoever stands there reaches behind the surface that was seen
    grown = clearance + settings.object_width
    cap_memory(
        device.put(distance_between_cells(mask)), device.put(previous.hidden_ticks), window.cell,
        grown, settings.object_speed, settings.stamp_error, age, remembered,
    )  # fmt: skip
    return remembered
