"""Fig. 15: ISS in the crowd, and its fan of motions as a panel."""

from __future__ import annotations

import numpy as np

from passpmp_ti.compare.svg import Drawing
from passpmp_ti.kernels.rollouts import STEPS
from passpmp_ti.planner.baselines.input_space import HORIZON, MOTIONS
from passpmp_ti.planner.baselines.motion import Motion
from passpmp_ti.planner.baselines.obstacles import Obstacles
from passpmp_ti.reproduce.crowds import row_of, table_of
from passpmp_ti.reproduce.figure import strip
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers
from passpmp_ti.reproduce.runs import Glimpse, Run
from passpmp_ti.reproduce.scene import Scene, thinned
from passpmp_ti.sim.world import Bounds

BEFORE = 0.8
"""How long before the touch the first panel is [s]."""
HALF = 25.0
"""Half of a panel's side [m]."""
CAPTION = (
    "ISS in `crowded`: blue, those of the 11 motions that are free of what it sees now; orange,"
    " those that are not; green, the chosen one to rest"
)
SAFE = {"passpmp-pso": "PASSPMP-PSO", "passpmp": "PASSPMP"}
"""Planners that are driven beside it, with their names in the paper."""
SEEDS = 5
"""Episodes at least: ISS is cheap, and not every drive ends in a touch."""


def run(asked: Asked) -> Found:
    """Fig. 15."""
    runs = []
    for seed in range(max(asked.seeds, SEEDS)):
        asked.see(f"fig15: crowded, iss, seed {seed}")
        runs.append(asked.runs.drive("crowded", "iss", seed, duration=asked.longest, between=0.1))
    rows = [row_of("ISS", runs)]
    for planner, name in SAFE.items():
        safe = []
        for seed in range(asked.seeds):
            asked.see(f"fig15: crowded, {planner}, seed {seed}")
            safe.append(asked.runs.drive("crowded", planner, seed, duration=asked.longest))
        rows.append(row_of(name, safe))
    touched = next((r for r in runs if any(c.moving for c in r.contacts)), None)
    figures = {}
    if touched is not None:
        contact = next(c for c in touched.contacts if c.moving)
        at = contact.start - touched.glimpses[0].time
        panels = []
        for when, name in ((at - BEFORE, "before"), (at, "the touch")):
            glimpse = touched.nearest(when)
            x, y = (float(v) for v in glimpse.state[:2])
            bounds = (x - HALF, y - HALF, x + HALF, y + HALF)
            title = f"{glimpse.time - touched.glimpses[0].time:.1f} s: {name}"
            panels.append(fan_panel(touched, glimpse, HORIZON, title, bounds))
        figures[CAPTION] = strip("ISS in the crowd", panels, 2)
    return Found(
        numbers={"rows": rows},
        claims=(
            Claim(
                says="ISS runs into a moving object while under way",
                ours=f"{rows[0]['moving']} contacts while moving in {rows[0]['episodes']} drives",
                holds=rows[0]["moving"] > 0,
            ),
            Claim(
                says="PASSPMP-PSO and PASSPMP do not",
                ours=", ".join(f"{r['name']}: {r['moving']} in {r['episodes']}" for r in rows[1:]),
                holds=not any(r["moving"] for r in rows[1:]),
            ),
        ),
        figures=figures,
    )


def tell(numbers: Numbers) -> str:
    """Fig. 15 as markdown."""
    return "\n\n".join(
        [
            table_of(numbers["rows"], "planner"),
            "Objects of at most 20 m/s, of which ISS knows where they are and nothing else. It is"
            " sooner at the goal for that: it drives as if all stood.",
        ]
    )


def fan_panel(run: Run, glimpse: Glimpse, horizon: float, title: str, bounds: Bounds) -> Drawing:
    """The motions that ISS looks at in one cycle, free or not, and what it chose."""
    scenario = run.scenario
    motion = Motion(scenario.robot, scenario.settings)
    steps = scenario.settings.steps_of(horizon)
    away = float(np.hypot(*(glimpse.root[:2] - np.array(scenario.goals[-1]))))
    speed = min(scenario.robot.top_speed, away / (steps * scenario.settings.time_step))
    targets = motion.inputs(np.full(MOTIONS, speed), np.linspace(-1.0, 1.0, MOTIONS))
    here = (float(glimpse.root[0]), float(glimpse.root[1]))
    reach = scenario.robot.top_speed * horizon + scenario.robot.radius
    seen = Obstacles.seen(glimpse.scans, here, reach, scenario.settings.cell)
    free = seen.tried(motion, glimpse.root, scenario.goals[-1], targets[:, None], steps)
    scene = Scene(bounds, title)
    scene.world(run.world)
    scene.movers(run.world, glimpse.time)
    scene.line(thinned(run.trail_until(glimpse.time)), "driven")
    start = glimpse.time + scenario.settings.cycle
    for n in range(MOTIONS):
        way = motion.towards(glimpse.root, start, targets[n : n + 1], steps)
        kind = "safe" if free[n, STEPS] >= steps else "refused"
        scene.line(thinned(way.states[: way.brakes_from + 1, :2], 10), kind)
    scene.robot(scenario.robot, glimpse.state)
    scene.line(thinned(glimpse.plan), "choice")
    for goal in scenario.goals:
        scene.goal(goal)
    return scene.drawing()
