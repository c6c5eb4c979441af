"""What a drive through the whole chain came to, in numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hardware.chain import Sent
from hardware.executor import Tick
from hardware.executor_process import ROW
from hardware.scip_receiver import Counters
from hardware.status import State
from passpmp_ti.sim.episode import Episode

SOON = 0.05
"""An executor that takes a trajectory has taken it this long after it was sent [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chained:
    """A drive through the chain."""

    episode: Episode
    """As a simulated one: of the truth, judged as there."""
    to_trajectory: np.ndarray
    """From a scan's arrival to the new trajectory, sent [s]."""
    to_executor: np.ndarray
    """From a scan's arrival to the first tick of an executor that has taken it [s]."""
    to_wheels: np.ndarray
    """From a scan's arrival to the first order to the wheels that is the new trajectory's [s]: not
    before its start, a cycle after the scan's stamp."""
    scan_age: np.ndarray
    """A scan's stamp to its arrival [s]."""
    refused: int
    """Trajectories that were sent and not taken."""
    idle: int
    """Cycles in which there was nothing to plan from: no scan, no pose, or a robot that brakes."""
    worst_error: float
    """Greatest distance from the path, as the executor measured it [m]."""
    worst_lean: float
    """[rad]."""
    twin_late: float
    """99 % of the twin's moments were computed within this of their time [s]."""
    executor_states: dict[str, float]
    """Share of time that the executor spent in each state."""
    lidars: tuple[Counters, ...]

    def summary(self) -> dict[str, Any]:
        """The drive in numbers, SI units."""
        told = self.episode.summary()
        for name in ("to_trajectory", "to_executor", "to_wheels", "scan_age"):
            values = getattr(self, name)
            for key, share in (("median", 0.5), ("p99", 0.99)):
                told[f"{name}_{key}"] = float(np.quantile(values, share)) if len(values) else None
        return told | {
            "sent": len(self.to_trajectory), "refused": self.refused, "idle": self.idle,
            "worst_error": self.worst_error, "worst_lean": self.worst_lean,
            "twin_late": self.twin_late, "executor_states": self.executor_states,
        }  # fmt: skip


def ticks_of(log: Path) -> list[Tick]:
    """What an executor did, from its log."""
    data = log.read_bytes()
    return [Tick(*row) for row in ROW.iter_unpack(data[: len(data) // ROW.size * ROW.size])]


def latencies(sent: Sequence[Sent], ticks: Sequence[Tick]) -> tuple[np.ndarray, np.ndarray, int]:
    """From arrival to an executor that has it, and to the wheels.

    Args:
        sent: in order.
        ticks: of the executor.

    Returns:
        Of those taken [m]: arrival to the first tick that knows it, and to the first order that is
        its own [s]; and how many were not taken.
    """
    times = np.array([tick.time for tick in ticks])
    taken = np.array([tick.taken for tick in ticks])
    to_executor, to_wheels = [], []
    for one in sent:
        before, after = np.searchsorted(times, [one.at, one.at + SOON])
        count = taken[before - 1] if before else 0.0
        known = np.flatnonzero(taken[before : after + 1] > count)
        if not len(known):
            continue
        knows = before + int(known[0])
        obeys = max(knows, int(np.searchsorted(times, one.start)))
        if obeys < len(times):
            to_executor.append(times[knows] - one.arrived)
            to_wheels.append(times[obeys] - one.arrived)
    return np.array(to_executor), np.array(to_wheels), len(sent) - len(to_wheels)


def shares(ticks: Sequence[Tick]) -> dict[str, float]:
    """Share of ticks in each state of the executor."""
    counts = Counter(State(int(tick.state)).name.lower() for tick in ticks)
    return {name: count / len(ticks) for name, count in counts.items()}
