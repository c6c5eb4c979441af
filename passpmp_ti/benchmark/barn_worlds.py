"""BARN's static worlds, its protocol, and its score."""

from __future__ import annotations

import csv
import gzip
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from passpmp_ti.sim.data_files import DATA, find_data

START = (-2.25, 3.0, math.pi / 2)
"""(x, y, theta) [m, m, rad] of the editions since 2023."""
GOAL = (-2.25, 13.0)
"""[m]"""
LONGEST = 100.0
"""Timeout of a trial [s]."""
TOP_SPEED = 2.0
"""Speed by which the optimal time is told [m/s]."""
LATTICE = 0.15
"""Side of a cell of the reference paths [m]."""
CORNER = (-4.575, 5.075)
"""(x, y) of the middle of their cell (0, 0) [m]."""
SCORE_CLIP = (2.0, 8.0)
"""Actual times are told within these multiples of the optimal one (2023 rule)."""
PUBLISHED = {
    "dwa": "DWA (organisers)",
    "drl_vo": "DRL-VO (2022, first in simulation)",
    "lics": "LiCS-KI (2024, first)",
}
"""Planners with published results, by their columns in baseline_per_world.csv."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BarnWorld:
    """One world: standing cylinders, and the path that the organisers call the reference."""

    number: int
    cylinders: np.ndarray
    """[n, 2] their middles [m]."""
    radius: float
    """[m]"""
    path: np.ndarray
    """[m, 2] the reference path through the obstacles [m]."""

    @property
    def optimal_time(self) -> float:
        """OT: from the start along the path to the goal at the top speed [s]."""
        way = np.concatenate([[START[:2]], self.path, [GOAL]])
        return float(np.hypot(*np.diff(way, axis=0).T).sum()) / TOP_SPEED


def read_worlds() -> dict[int, BarnWorld]:
    """Every world there is, by its number.

    Raises:
        ValueError: the data is absent (and where it was looked for), or is not what it should be.
    """
    cylinders, paths = _read("barn_cylinders.json.gz"), _read("barn_paths.json.gz")
    return {
        number: BarnWorld(
            number=number,
            cylinders=np.array(cylinders["worlds"][str(number)], dtype=np.float64),
            radius=float(cylinders["radius_m"]),
            path=np.array(CORNER) + LATTICE * np.array(paths[str(number)], dtype=np.float64),
        )
        for number in sorted(map(int, cylinders["worlds"]))
    }


def score(success: bool, took: float | None, optimal_time: float) -> float:
    """Of one trial, at most 0.5: the optimal time over the actual one, clipped (2023 rule).

    Args:
        success: arrived in time, without a contact.
        took: the actual time [s].
        optimal_time: `BarnWorld.optimal_time` [s].
    """
    if not success or took is None:
        return 0.0
    low, high = (times * optimal_time for times in SCORE_CLIP)
    return optimal_time / min(max(took, low), high)


def read_published() -> dict[str, dict[int, dict[str, float]]]:
    """Published results by planner and world: `success` share, `time` [s], `score` (2023 rule).

    Raises:
        ValueError: the data is absent.
    """
    path = _found("baseline_per_world.csv")
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {
        planner: {
            int(row["world"]): {
                "success": float(row[f"{planner}_success"]),
                "time": float(row[f"{planner}_time_s"]),
                "score": float(row[f"{planner}_s28"]),
            }
            for row in rows
        }
        for planner in PUBLISHED
    }


def _read(name: str) -> Mapping[str, Any]:
    path = _found(name)
    try:
        with gzip.open(path, "rt", encoding="utf-8") as file:
            found: Mapping[str, Any] = json.load(file)
    except (OSError, EOFError, ValueError) as cause:
        raise ValueError(f"{path}: not compressed JSON: {cause}") from cause
    return found


def _found(name: str) -> Path:
    return find_data(f"${{{DATA}}}/barn/{name}", Path.cwd() / "barn")
