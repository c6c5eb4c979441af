"""How long a whole planning cycle takes, scan to trajectory."""

from __future__ import annotations

import os
import platform
import sys
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from passpmp_ti import backend, door
from passpmp_ti.sim.episode import simulate
from passpmp_ti.sim.scenario import Scenario

if TYPE_CHECKING:
    from passpmp_ti.sim.episode import CycleInfo

PAPER = 0.029
"""Average running time of PASSPMP-PSO in Table VII, on a Core i7 of 1.6 GHz [s]."""
WARM_UP = 5
"""Cycles left out as the first episode begins: they load or compile the kernels."""


class _EnoughError(Exception):
    """Ends an episode from within."""


class _Stopwatch:
    def __init__(self, skip: int, wanted: int) -> None:
        self.skip, self.wanted = skip, wanted
        self.timings: list[dict[str, float]] = []
        self.nodes: list[int] = []

    def see(self, info: CycleInfo) -> None:
        if self.skip > 0:
            self.skip -= 1
            return
        record = info.navigator.record
        self.timings.append(record.timings)
        self.nodes.append(record.tree_nodes)
        if len(self.timings) >= self.wanted:
            raise _EnoughError


def measure_cycle(scenario: Scenario, cycles: int = 1000, seed: int = 0) -> dict[str, Any]:
    """Drive through a scenario and take the time of every cycle.

    Args:
        scenario: what is driven; episodes follow each other, seed after seed.
        cycles: how many are measured.
        seed: of the first episode.

    Returns:
        Seconds, parts of the cycle, machine and versions, ready for JSON.

    Raises:
        ValueError: no cycle asked for.
    """
    cycles = door.whole("measure_cycle", "cycles", cycles, least=1)
    first = door.whole("measure_cycle", "seed", seed, least=0)
    arch = backend.init()
    watch = _Stopwatch(WARM_UP, cycles)
    last = first
    while len(watch.timings) < cycles:
        try:
            simulate(scenario, seed=last, on_cycle=watch.see)
        except _EnoughError:
            break
        last += 1
    parts = dict.fromkeys(name for timing in watch.timings for name in timing)
    seconds = {
        name: _spread(np.array([timing.get(name, 0.0) for timing in watch.timings]))
        for name in ("total", *(p for p in parts if p != "total"))
    }
    return {
        "scenario": scenario.name,
        "cycles": len(watch.timings),
        "seeds": [first, last],
        "object_speed": scenario.settings.object_speed,
        "particles": scenario.settings.particles,
        "tree_nodes_median": float(np.median(watch.nodes)),
        "tree_nodes_most": int(max(watch.nodes)),
        "seconds": seconds,
        "paper_seconds": PAPER,
        "share_of_paper": seconds["total"]["median"] / PAPER,
        "backend": arch,
        **machine(),
    }


def machine() -> dict[str, Any]:
    """The machine, in words and numbers, and the versions of what ran on it."""
    return {
        "machine": processor(),
        "cores": len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
        "python": sys.version.split()[0],
        **{name: metadata.version(name) for name in ("taichi", "numpy")},
    }


def processor() -> str:
    """The processor's name, as well as the system tells it."""
    listing = Path("/proc/cpuinfo")
    if listing.is_file():
        for line in listing.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _spread(seconds: np.ndarray) -> dict[str, float]:
    return {
        "median": float(np.median(seconds)),
        "p99": float(np.quantile(seconds, 0.99)),
        "worst": float(seconds.max()),
    }
