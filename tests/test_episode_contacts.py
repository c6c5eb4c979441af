"""The judge misses no contact, and an episode tells the truth about what happened."""

import numpy as np
import pytest

from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.settings import Settings
from passpmp_ti.sim.contacts import WALL, Judge, closest_approach, gaps_to_walls
from passpmp_ti.sim.episode import simulate
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.movers import NoMovers, PathMovers
from passpmp_ti.sim.scenario import Scenario
from passpmp_ti.sim.sources import NobodyMoves, ScriptSource
from passpmp_ti.trajectory import Trajectory

ROBOT = DifferentialDrive(discs=((0.0, 0.4),))
NO_WALLS = np.zeros((0, 4))


def rolling(times, speed, x=0.0):
    """States of a robot that rolls along x."""
    times = np.asarray(times)
    states = np.zeros((len(times), 5))
    states[:, 0] = x + speed * (times - times[0])
    states[:, 3:] = speed
    return states


def test_closest_approach_is_found_between_the_ends_of_a_step():
    draw = np.random.default_rng(0)
    p0, p1, q0, q1 = draw.uniform(-2, 2, (4, 200, 2))
    share = np.linspace(0, 1, 2001)[:, None, None]
    gaps = np.linalg.norm((p0 + share * (p1 - p0)) - (q0 + share * (q1 - q0)), axis=2)
    found = closest_approach(p0, p1, q0, q1)
    assert (found <= gaps.min(axis=0) + 1e-12).all()
    assert np.abs(found - gaps.min(axis=0)).max() < 3e-3
    # head on through one another within one step: the ends are 2 m apart, the approach is 0
    assert closest_approach(*np.array([[-1.0, 0], [1, 0], [1, 0], [-1, 0]])) == 0.0


def test_a_wall_driven_through_within_one_step_is_a_contact():
    states = rolling([0.0, 1.0], 4.0)
    assert gaps_to_walls(ROBOT, states, np.array([[2.0, -1.0, 2.0, 1.0]]))[0] == -0.4


def test_discs_off_the_middle_count_too():
    long = DifferentialDrive(discs=((0.0, 0.4), (1.0, 0.4)))
    states = rolling([0.0, 0.1], 0.0)
    gap = gaps_to_walls(long, states, np.array([[1.5, -1.0, 1.5, 1.0]]))
    assert gap[0] == pytest.approx(0.1)


def test_a_touch_is_one_contact_from_its_first_moment_to_its_last():
    # a person of 0.25 m crosses at 2 m/s through the place where the robot stands
    movers = PathMovers([np.array([[0.0, 0.0, -2.0], [2.0, 0.0, 2.0]])], np.array([0.25]))
    judge = Judge(ROBOT, movers, NO_WALLS)
    for begin in np.arange(0.0, 2.0, 0.1):
        times = np.linspace(begin, begin + 0.1, 21)
        judge.see(times, rolling(times, 0.0))
    (contact,) = judge.contacts
    assert contact.mover == 0
    assert not contact.moving
    assert contact.start == pytest.approx(1.0 - 0.65 / 2, abs=0.006)
    assert contact.end == pytest.approx(1.0 + 0.65 / 2, abs=0.006)
    assert contact.mover_speed == pytest.approx(2.0)


def test_contacts_while_moving_are_told_from_contacts_at_rest():
    movers = PathMovers([np.array([[0.0, 1.0, 0.0]])], np.array([0.25]))
    judge = Judge(ROBOT, movers, NO_WALLS)
    times = np.linspace(0.0, 0.5, 101)
    judge.see(times, rolling(times, 1.0))
    (contact,) = judge.contacts
    assert contact.moving
    assert contact.moving_at_start
    assert contact.robot_speed == 1.0
    assert contact.mover_top_speed == 0.0
    assert judge.nearest_mover == pytest.approx(-0.15)


def test_a_robot_that_sets_off_in_contact_is_to_blame():
    movers = PathMovers([np.array([[0.0, 0.5, 0.0]])], np.array([0.25]))
    judge = Judge(ROBOT, movers, NO_WALLS)
    times = np.linspace(0.0, 0.1, 21)
    judge.see(times, rolling(times, 0.0))
    assert not judge.contacts[0].moving
    judge.see(times + 0.1, rolling(times, 0.5))
    (contact,) = judge.contacts
    assert contact.moving
    assert not contact.moving_at_start


def test_a_contact_remembers_how_fast_the_person_was_before():
    path = np.array([[0.0, -5.0, 0.0], [1.0, -1.0, 0.0], [3.0, 0.0, 0.0]])  # ran, then walked
    judge = Judge(ROBOT, PathMovers([path], np.array([0.25])), NO_WALLS)
    times = np.linspace(1.0, 2.5, 301)
    judge.see(times, rolling(times, 0.0))
    (contact,) = judge.contacts
    assert contact.mover_speed == pytest.approx(0.5)
    assert contact.mover_top_speed == pytest.approx(4.0)


def test_walls_count_as_contacts_of_their_own():
    judge = Judge(ROBOT, NoMovers(), np.array([[1.0, -1.0, 1.0, 1.0]]))
    times = np.linspace(0.0, 1.0, 201)
    judge.see(times, rolling(times, 1.0))
    assert [c.mover for c in judge.contacts] == [WALL]
    assert judge.nearest_wall == pytest.approx(-0.4, abs=1e-9)


class Forward:
    """A planner that sees nothing: rolls on at 1 m/s, and says so once it is past its goal."""

    def __init__(self, robot, settings, goal, static_map=None, *, seed=0):
        self.settings, self.goal = settings, goal[-1]
        self.reached = False
        self.calls = []
        self.record = CycleRecord(stamp=0.0, decision="new")

    def update(self, scans, state):
        self.calls.append((scans[0].stamp, state))
        self.reached = state[0] >= self.goal[0]
        start = scans[0].stamp + self.settings.cycle
        speed = 0.0 if self.reached else 1.0
        times = start + np.array([0.0, 5.0])
        first_answer = len(self.calls) == 1
        x = state[0] if first_answer else state[0] + self.settings.cycle
        states = rolling(times, speed, x)
        return Trajectory(times, states, 1)


def lane(movers=None, walls=NO_WALLS):
    return Scenario(
        name="lane", robot=ROBOT, settings=Settings.for_robot(ROBOT),
        lidars=(Lidar(range_max=5.0, beams=16),), bounds=(-5, -5, 5, 5), walls=walls,
        movers=movers or NobodyMoves(), start=(0.0, 0.0, 0.0), goals=((2.0, 0.0),), duration=4.0,
    )


def test_an_episode_executes_what_was_held_until_the_next_cycle():
    seen = []
    episode = simulate(lane(), planner=Forward, on_cycle=seen.append)
    # the first plan starts one cycle after the first scan; until then the robot stands
    assert [round(c.state[0], 6) for c in seen[:4]] == [0.0, 0.0, 0.1, 0.2]
    summary = episode.summary()
    assert summary["reached_goal"]
    assert summary["time_to_goal"] == pytest.approx(2.1)
    assert summary["distance_driven"] == pytest.approx(2.0)
    assert summary["mean_speed_under_way"] == pytest.approx(1.0)
    assert summary["share_moving"] == pytest.approx(2.0 / 2.1)
    assert summary["collisions_moving"] == 0


def test_a_planner_that_sees_nothing_is_found_out():
    standing = ScriptSource(paths=(((0.0, 1.5, -0.2),),), radius=(0.25,))
    wall = np.array([[1.0, 0.3, 1.0, 3.0]])
    episode = simulate(lane(standing, wall), planner=Forward)
    summary = episode.summary()
    assert summary["collisions_moving"] == 2
    assert summary["collisions_fixed"] == 1
    assert summary["collisions_at_rest"] == 0
    assert summary["collisions_moving_beyond_bound"] == 0
    assert summary["nearest_approach_moving"] < 0


def test_an_episode_that_does_not_arrive_ends_with_the_scenarios_time():
    class Resting(Forward):
        def update(self, scans, state):
            return Trajectory.resting(state, scans[0].stamp)

    summary = simulate(lane(), planner=Resting).summary()
    assert not summary["reached_goal"]
    assert summary["time_to_goal"] is None
    assert summary["duration"] == pytest.approx(4.0)
    assert summary["distance_driven"] == 0.0
    assert summary["mean_speed_under_way"] == 0.0
    assert summary["cycles"] == 40


def test_an_episode_is_kept_as_arrays(tmp_path):
    passing = ScriptSource(paths=(((0.0, -3.0, 3.0), (4.0, 1.0, 3.0)),), radius=(0.25,))
    episode = simulate(lane(passing), planner=Forward)
    episode.save(tmp_path / "episode.npz")
    arrays = np.load(tmp_path / "episode.npz")
    count = len(arrays["times"])
    assert arrays["states"].shape == (count, 5)
    assert arrays["mover_positions"].shape == (count, 1, 2)
    assert np.diff(arrays["times"]).max() <= 0.05 + 1e-9
    assert arrays["cycle_stamp"].shape == arrays["seconds_update"].shape


def test_the_same_seed_gives_the_same_episode():
    first, again = (simulate(lane(), planner=Forward, seed=3).states for _ in range(2))
    assert np.array_equal(first, again)
