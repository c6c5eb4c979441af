"""Growing trees of primitives: nodes a second, from a hundred nodes to ten million."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import ModuleType

import numpy as np

from passpmp_ti import FutureModel
from passpmp_ti.bench import reference, rivals
from passpmp_ti.bench.found import Found, Options
from passpmp_ti.bench.limit import Limit
from passpmp_ti.bench.machine import has_avx512
from passpmp_ti.bench.memory import available
from passpmp_ti.bench.rounds import interleaved
from passpmp_ti.bench.scenes import Scene, car_scene
from passpmp_ti.planner.guide import Guide
from passpmp_ti.planner.tree import TreeGrower, tree_bytes

SIZES = (100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000)
QUICK_SIZES = SIZES[:4]
MOST_FOR_NUMPY = 10_000
ROOT = np.array([0.0, 0.0, 0.0, 8.0, 0.0])
"""(x, y, theta, v, xi) of the car, at the scan."""
STEP = 0.05
"""Of the others [s]."""
OURS_AT_STEP = f"{rivals.OURS} {STEP:g} s"
DEEPEST = 12
"""Most levels of our tree."""
LARGE = 1_000_000
"""From so many nodes on the primitives are shorter, so that the tree stays in the ring."""
MOST_OF_MEMORY = 0.7
"""Share of what is free that the trees of one size may take."""
BUDGET, QUICK_BUDGET = 20.0, 4.0
"""For all rounds of one capacity [s]."""


def duration(size: int) -> float:
    """Of a primitive of a tree of `size` nodes [s]."""
    return 0.4 if size >= LARGE else 0.6


@dataclass(frozen=True, slots=True)
class Grown:
    """What a tree came to."""

    nodes: int
    checked: int | None = None
    """Children that were tried; None: not told."""


def measure(options: Options) -> Found:
    """Grow trees of each size in the ring."""
    limit, compiled = rivals.limit(options), rivals.numba_module("compiled", options)
    scene = car_scene("ring")
    found = Found(
        title="trees of nine controls in the ring, thousands of nodes a second",
        rows=[],
        ratios={},
        notes=[
            f"ours {STEP:g} s: at the time step of all others; ours: at the robot's own. Ours also"
            " works out what each node costs, and brakes where no child is safe",
            *rivals.missing(options),
        ],
    )
    clearance = scene.settings.changed(time_step=STEP).clearance(scene.robot)
    arrival = reference.arrival_seconds(
        scene.scan(), scene.size, scene.cell, clearance, scene.settings.object_speed
    )
    for size in options.sizes or (QUICK_SIZES if options.quick else SIZES):
        room = available()
        if room and _needed(size) > MOST_OF_MEMORY * room:
            found.notes.append(f"{size:,} nodes do not fit into {room / 2**30:.1f} GiB")
            continue
        options.see(f"tree: {size:,} nodes")
        _measure_one(options, _racing(scene, arrival, size, limit, compiled), size, found)
    return found


def _racing(
    scene: Scene, arrival: np.ndarray, size: int, limit: Limit | None, compiled: ModuleType | None
) -> dict[str, Callable[[], Grown]]:
    """Who grows trees of this size."""
    controls = np.array([c[1:] for c in scene.robot.controls], dtype=np.float32)
    racing: dict[str, Callable[[], Grown]] = {
        OURS_AT_STEP: _ours(scene, size, STEP),
        rivals.OURS: _ours(scene, size, scene.settings.time_step),
    }
    if limit is not None and has_avx512():
        grow = limit.tree(scene, arrival, ROOT, controls, duration(size), size, STEP)
        racing[rivals.CPP] = lambda: Grown(*grow())
    ticks, steps = reference.ticks_of(arrival), round(duration(size) / STEP)
    for name, loops in ((rivals.NUMBA, compiled), (rivals.NUMPY, reference)):
        if loops is not None and (name == rivals.NUMBA or size <= MOST_FOR_NUMPY):
            racing[name] = partial(grown, loops, ticks, scene.cell, controls, steps, size)
    return racing


def _measure_one(
    options: Options, racing: Mapping[str, Callable[[], Grown]], size: int, found: Found
) -> None:
    """Add the row and the ratios of one capacity."""
    trees: dict[str, Grown] = {}

    def kept(name: str, grow: Callable[[], Grown]) -> None:
        trees[name] = grow()

    rounds = interleaved(
        {name: partial(kept, name, grow) for name, grow in racing.items()},
        QUICK_BUDGET if options.quick else BUDGET,
    )
    row: dict[str, object] = {"capacity": size}
    row |= {f"{name} [k/s]": 1e-3 * trees[name].nodes / rounds.median(name) for name in racing}
    row["nodes"] = trees[rivals.OURS].nodes
    row["children tried by others"] = max(
        (tree.checked for tree in trees.values() if tree.checked is not None), default=None
    )
    found.rows.append(row)
    for ours in (OURS_AT_STEP, rivals.OURS):
        for name in racing:
            if name not in (OURS_AT_STEP, rivals.OURS):
                # trees differ a little in their size: what counts is nodes a second
                share = trees[ours].nodes / trees[name].nodes
                found.ratios[f"{size:.0e}: {ours} / {name}"] = rounds.faster(ours, name) * share


def _needed(size: int) -> float:
    """Bytes that all rivals' trees of `size` nodes take, about."""
    return 4 * tree_bytes(size)


def _ours(scene: Scene, size: int, step: float) -> Callable[[], Grown]:
    settings = scene.settings.changed(
        time_step=step, capacity=size, cycle=duration(size),
        primitives=(duration(size),) * (DEEPEST - 1), guide="euclidean",
    )  # fmt: skip
    model = FutureModel.from_scan(scene.scan(), scene.robot, settings)
    goal = (0.5 * scene.range_max, 0.0)
    guide = Guide(
        scene.robot, settings, (0.0, 0.0), [goal], model.window.anchor, model.window.inner_radius,
        None,
    ).field(model, goal, np.zeros(2))  # fmt: skip
    proof = int(model.proving_brakes(ROOT[None], np.array([model.stamp]))[0])
    grower = TreeGrower(scene.robot, settings)
    return lambda: Grown(grower.grow(model, guide, ROOT, model.stamp, proof).count)


def grown(
    loops: ModuleType, ticks: np.ndarray, cell: float, controls: np.ndarray, steps: int, size: int
) -> Grown:
    """A tree that is grown level by level by plain loops.

    Args:
        loops: `reference`, or `compiled`.
        ticks: [J, I] uint16 map of arrivals [ms].
        cell: [m]
        controls: [u, 2] float32 acceleration and steering rate.
        steps: of a primitive.
        size: most nodes.
    """
    nodes = np.zeros((size, 6), dtype=np.float32)
    parent = np.full(size, -1, dtype=np.int32)
    nodes[0, :5] = ROOT
    first, last, checked = 0, 1, 0
    while first < last < size:
        ends, safe = loops.children(ticks, cell, nodes[first:last], controls, steps, STEP)
        checked += len(safe)
        kept = np.flatnonzero(safe)[: size - last]
        nodes[last : last + len(kept)] = ends[kept]
        parent[last : last + len(kept)] = first + kept // len(controls)
        first, last = last, last + len(kept)
    return Grown(last, checked)
