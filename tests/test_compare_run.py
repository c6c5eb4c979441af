"""Comparisons that are driven: the same worlds, resumed, refused, and told on a page."""

import importlib.util
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from passpmp_ti.cli import BAD_INPUT, main
from passpmp_ti.compare import job as jobs
from passpmp_ti.compare.comparison import Comparison, carry_out_all
from passpmp_ti.compare.job import Job, carry_out
from passpmp_ti.compare.ledger import EPISODES
from passpmp_ti.compare.observer import Observer
from passpmp_ti.compare.progress import ComparisonProgress
from passpmp_ti.compare.variant import Variant, modes
from passpmp_ti.compare.workers import Here, Processes, opened
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

WORLD = """description: a short drive past somebody
robot: {type: differential}
settings: {object_speed: 1.0, cell: 0.08, particles: 20, iterations: 10, capacity: 300}
lidars: [{range_max: 6, beams: 180}]
world: {bounds: [-4, -4, 4, 4]}
movers:
  type: scripted
  discs: [{radius: 0.3, waypoints: [[0, 3, 2.5], [10, 3, -3]]}]
start: [0, 0, 0]
start_spread: [0.2, 0.2, 0.1]
goals: [[1, 0]]
duration: 0.8
"""
FAST, SLOW = Variant(name="fast"), Variant(name="slow", changes={"cycle": 0.2})


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "short.yaml"
    path.write_text(WORLD)
    return str(path)


@pytest.fixture(scope="module", autouse=True)
def unrehearsed():
    """Compiling every kernel beforehand makes costs comparable, and nothing else."""
    jobs.REHEARSED.add((DifferentialDrive, "conservative"))


def comparison(scenario, **others):
    return Comparison(**{"scenarios": [scenario], "variants": (FAST, SLOW), "episodes": 1} | others)


class Counting(Here):
    """Counts what it is asked to do."""

    def __init__(self):
        self.done = []

    def each(self, function, wanted):
        for one in wanted:
            self.done.append(one.key)
            yield function(one)


def silent(_):
    pass


def timeless(found):
    return {name: value for name, value in found.items() if name != "timings"}


# episodes -------------------------------------------------------------------------------------


def test_an_episode_depends_on_its_job_alone(scenario):
    job = Job(scenario=scenario, variant=FAST, seed=3)
    first, again = timeless(carry_out(job)), timeless(carry_out(job))
    assert json.dumps(first) == json.dumps(again)
    assert first["error"] is None
    assert first["outcome"]["distance_driven"] > 0.02
    other = timeless(carry_out(replace(job, seed=4)))
    assert json.dumps(other["outcome"]) != json.dumps(first["outcome"])


def test_variants_drive_the_same_world_and_only_their_changes_differ(scenario):
    twin = replace(FAST, name="twin")
    found = [
        carry_out(Job(scenario=scenario, variant=v, seed=1, observe=False))
        for v in (FAST, twin, SLOW)
    ]
    assert found[0]["outcome"] == found[1]["outcome"]
    assert (found[0]["outcome"]["cycles"], found[2]["outcome"]["cycles"]) == (8, 4)
    assert found[0]["observed"] is None


def test_the_observer_proves_every_cycle_of_the_conservative_mode(scenario):
    seen = carry_out(Job(scenario=scenario, variant=FAST, seed=0))["observed"]
    assert seen["cycles"] == 8
    assert seen["cycles_moving"] > 0
    assert (seen["proven"], seen["proven_moving"]) == (seen["cycles"], seen["cycles_moving"])


def test_the_observer_does_not_prove_what_nothing_speaks_for():
    chair = DifferentialDrive()
    settings = Settings.for_robot(chair, object_speed=1.0, cell=0.08)
    # a metre before somebody at top speed: no brakes are good enough
    state = np.array([0.0, 0.0, 0.0, 2.0, 2.0])
    held = Trajectory(
        np.array([0.0, 1.0]), np.array([state, [2.0, 0.0, 0.0, 0.0, 0.0]]), 1
    )
    scan = Scan(np.full(180, 1.2), -np.pi, 2 * np.pi / 180, 6.0, pose=(0, 0, 0), stamp=0.0)
    own = SimpleNamespace(model=None)
    navigator = SimpleNamespace(
        robot=chair, settings=settings, static_map=None, held=held, record=own
    )
    observer = Observer()
    observer.see(
        SimpleNamespace(time=0.0, state=state, scans=[scan], navigator=navigator, executing=held)
    )
    assert observer.counts() == {
        "cycles": 1, "proven": 0, "cycles_moving": 1, "proven_moving": 0
    }  # fmt: skip


# resumed --------------------------------------------------------------------------------------


def test_what_is_done_is_not_done_again(scenario, tmp_path):
    workers = Counting()
    first = carry_out_all(comparison(scenario), tmp_path, workers, silent)
    assert workers.done == [("short", "fast", 0), ("short", "slow", 0)]
    more = carry_out_all(comparison(scenario, episodes=2), tmp_path, workers, silent)
    assert workers.done[2:] == [("short", "fast", 1), ("short", "slow", 1)]
    assert list(more) == workers.done
    assert more[("short", "fast", 0)] == first[("short", "fast", 0)]
    fewer = carry_out_all(comparison(scenario, variants=[FAST]), tmp_path, workers, silent)
    assert (len(fewer), len(workers.done)) == (1, 4)


def test_a_line_that_was_cut_short_is_driven_again(scenario, tmp_path):
    carry_out_all(comparison(scenario), tmp_path, Here(), silent)
    path = tmp_path / EPISODES
    whole = path.read_bytes()
    path.write_bytes(whole[:-40])
    workers = Counting()
    carry_out_all(comparison(scenario), tmp_path, workers, silent)
    assert workers.done == [("short", "slow", 0)]
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    before = [json.loads(line) for line in whole.splitlines()]
    assert [timeless(line) for line in lines] == [timeless(line) for line in before]


def test_an_interrupted_comparison_keeps_what_is_finished(scenario, tmp_path):
    class Interrupted(Counting):
        def each(self, function, wanted):
            yield from super().each(function, wanted[:1])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        carry_out_all(comparison(scenario), tmp_path, Interrupted(), silent)
    workers = Counting()
    carry_out_all(comparison(scenario), tmp_path, workers, silent)
    assert workers.done == [("short", "slow", 0)]


def test_an_episode_that_raises_is_told_and_tried_again(scenario, tmp_path, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("on purpose")

    with monkeypatch.context() as patch:
        patch.setattr(jobs, "simulate", broken)
        found = carry_out_all(comparison(scenario), tmp_path, Here(), silent)
    assert "on purpose" in found[("short", "fast", 0)]["error"]
    again = carry_out_all(comparison(scenario), tmp_path, Here(), silent)
    assert [r["error"] for r in again.values()] == [None, None]


@pytest.mark.parametrize(
    ("others", "told"),
    [
        ({"changes": {"particles": 10}}, "changes"),
        ({"object_speed": 0.5}, "object_speed"),
        ({"observe": False}, "observe"),
        ({"variants": (replace(FAST, changes={"cycle": 0.1}), SLOW)}, r"variants\.fast"),
    ],
)
def test_a_folder_of_other_conditions_is_refused(scenario, tmp_path, others, told):
    carry_out_all(comparison(scenario, variants=[FAST]), tmp_path, Idle(), silent)
    with pytest.raises(ValueError, match=rf"{told}.*another --out"):
        carry_out_all(comparison(scenario, **others), tmp_path, Here(), silent)


def test_a_scenario_that_was_edited_is_refused(tmp_path):
    path = tmp_path / "short.yaml"
    path.write_text(WORLD)
    carry_out_all(comparison(str(path)), tmp_path / "out", Idle(), silent)
    path.write_text(WORLD + "# as it is now\n")
    with pytest.raises(ValueError, match=r"scenarios\.short"):
        carry_out_all(comparison(str(path)), tmp_path / "out", Here(), silent)


class Idle(Here):
    """Does nothing of what it is asked to."""

    def each(self, function, wanted):
        yield from ()


# refused --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("others", "told"),
    [
        ({"episodes": 0}, r"compare\.episodes must be >= 1"),
        ({"seed": -1}, r"compare\.seed"),
        ({"judge_every": 0}, r"compare\.judge_every"),
        ({"variants": (FAST, FAST)}, "'fast' twice"),
        ({"variants": ()}, "variants is empty"),
        ({"variants": (replace(FAST, changes={"cycel": 0.1}),)}, "did you mean 'cycle'"),
        ({"scenarios": ["crowdet"]}, "did you mean 'crowded'"),
    ],
)
def test_nonsense_is_refused_before_anything_is_driven(scenario, others, told):
    with pytest.raises(ValueError, match=told):
        comparison(scenario, **others)


def test_an_unknown_mode_is_refused_with_the_nearest(scenario, tmp_path, capsys):
    with pytest.raises(ValueError, match="did you mean 'conservative'"):
        modes(["conservativ"])
    out = tmp_path / "out"
    assert main(["compare", scenario, "--modes", "consrvative", "--out", str(out)]) == BAD_INPUT
    assert "did you mean 'conservative'" in capsys.readouterr().err
    assert not out.exists()


def test_workers_that_are_none_are_refused(scenario, tmp_path, capsys):
    assert main(["compare", scenario, "--workers", "0", "--out", str(tmp_path)]) == BAD_INPUT
    assert "compare.workers must be >= 1; got 0" in capsys.readouterr().err


@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is not None, reason="dask.distributed is installed"
)
def test_a_cluster_without_dask_is_refused_with_the_remedy(scenario, tmp_path, capsys):
    arguments = ["compare", scenario, "--scheduler", "local", "--out", str(tmp_path)]
    assert main(arguments) == BAD_INPUT
    assert "passpmp_ti[cluster]" in capsys.readouterr().err


# told -----------------------------------------------------------------------------------------


def test_the_command_leaves_a_page_and_goes_on_where_it_was(scenario, tmp_path, capsys):
    arguments = [
        "compare", scenario, "--episodes", "1", "--workers", "1", "--out", str(tmp_path),
        "--modes", "conservative",
    ]  # fmt: skip
    assert main(arguments) == 0
    printed = capsys.readouterr()
    assert "episodes with a contact while moving" in printed.out
    assert "1 of 1 episodes" in printed.err
    told = json.loads((tmp_path / "summary.json").read_text())
    assert told["scenarios"]["short"]["variants"]["conservative"]["episodes"] == 1
    assert told["command"].startswith("passpmp compare ")
    page = (tmp_path / "index.html").read_text()
    assert told["command"] in page
    (film,) = tmp_path.glob("*.mp4")
    assert f"src='{film.name}'" in page
    episodes, filmed = (tmp_path / EPISODES).read_bytes(), film.stat().st_mtime_ns
    assert main(arguments) == 0
    assert (tmp_path / EPISODES).read_bytes() == episodes
    assert film.stat().st_mtime_ns == filmed


def test_progress_counts_each_variant_apart(scenario):
    progress = ComparisonProgress(comparison(scenario, episodes=5))
    progress._new = 2
    outcome = {"reached_goal": True, "collisions_moving": 2}
    done = {
        ("short", v, 0): {"variant": v, "error": None, "outcome": outcome} for v in ("fast", "slow")
    }
    line = progress.line(done, elapsed=60.0)
    assert line.startswith("2 of 10 episodes, 4 min left")
    assert "slow: 1/1 at the goal, 2 contacts" in line


@pytest.mark.campaign
def test_processes_find_what_one_finds(scenario, tmp_path):
    wanted = comparison(scenario, episodes=2)
    alone = carry_out_all(wanted, tmp_path / "one", Here(), silent)
    together = carry_out_all(wanted, tmp_path / "two", Processes(2), silent)
    assert list(alone) == list(together)
    for key, found in alone.items():
        assert timeless(together[key]) == timeless(found)


@pytest.mark.campaign
def test_a_local_cluster_finds_what_one_process_finds(scenario, tmp_path):
    pytest.importorskip("distributed", reason="needs the extra [cluster]")
    wanted = comparison(scenario)
    alone = carry_out_all(wanted, tmp_path / "one", Here(), silent)
    with opened("local", 2) as cluster:
        together = carry_out_all(wanted, tmp_path / "two", cluster, silent)
    for key, found in alone.items():
        assert timeless(together[key]) == timeless(found)
