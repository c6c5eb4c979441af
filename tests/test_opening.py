"""Nothing hides where it does not fit: the hidden region opened by the size of objects."""

from dataclasses import replace

import numpy as np
import pytest
from oracle import attack, cases, exact, hidden

import passpmp_ti.grid.opening as opening
from passpmp_ti import CarLike, FutureModel, Settings
from passpmp_ti.grid.distance import distance_to_zeros
from passpmp_ti.kernels.visibility import SOURCES


def slot(width=2, length=20):
    """[60, 60]: all is seen but the lower third and a slot that leads into it."""
    seen = np.ones((60, 60), dtype=np.uint8)
    seen[40:] = 0
    seen[40 - length : 40, 30 : 30 + width] = 0
    seen[:, :10] = seen[:, -10:] = seen[:10] = 0
    return seen


def marks_at(shape, *cells):
    marks = np.ones((5, *shape), dtype=np.uint8)
    for j, i in cells:
        marks[SOURCES, j, i] = 0
    return marks


def test_a_disc_reaches_wherever_it_fits_and_nowhere_else():
    opened = opening.opened_region(slot(), 1.0, 4.0)
    assert opened[40:].all()
    # into the slot it bulges by less than two cells, the grid's own coarseness
    assert not opened[20:38, 25:35].any()
    # a disc that fits goes all the way in
    assert opening.opened_region(slot(), 1.0, 1.0)[20:40, 30:32].all()


def test_a_disc_that_just_fits_is_found_however_the_cells_lie():
    # a round hole exactly as large as the disc, at many places among the cells
    edges = np.arange(21) * 0.25
    x, y = np.meshgrid(edges, edges)
    for place in np.random.default_rng(0).uniform(2.3, 2.7, (200, 2)):
        # a cell is seen if all of it is outside the hole, and overlaps it if any of it is inside
        nearest = np.hypot(
            np.clip(place[0], x[:-1, :-1], x[1:, 1:]) - place[0],
            np.clip(place[1], y[:-1, :-1], y[1:, 1:]) - place[1],
        )
        hole = nearest < 1.0
        assert opening.opened_region((~hole).astype(np.uint8), 0.25, 1.0)[hole].all()


def test_beyond_the_grid_everything_is_hidden():
    seen = np.ones((8, 8), dtype=np.uint8)
    seen[:, 0] = 0
    # one hidden column is as wide as the world outside
    assert opening.opened_region(seen, 1.0, 5.0)[:, 0].all()


def test_a_mark_in_a_sliver_moves_to_where_the_sliver_begins():
    marks = opening.opened_sources(slot(), marks_at((60, 60), (22, 30)), 1.0, 4.0)
    sources = marks[SOURCES] == 0
    assert not sources[:37].any()
    assert sources[37:40, 28:34].any()


def test_a_sliver_that_nothing_leads_out_of_emits_nothing():
    marks = opening.opened_sources(slot(), marks_at((60, 60)), 1.0, 4.0)
    assert (marks[SOURCES] == 1).all()


def test_a_mark_on_the_opened_region_stays():
    marks = opening.opened_sources(slot(), marks_at((60, 60), (39, 15)), 1.0, 4.0)
    assert marks[SOURCES, 39, 15] == 0


CAR = CarLike()


def car_case(seed, radius):
    """(case, generator): a car among boxes and big discs, with objects of a declared radius."""
    generator = np.random.default_rng(seed)
    settings = Settings.for_robot(CAR, object_radius=radius, object_speed=5.0)
    place = (*map(float, generator.uniform(-30, 30, 2)), float(generator.uniform(-np.pi, np.pi)))
    world = cases.random_world(generator, place, CAR, settings, 8.0)
    scan = exact.sweep(world, place, 720, 2 * np.pi, 50.0, 10.0)
    return cases.Case(CAR, settings, world, [scan], place), generator


def without_size(case):
    return replace(case, settings=case.settings.changed(object_radius=0.0))


def test_objects_with_a_size_never_make_a_safe_state_unsafe():
    for seed in range(8):
        case, generator = car_case(seed, 1.0)
        states, times = cases.random_states(case, 400, generator)
        sized = case.model().passively_safe(states, times)
        points = without_size(case).model().passively_safe(states, times)
        assert not (points & ~sized).any()


def test_memory_of_larger_objects_is_refused():
    case, _ = car_case(0, 1.0)
    large = case.model()
    later = replace(case.scans[0], stamp=10.1)
    with pytest.raises(ValueError, match="object_radius"):
        FutureModel.from_scan(later, CAR, case.settings.changed(object_radius=0.5), large)


def attacked(case, attackers, states, times):
    """(states that no attacker breaks by every braking control, proven ones, broken proofs)."""
    proof = case.model().proving_brakes(states, times)
    safe = np.zeros(len(states), dtype=bool)
    broken = 0
    for k, control in enumerate(case.robot.braking):
        mine = proof == k
        broken += int(attack.breaks(case, states[mine], times[mine], control, attackers).sum())
        left = np.flatnonzero(~safe)
        safe[left[~attack.breaks(case, states[left], times[left], control, attackers)]] = True
    return safe, proof >= 0, broken


def test_discs_of_the_declared_size_break_no_proof_and_most_safe_states_are_proven():
    unattackable = proven = broken = 0
    for seed in range(100, 106):
        case, generator = car_case(seed, 1.0)
        case = replace(case, settings=case.settings.changed(object_speed=20.0))
        attackers = hidden.hidden_discs(case, 600, generator)
        states, times = cases.random_states(case, 80, generator)
        moving = ~CAR.at_rest(states)
        safe, proofs, failed = attacked(case, attackers, states[moving], times[moving])
        unattackable += int(safe.sum())
        proven += int((safe & proofs).sum())
        broken += failed
    print(f"{proven} of {unattackable} states that no disc of 1 m can attack are proven")
    assert broken == 0
    assert proven >= 0.6 * unattackable


def post_before_a_wall():
    """(case, states, times) beside a post whose shadow on a wall is 1.1 m wide."""
    boxes = [exact.box(8.0, 0.0, 0.8, 0.8), exact.box(12.0, 0.0, 2.0, 60.0)]
    place = (0.0, 0.0, 0.0)
    world = exact.world_of(boxes)
    settings = Settings.for_robot(CAR, object_radius=1.0, object_speed=5.0, cell=0.1)
    scan = exact.sweep(world, place, 1440, 2 * np.pi, 40.0, 10.0)
    case = cases.Case(CAR, settings, world, [scan], place)
    generator = np.random.default_rng(0)
    states, _ = cases.random_states(case, 3000, generator)
    states[:, 0], states[:, 1] = generator.uniform(3, 9, 3000), generator.uniform(-5, 5, 3000)
    states[:, 3] *= 0.2
    return case, states, 10.0 + 0.2 * generator.random(3000)


def test_nobody_hides_behind_a_post():
    case, states, times = post_before_a_wall()
    sized = case.model().passively_safe(states, times)
    points = without_size(case).model().passively_safe(states, times)
    assert sized.sum() > points.sum() + 300


def test_objects_smaller_than_declared_break_proofs():
    case, states, times = post_before_a_wall()
    generator = np.random.default_rng(1)
    small = hidden.hidden_discs(without_size(case), 4000, generator)
    large = hidden.hidden_discs(case, 4000, generator)
    assert attacked(case, large, states, times)[2] == 0
    assert attacked(case, small, states, times)[2] > 0


def test_the_extent_of_cells_is_needed_to_find_a_disc_that_just_fits(monkeypatch):
    monkeypatch.setattr(opening, "distance_between_cells", distance_to_zeros)
    with pytest.raises(AssertionError):
        test_a_disc_that_just_fits_is_found_however_the_cells_lie()


def test_a_centre_anywhere_in_its_cell_is_needed_too(monkeypatch):
    # half a cell less: as if only the middle of a cell could hold a centre
    exact_distance = distance_to_zeros
    monkeypatch.setattr(opening, "distance_to_zeros", lambda mask: exact_distance(mask) - 0.5)
    with pytest.raises(AssertionError):
        test_a_disc_that_just_fits_is_found_however_the_cells_lie()
