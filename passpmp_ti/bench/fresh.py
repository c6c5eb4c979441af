"""The first two cycles of a fresh process, timed; see `startup`, which starts it."""

from __future__ import annotations

import json
import time

PARTS = ("import", "init", "navigator", "first update", "second update")


def main(backend: str, imported: float) -> None:
    """Print the seconds of each part as JSON; importing the package itself took `imported` [s]."""
    import passpmp_ti as pti

    began = time.perf_counter()
    pti.init(backend)
    started = time.perf_counter() - began
    began = time.perf_counter()
    planner = pti.Navigator
    loaded = time.perf_counter() - began

    import numpy as np

    scenario = pti.load_scenario("crowded")
    world, state, start = scenario.build(0)
    errors = np.random.default_rng(0)
    scans = [
        [lidar.scan(world, state, start + k * scenario.settings.cycle, errors) for k in range(2)]
        for lidar in scenario.lidars
    ]
    began = time.perf_counter()
    navigator = planner(scenario.robot, scenario.settings, goal=scenario.goals)
    made = time.perf_counter() - began
    updates = []
    for k in range(2):
        began = time.perf_counter()
        navigator.update([sweeps[k] for sweeps in scans], state)
        updates.append(time.perf_counter() - began)
    seconds = (imported, started, loaded + made, *updates)
    print(json.dumps(dict(zip(PARTS, seconds, strict=True))))
