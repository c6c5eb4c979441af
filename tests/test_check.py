"""The check of a path against arrivals: nothing is jumped over, nothing is judged too early."""

from dataclasses import replace

import numpy as np
import pytest
from oracle import exact

from passpmp_ti import CarLike, DifferentialDrive, FutureModel, Settings
from passpmp_ti.kernels.arrival import NEVER
from passpmp_ti.planner.plan import braking_from

CAR = CarLike()
SETTINGS = Settings.for_robot(CAR, cell=0.25, object_speed=20.0, range_noise=0.0)


def model_with(arrivals, robot=CAR, settings=SETTINGS):
    """A model in which nothing ever arrives but at some columns: {column: tick}."""
    scan = exact.sweep(exact.world_of(), (0.0, 0.0, 0.0), 90, 2 * np.pi, 20.0, 0.0)
    model = FutureModel.from_scan(scan, robot, settings)
    ticks = np.full_like(model.ticks, NEVER)
    for column, tick in arrivals.items():
        ticks[:, column - model.window.corner[0]] = tick
    return replace(model, ticks=ticks)


def straight(speed, start, count, step=SETTINGS.time_step):
    """(states, times) of a car along x at one speed."""
    times = step * np.arange(count)
    states = np.zeros((count, 5))
    states[:, 0], states[:, 3] = start + speed * times, speed
    return states, times


@pytest.mark.parametrize("speed", [0.3, 5.0, 20.0])
def test_no_column_of_cells_is_jumped_over(speed):
    model = model_with({6: 0})
    for start in np.linspace(0, 0.4, 29):
        states, times = straight(speed, start, round(3.0 / speed / 0.02) + 2)
        assert model.touched(states, times).any()


@pytest.mark.parametrize("speed", [0.3, 5.0, 20.0])
def test_a_cell_is_judged_no_earlier_than_it_is_left(speed):
    # the middle of column 6 is at 1.625 m
    generator = np.random.default_rng(0)
    states, times = straight(speed, 0.0, round(3.0 / speed / 0.02) + 2)
    there = 1.625 / speed * 1000
    piece = 20.0
    for early in generator.uniform(0, 0.5 * there, 20):
        assert model_with({6: int(there - early)}).touched(states, times).any()
    left = 1.75 / speed * 1000
    assert not model_with({6: int(left + piece) + 2}).touched(states, times).any()


def test_a_robot_that_turns_on_the_spot_is_looked_at():
    # neither it nor anybody else gets anywhere: its way is none, and still it is looked at once
    chair = DifferentialDrive()
    settings = Settings.for_robot(chair, object_speed=0.0)
    states = np.zeros((3, 5))
    states[:, 2], states[:, 3:] = [0.0, 0.01, 0.02], [0.5, -0.5]
    model = model_with({0: 0}, chair, settings)
    assert model.touched(states, settings.time_step * np.arange(3))[:2].all()


def test_samples_too_far_apart_are_not_judged_clear():
    states, times = straight(1.0, 0.0, 10)
    assert not model_with({}).touched(states, times).any()
    assert model_with({}).touched(states, 2 * times)[:-1].all()
    assert not model_with({}).touched(states, 0.5 * times).any()


def test_a_robot_at_rest_is_never_touched():
    states = np.zeros((3, 5))
    assert not model_with({0: 0}).touched(states, 0.02 * np.arange(3)).any()


def test_the_braking_check_agrees_with_the_check_of_its_own_path():
    generator = np.random.default_rng(1)
    model = model_with({c: int(generator.integers(0, 3000)) for c in range(-30, 30)})
    agreed = {True: 0, False: 0}
    for _ in range(200):
        state = np.array([*generator.uniform(-3, 3, 2), *generator.uniform(-3, 3, 1), 0.0, 0.0])
        state[3] = generator.uniform(1, 12)
        proof = int(model.proving_brakes(state[None], np.array([0.1]))[0])
        paths = [braking_from(model, state, 0.1, k) for k in range(len(CAR.braking))]
        clear = [not model.touched(p.states, p.times).any() for p in paths]
        assert (proof >= 0) == any(clear)
        if proof >= 0:
            assert proof == clear.index(True)
        agreed[proof >= 0] += 1
    assert min(agreed.values()) > 20
