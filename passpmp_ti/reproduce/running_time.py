"""Table VII: running times of PASSPMP-PSO and ISS, in one run, cycle by cycle."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from passpmp_ti.planner.baselines.input_space import InputSpaceSampling
from passpmp_ti.reproduce import paper
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, table
from passpmp_ti.sim.episode import CycleInfo, simulate
from passpmp_ti.sim.scenario import load_scenario

SECONDS = 12.0
"""Of the drive [s]."""
WARM = 5
"""Cycles in which kernels may be compiled; they do not count."""
PAPERS_NODES = 40
"""Nodes of the paper's tree at a cycle of 2.4 s (Table VI)."""
STEPS = ("model", "guide", "tree", "choice", "bookkeeping")


class _Beside:
    """Lets ISS plan from every scan that the navigator was given."""

    def __init__(self) -> None:
        self.rows: list[dict[str, float]] = []
        self._iss: InputSpaceSampling | None = None

    def __call__(self, info: CycleInfo) -> None:
        navigator = info.navigator
        if self._iss is None:
            self._iss = InputSpaceSampling(navigator.robot, navigator.settings, navigator.goals)
        began = time.perf_counter()
        self._iss.update(info.scans, info.state, following=info.executing)
        taken = time.perf_counter() - began
        timings = navigator.record.timings
        if "choice" in timings:
            self.rows.append({"iss": taken, **{k: timings.get(k, 0.0) for k in (*STEPS, "total")}})


def run(asked: Asked) -> Found:
    """Table VII."""
    found = {}
    for name, changes in (
        ("default", {}),
        ("paper", {"capacity": PAPERS_NODES, "particles": paper.PARTICLES}),
    ):
        asked.see(f"table7: a drive through crowded, {name} tree")
        scenario = load_scenario("crowded").changed(changes)
        scenario = replace(scenario, duration=min(SECONDS, asked.longest))
        beside = _Beside()
        simulate(scenario, on_cycle=beside)
        rows = beside.rows[WARM:] or beside.rows
        whole = [r["total"] / r["iss"] for r in rows]
        alone = [(r["tree"] + r["choice"]) / r["iss"] for r in rows]
        found[name] = {
            "cycles": len(rows),
            "ratio": float(np.median(whole)),
            "ratio_decision": float(np.median(alone)),
            **{
                f"{key}_ms": 1e3 * float(np.median([r[key] for r in rows]))
                for key in ("iss", "total", *STEPS)
            },
        }
    ratio = found["paper"]["ratio"]
    printed = paper.TABLE_7["passpmp-pso"] / paper.TABLE_7["iss"]
    return Found(
        numbers=found,
        claims=(
            Claim(
                says=f"PASSPMP-PSO takes less than half as long as ISS ({printed:.2f} times)",
                ours=f"{ratio:.1f} times as long: it models the future, and ISS does not",
                holds=ratio < 0.5,
            ),
        ),
    )


def tell(numbers: Numbers) -> str:
    """Table VII as markdown."""
    theirs, own, default = paper.TABLE_7, numbers["paper"], numbers["default"]
    rows: list[list[object]] = [
        ["ISS: map of the returns, 11 motions of 2 s", theirs["iss"], own["iss_ms"],
         default["iss_ms"]],
        ["PASSPMP-PSO, scan to trajectory", theirs["passpmp-pso"], own["total_ms"],
         default["total_ms"]],
        *([f"of that: {step}", None, own[f"{step}_ms"], default[f"{step}_ms"]] for step in STEPS),
        ["**ratio PASSPMP-PSO / ISS**", theirs["passpmp-pso"] / theirs["iss"], own["ratio"],
         default["ratio"]],
        ["ratio of tree and choice alone / ISS", None, own["ratio_decision"],
         default["ratio_decision"]],
    ]  # fmt: skip
    head = ["[ms]", "paper", "ours, 40 nodes", "ours, default tree"]
    return "\n\n".join(
        [
            table(head, rows),
            "One drive through `crowded`, 22 movers, bound 20 m/s; each scan is given to both, one"
            f" after the other, {own['cycles']} and {default['cycles']} cycles. Ratios are medians"
            " of the cycles' own ratios, and the only figures here to be compared with the"
            " paper's. *Model* is the scan to arrival times, *guide* the time to the goal from"
            " everywhere, *choice* the swarm of 100 particles. The paper does not say what its"
            " figures hold. It lays its planner's time to the number of particles, and its"
            " advantage over ISS to planning while the robot moves. Here the particles take little,"
            " and the model of the future most of the cycle. ISS has none: a motion costs it one"
            " look a step at a map of gaps, and there are only 11 of them.",
        ]
    )
