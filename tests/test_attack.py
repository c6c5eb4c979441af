"""Adversaries keep the rules they attack by, and what a campaign tells is what happened."""

import json
import math

import numpy as np
import pytest

from passpmp_ti.attack.attempt import TICK, Attempt, outcome, run
from passpmp_ti.attack.blind import uncovered
from passpmp_ti.attack.bounds import rate_bound, share_bound
from passpmp_ti.attack.campaign import (
    EPISODES,
    Campaign,
    carry_out,
    carry_out_all,
    key_of,
    read_results,
)
from passpmp_ti.attack.case import HUNTERS, KINDS, ROBOTS, Case, draw
from passpmp_ti.attack.errors import POSES, RANGES, Drift, disturb_ranges, pose_errors
from passpmp_ti.attack.hunted import Ways
from passpmp_ti.attack.movers import SteeredMovers
from passpmp_ti.attack.pursuit import meeting, shortfall
from passpmp_ti.attack.replay import replay
from passpmp_ti.attack.report import summary, write_report
from passpmp_ti.attack.roadmap import Roadmap, crossed
from passpmp_ti.cli import main
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.sim import geometry
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.world import World

WALL = np.array([[1.0, -2.0, 1.0, 2.0]])
NOWHERE = np.full((1, 2), 1e6)


def one_mover(place=(0.0, 0.0), outline=WALL, top_speed=1.0):
    return SteeredMovers(np.array([place]), np.array([0.25]), top_speed, TICK, 0.0, outline)


def push(movers, velocity, ticks, discs=NOWHERE, radius=0.4):
    for _ in range(ticks):
        movers.survey(TICK)
        movers.advance(np.array([velocity]), np.array([np.inf]), discs, radius)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("kind", ["mixed", "crowd"])
def test_no_mover_is_faster_than_the_bound_or_goes_through_a_wall(robot, kind):
    attempt = Attempt(Case(robot=robot, kind=kind, seed=3))
    for k in range(60):
        attempt.cycle(k)
    movers, world = attempt.movers, attempt.world
    way = movers.history
    bound = attempt.attack.scenario.settings.object_speed
    speeds = np.linalg.norm(np.diff(way, axis=0), axis=2) / TICK
    assert speeds.max() <= bound
    assert speeds.max() > 0.5 * bound
    outline = world.outline
    for n, radius in enumerate(movers.radius):
        gaps = geometry.segment_to_segment(
            way[:-1, n, None], way[1:, n, None], outline[:, :2], outline[:, 2:]
        )
        assert gaps.min() >= radius - 1e-12
        for polygon in world.polygons:
            assert not geometry.inside_polygon(way[:, n], polygon).any()


def test_a_mover_stops_at_a_wall_and_slides_along_it():
    movers = one_mover()
    push(movers, (1.0, 0.5), 400)
    assert movers.now[0, 0] == pytest.approx(0.75, abs=6e-3)
    assert movers.now[0, 1] > 0.8
    assert movers.now[0, 0] <= 0.75


def test_a_mover_leans_on_the_robot_but_does_not_enter_it():
    movers = one_mover(outline=np.zeros((0, 4)))
    robot = np.array([[1.0, 0.0]])
    push(movers, (1.0, 0.0), 400, discs=robot)
    gap = 1.0 - movers.now[0, 0] - 0.4 - 0.25
    assert -2e-6 < gap <= 0.0  # in contact, as the judge counts it
    push(movers, (-1.0, 0.0), 20, discs=robot)
    assert movers.now[0, 0] < 0.3


def test_a_velocity_beyond_the_bound_is_cut():
    movers = one_mover(outline=np.zeros((0, 4)), top_speed=0.5)
    push(movers, (30.0, 0.0), 200)
    assert movers.now[0, 0] == pytest.approx(0.5)
    assert movers.now[0, 0] <= 0.5
    assert movers.at(0.5)[0, 0] == pytest.approx(0.25)
    assert movers.at(-1.0)[0, 0] == 0.0


def test_a_mover_that_begins_in_a_wall_is_refused():
    with pytest.raises(ValueError, match="inside a wall"):
        one_mover(place=(0.9, 0.0))


def test_pursuit_runs_to_where_the_robot_will_be():
    # the robot passes x = 0, 1, 2, ... at 1 m/s; a disc 2 m beside x = 3 can just be there at 3 s
    way = np.stack([np.arange(6.0), np.zeros(6)], axis=1)
    missing = shortfall(
        np.array([[3.0, 2.0], [3.0, 20.0]]), np.array([0.5, 0.5]), np.array([0.5, 0.5]), way,
        np.arange(6.0),
    )  # fmt: skip
    assert missing[0, 3] == pytest.approx(2.0 - 0.5 - 1.5)
    assert meeting(missing).tolist() == [3, 5]


def test_ways_lead_round_a_wall():
    wall = np.array([[-1.0, 0.0], [1.0, 0.0], [1.0, 0.5], [-1.0, 0.5]])
    world = World((-4, -4, 4, 4), (wall,))
    roadmap = Roadmap(world, 0.3, 60, np.random.default_rng(0))
    start = np.array([0.0, -2.0])
    goal = int(np.argmin(np.hypot(*(roadmap.places - np.array([0.0, 2.5])).T)))
    way = [start, *roadmap.way(start, goal)]
    assert crossed(start, roadmap.places[goal][None], world.outline)[0]
    assert len(way) > 2
    assert roadmap.clear(np.array(way[:-1]), np.array(way[1:])).all()


def test_who_is_behind_a_front_sensor_is_out_of_its_sight():
    front = Lidar(range_max=5.0, beams=271, field_of_view=math.radians(270))
    state = np.zeros(5)
    places = np.array([[2.0, 0.0], [-2.0, 0.0], [-1.5, 1.4], [0.0, 2.0]])
    hidden = uncovered([front], state, places, np.full(4, 0.25))
    assert hidden.tolist() == [False, True, True, False]
    assert not uncovered([Lidar(range_max=5.0, beams=360)], state, places, np.full(4, 0.25)).any()


def flat_scan():
    return Scan(np.array([1.0, 2.0, 3.99, np.inf]), 0.0, 0.1, 4.0, (0.0, 0.0, 0.0), 1.0)


@pytest.mark.parametrize("kind", RANGES[1:])
def test_range_errors_keep_within_their_margin_and_reach_it(kind):
    draws = np.random.default_rng(0)
    worst = 0.0
    for _ in range(200):
        found = disturb_ranges(flat_scan(), kind, 0.05, draws).ranges
        near = found[:2] - np.array([1.0, 2.0])
        worst = max(worst, float(np.nanmax(np.abs(near), initial=0.0)))
        assert np.isinf(found[3]) or np.isnan(found[3])
    assert 0.045 < worst <= 0.05


@pytest.mark.parametrize("kind", POSES[1:])
def test_pose_errors_keep_within_their_margin_and_reach_it(kind):
    draws = np.random.default_rng(0)
    worst = 0.0
    for _ in range(50):
        shifts, own = pose_errors(kind, 2, 0.1, np.array([0.6, 0.8]), draws)
        worst = max(worst, *(float(np.hypot(*s)) for s in (*shifts, own)))
    assert worst == pytest.approx(0.1)
    assert worst <= 0.1


def test_the_robot_drifts_smoothly_up_to_its_margin():
    drift = Drift("pull", Settings(tracking_error=0.1), np.random.default_rng(0))
    steps = []
    for n in range(400):
        before = drift.shift.copy()
        drift.advance(TICK, np.array([1.0, 0.0] if n < 200 else [0.0, -1.0]))
        steps.append(float(np.hypot(*(drift.shift - before))))
        assert np.hypot(*drift.shift) <= 0.1
    assert max(steps) < 0.002
    assert drift.shift == pytest.approx([0.0, -0.1])


@pytest.mark.parametrize("robot", ROBOTS)
def test_drawn_attacks_obey_what_the_guarantee_assumes(robot):
    for seed in range(3):
        for kind in KINDS:
            attack = draw(Case(robot=robot, kind=kind, seed=seed))
            settings = attack.scenario.settings
            assert attack.radius.min() >= 0.5 * settings.object_width
            assert attack.speed.max() <= settings.object_speed
            start = np.array([attack.scenario.start[:2]])
            assert attack.arena.world.clearance(start)[0] > settings.clear_radius
            for polygon in attack.arena.polygons:
                sides = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1)
                assert sides.min() >= settings.object_width - 1e-9


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_short_attack_moves_and_touches_nothing_while_moving(robot):
    told = [
        outcome(run(Case(robot=robot, kind=kind, seed=seed, duration=7.0)))
        for kind, seed in (("mixed", 2), ("shadow", 1), ("rim", 0))
    ]
    assert sum(t["metres"] for t in told) > 8.0
    assert sum(t["seconds_moving"] for t in told) > 6.0
    for one in told:
        assert one["contacts_moving"] == 0
        assert one["held_unsafe"] == 0
        assert one["broken_premises"] == 0


def test_the_same_seed_gives_the_same_bytes():
    case = Case(robot="wheelchair", kind="mixed", seed=5, duration=3.0)
    first, again = run(case), run(case)
    assert first.movers.history.tobytes() == again.movers.history.tobytes()
    assert first.episode().states.tobytes() == again.episode().states.tobytes()
    assert first.digest() == again.digest()
    other = run(Case(robot="wheelchair", kind="mixed", seed=6, duration=3.0))
    assert other.digest() != first.digest()


def test_movers_that_break_the_bound_are_found_out_and_replayed(tmp_path):
    case = Case(robot="wheelchair", kind="shadow", seed=4, duration=6.0, cheat_speed=4.0)
    found = carry_out(case)
    assert found["contacts_moving"] > 0
    assert found["broken_premises"] > 0
    path = tmp_path / "failed.json"
    path.write_text(json.dumps(found))
    again, same = replay(path, None)
    assert same
    assert again["contacts_moving"] == found["contacts_moving"]


def test_bounds_of_no_event_are_the_rule_of_three():
    assert rate_bound(0, 10.0) == pytest.approx(-math.log(0.05) / 10.0)
    assert share_bound(0, 300) == pytest.approx(1 - 0.05 ** (1 / 300))
    assert share_bound(0, 0) == 1.0
    assert rate_bound(0, 0.0) == math.inf
    # one event: the rate at which at most one is seen in 5 % of tries
    rate = rate_bound(1, 1.0)
    assert math.exp(-rate) * (1 + rate) == pytest.approx(0.05)
    assert share_bound(3, 3) == 1.0


def made_up(seed, **changes):
    told = {
        "case": Case(robot="car", kind="rim", seed=seed).__dict__ | {"changes": {}},
        "robot": "car", "kind": "rim", "seed": seed, "cycles": 100, "duration": 10.0,
        "metres": 500.0, "seconds_moving": 5.0, "top_speed": 9.0, "contacts_moving": 0,
        "contacts_at_rest": 2, "held_unsafe": 0, "held_unsafe_after_broken": 0,
        "broken_premises": 0, "lost_scans": 0, "nearest_moving": 0.5 + seed,
        "digest": "", "exception": None, "seconds_computed": 1.0,
    }  # fmt: skip
    return told | changes


def test_a_report_adds_up(tmp_path):
    results = [made_up(0), made_up(1, contacts_moving=1), made_up(2, nearest_moving=None)]
    told = summary(results)
    assert told["episodes"] == 3
    assert told["cycles"] == 300
    assert told["metres"] == 1500.0
    assert told["share_moving"] == 0.5
    assert told["contacts_at_rest"] == 6
    assert told["nearest_moving"] == 0.5
    assert told["episodes_failed"] == 1
    assert told["bound_per_km"] == pytest.approx(rate_bound(1, 1.5))
    assert told["bound_per_hour_moving"] == pytest.approx(rate_bound(1, 15 / 3600))
    assert told["bound_per_episode"] == pytest.approx(share_bound(1, 3))
    written = write_report(results, tmp_path, "made up")
    assert written == json.loads((tmp_path / "report.json").read_text())
    assert written["failed"] == ["failed-car-rim-1.json"]
    assert "| rim | 3 | 300 | 1 |" in (tmp_path / "report.md").read_text()


def test_a_campaign_goes_on_where_it_was_cut(tmp_path):
    campaign = Campaign(robots=("wheelchair",), kinds=("rim", "crowd"), episodes=2, duration=1.2)
    cases = list(campaign.cases("wheelchair"))
    assert [(c.kind, c.seed) for c in cases] == [("rim", 0), ("crowd", 1)]
    done = json.dumps(carry_out(cases[0]) | {"seconds_computed": 77.0})
    (tmp_path / EPISODES).write_text(done + "\n" + done[:30])  # the second was cut short
    seen = []
    results = carry_out_all(campaign, tmp_path, 1, lambda r: seen.append(len(r)))
    assert seen == [2]
    assert [key_of(r) for r in results] == [key_of(c) for c in cases]
    assert results[0]["seconds_computed"] == 77.0
    assert read_results(tmp_path) == results


def test_the_command_refuses_to_mix_campaigns(tmp_path, capsys):
    (tmp_path / EPISODES).write_text("")
    assert main(["attack", "--out", str(tmp_path)]) == 2
    assert "--resume" in capsys.readouterr().err
    assert main(["attack", "--kinds", "ambus", "--out", str(tmp_path / "new")]) == 2
    assert "did you mean 'ambush'" in capsys.readouterr().err


def test_every_kind_has_its_people():
    assert set(HUNTERS) | {"walkers"} == set(KINDS)
    assert Ways.__dataclass_params__.frozen
