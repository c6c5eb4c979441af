"""The crowd benchmark: the world that is drawn, who hides in it, and what is told of a drive."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from passpmp_ti.benchmark import crowd_world
from passpmp_ti.benchmark.campaign import Trial
from passpmp_ti.benchmark.crowd_movers import Ambush, CrowdMovers, timed
from passpmp_ti.benchmark.crowd_page import document, page
from passpmp_ti.benchmark.crowd_trial import drive, noticed, planner_of
from passpmp_ti.benchmark.crowd_world import ROUTE, crowd, draw_corners, hidden, way_along
from passpmp_ti.cli import BAD_INPUT, main
from passpmp_ti.compare import job as jobs
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.sim import geometry
from passpmp_ti.sim.episode import simulate
from passpmp_ti.sim.movers import PathMovers

TIMES = np.arange(0.0, 300.0, 0.5)


@pytest.fixture(autouse=True)
def unrehearsed():
    """Compiling every kernel beforehand makes costs comparable, and nothing else."""
    jobs.REHEARSED.add((DifferentialDrive, "conservative"))


@pytest.fixture
def brief(monkeypatch):
    """Episodes of half a second, planned coarsely."""
    usual = crowd_world.settings().changed(capacity=300, cell=0.1)
    monkeypatch.setattr(crowd_world, "DURATION", 0.5)
    monkeypatch.setattr(crowd_world, "settings", lambda: usual)


def world_of(count, seed):
    return crowd(count, seed).build(seed)[0]


def corners_of(seed):
    return draw_corners(np.random.default_rng([seed, 2]))


# the world ------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_so_many_walk_as_were_asked_for_and_six_wait_behind_occluders(seed):
    world = world_of(20, seed)
    assert len(world.movers.radius) == 20 + 6
    assert len(world.polygons) == 6
    sizes = [np.hypot(*(p - p.mean(axis=0)).T).max() for p in world.polygons]
    assert all(0.8 <= size <= 1.0 for size in sizes)
    assert (world.movers.radius >= 0.28).all()
    assert (world.movers.radius <= 0.42).all()


@pytest.mark.parametrize("seed", range(3))
def test_walkers_keep_their_speed_and_the_arena_and_stand_in_nothing(seed):
    world = world_of(30, seed)
    places = world.movers.positions(TIMES)
    assert world.movers.top_speed <= 1.0
    # from corner to corner of a way a chord is shorter than the way
    speeds = np.hypot(*np.moveaxis(np.diff(places, axis=0), -1, 0)) / 0.5
    assert speeds[:, :30].max() <= 1.0
    assert (speeds[:, :30].max(axis=0) >= 0.3 - 1e-9).all()
    assert (speeds[:, 30:] == 0.0).all()
    radius = world.movers.radius[None, :, None]
    assert (places >= radius).all()
    assert (places <= 30.0 - radius).all()
    for corner in corners_of(seed):
        apart = np.hypot(*np.moveaxis(places - corner.centre, -1, 0))
        assert (apart >= corner.size + world.movers.radius - 1e-9).all()


@pytest.mark.parametrize("seed", range(20))
def test_nobody_begins_on_the_robot_or_in_its_way(seed):
    scenario = crowd(30, seed)
    world, state, _ = scenario.build(seed)
    assert tuple(state[:2]) == tuple(ROUTE[0])
    assert np.hypot(*(world.movers.at(0.0)[:30] - state[:2]).T).min() >= 3.0
    assert np.hypot(*(world.movers.at(0.0) - state[:2]).T).min() >= 2.5


def test_a_seed_draws_one_world_and_another_seed_another():
    here, again, other = (world_of(10, seed).movers.positions(TIMES) for seed in (4, 4, 5))
    assert here.tobytes() == again.tobytes()
    assert here.tobytes() != other.tobytes()


def test_more_walkers_change_nothing_for_those_who_wait():
    few, many = world_of(10, 4), world_of(50, 4)
    assert few.movers.positions(TIMES)[:, 10:].tobytes() == (
        many.movers.positions(TIMES)[:, 50:].tobytes()
    )


def test_an_occluder_of_another_leg_stands_in_nobodys_way_across():
    # of 400 seeds the only one whose first occluders do
    for corner in corners_of(95):
        for other in corners_of(95):
            ways = np.linspace(*corner.ambush.way, 200)
            apart = np.hypot(*(ways - other.centre).T)
            assert apart.min() >= other.size + corner.ambush.radius - 1e-3
    assert world_of(10, 95).movers.positions(TIMES).shape == (len(TIMES), 16, 2)


def test_walls_about_the_square_leave_room_for_everybody():
    world = crowd(20, 0, walled=True).build(0)[0]
    assert len(world.outline) == len(world_of(20, 0).outline) + 4
    places = world.movers.at(7.0)
    assert (world.clearance(places) >= world.movers.radius - 1e-9).all()


# those who wait -------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_no_beam_meets_who_waits_from_anywhere_on_the_route_until_he_steps_out(seed):
    scenario = crowd(0, seed)
    world = scenario.build(seed)[0]
    for n, corner in enumerate(corners_of(seed)):
        looks = way_along(n // 2)
        apart = np.hypot(*(looks - corner.ambush.way[0]).T)
        until = int(np.argmax(apart <= corner.ambush.near))
        assert apart[until] <= corner.ambush.near
        near = looks[:until][apart[:until] < 11.0]
        for x, y in near[::3]:
            scan = scenario.lidars[0].scan(world, (x, y, 0.0), 0.0)
            hits = scan.ranges[np.asarray(scan.moving)]
            bearings = scan.angle_min + scan.angle_increment * np.flatnonzero(scan.moving)
            met = np.stack([x + hits * np.cos(bearings), y + hits * np.sin(bearings)], axis=1)
            him = np.hypot(*(met - corner.ambush.way[0]).T) < corner.ambush.radius + 0.01
            assert not him.any()


def test_beside_the_shadow_somebody_is_not_hidden():
    corner = corners_of(0)[0]
    ahead = corner.ambush.way[0] - corner.centre
    behind = corner.ambush.way[0] + ahead
    assert not hidden(behind[None], corner).any()
    assert hidden((corner.centre - 3 * ahead)[None], corner).all()


def test_who_waits_sets_out_when_the_robot_is_near_and_not_before():
    ambush = Ambush(way=np.array([(0.0, 2.0), (0.0, -1.5)]), radius=0.3, near=3.0, speed=1.0)
    movers = CrowdMovers(PathMovers([], np.zeros(0)), [ambush])
    movers.notice(1.0, np.array([5.0, 0.0]))
    assert movers.stepped == [None]
    before = movers.positions(np.linspace(0.0, 2.0, 9))
    movers.notice(2.0, np.array([2.0, 0.0]))
    movers.notice(2.1, np.array([0.0, 0.0]))
    assert movers.stepped == [2.0]
    assert (movers.positions(np.linspace(0.0, 2.0, 9)) == before).all()
    assert movers.at(3.0)[0] == pytest.approx((0.0, 1.0))
    assert movers.at(5.5)[0] == pytest.approx((0.0, -1.5))
    assert movers.present(0.0).all()


@pytest.mark.parametrize("seed", range(3))
def test_who_steps_out_crosses_the_route_past_his_occluder(seed):
    for n, corner in enumerate(corners_of(seed)):
        begin, end = ROUTE[n // 2], ROUTE[n // 2 + 1]
        way = corner.ambush.way
        assert geometry.segment_to_segment(way[0], way[1], begin, end) == pytest.approx(0.0)
        gap = geometry.point_to_segment(corner.centre, way[0], way[1])
        assert gap >= corner.size + corner.ambush.radius + 0.05 - 1e-9


def test_a_way_takes_as_long_as_its_speed_says():
    rows = timed(np.array([(0.0, 0.0), (3.0, 4.0), (3.0, 5.0)]), 0.5, 2.0)
    assert rows[:, 0].tolist() == [2.0, 12.0, 14.0]


# drives ---------------------------------------------------------------------------------------


def test_the_robot_that_comes_near_is_noticed():
    scenario = crowd(0, 1)
    first = corners_of(1)[0]
    leg = math.atan2(*(ROUTE[1] - ROUTE[0])[::-1])
    beside = np.array([ROUTE[0][0], first.ambush.way[0][1] - 0.5])
    near = replace(
        scenario, start=(beside[0], beside[1], leg), duration=0.3,
        settings=scenario.settings.changed(capacity=300, cell=0.1),
    )  # fmt: skip
    episode = simulate(near, seed=1, on_cycle=noticed)
    stepped = episode.world.movers.stepped
    assert stepped[0] == 0.0
    moved = episode.world.movers.positions(np.array([0.0, 0.3]))
    assert np.hypot(*(moved[1, 0] - moved[0, 0])) == pytest.approx(0.3, abs=1e-6)
    assert all(time is None for time in stepped[2:])


def test_a_trial_gives_the_same_twice(brief):
    trial = Trial(benchmark="crowd", world=5, variant="conservative", trial=3)
    first, second = (drive(trial) for _ in range(2))
    assert first["error"] is None
    assert first["outcome"] == second["outcome"]
    assert first["outcome"]["cycles"] == 5
    assert (first["scenario"], first["variant"], first["seed"]) == ("crowd-5", "conservative", 3)


def test_a_variant_is_a_mode_or_a_planner():
    made = [
        planner_of(Trial(benchmark="crowd", world=5, variant=name, trial=0))
        for name in ("hybrid", "dwa")
    ]
    assert made[0] is None
    assert made[1].__name__ == "DynamicWindow"


def test_the_command_goes_on_where_it_stopped(brief, tmp_path, capsys):
    given = ["benchmark", "crowd", "--counts", "2", "--workers", "1", "--no-picture"]

    def run(trials):
        return main([*given, "--out", str(tmp_path), "--trials", str(trials)])

    assert run(1) == 0
    first = (tmp_path / "episodes.jsonl").read_text()
    assert run(2) == 0
    both = (tmp_path / "episodes.jsonl").read_text()
    assert both.startswith(first)
    assert both.count("\n") == 2
    told = json.loads((tmp_path / "crowd.json").read_text())
    assert told["groups"]["conservative"]["2"]["trials"] == 2
    assert "2 of 2 trials" in capsys.readouterr().out
    assert main([*given, "--out", str(tmp_path), "--labels", "none"]) == BAD_INPUT
    assert "labels" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ("--modes bold", "crowd.modes"),
        ("--planners viability", "crowd.planners"),
        ("--counts -1", "crowd.counts"),
        ("--trials 0", "crowd.trials"),
        ("--labels all", "crowd.labels"),
        ("--modes", "crowd.modes"),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_is_driven(options, field, tmp_path, capsys):
    given = ["benchmark", "crowd", "--out", str(tmp_path / "out"), *options.split()]
    assert main(given) == BAD_INPUT
    assert field in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_crowds_speed_is_not_changed_with_the_bound():
    with pytest.raises(ValueError, match="object_speed alone"):
        crowd(5, 0).changed(object_speed=0.5)


# the page -------------------------------------------------------------------------------------


def result(count, seed, reached, **others):
    outcome = {
        "reached_goal": reached, "time_to_goal": 100.0 + seed if reached else None,
        "duration": 300.0, "collisions_moving": 0, "collisions_at_rest": 1, "distance_driven": 90.0,
        "share_moving": 0.9, "nearest_approach_moving": 0.2 - 0.1 * seed, "stepped_out": 5,
        "broken_premises": 0, "lost_scans": 2, "touched_for": 8.0, "place": [12.0, 14.0],
    } | others  # fmt: skip
    return {
        "scenario": f"crowd-{count}", "variant": "conservative", "seed": seed, "error": None,
        "outcome": outcome,
        "timings": {"cycles_us": [9000], "seconds": 20.0, "machine": "m", "commit": "c"},
    }  # fmt: skip


def told_of(results):
    return document(
        results, (10, 50), ("conservative",), wanted=4,
        world={"labels": "sensor", "walled": False}, date="2026-01-01",
        command="passpmp benchmark crowd",
    )  # fmt: skip


def test_the_table_sets_what_came_of_it_beside_what_is_published_and_wanted():
    told = told_of([result(10, 0, True), result(10, 1, True), result(50, 0, False)])
    ten, fifty = (told["groups"]["conservative"][n] for n in ("10", "50"))
    assert ten["mean_time"] == 100.5
    assert ten["nearest"] == pytest.approx(0.1)
    assert (fifty["mean_time"], fifty["reached"]["times"]) == (None, 0)
    text = page(told)
    assert "| 10 | 2 | 0.0 % [0.0, 84.2] | 100.0 % [15.8, 100.0] | 100.5 |" in text
    assert "0 contacts, >= 95 %, <= 115 s" in text
    assert "84 %, 1 %, 131 s" in text
    assert "3 of 4 trials" in text


def test_what_went_wrong_is_told_trial_by_trial():
    assert "What went wrong" not in page(told_of([result(10, 0, True)]))
    told = told_of([result(10, 0, True, collisions_moving=1), result(50, 7, False)])
    text = page(told).partition("What went wrong")[2]
    assert "| crowd-10 | conservative | 0 | 1 |" in text
    assert "| crowd-50 | conservative | 7 | 0 | (12.0, 14.0) |" in text
