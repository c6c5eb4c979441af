"""What a drive through the whole chain came to, in numbers."""

from __future__ import annotations

import math
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
from hardware.status import Reason, State
from hardware.twin_cycles import Cycle
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
    twin_latest: float
    """All of them were [s]."""
    revived: int
    """Planners that had died and were started again."""
    executor_states: dict[str, float]
    """Share of time that the executor spent in each state."""
    stops: dict[str, int]
    """How often it left what it held and braked, by the reason."""
    lidars: tuple[Counters, ...]

    def summary(self) -> dict[str, Any]:
        """The drive in numbers, SI units."""
        told = self.episode.summary()
        # it is watched to rest after the goal counts as reached: what it drives then is driven, too
        span = float(self.episode.times[-1] - self.episode.start_time)
        told["share_moving"] = self.episode.time_moving / span if span > 0 else 0.0
        told["mean_speed"] = self.episode.distance / span if span > 0 else 0.0
        for name in ("to_trajectory", "to_executor", "to_wheels", "scan_age"):
            values = getattr(self, name)
            for key, share in (("median", 0.5), ("p99", 0.99)):
                told[f"{name}_{key}"] = float(np.quantile(values, share)) if len(values) else None
        return told | {
            "sent": len(self.to_trajectory), "refused": self.refused, "idle": self.idle,
            "worst_error": self.worst_error, "worst_lean": self.worst_lean,
            "twin_late": self.twin_late, "twin_latest": self.twin_latest,
            "revived": self.revived, "executor_states": self.executor_states, "stops": self.stops,
            "rests_at_last": bool(self.episode.scenario.robot.at_rest(self.episode.states[-1])),
            "longest_stand": longest_stand(self.episode),
        }  # fmt: skip


def chained(
    episode: Episode, cycles: Sequence[Cycle], log: Path, truth: np.ndarray, revived: int
) -> Chained:
    """What a drive came to.

    Args:
        episode: of the truth.
        cycles: of all planners.
        log: of the executor.
        truth: [n, 8] rows of the twin.
        revived: planners that were started again.
    """
    ticks, sent = ticks_of(log), [cycle.sent for cycle in cycles if cycle.sent is not None]
    to_executor, to_wheels, refused = latencies(sent, ticks)
    return Chained(
        episode=episode,
        to_trajectory=np.array([one.at - one.arrived for one in sent]),
        to_executor=to_executor,
        to_wheels=to_wheels,
        scan_age=np.array([one.arrived - one.stamp for one in sent]),
        refused=refused,
        idle=sum(cycle.took is None for cycle in cycles),
        worst_error=max((c.worst_error for c in cycles if c.worst_error >= 0), default=math.nan),
        worst_lean=float(truth[:, 6].max()),
        twin_late=float(np.quantile(truth[:, 7], 0.99)),
        twin_latest=float(truth[:, 7].max()),
        revived=revived,
        executor_states=shares(ticks),
        stops=stops(ticks),
        lidars=next((c.lidars for c in reversed(cycles) if c.lidars), ()),
    )


def last_tick(log: Path) -> Tick | None:
    """The newest that an executor has logged."""
    if not log.exists():
        return None
    whole = log.stat().st_size // ROW.size
    if not whole:
        return None
    with log.open("rb") as file:
        file.seek((whole - 1) * ROW.size)
        return Tick(*ROW.unpack(file.read(ROW.size)))


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


def stops(ticks: Sequence[Tick]) -> dict[str, int]:
    """How often an executor began to brake off what it held, by the reason."""
    braking = np.array([tick.state == State.BRAKING for tick in ticks], dtype=bool)
    begun = np.flatnonzero(braking[1:] & ~braking[:-1]) + 1
    return dict(Counter(Reason(int(ticks[int(n)].reason)).name.lower() for n in begun))


def longest_stand(episode: Episode) -> float:
    """The longest time at rest between the first motion and the last [s]."""
    moves = np.flatnonzero(~episode.scenario.robot.at_rest(episode.states))
    if not len(moves):
        return 0.0
    return float(np.diff(episode.times[moves]).max(initial=0.0))
