"""The check against eq. 6 as it is written, and against a closed form from the literature."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import strategies as st
from oracle import exact, margins, scenes
from oracle.hunt import Hunt

from passpmp_ti import FutureModel, Settings
from passpmp_ti.settings import LOOK

HUNT = Hunt()
NEVER = 65535


@pytest.mark.campaign
@pytest.mark.parametrize("name", HUNT.properties)
def test_every_property_at_length(name):
    HUNT.at_length(name)


@HUNT.searched(30, st.sampled_from([scenes.ROUND_CHAIR, scenes.cases.LONG_CHAIR]), scenes.seeds)
def test_equation_6_holds_as_it_is_written(robot, seed):
    """Some braking control, at all of its samples, is clear on a grid drawn at random."""
    generator = np.random.default_rng(seed)
    settings = Settings(cell=0.25, window=32, object_speed=8.0)
    scan = exact.sweep(exact.world_of(), (0.0, 0.0, 0.0), 90, 2 * np.pi, 3.0, 2.0)
    ticks = generator.choice([0, 300, 900, 1500, 4000, NEVER], (32, 32), p=[0.01, *[0.198] * 5])
    model = FutureModel.from_scan(scan, robot, settings)
    model = replace(model, ticks=ticks.astype(np.uint16))
    states = np.zeros((15, 5))
    states[:, :2] = generator.uniform(-2, 2, (15, 2))
    states[:, 2] = generator.uniform(-3, 3, 15)
    states[:, 3:] = generator.uniform(-1.5, 1.5, (15, 2))
    times = 2.0 + 0.001 * generator.integers(0, 300, 15)
    proof = model.proving_brakes(states, times)
    for n in range(len(states)):
        answers = [clear_by_hand(model, states[n], times[n], c) for c in robot.braking]
        if None not in answers:
            assert proof[n] == (answers.index(True) if True in answers else -1)


def clear_by_hand(model, state, time, control):
    """Whether braking by one control touches nothing; None: too near to an edge to tell."""
    settings, robot = model.settings, model.robot
    path = exact.midpoint_path(robot, state[None], control, settings.time_step)[0]
    start = round((time - model.base) * 1000)
    for n in range(len(path) - 1):
        for offset, _ in robot.discs:
            ends = path[n : n + 2, :2] + offset * np.stack(
                [np.cos(path[n : n + 2, 2]), np.sin(path[n : n + 2, 2])], axis=1
            )
            # a step is cut into pieces, each looked at in its middle and judged at its end
            way = np.linalg.norm(ends[1] - ends[0]) + settings.object_speed * settings.time_step
            pieces = way / (2 * LOOK * settings.cell)
            count = int(np.ceil(pieces))
            if abs(pieces - round(pieces)) < 1e-4:
                return None
            for k in range(count):
                place = ends[0] + (k + 0.5) / count * (ends[1] - ends[0])
                place = (place - model.origin) / model.cell
                if (np.abs(place - np.round(place)) < 1e-4).any():
                    return None
                end = (
                    start + n * settings.step_ms + int(np.ceil((k + 1) * settings.step_ms / count))
                )
                i, j = np.floor(place).astype(int)
                inside = 0 <= i < model.shape[1] and 0 <= j < model.shape[0]
                ticks = model.ticks[j, i] if inside else 0
                if ticks <= end and ticks != NEVER:
                    return False
    return True


@HUNT.searched(
    30,
    scenes.scenes(robots=(scenes.ROUND_CHAIR, scenes.ROUND_CAR), lidars=(1,), lost=False),
    scenes.seeds,
)
def test_it_is_safe_where_the_separation_of_mitsch_et_al_holds(case, seed):
    """|p - o| > v^2 / 2b + V v / b (RSS 2013, passive safety) against every possible object.

    The state is judged while it brakes, so A = 0 and e = 0: the robot has no cycle left in which it
    could speed up. o is any point that was not seen to be empty, since then as fast as V; v is the
    fastest wheel's speed, since both brake in proportion and stop together.
    """
    robot, bound = case.robot, case.settings.object_speed
    (scan,) = case.scans
    states, times = scenes.states_for(case, seed, 400)
    wheels = slice(3, 4 if robot.kind == exact.CAR else 5)
    v = np.abs(states[:, wheels]).max(axis=1)
    room = exact.room(scan, states[:, :2]) - robot.disc_radius - bound * (times - scan.stamp)
    needed = v**2 / (2 * robot.deceleration) + bound * v / robot.deceleration
    apart = room > needed + margins.stated_margin(case, len(scan.ranges))
    assert case.model().passively_safe(states, times)[apart].all()
