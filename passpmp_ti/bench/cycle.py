"""How long a whole planning cycle takes, scan to trajectory."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from passpmp_ti import backend, door
from passpmp_ti.bench import episodes, reference
from passpmp_ti.bench.episodes import EnoughError
from passpmp_ti.bench.found import Found, Options
from passpmp_ti.bench.machine import machine
from passpmp_ti.bench.scenes import car_scene
from passpmp_ti.sim.scenario import Scenario, load_scenario

if TYPE_CHECKING:
    from passpmp_ti.sim.episode import CycleInfo

PAPER = 0.029
"""Average running time of PASSPMP-PSO in Table VII, on a Core i7 of 1.6 GHz [s]."""
WARM_UP = 5
"""Cycles left out as the first episode begins: they load or compile the kernels."""


CYCLES, QUICK_CYCLES = 1000, 100
LONG = (0.4,) * 7
"""Primitives that make a tree of ten thousand nodes [s]."""
YARDSTICK_EVERY = 25
"""Cycles between two looks at how fast the machine is just now."""


class _Stopwatch:
    def __init__(self, skip: int, wanted: int) -> None:
        self.skip, self.wanted = skip, wanted
        self.timings: list[dict[str, float]] = []
        self.nodes: list[int] = []
        self.yardstick: list[float] = []

    def see(self, info: CycleInfo) -> None:
        if self.skip > 0:
            self.skip -= 1
            return
        if len(self.timings) % YARDSTICK_EVERY == 0:
            self.yardstick.append(_yardstick())
        record = info.navigator.record
        self.timings.append(record.timings)
        self.nodes.append(record.tree_nodes)
        if len(self.timings) >= self.wanted:
            raise EnoughError


def measure(options: Options) -> Found:
    """Drive the scenes of `cycle`, or the one asked for, and take the time of every cycle."""
    from passpmp_ti.viz.report import cycle_report

    scenes = [options.scenario] if options.scenario else default_scenes()
    cycles = options.cycles or CYCLES
    if options.quick:
        cycles = min(cycles, QUICK_CYCLES)
    found = Found(
        title="scan to trajectory, in ms",
        rows=[],
        ratios={},
        notes=["yardstick: the plain NumPy map of an 80 m sweep (`raster`), taken between cycles"],
    )
    for scenario in scenes:
        options.see(f"cycle: {scenario.name}")
        one = measure_cycle(scenario, cycles, options.seed)
        total = one["seconds"]["total"]
        found.details[scenario.name] = one
        found.rows.append(
            {
                "scene": scenario.name,
                **{f"{key} [ms]": 1e3 * total[key] for key in ("median", "p99", "worst")},
                "nodes, median": int(one["tree_nodes_median"]),
                "nodes, most": one["tree_nodes_most"],
                "yardstick [ms]": 1e3 * one["yardstick_seconds"],
            }
        )
        for key in ("median", "p99"):
            share = one["yardstick_seconds"] / total[key]
            found.ratios[f"{scenario.name}: {key} / yardstick"] = share
        found.notes.append("\n" + cycle_report(one))
    return found


def default_scenes() -> list[Scenario]:
    """A crowd about a car, with trees of three sizes, and a wheelchair that meets a person."""
    crowded, corridor = load_scenario("crowded"), load_scenario("corridor_person")
    return [
        replace(crowded.changed({"capacity": 40}), name="crowded, 40 nodes"),
        replace(crowded, name="crowded"),
        replace(
            crowded.changed({"capacity": 10_000, "primitives": LONG}), name="crowded, 10,000 nodes"
        ),
        replace(corridor, name="wheelchair, 1081 beams"),
    ]


def measure_cycle(scenario: Scenario, cycles: int = CYCLES, seed: int = 0) -> dict[str, Any]:
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
    last = episodes.drive(
        scenario, first, lambda: len(watch.timings) >= cycles, on_cycle=watch.see
    )
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
        "yardstick_seconds": float(np.median(watch.yardstick)),
        "share_of_paper": seconds["total"]["median"] / PAPER,
        "backend": arch,
        **machine(),
    }


def _spread(seconds: np.ndarray) -> dict[str, float]:
    return {
        "median": float(np.median(seconds)),
        "p99": float(np.quantile(seconds, 0.99)),
        "worst": float(seconds.max()),
    }


def _yardstick() -> float:
    """How long a fixed piece of plain NumPy takes on this machine just now [s]."""
    scene = car_scene("crowded")
    scan = scene.scan()
    began = time.perf_counter()
    reference.arrival_seconds(
        scan, scene.size, scene.cell, scene.robot.radius, scene.settings.object_speed
    )
    return time.perf_counter() - began
