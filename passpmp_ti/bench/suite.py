"""The benchmarks by name, carried out one after the other."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from passpmp_ti.bench.found import Found, Options, document
from passpmp_ti.bench.machine import circumstances

QUICK_SWARM_SIZES = (1_000, 100_000)


def carry_out(names: Sequence[str], options: Options) -> Iterator[dict[str, Any]]:
    """Each benchmark's result in turn, ready for JSON; the kernels must have been started."""
    for name in names:
        found = _measure(name)(options)
        yield document(name, found, {**circumstances(options.threads), "quick": options.quick})


def _measure(name: str) -> Callable[[Options], Found]:
    if name == "swarm":
        return _swarm
    measure: Callable[[Options], Found] = importlib.import_module(
        f"passpmp_ti.bench.{name}"
    ).measure
    return measure


def _swarm(options: Options) -> Found:
    swarm = importlib.import_module("passpmp_ti.bench.swarm")
    asked: dict[str, Any] = {"seed": options.seed, "progress": options.see}
    sizes = options.sizes or (QUICK_SWARM_SIZES if options.quick else None)
    if sizes:
        asked["nodes"] = sizes
    told = swarm.measure_swarm(**asked)
    rivals = {"swarm": "ours", "numpy": "NumPy, every priority", "numba": "Numba, every priority"}
    rows: list[dict[str, Any]] = []
    ratios = {}
    for row in told["rows"]:
        label = f"{row['particles']} x {row['nodes']:.0e}"
        seconds = {key: row.get(f"{key}_seconds") for key in rivals}
        rows.append(
            {
                **{key: row[key] for key in ("particles", "nodes", "depth") if key in row},
                **{f"{rivals[key]} [ms]": 1e3 * s for key, s in seconds.items() if s is not None},
            }
        )
        for key in ("numpy", "numba"):
            if row.get(f"{key}_ratio") is not None:
                ratios[f"{label}: ours / {rivals[key]}"] = row[f"{key}_ratio"]
    return Found(title="an iteration of the swarm, in ms", rows=rows, ratios=ratios, details=told)
