"""The physics twin: a wheelchair in MuJoCo, what it sees, and the whole chain through it.

Physics has a clock of its own here, and nothing waits. The chain itself, in real time and over real
processes, is long: pytest -m campaign.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'passpmp_ti[twin]'")

from hardware.chair_lidar import ChairLidar
from hardware.chair_model import WALL_HALF, ChairNature
from hardware.executor import Tick
from hardware.executor_settings import ExecutorSettings
from hardware.executor_trials import motion
from hardware.follower import FollowerSettings, wheel_speeds
from hardware.mujoco_chair import MujocoChair
from hardware.path import Path
from hardware.scip_sweep import UST_10LX
from hardware.twin_figures import Sent, latencies
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.sim.movers import PathMovers
from passpmp_ti.sim.world import World

BOUNDS = (-20.0, -20.0, 20.0, 20.0)
PERFECT = ChairNature()
PERIOD = 0.01


class Clock:
    """Stands still but for what it is told."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def chair_in(world=None, nature=PERFECT, seed=0, **options):
    clock = Clock()
    world = World(BOUNDS) if world is None else world
    rng = np.random.default_rng(seed)
    return MujocoChair(world, nature, rng=rng, clock=clock, **options), clock


def driven(chair, clock, right, left, seconds):
    """[n] the truth at each period, while it is told the same speeds."""
    told = []
    for _ in range(round(seconds / PERIOD)):
        chair.drive(right, left)
        clock.now += PERIOD
        told.append(chair.truth)
    return told


# the chair --------------------------------------------------------------------------------------


def test_it_gains_speed_no_faster_than_its_limit_and_keeps_it():
    chair, clock = chair_in()
    told = driven(chair, clock, 1.0, 1.0, 2.0)
    speeds = np.array([t.right for t in told])
    a = chair.limits.acceleration
    # 0.05 m/s for tyres that give a little
    assert (speeds <= a * PERIOD * np.arange(1, len(speeds) + 1) + 0.05).all()
    assert speeds[80] > 0.9
    assert speeds[-50:] == pytest.approx(1.0, abs=0.02)
    assert abs(told[-1].y) < 0.01


def test_it_turns_on_the_spot():
    chair, clock = chair_in()
    told = driven(chair, clock, 0.3, -0.3, 2.0)[-1]
    # eq. 23: 0.6 m/s over a track of 0.54 m, for 2 s less the time to get there
    assert told.theta == pytest.approx(0.6 / 0.54 * (2.0 - 0.5 * 0.3 / 1.6), abs=0.2)
    assert math.hypot(told.x, told.y) < 0.05


def test_who_is_told_nothing_brakes_by_himself():
    chair, clock = chair_in()
    driven(chair, clock, 1.0, 1.0, 1.0)
    clock.now += chair.limits.command_timeout + 1.0 / chair.limits.acceleration + 0.1
    assert max(abs(chair.truth.right), abs(chair.truth.left)) < 0.01


def test_stopped_it_obeys_nobody_until_reset():
    chair, clock = chair_in()
    chair.stop()
    assert driven(chair, clock, 1.0, 1.0, 0.5)[-1].x == pytest.approx(0.0, abs=0.01)
    chair.reset()
    assert driven(chair, clock, 1.0, 1.0, 0.5)[-1].x > 0.1


def test_commands_that_are_no_numbers_change_nothing():
    chair, clock = chair_in()
    driven(chair, clock, 0.5, 0.5, 1.0)
    chair.drive(math.nan, 0.0)
    clock.now += PERIOD
    assert chair.truth.right == pytest.approx(0.5, abs=0.03)
    assert chair.refused == 1


def test_without_its_small_wheels_behind_it_tips_over_backwards():
    # all that the motors have, at once, under a centre of mass above the axle
    rash = replace(PERFECT.limits, acceleration=50.0)
    nature = replace(PERFECT, limits=rash, ahead=0.02, torque=150.0)
    lean = {}
    for held in (True, False):
        chair, clock = chair_in(nature=replace(nature, anti_tippers=held))
        driven(chair, clock, 3.0, 3.0, 1.0)
        lean[held] = chair.tilt
    assert lean[True] < math.radians(5)
    # it lies on the back of its frame
    assert lean[False] > math.radians(30)


def test_wheels_slip_and_are_not_as_large_as_it_believes():
    chair, clock = chair_in(nature=replace(PERFECT, radius_error=(0.01, 0.01)))
    driven(chair, clock, 1.0, 1.0, 2.0)
    assert chair.odometry().right == pytest.approx(1.0, abs=0.01)
    assert chair.truth.right == pytest.approx(1.01, abs=0.01)


def test_the_place_it_tells_is_within_the_declared_error():
    nature = replace(PERFECT, pose_noise=0.01)
    chair, clock = chair_in(nature=nature)
    off = []
    for _ in range(200):
        driven(chair, clock, 0.5, 0.3, PERIOD)
        told, truth = chair.odometry(), chair.truth
        off.append(math.hypot(told.x - truth.x, told.y - truth.y))
    assert 0.01 < max(off) <= nature.localisation_error + 0.5 * PERIOD


def test_the_same_seed_and_commands_give_the_same_drive():
    nature = ChairNature.drawn(np.random.default_rng(5))
    ends = []
    for _ in range(2):
        chair, clock = chair_in(nature=nature, seed=7)
        driven(chair, clock, 0.8, 0.6, 0.5)
        ends.append(chair.odometry())
    assert ends[0] == ends[1]


def worst_error(nature, *, seed=0, motions=2):
    """Farthest off its path [m] while the executor's follower drives it."""
    robot, follower = DifferentialDrive(wheel_speed=1.5), FollowerSettings()
    chair, clock = chair_in(nature=nature, seed=seed)
    rng, worst = np.random.default_rng(seed), 0.0
    driven(chair, clock, 0.0, 0.0, 0.1)
    for _ in range(motions):
        here = chair.odometry()
        path = Path(motion(robot, np.array([*here[1:4], 0.0, 0.0]), clock.now, rng))
        while clock.now < path.end + 0.2:
            told = chair.odometry()
            chair.drive(*wheel_speeds(told, path.at, clock.now, chair.limits, follower))
            clock.now += PERIOD
            place = path.at(told.stamp)
            worst = max(worst, math.hypot(told.x - place.x, told.y - place.y))
    return worst


@pytest.mark.parametrize("seed", [0, 2])
def test_it_keeps_to_its_path_within_the_executors_bound(seed):
    nature = ChairNature.drawn(np.random.default_rng(seed))
    assert worst_error(nature, seed=seed) < ExecutorSettings().bound


def test_on_ice_it_does_not():
    assert worst_error(replace(PERFECT, friction=0.1)) > ExecutorSettings().bound


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"mass": 0.0}, "mass"),
        ({"slippery": 1.0}, "slippery"),
        ({"radius_error": (0.5, 0.0)}, "radius_error"),
        ({"gains": (1.0, 2.0)}, "gains"),
        ({"ahead": 1.0}, "ahead"),
    ],
)
def test_a_nature_that_cannot_be_is_refused(change, named):
    with pytest.raises(ValueError, match=named):
        replace(PERFECT, **change)


# what it sees -----------------------------------------------------------------------------------


def sweep(chair, clock, mount=(0.0, 0.0, 0.0), **options):
    """One sweep that ended a moment ago."""
    lidar = ChairLidar(chair, mount, np.random.default_rng(0), **{"noise": 0.0, **options})
    return lidar(clock.now - 0.05)


def standing(world):
    """A chair that has stood for a while."""
    chair, clock = chair_in(world)
    driven(chair, clock, 0.0, 0.0, 0.2)
    return chair, clock


def test_a_beam_meets_the_wall_where_it_stands():
    chair, clock = standing(World(BOUNDS, segments=np.array([[3.0, -9.0, 3.0, 9.0]])))
    ranges = sweep(chair, clock, mount=(0.3, 0.0, 0.0))
    bearings = np.array([UST_10LX.angle(step) for step in range(1081)])
    ahead = np.abs(bearings) < 1.2
    wanted = (3.0 - WALL_HALF - 0.3) / np.cos(bearings[ahead])
    # the chair stands on tyres that give by a fraction of a millimetre
    assert ranges[ahead] == pytest.approx(wanted, abs=0.01)
    assert np.isinf(ranges[np.abs(bearings) > 1.6]).all()


def test_its_own_body_is_not_seen():
    chair, clock = standing(World(BOUNDS))
    assert np.isinf(sweep(chair, clock, mount=(-0.3, 0.0, math.pi))).all()


def test_people_are_where_their_paths_have_them_while_the_mirror_turns():
    # somebody crosses at 2 m/s: the sweep's slices see him at different times
    path = np.array([[0.0, 4.0, -4.0], [4.0, 4.0, 4.0]])
    chair, clock = standing(World(BOUNDS, movers=PathMovers([path], np.array([0.3]))))
    chair.begin = 2.0 - clock.now  # the world's time is 2 s: he stands straight ahead
    driven(chair, clock, 0.0, 0.0, 0.1)
    begin = clock.now - 0.05
    ranges = ChairLidar(chair, (0.0, 0.0, 0.0), np.random.default_rng(0), noise=0.0)(begin)
    hits = np.flatnonzero(np.isfinite(ranges))
    middle = UST_10LX.angle(float(hits.mean()))
    when = begin + UST_10LX.after(float(hits.mean())) + chair.begin
    x, y = chair.world.movers.at(when)[0]
    assert middle == pytest.approx(math.atan2(y, x), abs=0.01)
    assert ranges.min() == pytest.approx(math.hypot(x, y) - 0.3, abs=0.01)


def test_who_is_not_in_the_world_is_not_seen():
    path = np.array([[0.0, 2.0, 0.0]])
    gone = PathMovers([path], np.array([0.3]), gone=np.array([1.0]))
    chair, clock = standing(World(BOUNDS, movers=gone))
    chair.begin = 5.0 - clock.now
    assert np.isinf(sweep(chair, clock)).all()
    chair.begin = -clock.now
    assert np.isfinite(sweep(chair, clock)).any()


def test_errors_of_ranges_stay_within_what_is_declared():
    chair, clock = standing(World(BOUNDS, segments=np.array([[3.0, -9.0, 3.0, 9.0]])))
    clean, noisy = sweep(chair, clock), sweep(chair, clock, noise=0.02)
    hit = np.isfinite(clean)
    off = np.abs(noisy[hit] - clean[hit])
    assert 0.03 < off.max() <= 0.06 + 1e-6


def test_a_sweep_of_a_world_that_stands_still_is_lost_not_guessed():
    chair, clock = standing(World(BOUNDS))
    times = np.array([clock.now, clock.now + 1.0])
    assert chair.poses(times, patience=0.0) is None


# what is measured -------------------------------------------------------------------------------


def test_latencies_are_told_of_what_was_taken_only():
    rows = [(t / 100, 0.0 if t < 15 else 1.0) for t in range(100)]
    ticks = [Tick(t, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, taken) for t, taken in rows]
    taken = Sent(stamp=0.09, arrived=0.10, at=0.145, start=0.49)
    refused = Sent(stamp=0.49, arrived=0.50, at=0.60, start=0.89)
    to_executor, to_wheels, lost = latencies([taken, refused], ticks)
    assert to_executor == pytest.approx([0.05])
    assert to_wheels == pytest.approx([0.39])
    assert lost == 1


def test_a_twin_is_told_of_in_one_text(tmp_path):
    from hardware.twin_process import TwinConfig

    told = TwinConfig(directory=tmp_path, scenario="corridor", seed=3, object_speed=0.5)
    assert TwinConfig.from_json(told.to_json()) == told
    with pytest.raises(ValueError, match="configuration"):
        TwinConfig.from_json('{"directory": "/", "colour": 1}')


@pytest.mark.campaign
def test_through_the_whole_chain_nothing_is_touched_while_it_moves():
    from hardware.twin import Chain

    with Chain("corridor_person", cycle=0.4, object_speed=0.5) as chain:
        found = chain.run(30.0)
    told = found.summary()
    assert told["collisions_moving"] == 0
    assert told["distance_driven"] > 0.5
