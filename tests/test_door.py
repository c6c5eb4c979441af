"""What is refused at the door, and whether the refusal says what to do instead."""

import numpy as np
import pytest

from passpmp_ti import CarLike, DifferentialDrive, Scan, Settings, cover_rectangle, init


def scan(**changes):
    own = dict(
        ranges=np.ones(8), angle_min=0.0, angle_increment=0.1, range_max=5.0, pose=(0, 0, 0),
        stamp=0.0,
    )  # fmt: skip
    return Scan(**{**own, **changes})


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("object_speed", -0.1), ("object_speed", float("inf")), ("object_speed", "2"),
        ("object_speed", True), ("object_width", 0.0), ("blind_speed", -1.0),
        ("clear_radius", -1.0), ("tracking_error", float("nan")), ("localisation_error", -0.01),
        ("range_noise", -0.01), ("stamp_error", -0.01), ("map_tolerance", -0.1), ("cell", 0.0),
        ("window", 8), ("window", 16.5), ("time_step", 0.0), ("layer_length", 0.0),
        ("cycle", -0.1), ("capacity", 0), ("exploration_time", -1.0), ("particles", 0),
        ("iterations", 0), ("sub_swarms", 0), ("velocity_max", 0.0), ("goal_tolerance", 0.0),
        ("cruise_speed", -1.0), ("weight_time", -1.0),
    ],
)  # fmt: skip
def test_settings_name_the_field_the_value_and_the_rule(field, value):
    with pytest.raises(ValueError, match=rf"Settings\.{field} must be .*; got ") as refusal:
        Settings(**{field: value})
    assert repr(value) in str(refusal.value) or str(value) in str(refusal.value)


@pytest.mark.parametrize(
    ("field", "value", "nearest"),
    [
        ("optimizer", "psso", "pso"), ("guide", "safetime", "safe_time"),
        ("distance", "harmonic", None), ("mode", "conservativ", "conservative"),
    ],
)  # fmt: skip
def test_a_wrong_choice_suggests_the_nearest(field, value, nearest):
    with pytest.raises(ValueError, match=rf"Settings\.{field} must be one of") as refusal:
        Settings(**{field: value})
    assert ("did you mean" in str(refusal.value)) == (nearest is not None)
    assert nearest is None or f"did you mean {nearest!r}?" in str(refusal.value)


def test_an_unknown_setting_suggests_the_nearest():
    with pytest.raises(ValueError, match="'objct_speed'; did you mean 'object_speed'"):
        Settings.for_robot(CarLike(), objct_speed=3.0)
    with pytest.raises(ValueError, match="did you mean 'particles'"):
        Settings().changed(particle=3)


def test_times_that_do_not_divide_are_refused_with_the_reason():
    with pytest.raises(ValueError, match=r"time_step must be a whole number of millisec.*2.5 ms"):
        Settings(time_step=0.0025)
    with pytest.raises(ValueError, match=r"cycle = 0\.11 s must be a whole number of time steps"):
        Settings(cycle=0.11)
    with pytest.raises(ValueError, match=r"primitives\[1\] = 0\.33 s"):
        Settings(primitives=(0.4, 0.33))
    with pytest.raises(ValueError, match="primitives"):
        Settings(primitives="0.4")
    with pytest.raises(ValueError, match=r"primitives\[0\]"):
        Settings(primitives=("a",))


def test_settings_that_contradict_each_other_are_refused():
    with pytest.raises(ValueError, match="blind_speed = 3 m/s is above object_speed"):
        Settings(object_speed=2.0, blind_speed=3.0)
    with pytest.raises(ValueError, match="does not divide into sub_swarms"):
        Settings(particles=10, sub_swarms=3)


def test_settings_and_robots_are_frozen():
    for frozen, field in ((Settings(), "cell"), (CarLike(), "v_max"), (scan(), "stamp")):
        with pytest.raises(AttributeError):
            setattr(frozen, field, 1.0)
    given = np.ones(8)
    kept = scan(ranges=given)
    given[0] = 3.0
    assert kept.ranges[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        kept.ranges[0] = 2.0


@pytest.mark.parametrize(
    ("robot", "field", "value"),
    [
        (CarLike, "v_max", 0.0), (CarLike, "v_reverse", -1.0), (CarLike, "v_reverse", 30.0),
        (CarLike, "acceleration", float("nan")), (CarLike, "xi_max", 1.5),
        (CarLike, "xi_rate", 0.0), (CarLike, "wheelbase", -2.5),
        (DifferentialDrive, "wheel_speed", 0.0), (DifferentialDrive, "acceleration", "1"),
        (DifferentialDrive, "track", 0.0),
    ],
)  # fmt: skip
def test_robots_name_the_field_the_value_and_the_rule(robot, field, value):
    with pytest.raises(ValueError, match=rf"{robot.__name__}\.{field} must be .*; got "):
        robot(**{field: value})


def test_bodies_are_checked():
    with pytest.raises(ValueError, match="at least one"):
        CarLike(discs=())
    with pytest.raises(ValueError, match="share one radius"):
        CarLike(discs=((0.0, 1.0), (1.0, 0.5)))
    with pytest.raises(ValueError, match=r"discs\[1\]\.radius"):
        DifferentialDrive(discs=((0.0, 1.0), (1.0, 0.0)))
    with pytest.raises(ValueError, match="front \\+ back"):
        cover_rectangle(1.0, -1.0, 0.5, 2)
    with pytest.raises(ValueError, match="count"):
        cover_rectangle(1.0, 1.0, 0.5, 0)


def test_covering_discs_cover_the_rectangle():
    discs = cover_rectangle(3.2, 0.8, 1.7, 3)
    x, y = np.meshgrid(np.linspace(-0.8, 3.2, 101), np.linspace(-0.85, 0.85, 41))
    gaps = [np.hypot(x - offset, y) - radius for offset, radius in discs]
    assert (np.min(gaps, axis=0) <= 1e-9).all()


def test_states_beyond_a_limit_are_refused_by_name():
    states = np.zeros((4, 5))
    states[2, 4] = 0.5
    with pytest.raises(ValueError, match=r"states\[2\]: \|xi\| = 0\.5 rad .* limit 0\.314 rad"):
        CarLike().check_states("here", states)
    states[2, 4] = 0.314
    assert CarLike().check_states("here", states).shape == (4, 5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (dict(ranges=np.ones((2, 2))), r"Scan\.ranges must have shape \(n,\).*\(2, 2\)"),
        (dict(ranges=[1.0]), r"Scan\.ranges must have shape \(n,\), n >= 2"),
        (dict(angle_increment=0.0), r"Scan\.angle_increment must be .*> 0.*got 0"),
        (dict(angle_increment=-0.1), r"Scan\.angle_increment"),
        (dict(angle_increment=1.0), "span 7.0000 rad"),
        (dict(range_max=-1.0), r"Scan\.range_max must be .*> 0"),
        (dict(range_max=float("inf")), r"Scan\.range_max must be finite"),
        (dict(stamp=float("nan")), r"Scan\.stamp must be finite"),
        (dict(pose=(0, 0)), r"Scan\.pose must have shape \(3\)"),
        (dict(pose=(0, float("nan"), 0)), r"Scan\.pose\[1\] = nan"),
        (dict(moving=np.ones(8)), r"Scan\.moving must be bool of shape \(8,\)"),
        (dict(moving=np.ones(7, dtype=bool)), r"Scan\.moving must be bool of shape \(8,\)"),
    ],
)
def test_scans_are_refused_by_name(changes, message):
    with pytest.raises(ValueError, match=message):
        scan(**changes)


def test_beams_say_hit_nothing_or_lost():
    seen = scan(ranges=np.array([1.0, 5.0, 7.0, np.inf, np.nan, 0.0, -1.0, -np.inf]))
    assert list(seen.returned) == [True] + [False] * 7
    assert list(seen.lost) == [False] * 4 + [True] * 4
    assert seen.points() == pytest.approx(np.array([[1.0, 0.0]]))


def test_a_backend_that_does_not_exist_suggests_the_nearest():
    with pytest.raises(ValueError, match=r"init\.backend must be one of .*did you mean 'cuda'"):
        init("cudaa")
    with pytest.raises(ValueError, match=r"init\.threads"):
        init("cpu", threads=0)
