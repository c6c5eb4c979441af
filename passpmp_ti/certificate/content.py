"""What a certificate holds, as the document that passpmp_verify reads."""

from __future__ import annotations

import math
import platform
from collections.abc import Sequence
from dataclasses import asdict, fields
from importlib import metadata
from typing import Any

import numpy as np

from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.robots import CarLike, DifferentialDrive, Robot
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory
from passpmp_verify.certificate import Assumptions, Moment
from passpmp_verify.document import FORMAT, VERSION, pack
from passpmp_verify.reader import CAR_FIELDS, DIFFERENTIAL_FIELDS
from passpmp_verify.view import Scan

CLAIM = (
    "While the robot keeps to this trajectory, nothing that obeys the assumptions can touch it"
    " before it is at rest."
)


def assumptions_of(settings: Settings) -> Assumptions:
    """What the proof rests on, of all settings."""
    return Assumptions(**{f.name: getattr(settings, f.name) for f in fields(Assumptions)})


def robot_of(robot: Robot) -> dict[str, Any]:
    """What a robot declares of itself.

    Raises:
        ValueError: a kind of robot that the verifier does not know.
    """
    if isinstance(robot, CarLike):
        kind, declared = "car", CAR_FIELDS
    elif isinstance(robot, DifferentialDrive):
        kind, declared = "differential", DIFFERENTIAL_FIELDS
    else:
        raise ValueError(
            f"certificates are for CarLike and DifferentialDrive; got {type(robot).__name__}"
        )
    numbers = {name: float(getattr(robot, name)) for name in declared}
    return {"kind": kind, "discs": [list(map(float, disc)) for disc in robot.discs], **numbers}


def scan_of(scan: Scan) -> dict[str, Any]:
    """A scan, whole."""
    return {
        "ranges": pack(scan.ranges),
        "angle_min": scan.angle_min,
        "angle_increment": scan.angle_increment,
        "range_max": scan.range_max,
        "pose": list(scan.pose),
        "stamp": scan.stamp,
        "moving": None if scan.moving is None else pack(scan.moving),
    }


def map_about(static_map: StaticMap, moments: Sequence[Moment], tolerance: float) -> dict[str, Any]:
    """The part of a map that the scans' beams can end in."""
    x, y, yaw = static_map.origin
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, s], [-s, c]])
    scans = [scan for moment in moments for scan in moment.scans]
    places = np.array([turn @ (scan.pose[0] - x, scan.pose[1] - y) for scan in scans])
    reach = np.array([[scan.range_max + tolerance + 2 * static_map.resolution] for scan in scans])
    low = np.floor((places - reach).min(axis=0) / static_map.resolution)
    high = np.ceil((places + reach).max(axis=0) / static_map.resolution)
    most = np.array(static_map.occupied.shape[::-1])
    # at least one cell, be it far from all beams
    i0, j0 = np.clip(low, 0, most - 1).astype(int)
    i1, j1 = np.maximum(np.clip(high, 0, most), (i0 + 1, j0 + 1)).astype(int)
    corner = turn.T @ (i0, j0) * static_map.resolution
    return {
        "occupied": pack(static_map.occupied[j0:j1, i0:i1]),
        "resolution": static_map.resolution,
        "origin": [x + float(corner[0]), y + float(corner[1]), yaw],
    }


def document_of(
    robot: Robot,
    settings: Settings,
    static_map: StaticMap | None,
    moments: Sequence[Moment],
    trajectory: Trajectory,
    cycle: dict[str, Any],
) -> dict[str, Any]:
    """A certificate's document, not yet signed.

    Args:
        moments: that the proof rests on, newest first; their scans are `Scan`s.
        cycle: what else is to be told of the planner's cycle.
    """
    return {
        "format": FORMAT,
        "version": VERSION,
        "claim": CLAIM,
        "made_with": {
            "passpmp_ti": _version("passpmp_ti"),
            "taichi": _version("taichi"),
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
        "cycle": cycle,
        "assumptions": asdict(assumptions_of(settings)),
        "settings": asdict(settings),
        "robot": robot_of(robot),
        "moments": [
            {
                "position": list(moment.position),
                "clear_radius": moment.clear_radius,
                "on_map": moment.on_map,
                "scans": [scan_of(scan) for scan in moment.scans],
            }
            for moment in moments
        ],
        "static_map": (
            None if static_map is None else map_about(static_map, moments, settings.map_tolerance)
        ),
        "trajectory": {
            "times": pack(trajectory.times),
            "states": pack(trajectory.states),
            "brakes_from": int(trajectory.brakes_from),
        },
    }


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"
