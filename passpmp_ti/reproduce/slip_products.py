"""Products of probabilities, as eqs. 9 to 17 print them, call nearly every plan riskless."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from passpmp_ti.planner.guide import Guide
from passpmp_ti.planner.plan import trajectory_to
from passpmp_ti.planner.risk import risk_of
from passpmp_ti.planner.tree import TreeGrower
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, percent, table
from passpmp_ti.sim.episode import CycleInfo, simulate
from passpmp_ti.sim.scenario import load_scenario

SCENARIO, OBJECT_SPEED, SECONDS = "crowded", 5.0, 6.0
"""(name, bound [m/s], length of a drive [s])."""
NOTHING = 1e-6
"""A risk that is called none."""
EVERY, NODES, PLANS = 10, 240, 40
"""Each n-th cycle is looked at: a tree of so many nodes, and of its plans about so many."""
WEIGHT = 5
"""Column of a tree's costs with w_ps, see kernels/tree.py."""


@dataclass
class _Judge:
    """Weighs the plans of some cycles as printed, and by the chance of any contact."""

    printed: list[float] = field(default_factory=list)
    chance: list[float] = field(default_factory=list)
    _cycles: int = 0

    def __call__(self, info: CycleInfo) -> None:
        navigator = info.navigator
        self._cycles += 1
        if self._cycles % EVERY or navigator.model is None:
            return
        settings = navigator.settings.changed(risk="paper", capacity=NODES, guide="euclidean")
        # the same tracks and the same chances; only what is made of them differs
        model = replace(navigator.model, settings=settings)
        goal, anchor = navigator.goal, model.window.anchor
        here = (float(info.state[0]), float(info.state[1]))
        guide = Guide(
            navigator.robot, settings, here, [goal], anchor, model.window.inner_radius, None
        ).field(model, goal, info.state[:2])
        start = info.time + settings.cycle
        root = info.executing.at(start)
        proof = int(model.proving_brakes(root[None], np.array([start]))[0])
        tree = TreeGrower(navigator.robot, settings).grow(model, guide, root, start, proof)
        leaves = tree.leaves[:: max(1, len(tree.leaves) // PLANS)]
        for leaf in leaves[leaves > 0]:
            self.printed.append(float(tree.on_host().cost[leaf, WEIGHT]))
            way = trajectory_to(tree, int(leaf))
            self.chance.append(risk_of(navigator.model, way, start))


def run(asked: Asked) -> Found:
    """Weigh plans of trees both ways, and drive by what is printed."""
    scenario = load_scenario(SCENARIO).changed({"mode": "probabilistic"}, object_speed=OBJECT_SPEED)
    scenario = replace(scenario, duration=min(SECONDS, asked.longest))
    judge = _Judge()
    driven = {"any": 0.0, "paper": 0.0}
    for seed in range(asked.seeds):
        asked.see(f"products: {SCENARIO}, judged beside, seed {seed}")
        told = simulate(scenario, seed=seed, on_cycle=judge).summary()
        driven["any"] += told["distance_driven"]
        asked.see(f"products: {SCENARIO}, driven by the printed equations, seed {seed}")
        told = simulate(scenario, seed=seed, settings={"risk": "paper"}).summary()
        driven["paper"] += told["distance_driven"]
    printed, chance = np.array(judge.printed), np.array(judge.chance)
    risky = chance > scenario.settings.allowed_risk
    none = printed < NOTHING
    numbers: Numbers = {
        "plans": len(printed), "none": int(none.sum()), "risky": int(risky.sum()),
        "both": int((risky & none).sum()), "allowed": scenario.settings.allowed_risk,
        "median": float(np.median(chance[none])) if none.any() else 0.0,
        "worst": float(chance[none].max(initial=0.0)), "driven": driven, "drives": asked.seeds,
        "seconds": scenario.duration,
    }  # fmt: skip
    return Found(
        numbers=numbers,
        claims=(
            Claim(
                says="eq. 9: w_ps is small only where a plan is safe",
                ours=f"{numbers['none']} of {numbers['plans']} plans have none of it; the one of"
                " them that is most likely to touch does so with up to"
                f" {percent(numbers['worst'])}",
                holds=numbers["both"] == 0,
            ),
        ),
    )


def tell(numbers: Numbers) -> str:
    """As markdown."""
    allowed = percent(numbers["allowed"])
    driven = numbers["driven"]
    rows = [
        ["plans of trees of some cycles", numbers["plans"]],
        [f"w_ps as printed below {NOTHING:g}", numbers["none"]],
        [f"chance of any contact above {allowed}, which we refuse", numbers["risky"]],
        ["both", numbers["both"]],
        ["chance of any contact where w_ps is none: median", percent(numbers["median"])],
        ["the same: greatest", percent(numbers["worst"])],
        ["driven by the chance of any contact [m]", f"{driven['any']:.1f}"],
        ["driven by the printed equations [m]", f"{driven['paper']:.1f}"],
    ]
    return "\n\n".join(
        [
            table(["", ""], rows),
            f"`{SCENARIO}`, objects of at most {OBJECT_SPEED:g} m/s, mode `probabilistic`,"
            f" {numbers['drives']} drives of {numbers['seconds']:g} s. The product over times of"
            " eq. 12 and over states of eq. 10 is the chance that *all* collide, and the minimum of"
            " eq. 17 that of the most harmless object. By eq. 9 such a plan costs nothing wherever"
            ' it leads, and standing costs as little. `risk="any"` is the chance of any contact,'
            " bounded from above and certain where nothing is forecast ([risk.md](risk.md)); the"
            " same plans are judged by both.",
        ]
    )
