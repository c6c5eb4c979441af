"""Weights by which standing still is the best of all plans."""

from __future__ import annotations

import math
from typing import Any

from passpmp_ti.reproduce import paper
from passpmp_ti.reproduce.cycle import PAPERS
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, table

SECONDS = 10.0
"""Of each drive [s]."""
DRIVES = (("narrow_passage", (0.2, 0.5, 0.9)), ("simple", (0.02, 0.2)))
"""(scenario, w_d)."""


def run(asked: Asked) -> Found:
    """Some weights, a slow and a fast robot."""
    rows: list[dict[str, Any]] = []
    for name, weights in DRIVES:
        for w_d in weights:
            asked.see(f"standing: {name}, w_d = {w_d:g}")
            w_t = round(1 - w_d, 2)
            run = asked.runs.drive(
                name, settings={**PAPERS, "weight_distance": w_d, "weight_time": w_t},
                duration=min(SECONDS, asked.longest), patience=math.inf,
            )  # fmt: skip
            top = run.scenario.robot.top_speed
            rows.append(
                {"scenario": name, "top_speed": top, "w_d": w_d, "w_t": w_t,
                 "pays": w_d * top > w_t, "driven": run.summary["distance_driven"]}
            )  # fmt: skip
    papers = next(r for r in rows if r["w_d"] == paper.W_D and not r["pays"])
    return Found(
        numbers={"rows": rows, "seconds": SECONDS},
        claims=(
            Claim(
                says="w_d = 0.2, w_t = 0.8 are the weights to take",
                ours=f"a wheelchair of at most {papers['top_speed']:g} m/s drives"
                f" {papers['driven']:.2f} m in {SECONDS:g} s with them",
                holds=papers["driven"] > 0.0,
            ),
        ),
    )


def tell(numbers: Numbers) -> str:
    """As markdown."""
    rows = [
        [f"`{r['scenario']}`", r["top_speed"], r["w_d"], r["w_t"], r["w_d"] * r["top_speed"],
         r["pays"], f"{r['driven']:.2f}"]
        for r in numbers["rows"]
    ]  # fmt: skip
    head = ["scenario", "top speed [m/s]", "w_d", "w_t", "w_d x speed", "more than w_t",
            f"driven in {numbers['seconds']:g} s [m]"]  # fmt: skip
    return "\n\n".join(
        [
            table(head, rows),
            "By eqs. 5, 18 and 19 a second of driving straight to the goal gains w_d x speed and"
            " costs w_t. Where it costs more, the plan that takes no time at all is the best: the"
            " robot stands. The paper's weights pay above 4 m/s. In ours the distance is a time,"
            " averaged along the plan, and all plans are judged over one time.",
        ]
    )
