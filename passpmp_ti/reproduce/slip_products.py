"""Products of probabilities, as eqs. 9 to 17 print them, call nearly every plan riskless."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from passpmp_ti.grid.model import FutureModel
from passpmp_ti.planner.risk import risk_of
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, percent, table
from passpmp_ti.sim.episode import CycleInfo, simulate
from passpmp_ti.sim.scenario import load_scenario

SCENARIO, OBJECT_SPEED, LONGEST = "crowded", 5.0, 10.0
"""(name, bound [m/s], longest drive [s])."""
NOTHING = 1e-6
"""A risk that is called none."""
EVERY = 2
"""Plans of each n-th cycle are judged again."""


@dataclass
class _Judge:
    """Asks of every plan what the chance of any contact is."""

    printed: list[float] = field(default_factory=list)
    any_: list[float] = field(default_factory=list)
    _model: FutureModel | None = None
    _cycles: int = 0

    def begin(self) -> None:
        """Of a drive: nothing is remembered of the one before."""
        self._model = None

    def __call__(self, info: CycleInfo) -> None:
        navigator, record = info.navigator, info.navigator.record
        if navigator.model is None or record.chosen is None:
            return
        settings = navigator.settings.changed(risk="any")
        x, y, theta = (float(v) for v in info.state[:3])
        self._model = FutureModel.from_scan(
            info.scans, navigator.robot, settings, self._model, navigator.static_map,
            position=(x, y, theta), speed=abs(float(navigator.robot.speed(info.state))),
        )  # fmt: skip
        start = info.time + settings.cycle
        self._cycles += 1
        if self._cycles % EVERY or record.chosen.end <= start:
            return
        self.printed.append(risk_of(navigator.model, record.chosen, start))
        self.any_.append(risk_of(self._model, record.chosen, start))


def run(asked: Asked) -> Found:
    """Drive by the printed equations, and judge the same plans by the chance of any contact."""
    judge = _Judge()
    told: list[dict[str, Any]] = []
    scenario = load_scenario(SCENARIO).changed(
        {"mode": "probabilistic", "risk": "paper"}, object_speed=OBJECT_SPEED
    )
    scenario = replace(scenario, duration=min(LONGEST, asked.longest))
    for seed in range(asked.seeds):
        asked.see(f"products: {SCENARIO}, seed {seed}")
        judge.begin()
        told.append(simulate(scenario, seed=seed, on_cycle=judge).summary())
    printed, chance = np.array(judge.printed), np.array(judge.any_)
    none = printed < NOTHING
    allowed = scenario.settings.allowed_risk
    above = chance[none] > allowed
    numbers = {
        "plans": len(printed), "riskless": int(none.sum()), "above": int(above.sum()),
        "allowed": allowed, "median": float(np.median(chance[none])) if none.any() else math.nan,
        "worst": float(chance[none].max(initial=0.0)),
        "moving": sum(s["collisions_moving"] for s in told), "drives": len(told),
    }  # fmt: skip
    return Found(
        numbers=numbers,
        claims=(
            Claim(
                says="eqs. 9 to 17: w_ps tells the risk of a plan",
                ours=f"{numbers['riskless']} of {numbers['plans']} plans have none by them; the"
                f" chance of any contact of the worst of these is {percent(numbers['worst'])}",
                holds=not above.any(),
            ),
        ),
    )


def tell(numbers: Numbers) -> str:
    """As markdown."""
    rows = [
        ["plans that were driven, not at rest", numbers["plans"]],
        [f"risk as printed below {NOTHING:g}", numbers["riskless"]],
        [f"of these, chance of any contact above {percent(numbers['allowed'])}", numbers["above"]],
        ["of these, chance of any contact: median", percent(numbers["median"])],
        ["of these, chance of any contact: greatest", percent(numbers["worst"])],
        ["contacts while moving", f"{numbers['moving']} in {numbers['drives']} drives"],
    ]
    return "\n\n".join(
        [
            table(["", ""], rows),
            f"`{SCENARIO}`, objects of at most {OBJECT_SPEED:g} m/s, mode `probabilistic`,"
            ' `risk="paper"`: the product over times of eq. 12 and over states of eq. 10 is the'
            " chance that *all* collide, and the minimum of eq. 17 that of the most harmless"
            " object. By eq. 9 such a plan costs nothing wherever it leads. The same plans are"
            " judged by"
            ' `risk="any"`, the chance of any contact, bounded from above'
            " ([risk.md](risk.md)).",
        ]
    )
