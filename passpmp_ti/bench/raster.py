"""From a scan to the map of arrivals: ours against others that make the same kind of map."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from passpmp_ti import FutureModel
from passpmp_ti.bench import reference, rivals
from passpmp_ti.bench.found import Found, Options
from passpmp_ti.bench.rounds import interleaved
from passpmp_ti.bench.scenes import Scene, car_scene, wheelchair_scene
from passpmp_ti.scan import Scan

REMEMBERING = "ours, with memory"
BUDGET, QUICK_BUDGET = 12.0, 3.0
"""For all rounds of a scene [s]."""
MOVED = (0.6, 0.2)
"""Where the robot stands when it remembers [m]: maps are shifted then."""


def measure(options: Options) -> Found:
    """Time a map of each scene and robot."""
    limit, compiled = rivals.limit(options), rivals.numba_module("compiled_raster", options)
    found = Found(
        title="a scan to the map of arrivals, in ms",
        rows=[],
        ratios={},
        notes=["with memory: as in every cycle but the first", *rivals.missing(options)],
    )
    for scene in (car_scene("crowded"), car_scene("ring"), wheelchair_scene("crowded")):
        label = f"{type(scene.robot).__name__} {scene.name} {scene.size}x{scene.size}"
        options.see(f"raster: {label}")
        scan = scene.scan()
        given = (
            scan, scene.size, scene.cell, scene.settings.clearance(scene.robot),
            scene.settings.object_speed,
        )  # fmt: skip
        before = _model(scene, scan)
        after = scene.scan(MOVED, scene.settings.cycle)
        racing: dict[str, Callable[[], object]] = {
            rivals.OURS: partial(_model, scene, scan),
            REMEMBERING: partial(_model, scene, after, before),
            rivals.NUMPY: partial(reference.arrival_seconds, *given),
        }
        if compiled is not None:
            racing[rivals.NUMBA] = partial(compiled.arrival_seconds, *given)
        row: dict[str, object] = {}
        if limit is not None:
            racing[rivals.CPP], theirs = limit.raster(*given)
            racing[rivals.CPP]()
            other = np.abs(theirs - reference.arrival_seconds(*given)) > 1e-3
            row["cells C++ and NumPy tell apart"] = int(other.sum())
        rounds = interleaved(racing, QUICK_BUDGET if options.quick else BUDGET)
        found.rows.append(
            {
                "scene": label,
                **{f"{name} [ms]": 1e3 * rounds.median(name) for name in racing},
                **row,
            }
        )
        for own in (rivals.OURS, REMEMBERING):
            for name in racing:
                if name not in (rivals.OURS, REMEMBERING):
                    found.ratios[f"{label}: {own} / {name}"] = rounds.faster(own, name)
    return found


def _model(scene: Scene, scan: Scan, previous: FutureModel | None = None) -> FutureModel:
    return FutureModel.from_scan(scan, scene.robot, scene.settings, previous)
