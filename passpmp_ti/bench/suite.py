"""The benchmarks by name, carried out one after the other."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from passpmp_ti.bench.found import Found, Options, document
from passpmp_ti.bench.machine import circumstances


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
    found = swarm.measure_swarm(progress=options.see)
    return Found(
        title=str(found.get("title", "particles x nodes x iterations")),
        rows=list(found["rows"]),
        ratios=dict(found.get("ratios", {})),
        notes=list(found.get("notes", [])),
    )
