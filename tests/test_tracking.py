"""The tracker's cycle: who is met, kept, lost and forgotten."""

import numpy as np
import pytest

import passpmp_ti as pti
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.movers import PathMovers
from passpmp_ti.sim.world import World
from passpmp_ti.tracking import Sighting, follow

PEOPLE = pti.Settings(object_speed=2.0, object_width=0.4)
ALL_ROUND = Lidar(range_max=10.0, beams=720, labels="sensor")
HERE = np.zeros(3)
CYCLE = 0.1


def walkers(*ways, radius=0.25):
    """A world of discs, each walking from one place to another within 10 s."""
    paths = [np.array([[0.0, *begin], [10.0, *end]]) for begin, end in ways]
    movers = PathMovers(paths, np.full(len(paths), radius))
    return World((-20, -20, 20, 20), movers=movers)


def followed(world, seconds, *, lidars=(ALL_ROUND,), poses=(HERE,), settings=PEOPLE, tracks=None):
    """The tracks of every cycle."""
    found = []
    for k in range(round(seconds / CYCLE)):
        stamp = k * CYCLE
        seen = [
            Sighting.of(lidar.scan(world, pose, stamp))
            for lidar, pose in zip(lidars, poses, strict=True)
        ]
        tracks = follow(tracks, seen, stamp, settings)
        found.append(tracks)
    return found


def bytes_of(tracks):
    parts = (tracks.ids, tracks.radius, tracks.bank.mean, tracks.bank.covariance)
    return b"".join(p.tobytes() for p in (*parts, tracks.bank.weight, *tracks.owner))


def test_a_walker_is_followed_with_his_place_and_velocity():
    tracks = followed(walkers(((3, -5), (3, 7))), 3.0)[-1]
    assert len(tracks) == 1
    assert np.abs(tracks.positions[0] - [3, -5 + 1.2 * 2.9]).max() < 0.05
    assert np.abs(tracks.velocities[0] - [0, 1.2]).max() < 0.1
    assert 0.24 < tracks.radius[0] < 0.3


def test_a_walker_is_a_track_from_the_first_cycle_on_and_all_that_is_known_is_the_bound():
    tracks = followed(walkers(((3, -5), (3, 7))), CYCLE)[0]
    assert tracks.ids.tolist() == [0]
    assert tracks.seen.all()
    spread = np.sqrt(tracks.bank.combined()[1][0, 2, 2])
    assert 0.3 * PEOPLE.object_speed < spread <= 0.5 * PEOPLE.object_speed


def test_people_who_cross_keep_their_ids():
    world = walkers(((2.5, -4), (2.5, 6)), ((4, 4), (4, -6)), ((6, -3), (6, 3)))
    cycles = followed(world, 8.0)
    first, last = cycles[0], cycles[-1]
    assert first.ids.tolist() == last.ids.tolist() == [0, 1, 2]
    truth = world.movers.at(last.stamp)
    begin = world.movers.at(0.0)
    who = [int(np.argmin(np.hypot(*(begin - p).T))) for p in first.positions]
    assert np.hypot(*(truth[who] - last.positions).T).max() < 0.1


def test_who_turns_on_the_spot_keeps_his_id():
    path = np.array([[0.0, 3, -2], [2.0, 3, 2], [4.0, 3, -2]])
    world = World((-9, -9, 9, 9), movers=PathMovers([path], np.array([0.25])))
    assert [t.ids.tolist() for t in followed(world, 4.0)] == [[0]] * 40


def test_who_is_hidden_is_kept_and_met_again():
    # a standing disc hides the walker behind it for about a second
    world = walkers(((6, -4), (6, 8)), ((3, 0), (3, 0)))
    cycles = followed(world, 6.0)
    hidden = [t for t in cycles if not t.seen.all()]
    assert len(hidden) >= 5
    assert all(len(t) == 2 and not t.ended for t in cycles[1:])
    worst = max(np.hypot(*(t.positions[~t.seen][0] - world.movers.at(t.stamp)[0])) for t in hidden)
    assert worst < 0.3


def test_who_went_behind_lost_beams_is_kept_for_a_few_seconds_only():
    tracks = followed(walkers(((3, 0), (3, 0))), 1.0)[-1]
    blind = Sighting(
        origin=(0.0, 0.0), bearings=np.linspace(-3, 3, 50), ranges=np.full(50, np.nan),
        movable=np.zeros(50, dtype=bool), lost=np.ones(50, dtype=bool), increment=6 / 49,
        closed=False, range_max=10.0,
    )  # fmt: skip
    for k in range(1, 40):
        before, tracks = tracks, follow(tracks, [blind], 0.9 + k * CYCLE, PEOPLE)
        assert tracks.ended == (len(before) == 1 and len(tracks) == 0)
        assert len(tracks) == (1 if k <= 30 else 0)


def test_who_is_gone_from_where_all_is_seen_is_soon_forgotten():
    tracks = followed(walkers(((3, 0), (3, 0))), 2.0)[-1]
    empty = Sighting.of(ALL_ROUND.scan(World((-9, -9, 9, 9)), HERE, 0.0))
    left = []
    for k in range(1, 6):
        tracks = follow(tracks, [empty], 1.9 + k * CYCLE, PEOPLE)
        left.append((len(tracks), tracks.ended))
    assert left[0] == (1, False)
    assert (0, True) in left[:4]
    assert left[-1] == (0, False)


def test_what_the_map_explains_is_never_a_track():
    wall = World((-9, -9, 9, 9), segments=np.array([[2.0, -0.3, 2.0, 0.3]]))
    scan = ALL_ROUND.scan(wall, HERE, 0.0)
    assert not scan.moving.any()
    assert scan.returned.any()
    assert len(follow(None, [Sighting.of(scan)], 0.0, PEOPLE)) == 0


def test_every_movable_return_belongs_to_a_track_but_those_of_a_wall():
    unmapped = Lidar(range_max=10.0, beams=720)
    world = World(
        (-9, -9, 9, 9),
        segments=np.array([[-5.0, 4.0, 5.0, 4.0]]),
        movers=walkers(((2, -2), (2, 2)), ((-2, 1), (-2, -1))).movers,
    )
    for tracks, stamp in ((t, t.stamp) for t in followed(world, 2.0, lidars=(unmapped,))):
        scan = unmapped.scan(world, HERE, stamp)
        on_wall = np.abs(scan.points()[:, 1] - 4.0) < 1e-3
        assert ((tracks.owner[0][scan.returned] >= 0) == ~on_wall).all()
        assert set(tracks.owner[0][tracks.owner[0] >= 0]) <= set(tracks.ids)


def test_all_returns_of_the_last_detection_lie_in_its_disc():
    world = walkers(((2, -2), (2, 2)), ((3, 1), (3, -1)), ((-4, 2), (4, 2)))
    for tracks in followed(world, 5.0):
        scan = ALL_ROUND.scan(world, HERE, tracks.stamp)
        points, owner = scan.points(), tracks.owner[0][scan.returned]
        assert (owner >= 0).all()
        n = np.searchsorted(tracks.ids, owner)
        apart = np.hypot(*(points - tracks.last_centre[n]).T)
        assert (apart <= tracks.last_radius[n]).all()
        assert (tracks.last_seen[n] == tracks.stamp).all()


def test_what_two_sensors_see_is_one_track():
    # one looks from either side: they see opposite halves of the same disc
    half = Lidar(range_max=10.0, beams=361, field_of_view=np.pi, labels="sensor")
    poses = (np.array([-1.5, 0, 0]), np.array([1.5, 0, np.pi]))
    world = walkers(((0, -0.5), (0, 0.5)))
    tracks = followed(world, 2.0, lidars=(half, half), poses=poses)[-1]
    assert len(tracks) == 1
    assert all((own[own >= 0] == tracks.ids[0]).any() for own in tracks.owner)
    assert np.hypot(*(tracks.positions[0] - world.movers.at(tracks.stamp)[0])) < 0.03


def test_a_post_in_front_of_somebody_does_not_make_two_of_him():
    world = World(
        (-9, -9, 9, 9),
        polygons=[np.array([[1.5, -0.02], [1.54, -0.02], [1.54, 0.02], [1.5, 0.02]])],
        movers=walkers(((3, -2), (3, 2))).movers,
    )
    assert {len(t) for t in followed(world, 9.0)} == {1}


def test_the_same_sightings_give_the_same_bytes():
    def last():
        return followed(walkers(((2, -2), (2, 2)), ((3, 2), (3, -2))), 3.0)[-1]

    assert bytes_of(last()) == bytes_of(last())


def test_nothing_of_a_track_can_be_written_to():
    tracks = followed(walkers(((2, -2), (2, 2))), 0.3)[-1]
    with pytest.raises(ValueError, match="read-only"):
        tracks.bank.mean[0] = 0.0


def test_a_clock_that_goes_back_starts_anew_and_ids_are_never_given_twice():
    tracks = followed(walkers(((3, 0), (3, 0))), 1.0)[-1]
    seen = Sighting.of(ALL_ROUND.scan(walkers(((3, 0), (3, 0))), HERE, 0.0))
    again = follow(tracks, [seen], 0.0, PEOPLE)
    assert again.ended
    assert again.ids.tolist() == [1]


def test_a_bound_of_zero_is_legal():
    settings = PEOPLE.changed(object_speed=0.0)
    tracks = followed(walkers(((3, 0), (3, 0))), 1.0, settings=settings)[-1]
    forecast = tracks.forecast(tracks.stamp + np.array([1.0, 2.0]))
    assert np.abs(forecast.mean[0, :, :, :2] - forecast.mean[0, 0, 0, :2]).max() < 0.02


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"movable": np.ones(3)}, "movable must be bool"),
        ({"ranges": np.array([1.0, np.inf, 1.0])}, r"ranges\[1\] = inf m is no return"),
        ({"lost": np.array([True, False, False])}, "both movable and lost"),
        ({"increment": 0.0}, "increment must be finite and > 0"),
        ({"ranges": np.ones(2)}, "one a bearing"),
    ],
)
def test_a_sighting_that_contradicts_itself_is_refused(change, told):
    good = {
        "origin": (0.0, 0.0), "bearings": np.array([0.0, 0.1, 0.2]), "ranges": np.ones(3),
        "movable": np.ones(3, dtype=bool), "lost": np.zeros(3, dtype=bool), "increment": 0.1,
        "closed": False, "range_max": 5.0,
    }  # fmt: skip
    Sighting(**good)
    with pytest.raises(ValueError, match=told):
        Sighting(**{**good, **change})
