"""Braking-ICS checks of many states on one map: ours against the same loop of others."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType

import numpy as np

from passpmp_ti.bench import reference, rivals
from passpmp_ti.bench.found import Found, Options
from passpmp_ti.bench.limit import BY_SECONDS, Limit
from passpmp_ti.bench.machine import has_avx512
from passpmp_ti.bench.our_check import our_check
from passpmp_ti.bench.rounds import interleaved
from passpmp_ti.bench.scenes import Scene, car_scene
from passpmp_ti.bench.states import States, draw

SIZES = (1_000, 10_000, 100_000, 1_000_000, 10_000_000)
QUICK_SIZES = SIZES[:-1]
MOST_FOR_NUMPY = 100_000
STEP, FINE_STEP = 0.05, 0.0125
"""Of the C++, and of what our verdicts are judged by [s]."""
JUDGED = {True: 1_000_000, False: 10_000}
"""Most verdicts that are judged, with the C++ and without it."""
BUDGET, QUICK_BUDGET = 20.0, 4.0
"""For all rounds of one number of states [s]."""


def measure(options: Options) -> Found:
    """Check states by the thousand and by the million, and judge the verdicts."""
    limit, compiled = rivals.limit(options), rivals.numba_module("compiled", options)
    found = Found(
        title="braking-ICS checks on one map, millions of states a second",
        rows=[],
        ratios={},
        notes=[
            f"ours {STEP:g} s: at the time step of all others; ours: at the robot's own",
            "safe: what ours calls safe; theirs: what the C++ does (NumPy where there is none),"
            " whose map is cut into coarse layers; differ: where the two do",
            f"unsound: called safe, and touched when looked at every {1e3 * FINE_STEP:g} ms on the"
            " map of the body alone, without a margin: must be 0",
            *rivals.missing(options),
        ],
    )
    sizes = options.sizes or (QUICK_SIZES if options.quick else SIZES)
    for scene in (car_scene("crowded"), car_scene("ring")):
        options.see(f"check: drawing {max(sizes):,} states, {scene.name}")
        arrival = _arrival(scene, _settings(scene, STEP).clearance(scene.robot))
        states = draw(scene, arrival, max(sizes))
        for size in sizes:
            options.see(f"check: {scene.name}, {size:,} states")
            _measure_one(options, scene, arrival, states.first(size), limit, compiled, found)
    return found


def _measure_one(
    options: Options, scene: Scene, arrival: np.ndarray, states: States,
    limit: Limit | None, compiled: ModuleType | None, found: Found,
) -> None:  # fmt: skip
    """Add the row and the ratios of one number of states."""
    count, ticks = len(states), reference.ticks_of(arrival)
    at_step, own = f"ours {STEP:g} s", rivals.OURS
    racing: dict[str, Callable[[], object]] = {}
    racing[at_step], verdicts = _ours(scene, ticks, states, STEP)
    racing[own], _ = _ours(scene, ticks, states, scene.settings.time_step)
    theirs = None
    if limit is not None:
        racing[rivals.CPP_SCALAR], theirs = limit.check(
            arrival, scene.cell, states, STEP, vectors=False
        )
        if has_avx512():
            racing[rivals.CPP_VECTORS], _ = limit.check(
                arrival, scene.cell, states, STEP, vectors=True
            )
    if compiled is not None:
        racing[rivals.NUMBA] = lambda: compiled.passively_safe(ticks, scene.cell, states, STEP)
    if count <= MOST_FOR_NUMPY:
        racing[rivals.NUMPY] = lambda: reference.passively_safe(ticks, scene.cell, states, STEP)
    rounds = interleaved(racing, QUICK_BUDGET if options.quick else BUDGET)

    row: dict[str, object] = {"scene": scene.name, "states": count}
    row |= {f"{name} [M/s]": 1e-6 * count / rounds.median(name) for name in racing}
    judged = states.first(min(count, JUDGED[limit is not None]))
    safe = verdicts()[: len(judged)]
    if theirs is None:
        theirs = reference.passively_safe(ticks, scene.cell, judged, STEP)
    theirs = theirs[: len(judged)]
    row["safe [%]"] = 100 * float(safe.mean())
    row["theirs [%]"] = 100 * float(theirs.mean())
    row["differ [%]"] = 100 * float((safe != theirs).mean())
    row["unsound"] = int((safe & ~truly_safe(scene, judged, limit)).sum())
    found.rows.append(row)
    for ours in (at_step, own):
        for name in racing:
            if name not in (at_step, own):
                label = f"{scene.name} {count:.0e}: {ours} / {name}"
                found.ratios[label] = rounds.faster(ours, name)


def truly_safe(scene: Scene, states: States, limit: Limit | None) -> np.ndarray:
    """[n] bool: at small steps, on the map of the body alone, the states brake clear.

    The map takes the distance between the centres of cells for what it is: where a path runs
    through a neighbouring cell, that distance is at most a diagonal less, which is what our map
    has in hand.
    """
    bare = _arrival(scene, scene.robot.disc_radius - math.sqrt(2) * scene.cell)
    if limit is None:
        return reference.passively_safe(
            reference.ticks_of(bare), scene.cell, states, FINE_STEP
        ).astype(bool)
    call, safe = limit.check(bare, scene.cell, states, FINE_STEP, vectors=False, layout=BY_SECONDS)
    call()
    return safe.astype(bool)


def _arrival(scene: Scene, clearance: float) -> np.ndarray:
    return reference.arrival_seconds(
        scene.scan(), scene.size, scene.cell, clearance, scene.settings.object_speed
    )


def _settings(scene: Scene, step: float):
    return scene.settings.changed(time_step=step)


def _ours(
    scene: Scene, ticks: np.ndarray, states: States, step: float
) -> tuple[Callable[[], object], Callable[[], np.ndarray]]:
    corner = (-(scene.size // 2), -(scene.size // 2))
    return our_check(ticks, corner, scene.robot, _settings(scene, step), states.poses, states.ticks)
