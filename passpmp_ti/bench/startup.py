"""How long a fresh process takes until it plans, with and without kernels in the cache."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from passpmp_ti import backend
from passpmp_ti.bench.found import Found, Options
from passpmp_ti.bench.fresh import PARTS

RUNS, QUICK_RUNS = 7, 2
LIMIT = 300.0
"""[s] A process that takes longer hangs."""
HOME = Path(__file__).resolve().parents[2]
BEGIN = """
import time
began = time.perf_counter()
import passpmp_ti
imported = time.perf_counter() - began
from passpmp_ti.bench.fresh import main
main({arch!r}, imported)
"""


def measure(options: Options) -> Found:
    """Start processes one after the other, the first with an empty cache folder."""
    runs = QUICK_RUNS if options.quick else RUNS
    with tempfile.TemporaryDirectory() as folder:
        found = []
        for k in range(runs + 1):
            options.see(f"startup: process {k + 1} of {runs + 1}")
            found.append(fresh(folder, backend.running() or "cpu"))
    cold, warm = found[0], found[1:]
    typical = {part: float(np.median([one[part] for one in warm])) for part in PARTS}
    worst = {part: max(one[part] for one in warm) for part in PARTS}
    return Found(
        title="a fresh process, until its second cycle of `crowded`, in s",
        rows=[
            {"cache": name, **{f"{part} [s]": seconds[part] for part in PARTS}}
            for name, seconds in (
                ("empty", cold), ("filled, median", typical), ("filled, worst", worst)
            )
        ],
        ratios={
            "first update: empty cache / filled": cold["first update"] / typical["first update"]
        },
        notes=["navigator: importing the planner, and making one"],
        details={"processes": found},
    )  # fmt: skip


def fresh(folder: str, arch: str) -> dict[str, float]:
    """Seconds of each part in a process of its own, with its cache in `folder`."""
    path = os.pathsep.join(p for p in (str(HOME), os.environ.get("PYTHONPATH")) if p)
    done = subprocess.run(
        [sys.executable, "-c", BEGIN.format(arch=arch)],
        env={**os.environ, "XDG_CACHE_HOME": folder, "PYTHONPATH": path},
        capture_output=True, text=True, check=True, timeout=LIMIT,
    )  # fmt: skip
    seconds: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return seconds
