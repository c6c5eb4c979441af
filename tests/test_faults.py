"""Faults and broken premises put into running cycles, and a harness that can fail."""

import json

import numpy as np
import pytest

from passpmp_ti import FutureModel, Navigator, Scan, Settings
from passpmp_ti.cli import main
from passpmp_ti.faults.campaign import GROUNDS, KINDS, fault_jobs, run_faults, run_job
from passpmp_ti.faults.drive import FaultyDrive
from passpmp_ti.faults.executor import Executor, Frame
from passpmp_ti.faults.premises import PREMISES, PremiseTrial, comparison_margin, deepest_return
from passpmp_ti.faults.tally import merged, total
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.trajectory import Trajectory

CHAIR = DifferentialDrive()


# faults ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=list(GROUNDS))
def every_kind(request):
    """What became of every kind, once each, with one robot."""
    return FaultyDrive(GROUNDS[request.param][0], list(KINDS), seed=3).run()


def test_no_fault_makes_anything_unsafe_or_raise(every_kind):
    counts = total(every_kind)
    assert counts.contacts_moving == 0
    assert counts.exceptions == 0
    assert counts.failures == 0
    assert counts.time_moving > 3.0


def test_every_kind_is_put_in_and_told_of(every_kind):
    for kind in KINDS:
        assert every_kind[kind].times == 1
        assert every_kind[kind].faulty_cycles >= 1
        assert every_kind[kind].rested + every_kind[kind].went_on == 1
        assert every_kind[kind].unrecorded == 0
    assert sum(every_kind[kind].while_moving for kind in KINDS) >= len(KINDS) / 3
    raised = [kind for kind in KINDS if kind.startswith("raises") and every_kind[kind].caught]
    assert len(raised) >= 3


def test_no_premise_is_reported_where_none_is_broken(every_kind):
    assert total(every_kind).premises == 0
    assert total(every_kind).held_unclear == 0


def test_the_same_job_finds_the_same():
    job = fault_jobs(["wheelchair"], 1, seed=2)[0]
    job = type(job)(robot=job.robot, ground=0, seed=4, kinds=("pose jumps", "scan late"))
    assert run_job(job)[1] == run_job(job)[1]


def test_jobs_hold_every_kind_as_often_as_asked():
    jobs = fault_jobs(["car", "wheelchair"], 3, seed=1)
    for robot in ("car", "wheelchair"):
        kinds = [kind for job in jobs if job.robot == robot for kind in job.kinds]
        assert sorted(kinds) == sorted(list(KINDS) * 3)


# a harness that can fail ----------------------------------------------------------------------


class Raising(Navigator):
    """Lets a bad scan through to its caller."""

    def update(self, scan, state, *, following=None):
        held = super().update(scan, state, following=following)
        if self.record.lost_scan:
            raise RuntimeError(self.record.lost_scan)
        return held


class Careless(Navigator):
    """Drives straight on at speed where it has no scan, whatever may be there."""

    def update(self, scan, state, *, following=None):
        held = super().update(scan, state, following=following)
        if self.record.lost_scan and isinstance(state, np.ndarray):
            now = self.record.stamp + self.settings.cycle
            begin, times = held.at(now), np.arange(5.0)
            states = np.repeat(begin[None], 5, axis=0)
            states[:, 0] += 20.0 * times * np.cos(begin[2])
            states[:, 1] += 20.0 * times * np.sin(begin[2])
            states[1:, 3] = 20.0
            return Trajectory(now + times, states, 4)
        return held


class Silent(Navigator):
    """Tells nothing of what went wrong."""

    def update(self, scan, state, *, following=None):
        held = super().update(scan, state, following=following)
        object.__setattr__(self.record, "lost_scan", "")
        object.__setattr__(self.record, "reason", "")
        return held


class Deaf(Navigator):
    """Does not hear of broken premises."""

    def update(self, scan, state, *, following=None):
        held = super().update(scan, state, following=following)
        object.__setattr__(self.record, "broken_premises", np.zeros((0, 2)))
        return held


def test_a_planner_that_raises_out_of_update_is_counted():
    found = FaultyDrive(GROUNDS["car"][0], ["scan lost"], 3, planner=Raising).run()
    assert found["scan lost"].exceptions > 0
    assert found["scan lost"].failures > 0


def test_a_planner_that_drives_on_blindly_is_counted_and_hits_something():
    lost = ["scan repeated"] * 6
    found = total(FaultyDrive(GROUNDS["wheelchair"][0], lost, 3, planner=Careless).run())
    assert found.endless > 0
    assert found.contacts_moving > 0


def test_a_planner_that_tells_nothing_is_counted():
    found = FaultyDrive(GROUNDS["car"][0], ["no scan but rubbish"], 3, planner=Silent).run()
    assert found["no scan but rubbish"].unrecorded > 0


def test_an_answer_that_does_not_begin_where_the_robot_is_is_not_taken():
    executor = Executor(CHAIR, np.zeros(5), 0.0)
    near = np.zeros((3, 5))
    near[:, 0] = [0.0, 0.1, 0.1]
    for offset, breaks in ((0.0, 0), (0.5, 1)):
        states = near + np.array([offset, 0, 0, 0, 0])
        executor.offer(Trajectory(np.array([1.0, 1.5, 2.0]), states, 1), Frame(), 0.9)
        assert executor.switch(0.9, 1.1) == 1.0
        executor.take(1.0)
        assert executor.breaks == breaks
        assert executor.at(1.0)[0] == 0.0


def test_an_answer_that_comes_after_its_start_is_not_taken():
    executor = Executor(CHAIR, np.zeros(5), 0.0)
    late = Trajectory(np.array([1.0, 2.0]), np.zeros((2, 5)), 1)
    executor.offer(late, Frame(), 1.2)
    assert executor.dropped == 1
    assert executor.switch(1.2, 3.0) is None


def test_what_is_told_in_a_frame_is_undone_by_it():
    frame = Frame(3.0, -2.0, 0.7, 10.0)
    state = np.array([[1.0, 2.0, 0.3, 0.5, 0.6]])
    assert frame.true(frame.told(state)) == pytest.approx(state, abs=1e-12)
    assert frame.told(state)[0, 3:] == pytest.approx(state[0, 3:])
    assert frame.told(state)[0, 2] == pytest.approx(1.0)


# broken premises ------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", list(GROUNDS))
@pytest.mark.parametrize("premise", PREMISES)
def test_a_broken_premise_is_noticed_in_its_cycle_and_braked_for(robot, premise):
    found = None
    for seed in range(6):
        trial = PremiseTrial(GROUNDS[robot][0], premise, seed).run()
        found = trial if found is None else found
        if trial is not found:
            found.add(trial)
        if found.in_time:
            break
    assert found.failures == 0
    assert found.in_time >= 1
    assert found.braked >= 1


def test_a_premise_that_goes_unnoticed_is_counted():
    for seed in range(4):
        found = PremiseTrial(GROUNDS["wheelchair"][0], PREMISES[0], seed, planner=Deaf).run()
        if found.broken > found.shallow:
            break
    assert found.missed == 1
    assert found.failures >= 1


def test_the_depth_of_a_return_is_its_distance_into_the_disc_that_memory_keeps_free():
    settings = Settings.for_robot(CHAIR, object_speed=0.5, cell=0.1)
    far = Scan(np.full(360, 6.0), -np.pi, 2 * np.pi / 360, 6.0, (0.0, 0.0, 0.0), 0.0)
    model = FutureModel.from_scan(far, CHAIR, settings)

    def one_return(at, stamp):
        ranges = np.full(360, 6.0)
        ranges[180] = at
        return Scan(ranges, -np.pi, 2 * np.pi / 360, 6.0, (0.0, 0.0, 0.0), stamp)

    inside = deepest_return(model, [one_return(2.0, 0.1)])
    assert inside == pytest.approx(CHAIR.disc_radius, abs=0.8 * settings.cell)
    assert inside > comparison_margin(model)
    assert len(FutureModel.from_scan(one_return(2.0, 0.1), CHAIR, settings, model).broken_premises)
    at_the_rim = deepest_return(model, [one_return(5.9, 0.1)])
    assert at_the_rim < 0


# the command ----------------------------------------------------------------------------------


def test_a_campaign_writes_its_tables(tmp_path, monkeypatch, capsys):
    few = dict(list(KINDS.items())[:3])
    monkeypatch.setattr("passpmp_ti.faults.campaign.KINDS", few)
    arguments = ["faults", "--robot", "car", "--times", "1", "--workers", "1"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    told = json.loads((tmp_path / "faults.json").read_text())
    assert told["failures"] == 0
    assert sum(counts["times"] for counts in told["faults"]["car"].values()) == 3
    assert "contacts moving" in (tmp_path / "faults.md").read_text()
    assert "Must be 0" in capsys.readouterr().out


def test_tallies_add_up():
    one = FaultyDrive(GROUNDS["car"][0], ["all nan"], 5).run()
    both = merged([one, one])
    assert both["all nan"].times == 2
    assert total(both).distance == pytest.approx(2 * total(one).distance)


def test_bad_numbers_are_refused():
    with pytest.raises(ValueError, match="robots"):
        run_faults(["boat"], 1)
    with pytest.raises(ValueError, match="times_each"):
        run_faults(["car"], 0)


@pytest.mark.campaign
def test_a_campaign_of_faults_finds_nothing():
    assert run_faults(times_each=100).failures == 0


@pytest.mark.campaign
def test_a_campaign_of_broken_premises_finds_nothing():
    assert run_faults(times_each=100, premises=True).failures == 0
