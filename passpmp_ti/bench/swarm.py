"""What an iteration of the swarm takes, beside moving every priority of every particle."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from passpmp_ti import backend, door
from passpmp_ti.bench.cycle import machine
from passpmp_ti.bench.trees import random_tree
from passpmp_ti.planner.swarm import Swarm
from passpmp_ti.robots import CarLike
from passpmp_ti.settings import Settings

ITERATIONS = 60
"""Of a search, the default of `Settings`."""
REPEATS, MOST_REPEATS, ENOUGH = 5, 500, 20_000_000
"""Measurements of each, more where `ENOUGH` moves are not reached; what is told is their median."""
CHUNK = 1 << 16
"""Priorities that NumPy moves at a time: its temporary arrays stay in the cache."""
MOST = 4 << 30
"""Bytes that the dense swarms may take."""

Progress = Callable[[str], None]


class DenseSwarm:
    """Algorithm 3 as it is written, in NumPy: eqs. 2 and 3 for every priority of every particle.

    The walks are left out: beside the moves they are few, and in Python slow.
    """

    def __init__(self, particles: int, nodes: int, settings: Settings, seed: int) -> None:
        self._settings = settings
        self._generator = np.random.default_rng(seed)
        self.position = self._generator.random((particles, nodes), dtype=np.float32)
        self.velocity = self._generator.random((particles, nodes), dtype=np.float32)
        self.best = self.position[::-1].copy()
        self.of_group = self.position[0].copy()

    def iterate(self) -> None:
        """Move everything once."""
        nodes = len(self.of_group)
        for p in range(len(self.position)):
            for begin in range(0, nodes, CHUNK):
                self._move(p, slice(begin, begin + CHUNK))

    def _move(self, p: int, some: slice) -> None:
        settings, x, v = self._settings, self.position[p, some], self.velocity[p, some]
        pull = self._generator.random((2, len(x)), dtype=np.float32)
        pull *= np.array([[settings.cognitive], [settings.social]], dtype=np.float32)
        v += pull[0] * (self.best[p, some] - x)
        v += pull[1] * (self.of_group[some] - x)
        np.clip(v, -settings.velocity_max, settings.velocity_max, out=v)
        x += v
        v[(x < 0.0) | (x > 1.0)] *= -0.5
        np.clip(x, 0.0, 1.0, out=x)


def measure_swarm(
    particles: Sequence[int] = (20, 100),
    nodes: Sequence[int] = (1_000, 100_000, 1_000_000),
    seed: int = 0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Seconds an iteration, on random trees, of the swarm and of dense ones.

    Args:
        particles: how many, each in turn.
        nodes: of the trees, each in turn.
        seed: of trees and searches.
        progress: told what is measured now.

    Returns:
        Rows of seconds and ratios, machine and versions, ready for JSON. A ratio is how often the
        swarm's iteration fits into the dense one; Numba's is None where Numba is not installed.

    Raises:
        ValueError: the dense swarms would take more than 4 GiB.
    """
    arch = backend.init()
    counts = [door.whole("measure_swarm", "particles", p, least=1) for p in particles]
    sizes = [door.whole("measure_swarm", "nodes", n, least=2) for n in nodes]
    if 3 * 4 * max(counts) * max(sizes) > MOST:
        raise ValueError(
            f"measure_swarm: {max(counts)} particles on {max(sizes)} nodes, all kept, are"
            f" {3 * 4 * max(counts) * max(sizes) / 2**30:.1f} GiB, and {MOST >> 30} are allowed;"
            " take fewer"
        )
    compiled = compiled_moves()
    rows = []
    for count in counts:
        for size in sizes:
            if progress is not None:
                progress(f"swarm: {count} particles, {size} nodes")
            rows.append(_row(count, size, seed, compiled))
    return {"iterations": ITERATIONS, "rows": rows, "seed": seed, "backend": arch, **machine()}


def _row(particles: int, nodes: int, seed: int, compiled: list[Callable[..., None]]) -> dict:
    settings = Settings(
        particles=particles, sub_swarms=2 if particles % 2 == 0 else 1, iterations=ITERATIONS,
        capacity=nodes, distance="final",
    )  # fmt: skip
    generator = np.random.default_rng(seed)
    tree = random_tree(nodes, generator)
    swarm = Swarm(CarLike(), settings)
    dense = DenseSwarm(particles, nodes, settings, seed)
    swarm.choose(tree, generator)
    taken: dict[str, list[float]] = {"swarm": [], "numpy": [], "numba": []}

    def move(moves: Callable[..., None], turn: int) -> None:
        moves(
            dense.position, dense.velocity, dense.best, dense.of_group, np.uint32(turn),
            np.float32(settings.velocity_max), np.float32(settings.cognitive),
            np.float32(settings.social),
        )  # fmt: skip

    for moves in compiled:
        move(moves, 0)
    repeats = min(max(REPEATS, ENOUGH // (particles * nodes)), MOST_REPEATS)
    for repeat in range(repeats):
        # in turn, so that a machine that slows down slows all of them
        searched = _seconds(partial(swarm.choose, tree, generator))
        taken["swarm"].append(searched / (settings.iterations + 1))
        taken["numpy"].append(_seconds(dense.iterate))
        if compiled:
            # threads cost more than they bring where there is little to move: the better of both
            taken["numba"].append(min(_seconds(partial(move, m, repeat + 1)) for m in compiled))
    row: dict[str, Any] = {"particles": particles, "nodes": nodes, "depth": tree.depth}
    for name, seconds in taken.items():
        row[f"{name}_seconds"] = float(np.median(seconds)) if seconds else None
    for name in ("numpy", "numba"):
        ratios = np.array(taken[name]) / np.array(taken["swarm"]) if taken[name] else None
        row[f"{name}_ratio"] = None if ratios is None else float(np.median(ratios))
    return row


def _seconds(work: Callable[[], Any]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def compiled_moves() -> list[Callable[..., None]]:
    """`DenseSwarm.iterate` by Numba on one core and on all, with draws by the kernel's hash.

    Nothing where Numba is not installed.
    """
    try:
        import numba
    except ImportError:
        return []

    @numba.njit(inline="always")
    def scrambled(x):
        x ^= x >> np.uint32(16)
        x = np.uint32(x * np.uint32(0x7FEB352D))
        x ^= x >> np.uint32(15)
        x = np.uint32(x * np.uint32(0x846CA68B))
        return x ^ (x >> np.uint32(16))

    def moves(position, velocity, best, of_group, turn, velocity_max, cognitive, social):
        for p in numba.prange(position.shape[0]):
            start = scrambled(scrambled(np.uint32(turn)) ^ np.uint32(p))
            for n in range(position.shape[1]):
                h = scrambled(start ^ np.uint32(n))
                to_best = np.float32(h >> np.uint32(16)) * np.float32(1 / 65536)
                to_group = np.float32(h & np.uint32(0xFFFF)) * np.float32(1 / 65536)
                x = position[p, n]
                v = (
                    velocity[p, n]
                    + cognitive * to_best * (best[p, n] - x)
                    + social * to_group * (of_group[n] - x)
                )
                v = min(max(v, -velocity_max), velocity_max)
                x += v
                inside = min(max(x, np.float32(0.0)), np.float32(1.0))
                velocity[p, n] = v if x == inside else np.float32(-0.5) * v
                position[p, n] = inside

    return [numba.njit(moves), numba.njit(parallel=True)(moves)]
