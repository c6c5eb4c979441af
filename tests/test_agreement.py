"""The price of the grid: of the states that the model itself calls safe, how many the planner does.

The model itself is `Gridless`: the same premises in closed form, with no cells, looks or ticks.
"""

import os

import numpy as np
import pytest
from oracle import cases, exact, gridless

from passpmp_ti import CarLike, DifferentialDrive, Settings

ROBOTS = {"wheelchair": (DifferentialDrive(), 1.2, 10.0), "car": (CarLike(), 10.0, 80.0)}
"""Robot, size of the things about it, range of its lidar [m]."""
LEAST = {"wheelchair": 0.95, "car": 0.88}
SMALL_SAMPLE = 0.02
"""What a few hundred states may show less than many thousands."""
SEEDS = max(int(os.environ.get("PASSPMP_CAMPAIGN", "2000000")) // 40_000, 4)


def at_defaults(kind, seed):
    """(case, generator): a random world and one scan of it, all settings as they come."""
    robot, scale, range_max = ROBOTS[kind]
    generator = np.random.default_rng(seed)
    settings = Settings.for_robot(robot)
    place = (*map(float, generator.uniform(-30, 30, 2)), float(generator.uniform(-np.pi, np.pi)))
    world = cases.random_world(generator, place, robot, settings, scale)
    scan = exact.sweep(world, place, 1440, 2 * np.pi, range_max, float(generator.uniform(0, 1000)))
    return cases.Case(robot, settings, world, [scan], place), generator


def agreement(kind, seeds, states_each):
    """(states that the model calls safe, those that the planner proves too, planner alone)."""
    safe = both = alone = 0
    for seed in seeds:
        case, generator = at_defaults(kind, seed)
        states, times = cases.random_states(case, states_each, generator)
        moving = ~case.robot.at_rest(states)
        states, times = states[moving], times[moving]
        model = gridless.safe(case, states, times)
        planner = case.model().passively_safe(states, times)
        safe += int(model.sum())
        both += int((model & planner).sum())
        alone += int((planner & ~model).sum())
    print(f"{kind}: {safe} safe states, {both / safe:.4f} proven; proven alone: {alone}")
    return safe, both, alone


@pytest.mark.parametrize("kind", ROBOTS)
def test_nearly_every_state_that_is_safe_without_a_grid_is_proven_on_it(kind):
    safe, both, alone = agreement(kind, range(10), 150)
    assert safe > 300
    assert both >= (LEAST[kind] - SMALL_SAMPLE) * safe
    assert alone == 0


@pytest.mark.campaign
@pytest.mark.parametrize("kind", ROBOTS)
def test_nearly_every_state_that_is_safe_without_a_grid_is_proven_in_a_campaign(kind):
    safe, both, alone = agreement(kind, range(1000, 1000 + SEEDS), 400)
    assert both >= LEAST[kind] * safe
    assert alone == 0
