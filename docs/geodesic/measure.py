"""What cones that follow walls buy, and what they cost: `python docs/geodesic/measure.py scans`.

`scans` asks models of single scans, `along SCENARIO CYCLES` models with a memory that see the same
scans along one drive, `drive SCENARIO SEED ...` drives with either. All print rows of tables.
"""

from __future__ import annotations

import sys
import time as clock
from dataclasses import replace
from pathlib import Path

import numpy as np

import passpmp_ti as pti
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.sim.episode import CycleInfo
from passpmp_ti.sim.scenario import Scenario

CORNER = str(Path(__file__).parent / "corner.yaml")
PLACES = {
    CORNER: [(1.0, 0.3), (2.5, -0.3), (4.5, 0.0), (6.0, 0.4), (9.0, 0.0), (9.2, 2.5)],
    "corridor_person": [(1.0, 0.3), (2.5, 0.0), (4.5, 0.3), (6.7, 0.0), (9.0, -0.3)],
    "narrow_passage": [(0.0, 1.0), (3.0, 1.0), (4.4, 0.0), (6.0, 0.0)],
    "u_shape": [(40.0, 90.0), (60.0, 90.0), (80.0, 90.0)],
}
"""Of the robot, on its way, for each scenario [m]."""
CONES = ("straight", "geodesic")
STATES = 4000
MAP_CELL = 0.05
ROUNDS = 9


def mapped(scenario: Scenario) -> Scenario:
    """The scenario, with what stays told beforehand."""
    outline = scenario.still_world().outline
    return replace(scenario, static_map=StaticMap.from_segments(outline, MAP_CELL))


def model_at(scenario: Scenario, place: tuple[float, float], cones: str) -> pti.FutureModel:
    """What the scans from a place leave."""
    state = np.array([*place, 0.0, 0.0, 0.0])
    world, _, start = scenario.build(0)
    return pti.FutureModel.from_scan(
        [lidar.scan(world, state, start) for lidar in scenario.lidars], scenario.robot,
        scenario.settings.changed(cones=cones), static_map=scenario.static_map,
        position=tuple(state[:3]),
    )  # fmt: skip


def moving_states(model: pti.FutureModel, generator: np.random.Generator) -> np.ndarray:
    """[STATES, 5] anywhere that is free, straight ahead at up to the top speed."""
    free = np.argwhere(model.ticks > 0)
    chosen = free[generator.integers(len(free), size=STATES)]
    states = np.zeros((STATES, 5))
    states[:, :2] = model.origin + (chosen[:, ::-1] + 0.5) * model.cell
    states[:, 2] = generator.uniform(-np.pi, np.pi, STATES)
    speed = generator.uniform(0.1, 1.0, STATES) * model.robot.top_speed
    states[:, 3] = speed
    if not isinstance(model.robot, pti.CarLike):
        states[:, 4] = speed
    return states


def scans() -> None:
    """A row for each scenario, without and with a map."""
    for name, places in PLACES.items():
        for scenario in (pti.load_scenario(name), mapped(pti.load_scenario(name))):
            generator = np.random.default_rng(0)
            later, gains, safe, ratios = [], [], [], []
            for place in places:
                straight, geodesic = (model_at(scenario, place, cones) for cones in CONES)
                free = straight.ticks > 0
                gain = (geodesic.ticks.astype(int) - straight.ticks)[free]
                later.append((gain > 0).mean())
                gains.append(gain[gain > 0])
                states = moving_states(straight, generator)
                times = np.full(STATES, straight.stamp + scenario.settings.cycle)
                safe.append([m.passively_safe(states, times).mean() for m in (straight, geodesic)])
                for _ in range(ROUNDS):
                    ratios.append(_cost(scenario, place))
            gained = np.concatenate(gains)
            before, after = 100 * np.mean(safe, axis=0)
            print(
                f"| {Path(name).stem} | {'yes' if scenario.static_map else 'no'}"
                f" | {100 * np.mean(later):.1f} % | {np.median(gained) / 1000:.2f} s"
                f" | {before:.2f} % | {after:.2f} % | {np.median(ratios):.2f} |",
                flush=True,
            )


def _cost(scenario: Scenario, place: tuple[float, float]) -> float:
    """How many times as much of the processor a model takes with geodesic cones, once."""
    state = np.array([*place, 0.0, 0.0, 0.0])
    world, _, start = scenario.build(0)
    seen = [lidar.scan(world, state, start) for lidar in scenario.lidars]
    spent = []
    for cones in CONES:
        settings = scenario.settings.changed(cones=cones)
        began = clock.process_time()
        pti.FutureModel.from_scan(
            seen, scenario.robot, settings, static_map=scenario.static_map,
            position=tuple(state[:3]),
        )  # fmt: skip
        spent.append(clock.process_time() - began)
    return spent[1] / spent[0]


def along(name: str, cycles: int) -> None:
    """A row: both kinds of cones, each with its memory, along one drive."""
    scenario = pti.load_scenario(name)
    generator = np.random.default_rng(0)
    models: dict[str, pti.FutureModel] = {}
    later, safe = [], []

    def see(info: CycleInfo) -> None:
        for cones in CONES:
            models[cones] = pti.FutureModel.from_scan(
                info.scans, scenario.robot, scenario.settings.changed(cones=cones),
                models.get(cones), scenario.static_map, position=tuple(info.state[:3]),
            )  # fmt: skip
        if round(info.time / scenario.settings.cycle) % 10 == 9:
            straight, geodesic = (models[cones] for cones in CONES)
            later.append((geodesic.ticks > straight.ticks)[straight.ticks > 0].mean())
            states = moving_states(straight, generator)
            times = np.full(STATES, straight.stamp + scenario.settings.cycle)
            safe.append([m.passively_safe(states, times).mean() for m in (straight, geodesic)])

    pti.simulate(replace(scenario, duration=cycles * scenario.settings.cycle), seed=0, on_cycle=see)
    before, after = 100 * np.mean(safe, axis=0)
    print(
        f"| {Path(name).stem} | {100 * np.mean(later):.1f} % | {before:.2f} % | {after:.2f} % |",
        flush=True,
    )


def drive(name: str, seeds: list[int]) -> None:
    """A row for each seed, without and with a map, with both kinds of cones."""
    for seed in seeds:
        for scenario in (pti.load_scenario(name), mapped(pti.load_scenario(name))):
            for cones in CONES:
                changed = scenario.changed(settings={"cones": cones})
                told = pti.simulate(changed, seed=seed).summary()
                print(
                    f"| {Path(name).stem} | {seed} | {'yes' if scenario.static_map else 'no'}"
                    f" | {cones} | {told['time_to_goal']} | {told['collisions_moving']} |",
                    flush=True,
                )


if __name__ == "__main__":
    pti.init("cpu", threads=1)
    if sys.argv[1:2] == ["drive"]:
        drive(sys.argv[2], [int(seed) for seed in sys.argv[3:]])
    elif sys.argv[1:2] == ["along"]:
        along(sys.argv[2], int(sys.argv[3]))
    else:
        scans()
