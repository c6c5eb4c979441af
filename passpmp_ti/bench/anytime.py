"""Whether cycles meet their deadline when time alone ends the exploration."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from passpmp_ti.bench import episodes
from passpmp_ti.bench.cycle import LONG
from passpmp_ti.bench.episodes import EnoughError
from passpmp_ti.bench.found import Found, Options
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.sim.scenario import Scenario, load_scenario
from passpmp_ti.trajectory import Trajectory

CYCLES, QUICK_CYCLES = 10_000, 200
DEADLINE = 0.05
"""[s]"""
CAPACITY = 200_000
"""Nodes: more than any cycle has the time for."""


@dataclass
class _Watch:
    """What was seen of every cycle; arrays by `taken`."""

    wanted: int
    see: Callable[[str], None]
    seconds: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)
    nodes: list[int] = field(default_factory=list)
    left: list[float] = field(default_factory=list)
    stopped_by: list[str] = field(default_factory=list)

    def navigator(self, *given: Any, **named: Any) -> Navigator:
        """A navigator whose every `update` is timed from outside."""
        watch = self

        class Timed(Navigator):
            def update(self, *scan: Any, **following: Any) -> Trajectory:
                cpu, began = time.process_time(), time.perf_counter()
                answer = super().update(*scan, **following)
                seconds = time.perf_counter() - began
                watch.note(seconds, time.process_time() - cpu, self)
                return answer

        return Timed(*given, **named)

    def note(self, seconds: float, cpu: float, navigator: Navigator) -> None:
        record = navigator.record
        self.seconds.append(seconds)
        self.cpu.append(cpu)
        self.nodes.append(record.tree_nodes)
        self.left.append(record.time_left)
        self.stopped_by.append(record.tree_stopped_by or record.decision)
        if len(self.seconds) % 500 == 0:
            self.see(f"anytime: {len(self.seconds)} of {self.wanted} cycles")
        if len(self.seconds) >= self.wanted:
            raise EnoughError


def measure(options: Options) -> Found:
    """Drive through `crowded`, cycles as long as their deadline, and count the late answers."""
    deadline = DEADLINE if options.deadline is None else options.deadline
    cycles = options.cycles or CYCLES
    if options.quick:
        cycles = min(cycles, QUICK_CYCLES)
    watch = drive(hurried(options.scenario or load_scenario("crowded"), deadline), cycles, options)
    seconds, cpu = np.array(watch.seconds), np.array(watch.cpu)
    late = seconds > deadline
    spread = {
        "median": float(np.median(seconds)),
        "p99": float(np.quantile(seconds, 0.99)),
        "worst": float(seconds.max()),
    }
    ends = {end: watch.stopped_by.count(end) for end in sorted(set(watch.stopped_by))}
    row: dict[str, Any] = {
        "deadline [ms]": 1e3 * deadline,
        "cycles": len(seconds),
        "late": int(late.sum()),
        "late, CPU too": int((late & (cpu > deadline)).sum()),
        **{f"{name} [ms]": 1e3 * value for name, value in spread.items()},
        "CPU, median [ms]": 1e3 * float(np.median(cpu)),
        "nodes, median": int(np.median(watch.nodes)),
        "nodes, most": int(max(watch.nodes)),
    }
    return Found(
        title="answers within a deadline, measured outside `Navigator.update`, in ms",
        rows=[row],
        ratios={"deadline / p99": deadline / spread["p99"]},
        notes=[
            "late, CPU too: those of them in which the threads together computed for longer than"
            " the deadline; in the others the machine ran something else meanwhile",
            "exploration ended by: " + ", ".join(f"{end} {n}" for end, n in ends.items()),
        ],
        details={
            "worst overrun [s]": float(max(seconds.max() - deadline, 0.0)),
            "late cycles": [
                {
                    "cycle": int(k),
                    "seconds": float(seconds[k]),
                    "cpu": float(cpu[k]),
                    "nodes": watch.nodes[k],
                }
                for k in np.flatnonzero(late)
            ],
            "ended by": ends,
            "time left, median [s]": float(np.median(watch.left)),
        },
    )


def hurried(scenario: Scenario, deadline: float) -> Scenario:
    """The scenario in cycles as long as the deadline [s], and a tree that only time can end."""
    step = scenario.settings.time_step
    return replace(
        scenario.changed(
            {
                "deadline": deadline,
                "cycle": deadline,
                # a cycle is a whole number of steps
                "time_step": deadline / max(round(deadline / step), 1),
                "capacity": CAPACITY,
                "primitives": LONG,
            }
        ),
        name=f"{scenario.name}, {1e3 * deadline:g} ms",
    )


def drive(scenario: Scenario, cycles: int, options: Options) -> _Watch:
    """Episodes, seed after seed, until there were enough cycles."""
    watch = _Watch(cycles, options.see)
    episodes.drive(
        scenario, options.seed, lambda: len(watch.seconds) >= cycles, planner=watch.navigator
    )
    return watch
