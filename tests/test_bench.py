"""The benchmarks: what they print, write and compare, and that they measure the same thing."""

import importlib.util
import json
import sys
import types

import numpy as np
import pytest

from passpmp_ti import device
from passpmp_ti.bench import baseline, check, command, machine, memory, reference, suite, tree
from passpmp_ti.bench.found import Found, Options, aligned, document, report
from passpmp_ti.bench.our_check import our_check
from passpmp_ti.bench.rounds import LEAST_ROUNDS, interleaved
from passpmp_ti.bench.scenes import car_scene, wheelchair_scene
from passpmp_ti.bench.states import draw
from passpmp_ti.cli import BAD_INPUT, main

COUNT = 4000
HAS_NUMBA = importlib.util.find_spec("numba") is not None


def found(**ratios):
    rows = [{"scene": "crowded", "ours [ms]": 1.5}, {"scene": "ring", "ours [ms]": 20.25}]
    one = Found(title="a title", rows=rows, ratios=ratios, notes=["a note"])
    return document("check", one, machine.circumstances(None))


@pytest.fixture(autouse=True)
def soon_enough(monkeypatch):
    """What is measured here is not how fast anything is."""
    monkeypatch.setattr("passpmp_ti.bench.rounds.LEAST", 1e-4)
    monkeypatch.setattr("passpmp_ti.bench.rounds.MOST_ROUNDS", LEAST_ROUNDS)


@pytest.fixture(scope="module", params=["crowded", "ring"])
def scene(request):
    return car_scene(request.param)


@pytest.fixture(scope="module")
def drawn(scene):
    """(arrival [s], ticks, states) of a scene, with the clearance of a step of 50 ms."""
    clearance = scene.settings.changed(time_step=check.STEP).clearance(scene.robot)
    arrival = reference.arrival_seconds(
        scene.scan(), scene.size, scene.cell, clearance, scene.settings.object_speed
    )
    return arrival, reference.ticks_of(arrival), draw(scene, arrival, COUNT)


def verdicts(scene, ticks, states, step):
    corner = (-(scene.size // 2), -(scene.size // 2))
    settings = scene.settings.changed(time_step=step)
    call, verdict = our_check(ticks, corner, scene.robot, settings, states.poses, states.ticks)
    call()
    return verdict()


# what is printed and written


def test_a_table_is_aligned_and_tells_what_a_row_lacks():
    rows = [{"states": 1000, "scene": "ring", "ours [ms]": 1.234}, {"states": 7, "scene": "x"}]
    assert aligned(rows).splitlines() == [
        "scene  states  ours [ms]",
        "ring    1,000       1.23",
        "x           7          -",
    ]


def test_a_report_says_what_it_was_measured_on():
    told = report(found(a=1.0))
    for part in ("check: a title", "cores", "backend cpu", "Taichi", "commit", "a note"):
        assert part in told


def test_a_result_survives_being_written(tmp_path):
    result = found(a=1.0, b=0.25)
    path = baseline.result_file(tmp_path / "deep", "check", "cpu")
    baseline.write(path, result)
    assert baseline.read(path) == result
    assert path.name == "check-cpu.json"


def test_what_is_no_result_is_refused(tmp_path):
    path = tmp_path / "check-cpu.json"
    path.write_text("[1]")
    with pytest.raises(ValueError, match="no result of a benchmark"):
        baseline.read(path)


def test_only_a_ratio_that_fell_by_more_than_a_quarter_is_marked():
    then, now = found(a=1.0, b=1.0, c=1.0), found(a=0.74, b=0.76, c=3.0, new=1.0)
    assert baseline.worse(now["ratios"], then["ratios"]) == ["a"]
    told = baseline.comparison(now, then)
    marked = [line for line in told.splitlines() if "WORSE" in line]
    assert len(marked) == 1
    assert marked[0].startswith("a ")
    assert "-26 %" in marked[0]


def test_a_first_run_has_nothing_to_be_compared_with():
    assert "no committed result" in baseline.comparison(found(a=1.0), None)


def test_rounds_are_told_by_the_median_of_their_own_ratios():
    rounds = interleaved({"a": lambda: None, "b": lambda: None}, 0.1)
    assert set(rounds.seconds) == {"a", "b"}
    rounds.seconds.update(a=[1.0, 1.0, 2.0], b=[2.0, 3.0, 20.0])
    assert rounds.faster("a", "b") == 3.0
    assert rounds.faster("b", "a") == pytest.approx(1 / 3)


# what is measured


def test_a_scene_is_the_same_every_time(scene):
    again = car_scene(scene.name)
    assert np.array_equal(scene.scan().ranges, again.scan().ranges)
    assert scene.scan().returned.any()


def test_the_ring_is_closed_and_the_wheelchair_s_is_an_eighth_of_it():
    car, chair = car_scene("ring").scan(), wheelchair_scene("ring").scan()
    assert car.returned.all()
    assert chair.ranges == pytest.approx(car.ranges / 8)


def test_the_reference_map_is_never_free_behind_what_was_seen(scene, drawn):
    arrival, _, _ = drawn
    scan = scene.scan()
    middle = (np.arange(scene.size) + 0.5 - scene.size / 2) * scene.cell
    x, y = np.meshgrid(middle, middle)
    beam = np.round(np.arctan2(y, x) / scan.angle_increment).astype(int) % len(scan.ranges)
    behind = np.hypot(x, y) > np.minimum(scan.ranges, scan.range_max)[beam] + scene.cell
    assert (arrival[behind] == 0).all()
    assert (arrival > 0).any()


def test_the_reference_check_is_ours_but_for_the_margin_between_looks(scene, drawn):
    _, ticks, states = drawn
    ours = verdicts(scene, ticks, states, check.STEP)
    plain = reference.passively_safe(ticks, scene.cell, states, check.STEP).astype(bool)
    # ours looks between the steps too, and later: it says safe less often, by little
    assert (ours & ~plain).mean() < 1e-3
    assert (plain & ~ours).mean() < 0.01
    assert ours.any()
    assert not ours.all()


@pytest.mark.parametrize("step", [check.STEP, 0.02])
def test_what_we_call_safe_is_safe_at_small_steps(scene, drawn, step):
    _, ticks, states = drawn
    ours = verdicts(scene, ticks, states, step)
    assert not (ours & ~check.truly_safe(scene, states, None)).any()


def test_a_device_s_arrays_give_the_same_verdicts(scene, drawn):
    _, ticks, states = drawn
    here = verdicts(scene, ticks, states, check.STEP)
    with device.forced():
        there = verdicts(scene, ticks, states, check.STEP)
    assert np.array_equal(here, there)


def test_the_reference_tree_holds_only_what_is_safe():
    scene = car_scene("ring")
    ticks = reference.ticks_of(
        reference.arrival_seconds(scene.scan(), scene.size, scene.cell, 1.7, 5.0)
    )
    controls = np.array([c[1:] for c in scene.robot.controls], dtype=np.float32)
    assert tree.grown(reference, ticks, scene.cell, controls, 12, 500).nodes == 500
    nothing_free = np.zeros_like(ticks)
    assert tree.grown(reference, nothing_free, scene.cell, controls, 12, 500).nodes == 1


@pytest.mark.skipif(not HAS_NUMBA, reason="Numba is not installed")
def test_numba_s_loops_find_what_numpy_s_do(scene, drawn):
    from passpmp_ti.bench import compiled, compiled_raster

    arrival, ticks, states = drawn
    clearance = scene.settings.changed(time_step=check.STEP).clearance(scene.robot)
    again = compiled_raster.arrival_seconds(
        scene.scan(), scene.size, scene.cell, clearance, scene.settings.object_speed
    )
    assert (np.abs(again - arrival) > 1e-3).mean() < 1e-4
    plain = reference.passively_safe(ticks, scene.cell, states, check.STEP)
    quick = compiled.passively_safe(ticks, scene.cell, states, check.STEP)
    assert (plain != quick).mean() < 1e-3


def test_arrays_are_counted_once_whoever_looks_at_them():
    class Owner:
        def __init__(self):
            self.whole = np.zeros((10, 4), dtype=np.float32)
            self.part = self.whole[:3]

    Owner.__module__ = "passpmp_ti.invented"
    assert memory.held(Owner()) == 160
    with device.forced():
        assert memory.held([device.empty((10, 4), np.uint16)]) == 80


# the command


def test_a_benchmark_runs_end_to_end_and_is_compared_with_what_was_committed(tmp_path, capsys):
    asked = ["bench", "check", "--quick", "--sizes", "1000", "--results", str(tmp_path)]
    assert main([*asked, "--commit-result", "--json", str(tmp_path / "all.json")]) == 0
    assert "no committed result" in capsys.readouterr().out
    written = json.loads((tmp_path / "all.json").read_text())["results"][0]
    assert written["benchmark"] == "check"
    assert {row["unsound"] for row in written["rows"]} == {0}
    assert {"machine", "cores", "taichi", "numpy", "backend", "commit"} <= set(written)

    committed = tmp_path / "check-cpu.json"
    better = {name: 1000 * ratio for name, ratio in written["ratios"].items()}
    committed.write_text(json.dumps({**written, "ratios": better}))
    assert main(asked) == 0
    assert "WORSE" in capsys.readouterr().out
    assert main([*asked, "--strict"]) == command.STRICT


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (["chek"], "did you mean 'check'"),
        (["check", "crowded"], "bench.name"),
        (["cycle", "crowdet"], "did you mean 'crowded'"),
        (["check", "--sizes", "0"], "whole numbers > 0"),
        (["check", "--limit", "nowhere"], "perf.cpp"),
    ],
)
def test_what_cannot_be_measured_is_refused(asked, told, capsys):
    assert main(["bench", *asked]) == BAD_INPUT
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(("name", "beside"), [("raster", "NumPy"), ("tree", "NumPy")])
def test_a_map_and_a_tree_stand_beside_others(name, beside, tmp_path, capsys):
    asked = ["bench", name, "--quick", "--sizes", "50", "--results", str(tmp_path)]
    assert main([*asked, "--json", str(tmp_path / "all.json")]) == 0
    result = json.loads((tmp_path / "all.json").read_text())["results"][0]
    assert all(ratio > 0 for ratio in result["ratios"].values())
    assert any(key.endswith(f"ours / {beside}") for key in result["ratios"])
    assert not (tmp_path / f"{name}-cpu.json").exists()


def test_modes_are_shown_the_same_drive_again(monkeypatch):
    from passpmp_ti.bench import modes
    from passpmp_ti.sim.scenario import load_scenario

    monkeypatch.setattr(modes, "WARM_UP", 1)
    small = load_scenario("simple").changed({"capacity": 60})
    told = modes.measure(Options(scenario=small, cycles=3))
    assert told.rows[0]["cycles"] == 3
    assert set(told.ratios) == {
        "simple: conservative / hybrid", "simple: conservative / probabilistic"
    }  # fmt: skip
    assert all(ratio > 0 for ratio in told.ratios.values())
    # what is shown again leads to the same decisions
    shown = modes.drive(small, "hybrid", 4, seed=0)
    again = modes.drive(small, "hybrid", 4, seed=0)
    assert all(np.array_equal(a.state, b.state) for a, b in zip(shown, again, strict=True))


def test_the_swarm_s_figures_become_a_table_and_ratios(monkeypatch):
    def measure_swarm(seed, progress, nodes=(10,)):
        progress("swarm")
        row = {"particles": 20, "nodes": nodes[0], "depth": 3, "swarm_seconds": 0.001}
        row |= {"numpy_seconds": 0.05, "numpy_ratio": 50.0}
        return {"rows": [row | {"numba_seconds": None, "numba_ratio": None}]}

    module = types.SimpleNamespace(measure_swarm=measure_swarm)
    monkeypatch.setitem(sys.modules, "passpmp_ti.bench.swarm", module)
    (told,) = suite.carry_out(["swarm"], Options(sizes=(1000,)))
    assert told["rows"][0]["ours [ms]"] == 1.0
    assert told["ratios"] == {"20 x 1e+03: ours / NumPy, every priority": 50.0}


def test_a_memory_table_tells_of_every_owner():
    rows = memory.measure(Options(sizes=(1000,))).rows
    assert [row["owner"].partition(",")[0] for row in rows] == ["model", "tree", "swarm"]
