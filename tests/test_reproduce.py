"""What can be reproduced, each on a size that takes no time, and the page made of it."""

import json
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from passpmp_ti.cli import BAD_INPUT, main
from passpmp_ti.reproduce import (
    command,
    cycle_length,
    getting_there,
    object_speed,
    page,
    sampling,
    slip_memory,
    slip_standing,
)
from passpmp_ti.reproduce.cycle import AcceleratingCar, Ground, leaf_distances
from passpmp_ti.reproduce.item import Asked, Claim, Found
from passpmp_ti.reproduce.registry import GROUPS, ITEMS
from passpmp_ti.reproduce.runs import Runs
from passpmp_ti.reproduce.scene import _rectangles
from passpmp_ti.robots import CarLike
from passpmp_ti.settings import Settings

PAPERS = (
    "table3", "table4", "table5", "table6", "table7", "fig8", "fig9", "fig10", "fig12", "fig13",
    "fig14", "fig15", "fig16", "fig17", "fig19", "fig20", "fig21", "fig22",
)  # fmt: skip
LONG = ("table7", "trees", "products")
"""Those that take a second even so."""
SHORT = 0.4
"""Longest episode [s]."""


@pytest.fixture(scope="module")
def runs():
    """Driven once for all items, as on the command line."""
    return Runs()


@pytest.fixture
def small(monkeypatch):
    """What else makes a run long."""
    monkeypatch.setattr(object_speed, "STATES", 1000)
    monkeypatch.setattr(sampling, "SEEDS", 1)
    monkeypatch.setattr(cycle_length, "BUDGETS", (0.001, 0.002))
    monkeypatch.setattr(getting_there, "shipped", lambda: ["corridor", "crowded"])
    monkeypatch.setattr(getting_there, "TREES", getting_there.TREES[:2])
    monkeypatch.setattr(slip_memory, "DRIVES", slip_memory.DRIVES[:1])
    monkeypatch.setattr(slip_standing, "DRIVES", (("narrow_passage", (0.2,)),))


def asked(runs, **more):
    return Asked(seeds=1, searches=2, longest=SHORT, runs=runs, **more)


def test_every_item_of_the_paper_can_be_run_and_stands_on_the_page():
    assert set(PAPERS) <= set(ITEMS)
    assert tuple(ITEMS) == command.NAMES
    assert [name for group in GROUPS.values() for name in group] == list(command.NAMES)


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.campaign) if n in LONG else n for n in command.NAMES],
)
def test_an_item_runs_and_tells_what_it_found(name, runs, small):
    told = []
    found = ITEMS[name].run(asked(runs, see=told.append))
    numbers = json.loads(json.dumps(found.numbers))
    assert told
    assert all(what.startswith(f"{name}:") for what in told)
    assert found.claims
    assert all(isinstance(claim.holds, bool) and claim.ours for claim in found.claims)
    # what is told is worked out from what a file holds, and from nothing else
    text = ITEMS[name].tell(numbers)
    assert text == ITEMS[name].tell(found.numbers)
    assert "nan" not in text.split()
    for svg in found.figures.values():
        assert ET.fromstring(svg).tag.endswith("svg")


def test_the_same_is_found_again(runs):
    first, again = (ITEMS["table3"].run(asked(own)) for own in (runs, Runs()))  # a drive of its own
    assert first == again


def one(ours, figures):
    return Found(
        numbers=ours, claims=[Claim(says="it rises", ours="it does", holds=True)], figures=figures
    )


def made():
    return {
        "date": "2020-01-01", "seconds": 1.0, "machine": "m", "cores": 1, "threads": 1,
        "backend": "cpu", "python": "3", "taichi": "1", "numpy": "2", "commit": "c",
    }  # fmt: skip


@pytest.fixture
def cones_found(runs):
    return ITEMS["cones"].run(asked(runs))


def test_a_page_holds_what_was_run_and_says_what_was_not(tmp_path, cones_found):
    page.write(tmp_path, "cones", Asked(seeds=1), cones_found, made())
    text = page.assemble(tmp_path)
    assert text == (tmp_path / page.PAGE).read_text()
    assert ITEMS["cones"].tell(cones_found.numbers) in text
    assert "Not run yet: `passpmp reproduce table3`" in text
    assert "Not run yet: `passpmp reproduce cones`" not in text
    (figure,) = json.loads((tmp_path / page.NUMBERS / "cones.json").read_text())["figures"].values()
    assert f"]({page.IMAGES}/{figure})" in text
    assert (tmp_path / page.IMAGES / figure).is_file()


def test_an_item_that_is_run_again_takes_the_place_of_what_was_there(tmp_path, cones_found):
    numbers = cones_found.numbers
    for figures in ({"a": "<svg/>", "b": "<svg/>"}, {"c": "<svg></svg>"}):
        page.write(tmp_path, "cones", Asked(), one(numbers, figures), made())
    images = tmp_path / page.IMAGES
    assert [path.name for path in images.iterdir()] == ["cones.svg"]
    assert (images / "cones.svg").read_text() == "<svg></svg>"
    assert page.assemble(tmp_path).count("## Cones") == 1


def test_numbers_of_another_version_do_not_break_the_page(tmp_path):
    page.write(tmp_path, "cones", Asked(), one({"something": 1}, {}), made())
    assert "Run by another version: `passpmp reproduce cones`" in page.assemble(tmp_path)


def test_items_are_run_once_and_in_the_order_of_the_page():
    assert command.chosen(["fig8", "table5", "fig8"]) == ("table5", "fig8")
    assert command.chosen(["fig8", "all"]) == command.NAMES


def test_the_command_prints_a_section_and_writes_the_page(tmp_path, capsys):
    assert main(["reproduce", "cones", "--seeds", "1", "--out", str(tmp_path)]) == 0
    told = capsys.readouterr()
    assert "## Cones that fill the view after 4 s" in told.out
    assert "cones: an empty world" in told.err
    text = (tmp_path / page.PAGE).read_text()
    assert text.count('<a id="cones">') == 1
    assert "| [cones](#cones)" not in text, "slips are there to fail: not at a glance"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [(["fig88"], "did you mean 'fig8'"), (["fig8", "--seeds", "0"], "reproduce.seeds")],
)
def test_bad_input_is_refused(arguments, told, capsys, tmp_path):
    assert main(["reproduce", *arguments, "--out", str(tmp_path)]) == BAD_INPUT
    assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_papers_tree_only_accelerates_and_brakes_as_ours():
    car = AcceleratingCar()
    assert {control[1] for control in car.controls} == {car.acceleration}
    assert len(car.controls) == 3
    assert car.braking == CarLike().braking


def test_costs_of_leaves_are_those_of_the_planner(runs):
    run = runs.drive("simple", duration=SHORT)
    settings = Settings.for_robot(
        CarLike(), guide="euclidean", distance="final", weight_turn=0.0, weight_distance=0.3,
        weight_time=0.7, capacity=40,
    )  # fmt: skip
    goal = run.scenario.goals[0]
    tree = Ground.of(run.glimpses[0], CarLike(), settings, goal).grow(settings)
    away, taken = leaf_distances(tree, goal)
    from passpmp_ti.planner.swarm import leaf_costs

    costs = leaf_costs(tree, CarLike(), settings)[tree.leaves]
    # the guide is 0 in the middle of the goal's tolerance
    expected = 0.3 * (away - 0.4 * settings.goal_tolerance) + 0.7 * taken
    np.testing.assert_allclose(costs, expected, rtol=1e-5)


def test_an_episode_is_driven_once_for_all_who_ask(runs):
    first = runs.drive("simple", duration=SHORT)
    assert runs.drive("simple", duration=SHORT) is first
    assert runs.drive("simple", duration=SHORT, seed=1) is not first
    assert len(first.glimpses[0].scans) == 1
    assert first.summary["duration"] == pytest.approx(SHORT)


def test_who_stands_for_too_long_is_given_up(runs):
    run = runs.drive("simple", duration=30.0, patience=0.3, settings={"weight_distance": 0.0})
    assert run.gave_up
    assert run.summary["duration"] < 1.0


@pytest.mark.parametrize("seed", range(5))
def test_a_region_is_covered_by_rectangles_that_do_not_overlap(seed):
    mask = np.random.default_rng(seed).random((9, 7)) < 0.6
    drawn = np.zeros(mask.shape, dtype=int)
    for (i0, j0), (i1, j1) in _rectangles(mask):
        drawn[j0:j1, i0:i1] += 1
    np.testing.assert_array_equal(drawn, mask)
