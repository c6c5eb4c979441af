"""Table V: how much of the view is p-safe, by the bound on the speed of objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from passpmp_ti.compare.axes import Axis
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.reproduce import paper
from passpmp_ti.reproduce.figure import curves, document
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, percent, table
from passpmp_ti.sim.scenario import load_scenario
from passpmp_ti.viz.region import braking_ics

SPEEDS = (2.0, 5.0, 10.0, 20.0)
"""Of the states that are asked about [m/s]; the paper gives none."""
STATES = 100_000
MIDDLE = (90.0, 90.0, 0.0)
"""The robot stands in the middle of the scene, as in Fig. 6."""


def run(asked: Asked) -> Found:
    """Table V."""
    scenario = load_scenario("crowded")
    found: dict[tuple[float, float], list[float]] = {}
    for seed in range(asked.seeds):
        world, state, stamp = replace(scenario, start=MIDDLE).build(seed)
        scans = [lidar.scan(world, state, stamp) for lidar in scenario.lidars]
        for bound in paper.SPEEDS:
            asked.see(f"table5: objects of at most {bound:g} m/s, seed {seed}")
            settings = scenario.settings.changed(object_speed=bound)
            model = FutureModel.from_scan(scans, scenario.robot, settings, position=MIDDLE)
            for speed in SPEEDS:
                region = braking_ics(
                    model, scenario.bounds, MIDDLE[2], speed, stamp + settings.cycle, STATES
                )
                found.setdefault((speed, bound), []).append(region.share())
    shares = {
        f"{speed:g}": [float(np.mean(found[speed, bound])) for bound in paper.SPEEDS]
        for speed in SPEEDS
    }
    falls = all((np.diff(row) <= 0).all() for row in shares.values())
    drawing = curves(
        "P-safe share of the view",
        {
            "paper": list(zip(paper.SPEEDS, paper.TABLE_5, strict=True)),
            **{
                f"ours, {speed} m/s": list(zip(paper.SPEEDS, row, strict=True))
                for speed, row in shares.items()
            },
        },
        Axis(low=0.0, high=55.0, label="bound on the speed of objects [m/s]"),
        Axis(low=0.0, high=0.4, label="p-safe states", percent=True),
    )
    middle = shares[f"{SPEEDS[1]:g}"]
    return Found(
        numbers={"shares": shares, "scenes": asked.seeds},
        claims=(
            Claim(
                says="the faster objects may be, the fewer states are p-safe: 35.7 to 11.8 %",
                ours=f"states at {SPEEDS[1]:g} m/s: {percent(middle[0])} to {percent(middle[-1])};"
                f" it {'falls' if falls else 'does not fall'} at every speed",
                holds=falls,
            ),
        ),
        figures={
            "P-safe share of the view by the bound on the speed of objects": document(drawing)
        },
    )


def tell(numbers: Numbers) -> str:
    """Table V as markdown."""
    rows = [["paper", *(percent(p) for p in paper.TABLE_5)]]
    rows += [
        [f"ours, states at {speed} m/s", *(percent(p) for p in row)]
        for speed, row in numbers["shares"].items()
    ]
    head = ["objects of at most [m/s]", *(f"{v:g}" for v in paper.SPEEDS)]
    return "\n\n".join(
        [
            table(head, rows),
            "Share of states all over the 180 x 180 m, of one heading and speed, that can be braked"
            " to rest in time, asked one cycle of 0.1 s after one scan from the middle of"
            f" `crowded`; mean of {numbers['scenes']} draws of the movers. What is not seen is"
            " unsafe, as in the paper. The paper gives neither the speed nor the heading of its"
            " states, and its share hardly falls up to 20 m/s and then halves; ours falls most at"
            " first, as discs that grow from everything not seen do: what they leave shrinks by"
            " about v_b times the braking time on every side.",
        ]
    )
