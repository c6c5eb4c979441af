"""Hypothesis strategies: small scenes about a robot near the origin, and what it sees of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from oracle import cases, exact
from passpmp_ti import CarLike, DifferentialDrive, Settings

ROUND_CHAIR = DifferentialDrive()
ROUND_CAR = CarLike()
RANGE, BEAMS = 4.0, 360


@st.composite
def scenes(draw, robots=(cases.CHAIR, cases.LONG_CHAIR, cases.CAR), lidars=(1, 2), lost=True):
    """A Case: boxes and discs clear of the robot, all seen from where it stands."""
    robot = draw(st.sampled_from(robots))
    scale = 5.0 if robot.kind == exact.CAR else 1.0
    settings = Settings.for_robot(robot, cell=0.1 * scale).changed(
        object_speed=scale * draw(st.sampled_from([0.0, 0.5, 1.0, 2.0])),
        range_noise=0.01 * draw(st.integers(0, 2)),
    )
    world = draw(worlds(robot, scale, settings.object_width))
    # dyadic places: sums of them are exact, so that a move by whole cells is one
    place = st.integers(-512, 512).map(lambda n: n / 1024)
    pose = (draw(place), draw(place), draw(st.floats(-3.1, 3.1)))
    labelled = draw(st.booleans())
    scans = []
    for turn in np.linspace(0, np.pi, draw(st.sampled_from(lidars)))[:2]:
        seen_from = (pose[0], pose[1], pose[2] + float(turn))
        scan = exact.sweep(
            world, seen_from, BEAMS, 2 * np.pi, RANGE * scale, 5.25, labelled=labelled
        )
        if lost:
            scan = without_beams(scan, draw(lost_runs()))
        scans.append(scan)
    return cases.Case(robot, settings, world, scans, pose)


@st.composite
def worlds(draw, robot, scale, width):
    """Up to three boxes and three discs, none narrower than `width`, none on a robot within a
    metre of the origin."""
    far = st.floats(-4.0, 4.0).map(lambda value: value * scale)
    side = st.floats(0.0, 2.0).map(lambda value: width + value * scale)
    boxes = [
        exact.box(x, y, length, breadth, yaw)
        for x, y, length, breadth, yaw in draw(
            st.lists(st.tuples(far, far, side, side, st.floats(0.0, 3.1)), max_size=3)
        )
    ]
    keep = robot.radius + 0.8
    boxes = [
        one
        for one in boxes
        if exact.box_distance(np.zeros((1, 2)), exact.world_of([one]))[0] > keep
    ]
    discs = draw(st.lists(st.tuples(far, far, st.floats(0.5, 1.5)), max_size=3))
    discs = [(x, y, r * width) for x, y, r in discs if np.hypot(x, y) - r * width > keep]
    return exact.world_of(boxes, discs)


def lost_runs():
    """Up to three runs of lost beams: (first, how many)."""
    return st.lists(st.tuples(st.integers(0, BEAMS - 1), st.integers(1, 20)), max_size=3)


def without_beams(scan, runs):
    """The scan with runs of its beams lost."""
    ranges = scan.ranges.copy()
    for first, count in runs:
        ranges[(first + np.arange(count)) % len(ranges)] = np.nan
    return replace(scan, ranges=ranges)


def states_for(case, seed, count=150):
    """(states, times) about a case's robot."""
    return cases.random_states(case, count, np.random.default_rng(seed))


seeds = st.integers(0, 2**31)
