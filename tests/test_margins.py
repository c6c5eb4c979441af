"""Each margin is needed: with all of them nothing breaks a proof, without one of them attacks work.

A small robot on a fine grid, so that one margin is not hidden behind another. The order is always
the same: the claim is what the model proves of states; the truth is what `oracle` then does.
"""

from dataclasses import replace

import numpy as np
import pytest
from oracle import attack, cases, exact, hidden

import passpmp_ti.grid.arrival as arrival_module
import passpmp_ti.grid.proven as proven_module
from passpmp_ti import DifferentialDrive, FutureModel, Scan, Settings
from passpmp_ti.kernels.beams import SLACK

MOUSE = DifferentialDrive(discs=((0.0, 0.1),), wheel_speed=2.0, acceleration=4.0, track=1.5)
HERE = (0.37, -0.21, 0.4)
BOXES = [
    exact.box(1.5, 0.6, 0.5, 0.7, 0.9),
    exact.box(-0.9, 1.1, 0.6, 0.6, 0.2),
    exact.box(0.5, -1.6, 1.4, 0.5, 2.0),
]
DISCS = [(-1.4, -0.9, 0.3), (2.2, -0.8, 0.25)]
WORLD = exact.world_of(BOXES, DISCS)
WALLS_ONLY = exact.world_of(BOXES)
FINE = Settings(cell=0.02, object_width=0.4, object_speed=0.0, time_step=0.02)


def seen(world, settings, beams=720, range_max=2.5, robot=MOUSE):
    """What one lidar at HERE shows of `world`."""
    scan = exact.sweep(world, HERE, beams, 2 * np.pi, range_max, 10.0)
    return cases.Case(robot, settings, world, [scan], HERE)


def states_beside(case, count, generator):
    """(states, times): a third anywhere, a third beside a box, a third about to pass a corner."""
    states, times = cases.random_states(case, count, generator)
    radius, top = case.robot.disc_radius, case.robot.wheel_speed
    third = count // 3
    edges = case.world.edges[generator.integers(0, len(case.world.edges), third)]
    side = edges[:, 1] - edges[:, 0]
    outward = np.stack([side[:, 1], -side[:, 0]], axis=1)
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    share, apart = generator.random((third, 1)), generator.uniform(-0.02, 0.2, (third, 1))
    states[:third, :2] = edges[:, 0] + share * side + (radius + apart) * outward
    heading = states[third : 2 * third, 2]
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    before, beside = generator.uniform(0, 0.8, (third, 1)), generator.uniform(0, radius, (third, 1))
    states[third : 2 * third, :2] = edges[:, 0] - before * ahead + beside * left
    states[third : 2 * third, 3:5] = generator.uniform(0.6, 1, (third, 2)) * top
    return states, times


def broken(claim, truth=None, shift=(0.0, 0.0), attackers=0, later=0.0, seeds=3, width=None):
    """How many proofs of `claim` fail in `truth`.

    Args:
        claim: the case that the model is made of.
        truth: the case as it is; None: the same.
        shift: from where a robot was claimed to be to where it is [m].
        attackers: hidden discs a seed; 0: only the boxes are there to be hit.
        later: how much older than its stamp the scan is [s].
        width: of the narrowest attacker; None: as declared.
    """
    truth = truth or claim
    model = claim.model()
    count = 0
    braking = claim.robot.braking
    for seed in range(seeds):
        generator = np.random.default_rng(seed)
        states, times = states_beside(truth, 2000, generator)
        movers = hidden.NOBODY
        if attackers:
            sized = truth.settings.changed(object_width=width or truth.settings.object_width)
            movers = hidden.hidden_discs(replace(truth, settings=sized), attackers, generator)
        proof = model.proving_brakes(states, times)
        true_states = states + np.array([*shift, 0, 0, 0])
        for k, control in enumerate(braking):
            mine = proof == k
            count += attack.breaks(
                truth, true_states[mine], times[mine] + later, control, movers
            ).sum()
    return count


def test_the_extent_of_cells(monkeypatch):
    case = seen(WALLS_ONLY, FINE.changed(cell=0.2))
    assert broken(case) == 0
    monkeypatch.setattr(arrival_module, "BORDER", 0)
    assert broken(case) > 0


def test_the_corner_that_stands_out_between_two_beams(monkeypatch):
    # a corner that looks at the sensor, in the middle between two of 24 beams
    bearing = HERE[2] + 2.5 * np.pi / 12
    middle = 1.4 + 0.4 * np.sqrt(2)
    corner = exact.box(
        HERE[0] + middle * np.cos(bearing), HERE[1] + middle * np.sin(bearing), 0.8, 0.8,
        bearing + np.pi / 4,
    )  # fmt: skip
    case = seen(exact.world_of([corner]), FINE, beams=24)
    assert broken(case) == 0
    views_of = proven_module.views_of

    def without_half_chord(*arguments):
        views = views_of(*arguments)
        proven = views.reach[0] > 0
        views.reach[0, proven] = (views.reach[0, proven] + SLACK) / (1 - 0.5 * views.view[0, 3])
        return views

    monkeypatch.setattr(proven_module, "views_of", without_half_chord)
    assert broken(case) > 0


def test_the_width_of_objects():
    # 0.2 m wide things slip between beams that 0.4 m wide ones cannot slip between
    believed = seen(WORLD, FINE.changed(object_width=0.4), beams=40, range_max=4.0)
    honest = seen(WORLD, FINE.changed(object_width=0.2), beams=40, range_max=4.0)
    assert broken(honest, attackers=1000, width=0.2) == 0
    assert broken(believed, attackers=1000, width=0.2) > 0


def test_the_noise_of_ranges():
    noise = 0.08
    truth = seen(WALLS_ONLY, FINE)
    (scan,) = truth.scans
    longer = Scan(
        scan.ranges + noise, scan.angle_min, scan.angle_increment, scan.range_max, scan.pose,
        scan.stamp, scan.moving,
    )  # fmt: skip
    careless = replace(truth, scans=[longer])
    careful = replace(careless, settings=FINE.changed(range_noise=noise))
    assert broken(careful, truth) == 0
    assert broken(careless, truth) > 0


def test_noise_may_not_shut_a_gap_that_an_object_fits_through():
    # 0.45 m between a box and the wall behind it; with ranges 0.05 m wrong it looks like 0.35 m
    noise = 0.05
    dot = DifferentialDrive(discs=((0.0, 0.05),), wheel_speed=2.0, acceleration=4.0, track=1.5)
    settings = FINE.changed(object_speed=1.0, range_noise=noise)
    world = exact.world_of([exact.box(2.2, -1.3, 0.4, 2.0), exact.box(3.15, 0.0, 0.6, 6.0)])
    true = exact.sweep(world, (0.0, 0.0, 0.0), 2880, 2 * np.pi, 6.0, 10.0)
    error = np.where(true.points()[:, 0] > 2.8, -noise, noise)
    ranges = true.ranges.copy()
    ranges[true.returned] += error
    scan = Scan(
        ranges, true.angle_min, true.angle_increment, true.range_max, true.pose, true.stamp,
        true.moving,
    )  # fmt: skip
    mover = hidden.Attackers(np.array([[2.64, -0.8]]), np.array([0.2]), np.array([1.0]))
    place, later = np.array([[2.58, 0.6]]), np.array([1.2])
    assert hidden.consistent(true, mover.centres, mover.radii).all()
    assert attack.reaches(place, later, mover, dot.disc_radius, world).all()
    model = FutureModel.from_scan(scan, dot, settings)
    assert not model.occupied(place, [model.stamp]).any()
    assert model.occupied(place, model.stamp + later).all()


def test_the_error_of_localisation():
    # the scan is believed to be 0.04 m to the left of where it was, the robot 0.04 m to the right
    error = 0.04
    truth = seen(WALLS_ONLY, FINE)
    (scan,) = truth.scans
    believed = (HERE[0] - error, *HERE[1:])
    moved = Scan(
        scan.ranges, scan.angle_min, scan.angle_increment, scan.range_max, believed, scan.stamp,
        scan.moving,
    )  # fmt: skip
    careless = replace(truth, scans=[moved], position=believed)
    careful = replace(careless, settings=FINE.changed(localisation_error=error))
    assert broken(careful, truth, shift=(-error, 0)) == 0
    assert broken(careless, truth, shift=(-error, 0)) > 0


@pytest.mark.parametrize("shift", [(0.15, 0.0), (0.0, -0.15)])
def test_the_error_of_tracking(shift):
    case = seen(WALLS_ONLY, FINE)
    careful = replace(case, settings=FINE.changed(tracking_error=0.15))
    assert broken(careful, case, shift) == 0
    assert broken(case, case, shift) > 0


def test_the_age_of_a_scan_that_its_stamp_does_not_tell():
    late = 0.1
    case = seen(WORLD, FINE.changed(object_speed=2.0))
    careful = replace(case, settings=case.settings.changed(stamp_error=late))
    assert broken(careful, attackers=300, later=late) == 0
    assert broken(case, attackers=300, later=late) > 0
