"""A model made of the latest scan alone loses the robot's own root."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, table
from passpmp_ti.sim.episode import CycleInfo, simulate
from passpmp_ti.sim.scenario import load_scenario

DRIVES = (("simple", 10.0, 20.0), ("nested_u", 5.0, 15.0), ("crowded", 5.0, 10.0))
"""(scenario, bound on objects [m/s], longest [s])."""


@dataclass
class _Forgetful:
    """Counts cycles in which what was proven is no longer; takes memory away where asked to."""

    forgets: bool
    cycles: int = 0
    lost: int = 0

    def __call__(self, info: CycleInfo) -> None:
        record = info.navigator.record
        self.cycles += 1
        self.lost += not record.held_clear
        if self.forgets:
            info.navigator.model = None


def run(asked: Asked) -> Found:
    """With memory and without."""
    rows: list[dict[str, Any]] = []
    for name, bound, longest in DRIVES:
        scenario = load_scenario(name).changed(object_speed=bound)
        scenario = replace(scenario, duration=min(longest, asked.longest))
        for forgets in (False, True):
            row: dict[str, Any] = {"scenario": name, "forgets": forgets}
            row |= {"cycles": 0, "lost": 0, "moving": 0}
            for seed in range(asked.seeds):
                asked.see(f"memory: {name}, {'without' if forgets else 'with'}, seed {seed}")
                watcher = _Forgetful(forgets)
                told = simulate(scenario, seed=seed, on_cycle=watcher).summary()
                row["cycles"] += watcher.cycles
                row["lost"] += watcher.lost
                row["moving"] += told["collisions_moving"]
            rows.append(row)
    without = sum(r["lost"] for r in rows if r["forgets"])
    kept = sum(r["lost"] for r in rows if not r["forgets"])
    return Found(
        numbers={"rows": rows},
        claims=(
            Claim(
                says="Property 3: what was p-safe by one model is so by the next",
                ours=f"lost in {without} of {sum(r['cycles'] for r in rows if r['forgets'])} cycles"
                f" without memory, in {kept} of"
                f" {sum(r['cycles'] for r in rows if not r['forgets'])} with it",
                holds=without == 0,
            ),
        ),
    )


def tell(numbers: Numbers) -> str:
    """As markdown."""
    rows = [
        [f"`{r['scenario']}`", "the latest scan" if r["forgets"] else "with memory", r["cycles"],
         r["lost"], r["moving"]]
        for r in numbers["rows"]
    ]  # fmt: skip
    head = ["scenario", "model", "cycles", "held plan no longer free", "contacts while moving"]
    return "\n\n".join(
        [
            table(head, rows),
            "The proof of Property 3 takes it that a state found safe by W(t_k) cannot be unsafe by"
            " W(t_k+1). But a place that was seen empty a moment ago and lies in a shadow now,"
            " behind a mover or a corner, is unknown again to a model of one scan, though nothing"
            " can have got there so soon. The planner then finds its own plan unsafe, and brakes"
            " without need. Both models are sound, and so is the later of both arrival times: with"
            " that memory ([how-it-works.md](how-it-works.md)) nothing is lost.",
        ]
    )
