"""The twin's chain: margins, what is recorded and shown, experiments, faults.

The processes are stood in for here; all of it over real processes and in real time is long:
pytest -m campaign.
"""

import json
import math
from argparse import Namespace
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'passpmp_ti[twin]'")

from hardware import drive, twin, twin_experiments, twin_faults, twin_page, twin_view
from hardware.chair_model import ChairNature
from hardware.executor import ADDRESS, Tick
from hardware.letterbox import Letterbox
from hardware.messages import Offer, decode
from hardware.mujoco_chair import MujocoChair
from hardware.status import Reason, State
from hardware.twin_cycles import Cycle, CycleReader, CycleWriter
from hardware.twin_experiments import EXPERIMENTS, LATE, TRIES, Job
from hardware.twin_figures import chained, longest_stand, stops
from hardware.twin_film import moment_at
from hardware.twin_picture import HEAD, Picture
from hardware.twin_planner import CYCLES, PlannerConfig
from hardware.twin_process import TwinConfig, _obey
from hardware.twin_settings import TOP_SPEED, executor_of, on_chair, settings_of
from hardware.twin_wrong import WrongLink
from passpmp_ti.scan import Scan
from passpmp_ti.sim.drive import Drive
from passpmp_ti.sim.episode import episode_of
from passpmp_ti.sim.scenario import load_scenario
from passpmp_ti.trajectory import Trajectory

NATURE = ChairNature.drawn(np.random.default_rng(0))


def on_the_chair(name):
    """A scenario as the chair drives it, its world, and the planner's settings."""
    scenario = on_chair(load_scenario(name))
    world, _, _ = scenario.build(0)
    return scenario, world, settings_of(scenario, world, 0.1, NATURE)


# how it is driven ------------------------------------------------------------------------------


def test_the_planner_reckons_with_what_executor_and_localisation_may_be_off_by():
    _, _, settings = on_the_chair("narrow_passage")
    executor = executor_of(0.1)
    age = settings.stamp_error - executor.rest_late
    executor.check_margins(settings, scan_age=age)
    for less in ("tracking_error", "stamp_error"):
        with pytest.raises(ValueError, match=less):
            executor.check_margins(
                settings.changed(**{less: getattr(settings, less) - 0.005}), scan_age=age
            )
    # a told place, and what its wheels do otherwise for 30 ms while the next one is on its way
    assert settings.localisation_error >= NATURE.localisation_error + 0.5 * 1.6 * 0.03**2
    assert settings.range_noise > 0.03  # a lidar's errors are cut at that


def test_with_these_margins_the_chair_fits_through_the_narrow_passage_with_the_old_ones_not():
    scenario, _, settings = on_the_chair("narrow_passage")
    # the passage is 1.3 m, its walls a centimetre thick, returns 3 cm off, seen cells and the
    # guide's a cell off each
    left = 0.65 - 0.01 - 0.03 - settings.range_noise - settings.cell
    assert settings.clearance(scenario.robot) < left
    old = settings.changed(tracking_error=0.10, localisation_error=0.03)
    assert old.clearance(scenario.robot) > left


def test_nobody_in_the_world_is_slimmer_than_the_planner_takes_people_to_be():
    _, world, settings = on_the_chair("corridor_person")
    assert settings.object_radius <= world.movers.radius.min()
    slim = replace(world, movers=replace_radius(world.movers, 0.12))
    assert settings_of(load_scenario("corridor_person"), slim, 0.1, NATURE).object_radius == 0.12


def replace_radius(movers, radius):
    """The same movers, slimmer."""
    movers.radius = np.full_like(movers.radius, radius)
    return movers


def test_the_chair_is_driven_no_faster_than_its_margins_are_for():
    scenario, _, settings = on_the_chair("corridor")
    assert scenario.robot.top_speed == TOP_SPEED == settings.cruise_speed
    with pytest.raises(ValueError, match="wheelchair"):
        on_chair(load_scenario("simple"))


# what is recorded ------------------------------------------------------------------------------


def cycle(at, reached=0, plan=((0.0, 0.0), (1.0, 0.0))):
    return Cycle(
        at=at, record=None, took=None, sent=None, goals_reached=reached,
        plan=np.array(plan, dtype=np.float32), seen=np.zeros((0, 2), dtype=np.float32),
        worst_error=math.nan, lidars=(),
    )  # fmt: skip


def test_what_is_written_is_read_once_and_a_torn_end_waits_for_its_rest(tmp_path):
    path = tmp_path / "cycles"
    reader = CycleReader(path)
    assert reader.new() == []
    writer = CycleWriter(path)
    for at in (1.0, 2.0):
        writer.add(cycle(at))
    whole = path.read_bytes()
    path.write_bytes(whole[:-7])
    assert [c.at for c in reader.new()] == [1.0]
    path.write_bytes(whole)
    assert [c.at for c in reader.new()] == [2.0]
    assert reader.new() == []
    writer.close()


def test_a_picture_shows_what_was_known_then():
    scenario, world, _ = on_the_chair("corridor")
    stamps = np.arange(0.0, 2.0, 0.01)
    truth = np.column_stack([stamps, stamps, *[np.zeros_like(stamps)] * 6])
    cycles = [cycle(0.5, plan=[(0, 0), (2, 0)]), cycle(1.5, plan=[(0, 0), (3, 0)])]
    moment = moment_at(1.0, truth, cycles, scenario.goals, 10.0, 0.0)
    assert moment.state[0] == pytest.approx(1.0, abs=0.01)
    assert moment.plan[-1, 0] == 2
    assert moment.time == 11.0
    picture = Picture("corridor", world, scenario.robot)
    image = picture.of(moment)
    assert image.shape == (picture.size[1], picture.size[0], 3)
    moved = picture.of(moment_at(1.9, truth, cycles, scenario.goals, 10.0, 0.0))
    assert (image[HEAD:] != moved[HEAD:]).any()


def test_without_a_window_the_live_picture_is_there_whole(tmp_path):
    image = np.zeros((20, 30, 3), dtype=np.uint8)
    image[:, :, 0] = 200  # red
    twin_view._show(image, "", tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["live.png"]
    assert (cv2.imread(str(tmp_path / "live.png"))[:, :, 2] == 200).all()


def test_a_view_is_told_all_in_one_text(tmp_path):
    told = twin_view.ViewConfig(
        twin=TwinConfig(directory=tmp_path, scenario="corridor"), begin=1.5, folder="out"
    )
    assert twin_view.ViewConfig.from_json(told.to_json()) == told


@pytest.mark.parametrize("option", ["video", "live"])
def test_what_is_true_is_shown_of_the_twin_only(option):
    given = {"config": "robot.yaml", "twin": None, "video": None, "live": None, option: "out"}
    with pytest.raises(ValueError, match=f"--{option}"):
        drive.run(Namespace(**given))


def driven(speeds, step=0.05):
    """An episode of a chair that drives ahead at these speeds, a step each."""
    scenario, world, settings = on_the_chair("corridor")
    state = np.array([0.0, 0.0, 0.0, 0.0, 0.0])
    truth = Drive(scenario, world, state, 100.0)
    times = 100.0 + step * np.arange(len(speeds))
    x = np.concatenate([[0.0], np.cumsum(step * np.array(speeds[:-1]))])
    for n in range(1, len(speeds)):
        rows = [[x[m], 0.0, 0.0, speeds[m], speeds[m]] for m in (n - 1, n)]
        truth.follow(times[n - 1 : n + 1], np.array(rows))
    truth.update_times.append(0.01)
    return episode_of(truth, settings, 0, times[len(times) // 2], False)


def test_a_chair_that_is_watched_to_rest_never_moves_for_more_than_all_the_time(tmp_path):
    (tmp_path / "ticks").write_bytes(b"")
    episode = driven([0.0] + [0.5] * 59)
    truth = np.zeros((3, 8))
    # it reached the goal half way, and rolled on
    assert episode.summary()["share_moving"] > 1.0
    told = chained(episode, [], tmp_path / "ticks", truth, 0).summary()
    assert told["share_moving"] <= 1.0
    assert told["mean_speed"] == pytest.approx(0.5, rel=0.1)


def test_the_longest_stand_is_between_two_motions():
    assert longest_stand(driven([0.5] * 5 + [0.0] * 20 + [0.5] * 5 + [0.0] * 40)) == pytest.approx(
        1.05, abs=0.06
    )
    assert longest_stand(driven([0.0] * 5)) == 0.0


def test_stops_are_counted_as_they_begin_by_their_reason():
    def tick(state, reason=Reason.NONE):
        return Tick(0.0, float(state), float(reason), 0.0, 0.0, 0.0, 0.0, 0.0)

    off = tick(State.BRAKING, Reason.OFF_ITS_PATH)
    lost = tick(State.BRAKING, Reason.FEEDBACK_LOST)
    follows = tick(State.FOLLOWING)
    found = stops([follows, off, off, follows, lost, follows, off])
    assert found == {"off_its_path": 2, "feedback_lost": 1}


# who dies is started again ---------------------------------------------------------------------


def test_a_planner_that_died_is_followed_by_one_with_the_goals_that_are_left(
    monkeypatch, tmp_path
):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    started = []

    class Planner:
        alive = False

        def __init__(self, config):
            started.append(config.goals)

        def close(self):
            pass

    monkeypatch.setattr(twin, "PlannerProcess", Planner)
    chain = twin.Chain("corridor", goals=((1.0, 0.0), (2.0, 0.0), (3.0, 0.0)))
    writer = CycleWriter(chain.directory / CYCLES)
    chain.twin = SimpleNamespace(truth=lambda: np.zeros((0, 8)))
    chain.planner = chain.start_planner()
    writer.add(cycle(1.0, reached=1))
    chain.revive()
    assert started == [chain.goals, chain.goals[1:]]
    assert chain.goals_reached == 1
    recorded = []
    chain._record = lambda scans, state: recorded.append((len(scans), state[0]))
    scan = Scan(np.ones(9), 0.0, 0.1, 5.0, (0.0, 0.0, 0.0), 1.0)
    planned = replace(cycle(2.0, reached=2), scans=(scan, scan), state=np.full(5, 7.0))
    writer.add(planned)
    chain.see()
    assert recorded == [(2, 7.0)]
    assert chain.goals_reached == 3
    writer.close()
    assert chain.revived == 1


def test_a_planner_is_told_all_in_one_text(tmp_path):
    config = PlannerConfig(
        twin=TwinConfig(directory=tmp_path, scenario="corridor", ahead=3.0), cycle=0.1,
        goals=((1.0, 2.0),), obeys=True,
    )  # fmt: skip
    assert PlannerConfig.from_json(config.to_json()) == config
    with pytest.raises(ValueError, match="configuration"):
        PlannerConfig.from_json('{"cycle": 1}')
    with pytest.raises(ValueError, match="cycle"):
        replace(config, cycle=0.0)
    with pytest.raises(ValueError, match="ahead"):
        TwinConfig(directory=tmp_path, scenario="corridor", ahead=-1.0)


# experiments -----------------------------------------------------------------------------------


def told_by_a_drive(**changes):
    """What `Chained.summary` tells, in part."""
    known = {
        "interrupted": False, "twin_latest": 0.003, "collisions_moving": 0,
        "collisions_at_rest": 0, "reached_goal": True, "time_to_goal": 12.0, "longest_stand": 0.0,
        "rests_at_last": True, "stops": {}, "nearest_fixed_moving": 0.2,
        "nearest_approach_moving": None, "worst_error": 0.02, "sent": 9, "refused": 0, "idle": 0,
    }  # fmt: skip
    for name in ("scan_age", "to_trajectory", "to_executor", "to_wheels"):
        known |= {f"{name}_median": 0.01, f"{name}_p99": 0.02}
    return known | changes


def stood_in(monkeypatch, told):
    """Drives come to these, one after the other; returns those that are left."""
    left = list(told)

    class Stand:
        def __init__(self, *_, **__):
            pass

        def __enter__(self):
            if left[0] is None:
                left.pop(0)
                raise RuntimeError("the twin did not start")
            return self

        def __exit__(self, *_):
            pass

        def run(self, seconds):
            if left[0] == "gone":
                raise RuntimeError("the executor is gone")
            self.summary = lambda: left.pop(0)
            return self

    monkeypatch.setattr(twin_experiments, "Chain", Stand)
    return left


def test_a_disturbed_drive_is_driven_again_and_both_are_told(monkeypatch):
    late = told_by_a_drive(twin_latest=2 * LATE, collisions_moving=1, reached_goal=False)
    stood_in(monkeypatch, [late, told_by_a_drive()])
    found = twin_experiments.carry_out(Job(EXPERIMENTS[0], 3))
    assert found["reached_goal"]
    assert found["quiet"]
    assert found["disturbed"] == [
        {"twin_latest": 2 * LATE, "collisions_moving": 1, "reached_goal": False}
    ]
    page = twin_page.experiments([found])
    assert "happened 1 times, with 1 contacts while moving; 0 of the 1 drives" in page


def test_a_drive_that_stays_disturbed_counts_and_is_called_so(monkeypatch):
    left = stood_in(monkeypatch, [told_by_a_drive(twin_latest=1.0)] * (TRIES + 1))
    found = twin_experiments.carry_out(Job(EXPERIMENTS[0], 0))
    assert len(left) == 1
    assert not found["quiet"]
    assert "1 of the 1 drives were disturbed to the last" in twin_page.experiments([found])


def test_what_does_not_start_is_tried_again_and_counted(monkeypatch):
    stood_in(monkeypatch, [None, told_by_a_drive()])
    assert len(twin_experiments.carry_out(Job(EXPERIMENTS[0], 0))["disturbed"]) == 1
    stood_in(monkeypatch, [None] * TRIES)
    with pytest.raises(RuntimeError, match="did not start"):
        twin_experiments.carry_out(Job(EXPERIMENTS[0], 0))


def test_an_executor_that_dies_on_the_way_is_no_disturbance(monkeypatch):
    stood_in(monkeypatch, ["gone", told_by_a_drive()])
    with pytest.raises(RuntimeError, match="the executor is gone"):
        twin_experiments.carry_out(Job(EXPERIMENTS[0], 0))


def test_what_was_driven_is_not_driven_again(monkeypatch, tmp_path, capsys):
    count = len(EXPERIMENTS)
    left = stood_in(monkeypatch, [told_by_a_drive()] * (2 * count))
    for runs, rest in ((1, count), (1, count), (2, 0)):
        command = ["twin_experiments", "--runs", str(runs), "--out", str(tmp_path)]
        monkeypatch.setattr("sys.argv", command)
        assert twin_experiments.main() == 0
        assert len(left) == rest
    assert f"{2 * count} drives, 0 with a contact" in capsys.readouterr().out
    target = tmp_path / "page.md"
    monkeypatch.setattr(
        "sys.argv", ["twin_page", "--experiments", str(tmp_path), "--page", str(target)]
    )
    assert twin_page.main() == 0
    assert target.read_text().count("| Fig. 19, `narrow_passage`") == 4


# faults ----------------------------------------------------------------------------------------


def run_of(**changes):
    known = {
        "kind": "planner killed", "took": 1.0, "allowed": 1.5, "stalled": 0.0, "error": 0.01,
        "back": 3.0, "failure": "", "scenario": "corridor", "variant": "planner killed", "seed": 0,
        "touched": 0, "late": 0.0, "disturbed": [], "quiet": True,
    }  # fmt: skip
    return known | changes


def test_faults_that_failed_are_on_the_page_those_of_disturbed_runs_too():
    again = [{"late": 1.0, "failure": "late", "touched": 2}]
    told = twin_page.faults([run_of(), run_of(seed=1, failure="it moved", disturbed=again)])
    assert "| planner killed | 0.03 | 2 | 1 | 0 | 1.00, 1.00 | 0.50 | 3.00, 3.00 |" in told
    assert "- planner killed 1: it moved" in told
    assert "1 runs in which the twin was late" in told
    assert "1 of those failed, with 2 contacts" in told


def test_every_fault_of_the_issue_has_a_time_by_which_it_is_noticed():
    found = twin_faults.kinds(executor_of(0.1), 0.01)
    assert len({kind.name for kind in found}) == 10
    assert all(0.0 < kind.detection <= 0.3 for kind in found)


def test_a_chair_whose_encoders_are_cut_off_tells_nothing_new():
    _, world, _ = on_the_chair("corridor")
    now = [0.0]
    chair = MujocoChair(world, rng=np.random.default_rng(0), clock=lambda: now[0])
    now[0] = 0.1
    known = chair.odometry()
    _obey("silent", chair, [])
    now[0] = 0.2
    assert chair.odometry() is known
    _obey("", chair, [])
    now[0] = 0.3
    assert chair.odometry().stamp > 0.2


def test_a_planner_told_to_go_wrong_does_until_it_is_told_otherwise(tmp_path):
    here = Letterbox(tmp_path / ADDRESS)
    rig = Letterbox(tmp_path / "rig")
    rest = Trajectory.resting(np.zeros(5), 1.0)

    def offered(link):
        link.poll()
        link.offer(rest)
        return [decode(data) for data, _ in here.collect()][-1]

    with WrongLink(
        tmp_path, track=0.54, guess=0.03, orders=tmp_path / "planner-orders"
    ) as link:
        right = offered(link)
        assert isinstance(right.body, Offer)
        rig.post(tmp_path / "planner-orders", b"nan")
        assert math.isnan(offered(link).body.trajectory.states[0, 3])
        rig.post(tmp_path / "planner-orders", b"clock -100")
        assert offered(link).sent_at == pytest.approx(right.sent_at - 100.0, abs=5.0)
        rig.post(tmp_path / "planner-orders", b"")
        last = offered(link)
        assert last.sent_at == pytest.approx(right.sent_at, abs=5.0)
        assert not math.isnan(last.body.trajectory.states[0, 3])
    here.close()
    rig.close()


@pytest.mark.campaign
def test_a_planner_that_is_killed_is_started_again_and_the_goal_reached():
    with twin.Chain("corridor", cycle=0.2, object_speed=0.2, threads=1) as chain:
        killed = []

        def see(look):
            if look.time > 3.0 and not killed:
                killed.append(chain.planner.process.kill())

        found = chain.run(60.0, see)
    told = found.summary()
    assert told["revived"] == 1
    assert told["reached_goal"]
    assert told["collisions_moving"] == 0


@pytest.mark.campaign
def test_faults_in_the_chain_are_survived(tmp_path):
    command = ["--runs", "1", "--only", "base's feedback lost", "--out", str(tmp_path)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["twin_faults", *command])
        assert twin_faults.main() == 0
    lines = (tmp_path / "episodes.jsonl").read_text().splitlines()
    assert json.loads(lines[0])["failure"] == ""
