"""Scenario files: what is shipped loads and builds, what is wrong is told all at once."""

import numpy as np
import pytest

from passpmp_ti.sim.scenario import load_scenario, shipped
from passpmp_ti.sim.sources import RecordingSource

SHIPPED = [
    "corridor",
    "corridor_person",
    "crowded",
    "dead_end",
    "deep_u",
    "eth",
    "eth_stream",
    "narrow_passage",
    "nested_u",
    "simple",
    "spiral",
    "u_shape",
]

GOOD = """\
robot: {type: differential}
lidars:
  - {range_max: 10.0, beams: 100}
world:
  bounds: [-5, -5, 5, 5]
  walls: [[3, -3, 3, 3]]
start: [0, 0, 0]
goals: [[2, 0]]
duration: 10
"""


@pytest.fixture
def file(tmp_path):
    """Writes a scenario file: GOOD with replacements."""

    def write(*changes, name="mine.yaml"):
        text = GOOD
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def load_eth():
    try:
        return load_scenario("eth")
    except ValueError as absent:
        if "no such file" not in str(absent):
            raise
        pytest.skip("the recorded data is absent; set PASSPMP_DATA to its folder")


def test_every_scenario_of_the_paper_is_shipped():
    assert shipped() == SHIPPED


@pytest.mark.parametrize("name", [n for n in SHIPPED if not n.startswith("eth")])
def test_a_shipped_scenario_builds_a_world_whose_start_is_clear_of_movers(name):
    scenario = load_scenario(name)
    world, state, start_time = scenario.build(seed=1)
    assert start_time == 0.0
    assert (np.abs(state[:3] - scenario.start) <= scenario.start_spread).all()
    assert state[3:].tolist() == [0.0, 0.0]
    assert world.movers.top_speed <= scenario.settings.object_speed
    gap = np.hypot(*(world.movers.at(0.0) - state[:2]).T) - world.movers.radius
    assert (gap > scenario.robot.radius).all()
    assert world.clearance(state[None, :2])[0] > scenario.robot.radius


def test_seeds_but_the_first_start_elsewhere_within_the_spread():
    scenario = load_scenario("corridor")
    starts = [tuple(scenario.build(seed)[1][:3]) for seed in range(4)]
    assert starts[0] == scenario.start
    assert len(set(starts)) == 4
    assert starts[1] == tuple(scenario.build(1)[1][:3])


def test_another_bound_slows_the_crowd_down_with_it():
    scenario = load_scenario("crowded").changed(object_speed=5.0)
    world, _, _ = scenario.build(seed=0)
    assert scenario.settings.object_speed == 5.0
    assert len(world.movers.radius) == 22
    assert world.movers.top_speed <= 5.0
    assert world.movers.speed.min() >= 2.0  # in proportion: 8 of 20 m/s


def test_movers_may_be_made_faster_than_the_bound():
    scenario = load_scenario("crowded").changed(object_speed=5.0, movers_speed=10.0)
    world, _, _ = scenario.build(seed=0)
    assert scenario.settings.object_speed == 5.0
    assert 5.0 < world.movers.top_speed <= 10.0


def test_the_seed_alone_decides_the_world():
    scenario = load_scenario("crowded")
    first, again, other = (scenario.build(seed)[0].movers.at(3.0) for seed in (4, 4, 5))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_the_recording_gives_its_own_bound_its_walls_and_twenty_start_times():
    scenario = load_eth()
    assert isinstance(scenario.movers, RecordingSource)
    assert scenario.settings.object_speed == scenario.movers.top_speed
    assert 4.0 < scenario.settings.object_speed < 5.0
    times = [scenario.build(seed)[2] for seed in (0, 10, 19)]
    assert 52 < times[0] < times[1] < times[2] < 825.4 - scenario.duration + 30
    walls = scenario.build(0)[0].outline
    middle = 0.5 * (walls[:, :2] + walls[:, 2:])
    assert scenario.static_map.contains(middle, 0.1).all()


def test_nobody_in_the_recording_appears_within_the_range_finders_reach():
    scenario = load_eth()
    world, _, _ = scenario.build(0)
    movers = world.movers
    low, high = np.array([-4 - 10, 0 - 10]), np.array([13 + 10, 13 + 10])
    for n, born in enumerate(movers.born):
        if np.isfinite(born):
            place = movers.at(born)[n]
            assert (place <= low).any() or (place >= high).any()


def test_recorded_people_cannot_be_hurried():
    with pytest.raises(ValueError, match="walk as they were recorded"):
        load_eth().changed(movers_speed=1.0)


def test_absent_data_is_told_with_the_remedy(monkeypatch, tmp_path):
    monkeypatch.setenv("PASSPMP_DATA", str(tmp_path))
    with pytest.raises(ValueError, match=r"eth\.yaml:\d+: .*no such file; set PASSPMP_DATA"):
        load_scenario("eth")


def test_an_unknown_name_suggests_the_nearest_and_lists_all():
    with pytest.raises(ValueError, match="did you mean 'crowded'") as refusal:
        load_scenario("crowdet")
    assert all(name in str(refusal.value) for name in SHIPPED)


def test_a_file_of_ones_own_is_loaded_by_its_path(file):
    scenario = load_scenario(file())
    assert scenario.name == "mine"
    assert scenario.goals == ((2.0, 0.0),)
    assert scenario.static_map is None


def test_everything_wrong_is_told_at_once_with_its_line(file):
    path = file(
        ("type: differential", "type: differental"),
        ("beams: 100", "beams: 1, colour: red"),
        ("walls: [[3, -3, 3, 3]]", "walls: [[3, -3, 3]]"),
        ("duration: 10", "duration: -1\nsettings: {objekt_speed: 2, cycle: 0.1}"),
    )
    with pytest.raises(ValueError, match="mine") as refusal:
        load_scenario(path)
    told = str(refusal.value).splitlines()
    assert [line.split("mine.yaml:")[1].split(":")[0] for line in told] == [
        "1",
        "3",
        "3",
        "6",
        "9",
        "10",
    ]
    assert "did you mean 'differential'" in told[0]
    assert any("beams must be >= 2" in line for line in told)
    assert any("unknown key 'colour'" in line and "allowed:" in line for line in told)
    assert "must have shape (n, 4)" in told[3]
    assert "duration must be finite and > 0" in told[4]
    assert "did you mean 'object_speed'" in told[5]


def test_a_missing_key_is_told(file):
    with pytest.raises(ValueError, match="goals is missing"):
        load_scenario(file(("goals: [[2, 0]]\n", "")))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            ("start: [0, 0, 0]", "start: [2.8, 0, 0]"),
            r"mine\.yaml:7: .*start: \(2\.8, 0\) is 0\.20 m",
        ),
        (
            ("goals: [[2, 0]]", "goals: [[3.1, 0]]"),
            r"mine\.yaml:8: .*goals: \(3\.1, 0\) is 0\.10 m",
        ),
    ],
)
def test_a_start_or_goal_inside_a_wall_is_refused(file, change, told):
    with pytest.raises(ValueError, match=told):
        load_scenario(file(change))


def test_broken_yaml_is_told_with_its_line(file):
    with pytest.raises(ValueError, match=r"mine\.yaml:\d+: not YAML"):
        load_scenario(file(("type: differential}", "type: [differential}")))


def test_settings_that_only_fit_together_are_taken_together(file):
    scenario = load_scenario(
        file(
            (
                "duration: 10",
                "duration: 10\nsettings:\n  cycle: 0.15\n  time_step: 0.03"
                "\n  primitives: [0.3, 0.9]\n  blind_speed: 2.5\n  object_speed: 3.0",
            )
        )
    )
    assert scenario.settings.cycle == 0.15
    assert scenario.settings.blind_speed == 2.5


def test_settings_allow_for_the_range_finders_noise(file):
    scenario = load_scenario(file(("beams: 100", "beams: 100, noise: 0.01")))
    assert scenario.settings.range_noise == pytest.approx(0.03)


def test_a_scenario_may_take_its_walls_from_a_map_beside_it(file, tmp_path):
    image = np.full((40, 40), 254, dtype=np.uint8)
    image[:, 30] = 0
    (tmp_path / "hall.pgm").write_bytes(b"P5 40 40 255\n" + image.tobytes())
    (tmp_path / "hall.yaml").write_text("image: hall.pgm\nresolution: 0.1\norigin: [0, -2, 0]\n")
    scenario = load_scenario(
        file(
            ("walls: [[3, -3, 3, 3]]", "map: hall.yaml"), ("duration", "static_map: true\nduration")
        )
    )
    assert scenario.still_world().clearance(np.array([[0.0, 0.0]]))[0] == pytest.approx(3.0)
    assert scenario.static_map.resolution == 0.1
