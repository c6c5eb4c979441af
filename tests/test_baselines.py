"""Other planners behind the navigator's door."""

from dataclasses import replace

import numpy as np
import pytest

import passpmp_ti as pti
from passpmp_ti import device
from passpmp_ti.cli import BAD_INPUT, main
from passpmp_ti.planner.baselines.cycle import Sight
from passpmp_ti.planner.baselines.dynamic_window import DynamicWindow, smoothed
from passpmp_ti.planner.baselines.input_space import Fan, InputSpaceSampling
from passpmp_ti.planner.baselines.motion import Motion
from passpmp_ti.planner.baselines.mppi import Mppi
from passpmp_ti.planner.baselines.names import BASELINES, baseline
from passpmp_ti.planner.baselines.obstacles import Obstacles
from passpmp_ti.planner.baselines.passpmp import Passpmp
from passpmp_ti.sim.planners import planner_for

REACTIVE = {"iss": InputSpaceSampling, "dwa": DynamicWindow, "mppi": Mppi}
CHAIR = pti.DifferentialDrive(wheel_speed=2.0)


def settings_for(robot, **changes):
    return pti.Settings.for_robot(robot, **changes)


def scan_of(points, stamp=0.0, pose=(0.0, 0.0, 0.0)):
    """A full sweep with returns nearest to some points, and nothing else in 10 m."""
    ranges = np.full(720, np.inf)
    d = np.asarray(points, dtype=float).reshape(-1, 2) - pose[:2]
    beams = np.round((np.arctan2(d[:, 1], d[:, 0]) - pose[2]) / (2 * np.pi / 720)).astype(int)
    np.minimum.at(ranges, beams % 720, np.hypot(*d.T))
    return pti.Scan(ranges, 0.0, 2 * np.pi / 720, 10.0, pose, stamp)


def wall(x, y_low, y_high):
    y = np.arange(y_low, y_high, 0.02)
    return np.stack([np.full_like(y, x), y], axis=1)


def sight_of(scan, goal=(5.0, 0.0), speed=0.0, cycle=0.1):
    return Sight((scan,), np.array([0.0, 0.0, 0.0, speed, speed]), scan.stamp + cycle, goal)


def driven(planner, scans_at, cycles):
    """States [cycles, 5] of a robot that takes every answer."""
    state, held, states = np.zeros(5), None, []
    for k in range(cycles):
        stamp = k * planner.settings.cycle
        state = state if held is None else held.at(stamp)
        held = planner.update(scans_at(state, stamp), state)
        states.append(state)
    return np.array(states)


@pytest.mark.parametrize("name", sorted(BASELINES))
def test_each_drives_simple_to_its_goal(name):
    scenario = pti.load_scenario("simple").changed({"cell": 0.5})
    scenario = replace(scenario, bounds=(10, 60, 170, 120))  # what viability is worked out for
    episode = pti.simulate(scenario, planner=planner_for(name, scenario))
    assert episode.summary()["reached_goal"]
    if name in ("passpmp", "viability"):
        assert episode.summary()["collisions_moving"] == 0


@pytest.mark.parametrize("name", sorted(REACTIVE))
@pytest.mark.parametrize("robot", [CHAIR, pti.CarLike()], ids=["chair", "car"])
def test_an_answer_starts_a_cycle_later_where_the_robot_will_be_and_ends_at_rest(name, robot):
    planner = REACTIVE[name](robot, settings_for(robot), goal=(40.0, 0.0))
    state, held = np.zeros(5), None
    for k in range(4):
        stamp = 0.1 * k
        if held is not None:
            state = held.at(stamp)
        answer = planner.update(scan_of([], stamp, tuple(state[:3])), state)
        assert answer.start == pytest.approx(stamp + 0.1)
        there = state if held is None else held.at(answer.start)
        assert np.abs(answer.states[0] - there).max() < 1e-5
        assert robot.at_rest(answer.states[-1])
        robot.check_states("test", answer.states)
        assert planner.record.decision == "new"
        held = answer
    assert robot.speed(held.at(0.4)) > 0


@pytest.mark.parametrize("name", sorted(REACTIVE))
def test_each_stops_before_a_wall_that_stands(name):
    planner = REACTIVE[name](CHAIR, settings_for(CHAIR), goal=(5.0, 0.0), seed=1)
    barrier = wall(3.0, -9.0, 9.0)
    states = driven(planner, lambda s, t: scan_of(barrier, t, tuple(s[:3])), 60)
    assert 0.5 < states[:, 0].max() < 3.0 - CHAIR.radius


@pytest.mark.parametrize("name", sorted(REACTIVE))
def test_the_same_seed_gives_the_same_bytes(name):
    def once():
        planner = REACTIVE[name](CHAIR, settings_for(CHAIR), goal=(5.0, 0.0), seed=7)
        post = wall(2.0, -0.2, 0.3)
        return driven(planner, lambda s, t: scan_of(post, t, tuple(s[:3])), 8).tobytes()

    assert once() == once()


@pytest.mark.parametrize("name", sorted(REACTIVE))
def test_a_device_gives_the_answer_of_the_host(name):
    def once():
        planner = REACTIVE[name](CHAIR, settings_for(CHAIR), goal=(5.0, 0.0), seed=7)
        return planner.update(scan_of(wall(2.0, -0.2, 0.3)), np.zeros(5)).states

    here = once()
    with device.forced():
        assert np.array_equal(once(), here)


def test_only_mppi_depends_on_the_seed():
    for name, made in REACTIVE.items():
        answers = [
            made(CHAIR, settings_for(CHAIR), goal=(5.0, 0.0), seed=seed)
            .update(scan_of([]), np.zeros(5))
            .states.tobytes()
            for seed in (1, 2)
        ]
        assert (answers[0] != answers[1]) == (name == "mppi")


def test_a_robot_brakes_where_it_finds_nothing_free_and_without_a_scan():
    planner = InputSpaceSampling(CHAIR, settings_for(CHAIR), goal=(5.0, 0.0))
    first = planner.update(scan_of([]), np.zeros(5))
    state = first.at(0.1)
    angles = np.linspace(-np.pi, np.pi, 720)
    ring = 0.42 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    answer = planner.update(scan_of(ring, 0.1), state)
    assert (planner.record.decision, planner.record.reason) == ("brake", "no motion is free")
    assert answer.duration <= CHAIR.longest_braking
    assert planner.update(None, answer.at(0.2)) is answer
    assert planner.record.lost_scan == "no scan at all"


def test_a_robot_that_is_not_on_its_plan_brakes_where_it_is():
    planner = DynamicWindow(CHAIR, settings_for(CHAIR), goal=(5.0, 0.0))
    planner.update(scan_of([]), np.zeros(5))
    moved = np.array([0.0, 1.0, 0.0, 0.5, 0.5])
    answer = planner.update(scan_of([], 0.1, (0.0, 1.0, 0.0)), moved)
    assert planner.record.decision == "brake"
    assert "off its plan" in planner.record.reason
    assert np.array_equal(answer.states[0], moved)


def test_an_answer_that_was_not_taken_is_planned_on_from_what_is_followed_instead():
    planner = DynamicWindow(CHAIR, settings_for(CHAIR), goal=(5.0, 0.0))
    planner.update(scan_of([]), np.zeros(5))
    standing = pti.Trajectory.resting(np.zeros(5), 0.0)
    answer = planner.update(scan_of([], 0.1), np.zeros(5), following=standing)
    assert planner.record.decision == "new"
    assert np.array_equal(answer.states[0], np.zeros(5))


def test_goals_are_reached_in_turn_at_rest():
    goals = [(0.8, 0.0), (1.6, 0.0)]
    planner = DynamicWindow(CHAIR, settings_for(CHAIR), goal=goals)
    states = driven(planner, lambda s, t: scan_of([], t, tuple(s[:3])), 70)
    assert planner.reached
    stops = states[CHAIR.at_rest(states)][:, 0]
    for x, _ in goals:
        assert np.abs(stops - x).min() <= planner.settings.goal_tolerance


def test_motions_are_told_when_they_touch_and_where_they_end():
    settings = settings_for(CHAIR, cell=0.02)
    motion = Motion(CHAIR, settings)
    sight = sight_of(scan_of(wall(2.0, -3, 3)), speed=1.0)
    obstacles = Obstacles.seen(sight.scans, (0.0, 0.0), 5.0, settings.cell)
    straight, spin = [[1.0, 1.0]], [[-1.0, 1.0]]
    targets = np.array([straight, spin])
    found = obstacles.tried(motion, sight.root, sight.goal, targets, 200)
    mean, last, free, gap = found[0]
    # at 1 m/s towards a goal 5 m away, past the wall: from 5 to 3 m in 2 s
    assert (mean, last) == pytest.approx((4.0, 3.0), abs=0.01)
    # the disc of 0.4 m meets the wall after 1.6 m, or up to three cells earlier
    assert 100 * (1.6 - 3 * settings.cell) <= free <= 161
    assert gap < 0.02
    assert found[1, 2] == 200


def test_the_distance_to_returns_is_never_told_too_long():
    generator = np.random.default_rng(4)
    settings = settings_for(CHAIR)
    points = generator.uniform(-3, 3, (40, 2))
    scan = scan_of(points)
    obstacles = Obstacles.seen((scan,), (0.3, -0.2), 4.0, settings.cell)
    places = generator.uniform(-2, 2, (300, 2))
    true = np.hypot(*(places[:, None] - scan.points()).transpose(2, 0, 1)).min(axis=1)
    own = places - obstacles.centre
    i, j = np.floor((own - obstacles.frame[:2]) * obstacles.frame[2]).astype(int).T
    told = obstacles.gaps[j, i] - 2**0.5 * settings.cell
    assert (told <= true + 1e-5).all()
    assert (true - told).max() <= 2 * 2**0.5 * settings.cell + 1e-5


def test_iss_tries_eleven_motions_and_ignores_what_moves():
    fan = Fan(CHAIR, settings_for(CHAIR), 2.0)
    free = fan.plan(sight_of(scan_of([])))
    assert abs(free.states[-1, 1]) < 1e-5
    # a post straight ahead: it passes to one side, as near as it is free now
    around = fan.plan(sight_of(scan_of(wall(1.2, -0.1, 0.1))))
    gap = np.hypot(*(around.states[: around.brakes_from, :2] - (1.2, 0.0)).T).min()
    assert gap > CHAIR.radius
    assert len(fan._turns) == 11


def test_smoothing_is_the_mean_of_neighbours():
    score = np.zeros((3, 3))
    score[1, 1] = 9.0
    assert np.array_equal(smoothed(score), np.ones((3, 3)))


def test_passpmp_keeps_everything_of_the_navigator_but_its_choice():
    planner = Passpmp(CHAIR, settings_for(CHAIR, cycle=0.2), goal=(5.0, 0.0))
    assert planner.settings == settings_for(
        CHAIR, cycle=0.2, guide="euclidean", distance="final", optimizer="exhaustive",
        weight_turn=0.0,
    )  # fmt: skip


def test_names_are_resolved_and_a_misspelt_one_is_refused():
    assert baseline("passpmp-pso") is pti.Navigator
    assert baseline("iss") is InputSpaceSampling
    with pytest.raises(ValueError, match="did you mean 'viability'"):
        baseline("viabilty")
    with pytest.raises(ValueError, match=r"InputSpaceSampling\.horizon must be finite and >="):
        InputSpaceSampling(CHAIR, settings_for(CHAIR), goal=(1.0, 0.0), horizon=0.0)
    with pytest.raises(ValueError, match=r"Mppi\.goal"):
        Mppi(CHAIR, settings_for(CHAIR), goal=(1.0, 0.0, 3.0))


def test_the_command_runs_a_planner_by_name(tmp_path, capsys):
    file = tmp_path / "open.yaml"
    file.write_text(
        "description: in the open\nrobot: {type: differential}\n"
        "settings: {object_speed: 1.0}\nlidars: [{range_max: 8, beams: 360}]\n"
        "world: {bounds: [-5, -5, 5, 5]}\nstart: [0, 0, 0]\ngoals: [[1, 0]]\nduration: 4\n"
    )
    out = tmp_path / "out"
    assert main(["run", str(file), "--planner", "dwa", "--out", str(out), "--no-video"]) == 0
    assert (out / "summary.json").exists()
    assert main(["run", str(file), "--planner", "isss"]) == BAD_INPUT
    assert "did you mean 'iss'" in capsys.readouterr().err
    assert main(["run", str(file), "--planner", "dwa", "--certificates", str(out)]) == BAD_INPUT
    assert "dwa proves nothing" in capsys.readouterr().err


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["passpmp", "iss"])
def test_the_u_shape_traps_what_looks_for_the_nearest_place(name):
    scenario = replace(pti.load_scenario("u_shape"), duration=60)
    summary = pti.simulate(scenario, planner=planner_for(name, scenario)).summary()
    assert not summary["reached_goal"]
    assert summary["collisions_moving"] == 0


@pytest.mark.campaign
def test_iss_is_touched_under_way_in_the_crowd():
    scenario = pti.load_scenario("crowded")
    touched = [
        pti.simulate(scenario, seed=seed, planner=InputSpaceSampling).summary()["collisions_moving"]
        for seed in range(5)
    ]
    assert sum(touched) > 0
