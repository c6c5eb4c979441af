"""BARN and DynaBARN: worlds, judge, score, and what is kept of their trials."""

import argparse
import os
from pathlib import Path

import numpy as np
import pytest

from passpmp_ti import Settings
from passpmp_ti.benchmark import barn, dynabarn
from passpmp_ti.benchmark.barn_page import document, page
from passpmp_ti.benchmark.barn_worlds import (
    GOAL,
    PUBLISHED,
    START,
    BarnWorld,
    read_published,
    read_worlds,
    score,
)
from passpmp_ti.benchmark.campaign import Campaign, carry_out_all, outcome_of, read_all
from passpmp_ti.benchmark.course import Course
from passpmp_ti.benchmark.dynabarn_worlds import (
    BORDER,
    KEEP_OUT,
    OUTSIDE,
    Crossing,
    CrossingSource,
    class_of,
    movers_of,
    outwards,
)
from passpmp_ti.benchmark.dynabarn_worlds import read_worlds as read_dynabarn
from passpmp_ti.benchmark.jackal import ACCELERATION_LIMITS, JACKAL, LENGTH, TURN_RATE, WIDTH
from passpmp_ti.benchmark.options import chosen_worlds
from passpmp_ti.benchmark.rectangle import gaps_to_discs, gaps_to_walls
from passpmp_ti.compare.workers import Here
from passpmp_ti.grid.body import Body, to_poses, to_states
from passpmp_ti.kernels.check import trace
from passpmp_ti.sim.data_files import DATA, REPOSITORY
from passpmp_ti.sim.episode import simulate
from passpmp_ti.sim.scenario import Scenario

RECORDED = Path(os.environ.get(DATA, REPOSITORY.parent / "shared" / "data"))


def needs(folder):
    """Skips a test where the data of a benchmark is absent."""
    return pytest.mark.skipif(
        not (RECORDED / folder).is_dir(),
        reason=f"the data of {folder} is absent; set PASSPMP_DATA to the folder that holds it",
    )


# the robot


def traced(controls, state, steps):
    """[n, 5] states of the Jackal through some controls, each for some steps (-1: to rest)."""
    settings = Settings.for_robot(JACKAL)
    path, length = np.empty((400, 7), np.float32), np.zeros(1, np.int32)
    trace(
        JACKAL.kind, Body.of(JACKAL, settings).numbers, to_poses(np.array([state]), (0.0, 0.0)),
        np.array(controls, np.float32), np.array(steps, np.int32), path, length,
    )  # fmt: skip
    return to_states(path[: length[0]], (0.0, 0.0))


def turn_rates(states):
    return (states[:, 3] - states[:, 4]) / JACKAL.track


def test_no_control_turns_the_jackal_faster_than_its_controller_allows():
    for control in JACKAL.controls:
        for state in ([0, 0, 0, 0.0, 0.0], [0, 0, 0, 2.0, 0.6], [0, 0, 0, 0.2, -1.2]):
            states = traced([control], state, [100])
            assert np.abs(turn_rates(states)).max() <= TURN_RATE + 1e-5
            rates = np.abs(np.diff(states[:, 3:], axis=0)) / Settings.for_robot(JACKAL).time_step
            assert rates.max() <= JACKAL.acceleration * (1 + 1e-3)
    spun = traced([next(c for c in JACKAL.controls if c[1] > 0 > c[2])], [0] * 5, [100])
    assert turn_rates(spun)[-1] == pytest.approx(TURN_RATE, abs=1e-5)


def test_braking_keeps_below_the_limit_too():
    for control in JACKAL.braking:
        for state in ([0, 0, 0, 2.0, 0.5], [0, 0, 0, 0.7, -0.7], [0, 0, 0, 0.3, 1.8]):
            states = traced([control], state, [-1])
            assert np.abs(turn_rates(states)).max() <= TURN_RATE + 1e-5
            assert not states[-1, 3:].any()


def test_wheels_keep_both_limits_of_the_benchmark():
    assert JACKAL.acceleration <= ACCELERATION_LIMITS[0]
    assert 2 * JACKAL.acceleration / JACKAL.track <= ACCELERATION_LIMITS[1]


def test_states_that_turn_too_fast_are_refused():
    with pytest.raises(
        ValueError, match=r"states\[0\]: \|v_r - v_l\| / track = 5\.3.*limit 4 rad/s"
    ):
        JACKAL.check_states("model", [[0, 0, 0, 1.0, -1.0]])


def test_the_discs_cover_the_rectangle():
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 201) * LENGTH, np.linspace(-0.5, 0.5, 201) * WIDTH)
    reach = [np.hypot(x - offset, y) for offset, _ in JACKAL.discs]
    assert (np.min(reach, axis=0) <= JACKAL.disc_radius + 1e-9).all()


# the judge


def gap_of(states, centres, radius=0.1):
    """[n - 1] gap of a 2 m x 1 m rectangle to one disc at some centres [n, 2]."""
    states = np.array([[*s, 0.0, 0.0] for s in states], dtype=float)
    return gaps_to_discs((2.0, 1.0), states, np.array(centres)[:, None], np.array([radius]))[:, 0]


def test_gaps_are_those_of_the_rectangle():
    here = [(0, 0, 0)] * 2
    assert gap_of(here, [(0, 0.8)] * 2) == pytest.approx(0.2)  # beside it
    assert gap_of(here, [(1.3, 0.9)] * 2) == pytest.approx(0.4)  # 0.3 and 0.4 from the corner
    assert gap_of(here, [(0.2, 0.1)] * 2) == pytest.approx(-0.1)  # inside
    turned = [(5, 5, np.pi / 2)] * 2  # its long side is along y now
    assert gap_of(turned, [(5.9, 5)] * 2) == pytest.approx(0.3)
    assert gap_of(turned, [(5, 6.3)] * 2) == pytest.approx(0.2)


def test_what_is_only_touched_between_two_samples_is_touched():
    # past a corner: at both ends 0.3 m away, between them the way cuts it
    assert gap_of([(0, 0, 0)] * 2, [(1.2, 0.2), (0.7, 0.7)], radius=0.05) == pytest.approx(-0.05)
    # turning by 0.02 rad, as in a step of the judge: the straight way is off by what it tells
    turned = gap_of([(0, 0, -0.01), (0, 0, 0.01)], [(1.2, 0.0)] * 2)
    assert turned == pytest.approx(0.1, abs=2e-4)


def test_gaps_to_walls():
    states = np.array([[0, 0, 0, 0, 0], [0, 0, np.pi / 2, 0, 0]], dtype=float)
    wall = np.array([[1.5, -3.0, 1.5, 3.0]])
    assert gaps_to_walls((2.0, 1.0), states, wall) == pytest.approx([0.5, 1.0])
    assert np.isinf(gaps_to_walls((2.0, 1.0), states, np.zeros((0, 4)))).all()


# BARN


def test_the_score_is_the_optimal_time_over_the_clipped_one():
    assert score(True, 12.0, 6.0) == 0.5
    assert score(True, 7.0, 6.0) == 0.5  # no more for less than twice the optimal time
    assert score(True, 24.0, 6.0) == 0.25
    assert score(True, 90.0, 6.0) == 0.125  # nor less for more than eight times
    assert score(False, 12.0, 6.0) == 0.0
    assert score(False, None, 6.0) == 0.0


@needs("barn")
def test_paths_and_cylinders_share_one_frame():
    worlds = read_worlds()
    assert len(worlds) == 225
    gaps = []
    for world in worlds.values():
        apart = np.hypot(*(world.path[:, None] - world.cylinders).transpose(2, 0, 1))
        gaps.append(apart.min() - world.radius)
        assert np.hypot(*(world.cylinders - START[:2]).T).min() > 2.0
    # two cells of 0.15 m to the side, and a third of one along: sqrt(0.3^2 + 0.05^2) - 0.075
    assert min(gaps) == pytest.approx(0.229, abs=5e-4)
    assert np.median(gaps) == pytest.approx(0.229, abs=5e-4)


@needs("barn")
def test_published_results_are_what_their_authors_tell():
    published = read_published()
    assert set(published) == set(PUBLISHED)
    assert all(len(of) == 25 for of in published.values())

    # of 25 of the 50 public worlds; over all 50: 0.85, 0.936, 0.98 and 0.159, 0.372, 0.489
    told = {"dwa": (0.84, 0.1572), "drl_vo": (0.924, 0.3628), "lics": (0.984, 0.4903)}
    for planner, (success, its_score) in told.items():
        worlds = published[planner].values()
        assert np.mean([w["success"] for w in worlds]) == pytest.approx(success, abs=1e-4)
        assert np.mean([w["score"] for w in worlds]) == pytest.approx(its_score, abs=1e-4)


@needs("barn")
def test_optimal_times_are_those_of_the_published_scores():
    # a trial of world 288 took LiCS-KI 8.96 s on average: within twice 6.24 s, so 0.5 each
    worlds, published = read_worlds(), read_published()["lics"]
    assert worlds[288].optimal_time == pytest.approx(6.243, abs=1e-3)
    assert worlds[0].optimal_time == pytest.approx(6.796, abs=1e-3)
    for number, its in published.items():
        of_the_mean = score(True, its["time"], worlds[number].optimal_time)
        assert its["score"] == pytest.approx(its["success"] * of_the_mean, abs=0.02)


def shortened(scenario, seconds):
    import dataclasses

    return dataclasses.replace(scenario, duration=seconds)


def alley():
    """A world as BARN's, of two rows of cylinders."""
    y = np.arange(5.0, 9.0, 0.15)
    rows = [np.stack([np.full_like(y, x), y], axis=1) for x in (-2.75, -1.75)]
    path = np.stack([np.full(5, -2.25), np.linspace(5.0, 9.0, 5)], axis=1)
    return BarnWorld(number=7, cylinders=np.concatenate(rows), radius=0.075, path=path)


def test_the_jackal_goes_into_a_narrow_alley():
    scenario = shortened(barn.scenario_of(alley()), 1.6)
    course = Course(scenario.start[:2], GOAL)
    episode = simulate(scenario, on_cycle=course.see)
    told = outcome_of(episode, course)
    assert told["distance"] > 1.8  # from rest: its nose is between the rows
    assert 0 < told["nearest"] < 0.5 - 0.075 - WIDTH / 2 + 0.05
    assert not told["touched_moving"]
    assert not told["collisions_moving"]
    assert told["took"] is None
    assert course.began == pytest.approx(0.4, abs=0.15)
    assert told["fastest_turn"] <= TURN_RATE + 1e-5


def test_the_clock_runs_from_the_first_decimetre_to_a_metre_before_the_goal():
    class Info:
        """A straight way at 1 m/s, cycle by cycle."""

        world = barn.scenario_of(alley()).still_world()

        class navigator:
            settings = Settings.for_robot(JACKAL, cycle=0.1)
            robot = JACKAL

        class executing:
            @staticmethod
            def sampled(times):
                y = 3.0 + np.asarray(times)
                still = np.zeros_like(y)
                one = np.ones_like(y)
                return np.stack([still - 2.25, y, one * np.pi / 2, one, one], axis=1)

    course = Course(START[:2], GOAL)
    for k in range(120):
        Info.time = 0.1 * k
        course.see(Info)
    assert course.began == pytest.approx(0.1, abs=0.006)
    assert course.arrived == pytest.approx(9.0, abs=0.006)
    assert course.told()["took"] == pytest.approx(8.9, abs=0.01)
    assert course.told()["distance"] == pytest.approx(9.0, abs=0.01)


# DynaBARN

DIAGONAL = Crossing(
    radius=0.5,
    period=20.0,
    way=np.array([[0.0, -10.0, 5.0], [10.0, 0.0, 5.0], [20.0, 10.0, 0.0]]),
)


def test_cylinders_enter_where_they_were_published_to_appear():
    movers = movers_of([DIAGONAL], 0.0, 60.0)
    speeds = np.hypot(*np.diff(DIAGONAL.way[:, 1:], axis=0).T) / np.diff(DIAGONAL.way[:, 0])
    assert movers.top_speed == pytest.approx(speeds.max())
    for time, place in [(0.0, (-10, 5)), (10.0, (0, 5)), (30.0, (0, 5)), (35.0, (5, 2.5))]:
        here = movers.at(time)[movers.present(time)]
        assert np.hypot(*(here - place).T).min() < 1e-9
    # as one lap ends at the right the next begins at the left: two at once, and nobody jumps
    here = movers.at(20.0)[movers.present(20.0)]
    for place in ((10, 0), (-10, 5)):
        assert np.hypot(*(here - place).T).min() < 1e-9
    # a second before, it is outside, on its way straight through the border
    here = movers.at(19.0)[movers.present(19.0)]
    assert np.hypot(*(here - (-11, 5)).T).min() < 1e-9


def test_nobody_is_born_or_gone_in_sight():
    movers = movers_of([DIAGONAL], 0.0, 60.0)
    for ends in (movers.born, movers.gone):
        for n, time in enumerate(ends):
            x, y = movers.at(float(time))[n]
            assert max(abs(x), abs(y)) == pytest.approx(BORDER + OUTSIDE)


def test_outwards_is_straight_through_the_border():
    assert outwards(np.array([-10.0, 5.0])) == pytest.approx([-1, 0])
    assert outwards(np.array([3.0, 10.0])) == pytest.approx([0, 1])
    assert outwards(np.array([10.0, -10.0])) == pytest.approx([0.5**0.5, -(0.5**0.5)])


def test_the_robot_sets_out_when_nobody_is_about():
    # leaves the arena just where the robot starts, every twenty seconds
    crossing = Crossing(
        radius=0.5, period=20.0, way=np.array([[0.0, -10.0, 0.0], [20.0, 10.0, 0.0]])
    )
    source = CrossingSource(crossings=(crossing,), top_speed=1.0)
    still = dynabarn.scenario_of(0, (crossing,), dynabarn.FRONT).still_world()
    for seed in range(4):
        movers, time = source.draw(still, (11.0, 0.0, np.pi), 100.0, seed, np.random.default_rng(0))
        for later in np.arange(0.0, 5.0, 0.05):
            here = movers.at(time + later)[movers.present(time + later)]
            assert (np.hypot(*(here - (11, 0)).T) - 0.5 >= KEEP_OUT - 0.06).all()


@needs("dynabarn")
def test_no_cylinder_is_faster_than_the_bound_of_its_class():
    worlds = read_dynabarn()
    assert len(worlds) == 30
    assert [class_of(n) for n in (0, 19, 20, 39, 40, 59)] == [
        "easy", "easy", "medium", "medium", "hard", "hard"
    ]  # fmt: skip
    for number, crossings in worlds.items():
        scenario = dynabarn.scenario_of(number, crossings, dynabarn.ALL_ROUND)
        movers = movers_of(crossings, 0.0, 1.0)
        assert movers.top_speed <= scenario.settings.object_speed
        for crossing in crossings:
            assert np.abs(crossing.way[[0, -1], 1:]).max(axis=1) == pytest.approx([BORDER] * 2)


# the campaign


def fake(trial):
    """A trial's result without a drive: odd worlds fail."""
    DRIVEN.append(trial.key)
    return {
        "scenario": trial.key[0], "variant": trial.variant, "seed": trial.trial, "error": None,
        "outcome": {
            "arrived": trial.world % 2 == 0, "took": 12.0 if trial.world % 2 == 0 else None,
            "touched_moving": False, "touched_at_rest": False, "nearest": 0.1,
            "fastest_turn": 2.0, "distance": 10.0, "reached_goal": trial.world % 2 == 0,
            "collisions_moving": 0, "collisions_at_rest": 0,
        },
        "timings": {"commit": "0", "seconds": 1.0, "cycles_us": [1000, 3000]},
    }  # fmt: skip


DRIVEN: list = []


def campaign(worlds, trials=2):
    return Campaign(
        benchmark="barn", worlds=worlds, trials=trials, names=("passpmp-pso",), conditions={"a": 1}
    )


def test_a_folder_is_gone_on_with(tmp_path):
    DRIVEN.clear()
    carry_out_all(campaign([2, 3], 1), fake, tmp_path, Here(), lambda _: None)
    carry_out_all(campaign([2, 3, 4], 2), fake, tmp_path, Here(), lambda _: None)
    assert len(DRIVEN) == len(set(DRIVEN)) == 6
    assert len(read_all(campaign([2, 4], 2), tmp_path)) == 4


def test_the_page_tells_shares_with_their_intervals():
    worlds = {n: BarnWorld(number=n, **WORLD) for n in (2, 3)}
    results = [fake(job) for job in campaign([2, 3]).jobs()]
    published = {p: {2: {"success": 1.0, "time": 9.0, "score": 0.4}} for p in PUBLISHED}
    told = document(worlds, results, published, wanted=4, date="today", command="passpmp")
    assert told["all"]["success"]["times"] == 2
    assert told["all"]["timeout"]["times"] == 2
    assert told["common"]["worlds"] == [2]
    optimal = worlds[2].optimal_time
    assert told["all"]["score"] == pytest.approx(0.5 * optimal / 12.0)
    text = page(told)
    assert "| passpmp-pso (this run) | 2 | 4 | 50.0 % [6.8, 93.2] |" in text
    assert "not Gazebo" in text
    assert barn.slowest(told["worlds"]) == 3


WORLD = dict(
    cylinders=np.array([[-4.0, 6.0]]), radius=0.075, path=np.array([[-2.25, 5.0], [-2.25, 9.0]])
)


def test_worlds_are_chosen_by_numbers_ranges_and_steps():
    known = list(range(0, 60, 2))
    assert chosen_worlds("all/10", known, "barn") == [0, 20, 40]
    assert chosen_worlds("4-9, 0", known, "barn") == [0, 4, 6, 8]
    for text, told in [
        ("3", r"world 3 is not among the 30 .*0 to 58"),
        ("x", "give numbers and ranges"),
        ("100-200", "none of these worlds"),
        ("all/0", "a whole number >= 1"),
    ]:
        with pytest.raises(ValueError, match=told):
            chosen_worlds(text, known, "barn")


def test_without_the_data_the_remedy_is_told(monkeypatch, tmp_path):
    monkeypatch.setenv("PASSPMP_DATA", str(tmp_path))
    for read in (read_worlds, read_published, read_dynabarn):
        with pytest.raises(ValueError, match="no such file; set PASSPMP_DATA"):
            read()


def test_unknown_sensors_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(dynabarn, "worlds", lambda: {0: (DIAGONAL,)})
    parser = argparse.ArgumentParser()
    dynabarn.add_options(parser)
    given = parser.parse_args(["--sensors", "frnt", "--out", str(tmp_path)])
    with pytest.raises(ValueError, match=r"frnt.*front"):
        dynabarn.run(given)


def test_scenarios_are_scenarios():
    for sensors in dynabarn.SENSORS:
        scenario = dynabarn.scenario_of(40, (DIAGONAL,), sensors)
        assert isinstance(scenario, Scenario)
        assert scenario.settings.object_speed == 1.95
        assert all(lidar.labels == "none" for lidar in scenario.lidars)
