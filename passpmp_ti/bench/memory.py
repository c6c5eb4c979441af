"""What the owners of arrays take: computed from their shapes, and measured as it is used."""

from __future__ import annotations

import ctypes
import dataclasses
import gc
import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from passpmp_ti import FutureModel
from passpmp_ti.bench.found import Found, Options
from passpmp_ti.bench.scenes import car_scene
from passpmp_ti.planner.swarm import Swarm
from passpmp_ti.planner.tree import planted

SIZES = (1_000, 10_000, 100_000, 1_000_000)
QUICK_SIZES = SIZES[:3]
MIB = 2**20
POSE = 28
"""Bytes of a node's pose, the least that a node can be: the yardstick of the ratios."""
NODE = ((7, np.float32), (8, np.int32), (5, np.float32))
"""A node's pose, link and cost."""
TOLD_FROM = 16 * MIB
"""Smaller owners drown in what an allocator keeps: no ratio is told of them."""


def measure(options: Options) -> Found:
    """Make each owner, touch all it holds, and look at what the process grew by."""
    scene = car_scene("ring")
    model = FutureModel.from_scan(scene.scan(), scene.robot, scene.settings)
    found = Found(
        title="arrays of each owner, in MiB",
        rows=[],
        ratios={},
        notes=["computed: shapes times sizes of elements, before a page is touched; measured: what"
               " the resident set grew by once all were"],
    )  # fmt: skip
    found.rows.append(
        {"owner": f"model, {scene.size}x{scene.size} cells", "computed [MiB]": held(model) / MIB}
    )
    for size in options.sizes or (QUICK_SIZES if options.quick else SIZES):
        settings = scene.settings.changed(capacity=size)
        for owner, make in (
            ("tree", lambda n=size: planted(n, *(np.zeros(k, t) for k, t in NODE))),
            ("swarm", lambda s=settings: Swarm(scene.robot, s)),
        ):
            options.see(f"memory: {owner} of {size:,} nodes")
            _give_back()
            before = resident_set()
            made = make()
            computed = held(made)
            _touch(made)
            measured = max(resident_set() - before, 0)
            del made
            name = f"{owner}, {size:,} nodes"
            found.rows.append(
                {
                    "owner": name,
                    "computed [MiB]": computed / MIB,
                    "measured [MiB]": measured / MIB,
                    "bytes a node": computed // size,
                }
            )
            found.ratios[f"{name}: a pose / held"] = POSE * size / computed
            if computed >= TOLD_FROM and measured:
                found.ratios[f"{name}: computed / measured"] = computed / measured
    return found


def held(owner: object) -> int:
    """Bytes of all arrays that an object holds, those of the frozen data in it among them."""
    return sum(_bytes(array) for array in arrays_of(owner))


def arrays_of(owner: object) -> list[object]:
    """Arrays that an object holds, each once; NumPy's views count as what they look at."""
    found: dict[int, object] = {}
    waiting, seen = [owner], set()
    while waiting:
        thing = waiting.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, np.ndarray):
            while isinstance(thing.base, np.ndarray):
                thing = thing.base
            found[id(thing)] = thing
        elif hasattr(thing, "element_shape"):
            found[id(thing)] = thing
        elif type(thing).__module__.startswith("passpmp_ti"):
            waiting.extend(_parts(thing))
        elif isinstance(thing, (list, tuple)):
            waiting.extend(thing)
    return list(found.values())


def _parts(thing: object) -> Iterable[object]:
    if dataclasses.is_dataclass(thing):
        return [getattr(thing, field.name) for field in dataclasses.fields(thing)]
    return list(vars(thing).values()) if hasattr(thing, "__dict__") else []


def _bytes(array: object) -> int:
    if isinstance(array, np.ndarray):
        return array.nbytes
    import taichi as ti

    assert isinstance(array, ti.Ndarray)
    return int(np.prod(array.shape)) * np.dtype(ti.lang.util.to_numpy_type(array.dtype)).itemsize


def available() -> int:
    """Bytes of memory that are free for use; 0 where the system does not tell."""
    listing = Path("/proc/meminfo")
    if listing.is_file():
        for line in listing.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    return 0


def _touch(owner: object) -> None:
    """Write to every array in the host's memory."""
    for array in arrays_of(owner):
        if isinstance(array, np.ndarray):
            array.fill(0)


def _give_back() -> None:
    """Hand what is free inside the process back to the system, so that what comes next is seen."""
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def resident_set() -> int:
    """Bytes of this process that lie in memory; 0 where the system does not tell."""
    statm = Path("/proc/self/statm")
    if not statm.is_file():
        return 0
    return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
