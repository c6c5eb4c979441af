"""The viability kernel, and control inside it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import passpmp_ti as pti
from passpmp_ti import device
from passpmp_ti.planner.baselines.known import KnownWorld
from passpmp_ti.planner.baselines.lattice import HEADINGS, LEVELS, STANDING, Lattice
from passpmp_ti.planner.baselines.motion import Motion
from passpmp_ti.planner.baselines.viability import Viability
from passpmp_ti.planner.baselines.viability_kernel import ViabilityKernel, half_move
from passpmp_ti.sim.movers import NoMovers, PathMovers
from passpmp_ti.sim.patrol import PatrolMovers, PatrolSource
from passpmp_ti.sim.planners import known_world, planner_for

CHAIR = pti.DifferentialDrive(wheel_speed=2.0)
SETTINGS = pti.Settings.for_robot(CHAIR)
PATROL = Path(__file__).parents[1] / "examples" / "patrol.yaml"
ROUND = ((0.0, -2.0, 0.0), (4.0, 4.0, 0.0), (8.0, -2.0, 0.0))


def far(points):
    return np.full(len(points), 99.0)


def lattice_of(robot=CHAIR, period=None):
    settings = pti.Settings.for_robot(robot)
    return Lattice(Motion(robot, settings), half_move(settings, period))


def a_patrol(width=3.0):
    """A guard to and fro along a strip, 8 s a round."""
    movers = PatrolMovers(PathMovers([np.array(ROUND)], np.array([0.25])), 8.0)
    return KnownWorld(bounds=(-4, -width, 6, width), clearance=far, movers=movers, period=8.0)


@pytest.fixture(scope="module")
def kernel():
    world = a_patrol()
    return ViabilityKernel.computed(lattice_of(period=8.0), world, begin=0.3)


@pytest.mark.parametrize("robot", [CHAIR, pti.CarLike()], ids=["chair", "car"])
def test_moves_are_what_the_robot_can_drive_and_end_at_their_level(robot):
    lattice = lattice_of(robot)
    assert lattice.duration == pytest.approx(1.0)
    for move in lattice.moves:
        begin = np.concatenate([[3.0, 2.0, 1.0], lattice.speeds(move.before)])
        path = lattice.drive(begin, 0.0, move)
        robot.check_states("test", path.states)
        assert robot.at_rest(path.states[-1])
        end = path.at(lattice.duration)
        assert np.abs(end[3:] - lattice.speeds(move.after)).max() < 1e-5
        # the brakes alone are enough for every change of a wheel's speed
        change = np.abs(np.diff(path.states[:, 3], axis=0)) / np.diff(path.times)
        assert change.max() <= robot.deceleration * (1 + 1e-4)
        turned = np.sign(round(end[2] - 1.0, 6))
        forwards = LEVELS[move.before] + LEVELS[move.after] >= 0
        assert turned in (0, move.turn if forwards else -move.turn, move.turn)


def test_from_every_viable_state_some_move_stays_viable_and_touches_nothing(kernel):
    # where in its cell and heading the robot really is, is drawn at random: none may be a trap
    lattice, movers = kernel.lattice, kernel.world.movers
    generator = np.random.default_rng(3)
    tried = moves_made = 0
    while tried < 25:
        k = int(generator.integers(len(kernel.slices)))
        h, j, i = (int(generator.integers(n)) for n in kernel.slices[k].shape)
        levels = [n for n in range(len(LEVELS)) if kernel.slices[k][h, j, i] >> n & 1]
        if not levels:
            continue
        tried += 1
        level = int(generator.choice(levels))
        place = (np.array([i, j]) + generator.random(2)) * lattice.cell + kernel.world.bounds[:2]
        heading = (h + generator.random() - 0.5) * 2 * np.pi / HEADINGS
        state = np.concatenate([place, [heading], lattice.speeds(level)])
        time = kernel.begin + k * lattice.duration
        for _ in range(6):
            assert kernel.viable(state, level, time)
            moves = [m for m in lattice.moves if m.before == level]
            paths = [lattice.drive(state, time, m) for m in moves]
            kept = [n for n, m in enumerate(moves) if kernel.keeps(m, paths[n], time)]
            assert kept
            n = int(generator.choice(kept))
            times = np.linspace(time, time + lattice.duration, 40)
            apart = paths[n].sampled(times)[:, :2] - movers.positions(times)[:, 0]
            assert (np.hypot(*apart.T) > CHAIR.radius + 0.25).all()
            time, level = time + lattice.duration, moves[n].after
            state = paths[n].at(time)
            state[3:] = lattice.speeds(level)
            moves_made += 1
    assert moves_made == 150


def test_the_kernel_repeats_with_the_world_and_keeps_out_of_its_way(kernel):
    assert len(kernel.slices) == 8
    ahead = np.array([2.0, 0.1, 0.0, 0.0, 0.0])
    aside = np.array([2.0, 2.5, 0.0, 0.0, 0.0])
    for time in kernel.begin + np.arange(16):
        assert kernel.viable(aside, STANDING, time)
        assert kernel.viable(ahead, STANDING, time) == kernel.viable(ahead, STANDING, time + 8)
    # where the guard is
    assert not kernel.viable(np.array([*kernel.world.movers.at(4.3)[0], 0, 0, 0]), STANDING, 4.3)


def test_nothing_is_viable_where_there_is_no_room_beside_the_patrol():
    world = replace(a_patrol(width=0.5), bounds=(-2.2, -0.5, 4.2, 0.5))
    kernel = ViabilityKernel.computed(lattice_of(period=8.0), world, begin=0.0)
    assert not any(s.any() for s in kernel.slices)


def test_standing_is_viable_for_ever_once_the_world_has_frozen():
    path = np.array([[0.0, -2.0, 0.0], [3.0, 1.0, 0.0]])
    world = KnownWorld(
        bounds=(-4, -3, 6, 3), clearance=far, movers=PathMovers([path], np.array([0.25])),
        freezes_at=3.0,
    )  # fmt: skip
    kernel = ViabilityKernel.computed(lattice_of(), world, begin=0.0)
    assert len(kernel.slices) == 4
    still = np.array([3.0, 0.0, 0.0, 0.0, 0.0])
    assert kernel.viable(still, STANDING, 0.0)
    assert kernel.viable(still, STANDING, 50.0)
    # at the edge of the world it cannot stop any more
    edge = np.array([5.9, 0.0, 0.0, *lattice_of().speeds(LEVELS.index(2))])
    assert not kernel.viable(edge, LEVELS.index(2), 50.0)


def test_a_device_computes_the_same_kernel():
    world = replace(a_patrol(), bounds=(-1, -2, 2, 2))
    here = ViabilityKernel.computed(lattice_of(period=8.0), world, begin=0.0)
    with device.forced():
        there = ViabilityKernel.computed(lattice_of(period=8.0), world, begin=0.0)
    assert all(np.array_equal(a, b) for a, b in zip(here.slices, there.slices, strict=True))
    assert here.slices[0].any()


def test_it_gets_past_guards_on_patrol_without_a_touch():
    scenario = pti.load_scenario(PATROL)
    episode = pti.simulate(scenario, planner=planner_for("viability", scenario))
    told = episode.summary()
    assert told["reached_goal"]
    assert told["collisions_moving"] == told["collisions_at_rest"] == 0
    assert {r.decision for r in episode.records} == {"new", "held", "arrived"}


def test_what_is_not_known_for_ever_is_refused():
    with pytest.raises(ValueError, match=r"Viability\.world is missing"):
        Viability(CHAIR, SETTINGS, goal=(1.0, 0.0))
    with pytest.raises(ValueError, match="not known for ever"):
        planner_for("viability", pti.load_scenario("crowded"))
    with pytest.raises(ValueError, match="one of period and freezes_at"):
        KnownWorld(bounds=(0, 0, 1, 1), clearance=far, movers=NoMovers())
    with pytest.raises(ValueError, match="must divide it"):
        Viability(CHAIR, SETTINGS, goal=(1.0, 0.0), world=replace(a_patrol(), period=7.77))
    huge = replace(a_patrol(), bounds=(-4000, -4000, 4000, 4000))
    with pytest.raises(ValueError, match="too many to work out"):
        ViabilityKernel.computed(lattice_of(period=8.0), huge, begin=0.0)


def test_the_future_of_a_scenario_is_told_by_what_moves_it():
    assert known_world(pti.load_scenario(PATROL)).period == 12.0
    assert known_world(pti.load_scenario("simple")).freezes_at == 40.0
    assert known_world(pti.load_scenario("u_shape")).freezes_at == 0.0


def test_rounds_that_do_not_close_or_differ_in_time_are_refused():
    with pytest.raises(ValueError, match="must end where it begins"):
        PatrolSource(paths=(((0.0, 0.0, 0.0), (4.0, 1.0, 0.0)),), radius=(0.2,))
    with pytest.raises(ValueError, match=r"discs\[1\].*one period, here 8 s"):
        PatrolSource(paths=(ROUND, tuple((t / 2, x, y) for t, x, y in ROUND)), radius=(0.2, 0.2))
    slowed = PatrolSource(paths=(ROUND,), radius=(0.2,)).paced(0.75)
    assert (slowed.period, slowed.top_speed) == (16.0, 0.75)


def test_a_round_of_a_scenario_file_is_refused_with_its_line(tmp_path):
    text = PATROL.read_text()
    assert "[12, 4, 3.3]" in text
    (tmp_path / "open.yaml").write_text(text.replace("[12, 4, 3.3]", "[12, 4, 3.2]"))
    with pytest.raises(ValueError, match=r"open\.yaml.*\n?.*must end where it begins"):
        pti.load_scenario(tmp_path / "open.yaml")
