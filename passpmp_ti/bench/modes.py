"""What a cycle costs in each safety mode, in the same scenarios and the same run.

Each mode drives for itself and what its planner sees is kept. Then planners that begin anew are
shown it again, cycle by cycle in turn: whatever else the machine does meets all modes alike.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from passpmp_ti import backend
from passpmp_ti.bench.episodes import EnoughError
from passpmp_ti.bench.found import Found, Options
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.scan import Scan
from passpmp_ti.settings import MODES
from passpmp_ti.sim.episode import simulate
from passpmp_ti.sim.scenario import Scenario, load_scenario

if TYPE_CHECKING:
    from passpmp_ti.sim.episode import CycleInfo

SCENARIOS = ("corridor_person", "eth", "crowded")
CYCLES, QUICK_CYCLES = 150, 20
WARM_UP = 5
"""Cycles left out as a drive begins: they load or compile the kernels."""


@dataclass(frozen=True, slots=True)
class Seen:
    """What a planner was shown in one cycle."""

    scans: Sequence[Scan]
    state: np.ndarray
    """[5]"""


def measure(options: Options) -> Found:
    """Drive the scenarios, or the one asked for, in every mode, and compare what a cycle takes."""
    cycles = options.cycles or (QUICK_CYCLES if options.quick else CYCLES)
    backend.init()
    title = "a cycle in each safety mode, scan to trajectory, in ms"
    found = Found(title=title, rows=[], ratios={})
    for scenario in [options.scenario] if options.scenario else _shipped(found.notes):
        options.see(f"modes: {scenario.name}")
        seconds = measure_modes(scenario, cycles, options.seed)
        median = {mode: float(np.median(each)) for mode, each in seconds.items()}
        found.rows.append(
            {
                "scenario": scenario.name,
                "cycles": len(seconds[MODES[0]]),
                **{f"{mode} [ms]": 1e3 * median[mode] for mode in MODES},
            }
        )
        for mode in MODES[1:]:
            share = median[MODES[0]] / median[mode]
            found.ratios[f"{scenario.name}: {MODES[0]} / {mode}"] = share
            found.notes.append(f"{scenario.name}: {mode} takes {1 / share:.2f} times {MODES[0]}")
    return found


def measure_modes(scenario: Scenario, cycles: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Seconds [cycles] of the same number of cycles of one drive in each mode."""
    drives = {mode: drive(scenario, mode, WARM_UP + cycles, seed) for mode in MODES}
    planners = {mode: _planner(scenario, mode, seed) for mode in MODES}
    seconds: dict[str, list[float]] = {mode: [] for mode in MODES}
    for k in range(min(len(each) for each in drives.values())):
        for mode, planner in planners.items():
            seen = drives[mode][k]
            began = time.perf_counter()
            planner.update(seen.scans, seen.state)
            seconds[mode].append(time.perf_counter() - began)
    return {mode: np.array(each[WARM_UP:]) for mode, each in seconds.items()}


def drive(scenario: Scenario, mode: str, cycles: int, seed: int) -> list[Seen]:
    """What a planner is shown in the first cycles of an episode."""
    shown: list[Seen] = []

    def see(info: CycleInfo) -> None:
        shown.append(Seen(info.scans, np.array(info.state)))
        if len(shown) == cycles:
            raise EnoughError

    with contextlib.suppress(EnoughError):
        simulate(scenario, mode=mode, seed=seed, on_cycle=see)
    return shown


def _planner(scenario: Scenario, mode: str, seed: int) -> Navigator:
    """Made as `simulate` makes it, so that it decides alike."""
    return Navigator(
        scenario.robot, scenario.settings.changed(mode=mode), goal=scenario.goals,
        static_map=scenario.static_map, seed=seed,
    )  # fmt: skip


def _shipped(notes: list[str]) -> list[Scenario]:
    scenarios = []
    for name in SCENARIOS:
        try:
            scenarios.append(load_scenario(name))
        except ValueError as missing:  # the recording is not on every machine
            notes.append(f"{name}: not driven, {missing}")
    return scenarios
