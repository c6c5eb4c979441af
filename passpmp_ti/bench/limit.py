"""The tuned C++ that our kernels are held against, built and called where its folder is at hand.

The folder holds one source file, `perf.cpp`. It speaks of a car with the limits of our own, on a
square grid about the origin, and of times after the scan.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from passpmp_ti.bench.machine import cores
from passpmp_ti.bench.scenes import Scene
from passpmp_ti.bench.states import States
from passpmp_ti.scan import Scan

SOURCE = "perf.cpp"
FLAGS = ("-O3", "-march=native", "-ffast-math", "-fopenmp", "-shared", "-fPIC")
LEVELS, HORIZON = 64, 7.7
"""Its arrival is kept in levels of HORIZON / LEVELS seconds, and nothing is free after the last."""
BY_LEVEL, BY_SECONDS = 3, 4
"""How it looks up when something could be somewhere."""
PAD = 64
"""Its vector loads read a few bytes past the last cell."""
ORDER = np.array([0, -1, 1], dtype=np.int32)
"""Steering of its braking controls, in the order of ours."""


class _Frame(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("columns", "rows", "levels")),
        *((name, ctypes.c_float) for name in ("x", "y", "per_metre", "per_second", "speed")),
        ("step", ctypes.c_float),
    )  # fmt: skip


class _Grids(ctypes.Structure):
    _fields_ = tuple(
        (name, ctypes.c_void_p)
        for name in ("layers", "by_cell", "bits", "levels", "seconds", "tiled_bits",
                     "tiled_levels", "by_row", "packed")
    )  # fmt: skip


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


class Limit:
    """The C++, loaded. What its methods return are calls without arguments, ready to be timed."""

    def __init__(self, folder: Path, threads: int | None) -> None:
        source = Path(folder) / SOURCE
        if not source.is_file():
            raise ValueError(f"--limit {folder}: there is no {SOURCE} in it")
        if shutil.which("g++") is None:
            raise ValueError("--limit needs g++ to build the C++; install it or leave --limit out")
        # its threads would wait busily on cores that the next rival needs
        os.environ.setdefault("OMP_WAIT_POLICY", "passive")
        with tempfile.TemporaryDirectory() as built:
            library = Path(built) / "limit.so"
            done = subprocess.run(
                ["g++", *FLAGS, "-o", str(library), str(source)], capture_output=True, text=True
            )
            if done.returncode:
                raise ValueError(f"--limit: {source} does not build here:\n{done.stderr[-2000:]}")
            self._library = ctypes.CDLL(str(library))
        self._library.set_threads(threads or cores())

    def raster(
        self, scan: Scan, size: int, cell: float, clearance: float, speed: float
    ) -> tuple[Callable[[], object], np.ndarray]:
        """The call that makes the map of one sweep, and the map: [J, I] float32 [s]."""
        ranges = np.minimum(scan.ranges, scan.range_max).astype(np.float32)
        kinds = np.where(scan.returned, 1 + np.asarray(scan.moving), 0).astype(np.int32)
        cells = size * size
        bytes_ = [np.zeros(cells, dtype=np.uint8) for _ in range(3)]
        column = np.zeros(cells, dtype=np.int32)
        floats = [np.zeros(cells, dtype=np.float32) for _ in range(3)]
        levels = np.zeros(cells + PAD, dtype=np.uint8)
        seconds = floats[2].reshape(size, size)

        def call() -> None:
            self._library.raster_c(
                _at(ranges), _at(kinds), len(ranges), size, size, ctypes.c_float(cell),
                ctypes.c_float(clearance), ctypes.c_float(speed),
                ctypes.c_float(HORIZON / LEVELS), LEVELS, *map(_at, bytes_), _at(column),
                *map(_at, floats), _at(levels), None, None, 0,
            )  # fmt: skip

        return call, seconds

    def check(
        self, arrival: np.ndarray, cell: float, states: States, step: float, *,
        vectors: bool, layout: int = BY_LEVEL,
    ) -> tuple[Callable[[], object], np.ndarray]:  # fmt: skip
        """The call that checks the states, and where its verdicts go: [n] uint8, 1: safe.

        Args:
            arrival: [J, I] float32 [s].
            cell: [m]
            states: all at or after the scan.
            step: [s]
            vectors: sixteen states at once, by AVX-512.
            layout: BY_LEVEL or BY_SECONDS.
        """
        frame, grids, kept = _grids(arrival, cell, step)
        safe = np.zeros(len(states) + PAD, dtype=np.uint8)
        columns = states.columns

        def call() -> None:
            end = (len(states), *map(_at, columns), _at(ORDER), _at(safe))
            both = (ctypes.byref(frame), ctypes.byref(grids), layout)
            if vectors:
                self._library.brake_simd_c(*both, *end)
            else:
                # sine and cosine by recurrence, early exits: its quickest scalar form
                self._library.brake_c(*both, 1, 2, *end)
            _ = kept  # the C++ knows it by address alone

        return call, safe[: len(states)]

    def tree(
        self, scene: Scene, arrival: np.ndarray, root: np.ndarray, controls: np.ndarray,
        duration: float, capacity: int, step: float,
    ) -> Callable[[], tuple[int, int]]:  # fmt: skip
        """The call that grows a tree: (nodes, children that were tried).

        Args:
            scene: whose grid.
            arrival: [J, I] float32 [s].
            root: [5] state of a car, at the scan.
            controls: [u, 2] acceleration and steering rate.
            duration: of every primitive [s].
            capacity: most nodes.
            step: [s]
        """
        frame, grids, kept = _grids(arrival, scene.cell, step)
        x, y, theta, v, xi = root
        nodes = [np.zeros(capacity + PAD, dtype=np.float32) for _ in range(7)]
        for row, value in zip(nodes, (x, y, np.cos(theta), np.sin(theta), v, xi, 0), strict=True):
            row[0] = value
        pointers = (ctypes.c_void_p * 7)(*(row.ctypes.data for row in nodes))
        parent, first = (np.zeros(capacity + PAD, dtype=np.int32) for _ in range(2))
        control, children = (np.zeros(capacity + PAD, dtype=np.uint8) for _ in range(2))
        offsets = np.zeros(PAD, dtype=np.int32)
        pull, steering = (np.ascontiguousarray(c, dtype=np.float32) for c in controls.T)
        checked = ctypes.c_long()

        def call() -> tuple[int, int]:
            levels = self._library.tree_c(
                ctypes.byref(frame), ctypes.byref(grids), len(pull), _at(pull), _at(steering),
                ctypes.c_float(duration), capacity, PAD - 2, pointers, _at(parent), _at(control),
                _at(first), _at(children), _at(offsets), 1, ctypes.byref(checked),
            )  # fmt: skip
            _ = kept, nodes  # the C++ knows them by address alone
            return int(offsets[levels + 1]), int(checked.value)

        return call


def _grids(arrival: np.ndarray, cell: float, step: float) -> tuple[_Frame, _Grids, object]:
    """Its view of an arrival map, and the arrays that must outlive it."""
    size = len(arrival)
    seconds = np.ascontiguousarray(arrival, dtype=np.float32).ravel()
    levels = np.zeros(len(seconds) + PAD, dtype=np.uint8)
    levels[: len(seconds)] = np.minimum(seconds * np.float32(LEVELS / HORIZON), 255)
    corner = -0.5 * size * cell
    frame = _Frame(size, size, LEVELS, corner, corner, 1 / cell, LEVELS / HORIZON, 0.0, step)
    grids = _Grids(levels=levels.ctypes.data, seconds=seconds.ctypes.data)
    return frame, grids, (seconds, levels)
