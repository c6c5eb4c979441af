"""Passively safe motion planning: at rest before anything can hit the robot.

The public names live here. They are imported when first used, so that importing the package is
quick.
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from passpmp_ti.backend import init
    from passpmp_ti.grid.model import FutureModel
    from passpmp_ti.grid.static_map import StaticMap
    from passpmp_ti.planner.navigator import Navigator
    from passpmp_ti.planner.record import CycleRecord
    from passpmp_ti.robots import CarLike, DifferentialDrive, cover_rectangle
    from passpmp_ti.scan import Scan
    from passpmp_ti.settings import Settings
    from passpmp_ti.sim.episode import simulate
    from passpmp_ti.sim.scenario import load_scenario
    from passpmp_ti.trajectory import Trajectory

# Taichi greets on standard output when it is first imported; that belongs to the program.
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")

__version__ = "0.1.0"

_HOMES = {
    "CarLike": "robots",
    "CycleRecord": "planner.record",
    "DifferentialDrive": "robots",
    "FutureModel": "grid.model",
    "Navigator": "planner.navigator",
    "Scan": "scan",
    "Settings": "settings",
    "StaticMap": "grid.static_map",
    "Trajectory": "trajectory",
    "cover_rectangle": "robots",
    "init": "backend",
    "load_scenario": "sim.scenario",
    "simulate": "sim.episode",
}

__all__ = [
    "CarLike",
    "CycleRecord",
    "DifferentialDrive",
    "FutureModel",
    "Navigator",
    "Scan",
    "Settings",
    "StaticMap",
    "Trajectory",
    "cover_rectangle",
    "init",
    "load_scenario",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f"passpmp_ti.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'passpmp_ti' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
