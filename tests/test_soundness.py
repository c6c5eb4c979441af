"""Whatever the model proves, hidden attackers try to break (the guarantee, eq. 6).

A scan is cast exactly in a random world. Attackers are discs that change no beam of it: most of
them stand as near as their bearing allows. Everything is judged in continuous float64 without a
grid (see oracle/). One broken proof fails the test.
"""

import os

import numpy as np
import pytest
from oracle import attack, exact

SCANS, STATES, ATTACKERS = 220, 100, 300
CAMPAIGN = int(os.environ.get("PASSPMP_CAMPAIGN", "2000000"))


def broken_proofs(seed, states_each, attackers_each):
    """(states asked, proofs given, descriptions of the proofs that an attacker breaks)."""
    generator = np.random.default_rng(seed)
    case = attack.random_case(generator)
    model = case.model()
    attackers = exact.hidden_discs(
        case.scans, case.world, case.body, case.settings, attackers_each, generator
    )
    states, times = attack.random_states(case, states_each, generator)
    proof = model.proving_brakes(states, times)
    found = []
    for k, control in enumerate(case.robot.braking):
        mine = np.flatnonzero(proof == k)
        broken = attack.breaks(case, states[mine], times[mine], control, attackers)
        found += [f"seed {seed}, state {n}, braking control {k}" for n in mine[broken]]
    return len(states), int((proof >= 0).sum()), found


def run(seeds, states_each, attackers_each):
    asked, proven, found = 0, 0, []
    for seed in seeds:
        a, p, f = broken_proofs(seed, states_each, attackers_each)
        asked, proven, found = asked + a, proven + p, found + f
    print(f"{asked} states, {proven} proven p-safe, {len(found)} broken")
    return asked, proven, found


def test_no_proof_of_passive_safety_is_broken():
    asked, proven, found = run(range(SCANS), STATES, ATTACKERS)
    assert asked >= 20_000
    assert proven > 0.2 * asked, "nothing is tested where nothing is proven"
    assert not found


@pytest.mark.campaign
def test_no_proof_of_passive_safety_is_broken_in_a_long_campaign():
    each = 400
    _, _, found = run(range(10_000, 10_000 + CAMPAIGN // each), each, 500)
    assert not found


def test_nothing_can_be_where_the_model_says_that_nothing_can():
    checked = 0
    for seed in range(1000, 1080):
        generator = np.random.default_rng(seed)
        case = attack.random_case(generator)
        model = case.model()
        states, times = attack.random_states(case, 400, generator)
        points = states[:, :2]
        free = ~model.occupied(points, times)
        attackers = exact.hidden_discs(
            case.scans, case.world, case.body, case.settings, ATTACKERS, generator
        )
        radius = case.robot.disc_radius
        touched = exact.reaches(
            points[free], times[free] - model.stamp, attackers, radius,
            case.settings.object_speed, case.world,
        )  # fmt: skip
        touched |= exact.box_distance(points[free], case.world) < radius
        assert not touched.any(), f"seed {seed}"
        checked += int(free.sum())
    assert checked > 5_000


def test_memory_is_sound_against_attackers_that_use_every_cycle():
    """A population of attackers moves towards the robot as fast as it may, unseen by every scan."""
    proven = 0
    for seed in range(2000, 2014):
        generator = np.random.default_rng(seed)
        case = attack.random_case(generator)
        bound, cycle = case.settings.object_speed, case.settings.cycle
        stamp = case.scans[0].stamp
        c, rho = exact.hidden_discs(
            case.scans, case.world, case.body, case.settings, 800, generator
        )
        model = case.model()
        x, y, theta = case.position
        ahead = 2.0 if case.robot.kind == exact.CAR else 0.5
        for _ in range(5):
            # the robot goes where nobody stands: what is asked is not whether it drives well
            stamp += cycle
            x, y = x + ahead * cycle * np.cos(theta), y + ahead * cycle * np.sin(theta)
            middle = np.array([x, y])
            if exact.box_distance(middle[None], case.world)[0] < case.robot.radius:
                break
            scale = 5.0 if case.robot.kind == exact.CAR else 1.0
            scans = attack.random_scans(
                generator, case.world, (x, y, theta), case.settings, scale, case.robot, stamp
            )
            case = attack.Case(case.robot, case.settings, case.world, scans, (x, y, theta))
            model = case.model(model)
            c, rho = advanced(case, c, rho, bound * cycle, generator)
        states, times = attack.random_states(case, 150, generator)
        proof = model.proving_brakes(states, times)
        proven += int((proof >= 0).sum())
        for k, control in enumerate(case.robot.braking):
            mine = proof == k
            broken = attack.breaks(case, states[mine], times[mine], control, (c, rho))
            assert not broken.any(), f"seed {seed}"
    assert proven > 400


def advanced(case, c, rho, most, generator):
    """Attackers a cycle later: the move nearest to the robot that no scan contradicts."""
    moved, radii = [], []
    left = np.ones(len(c), dtype=bool)
    toward = np.array(case.position[:2]) - c
    toward /= np.linalg.norm(toward, axis=1)[:, None]
    moves = ((1, 0), (1, 0.8), (1, -0.8), (0.5, 0), (0.2, 0), (0, 0), (1, 1.6), (1, -1.6))
    for share, turn in moves:
        spin = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        index = np.flatnonzero(left)
        to = c[index] + share * most * toward[index] @ spin
        free = ~exact.sweep_blocked(c[index], to, rho[index], case.world)
        possible = exact.box_distance(to, case.world) >= rho[index]
        for x, y, r in case.body:
            possible &= np.hypot(to[:, 0] - x, to[:, 1] - y) >= rho[index] + r
        for scan in case.scans:
            possible &= exact.consistent(scan, to, rho[index], case.settings.range_noise)
        good = free & possible
        moved.append(to[good])
        radii.append(rho[index][good])
        left[index[good]] = False
    return np.concatenate(moved), np.concatenate(radii)


def test_most_states_that_nobody_can_attack_are_proven_safe():
    """The price of the margins: the share of truly safe states that the planner also calls safe."""
    unattacked = agreed = 0
    for seed in range(3000, 3016):
        generator = np.random.default_rng(seed)
        case = attack.random_case(generator)
        model = case.model()
        attackers = exact.hidden_discs(
            case.scans, case.world, case.body, case.settings, 500, generator
        )
        states, times = attack.random_states(case, 60, generator)
        moving = ~case.robot.at_rest(states)
        states, times = states[moving], times[moving]
        safe = np.zeros(len(states), dtype=bool)
        for control in case.robot.braking:
            index = np.flatnonzero(~safe)
            broken = attack.breaks(case, states[index], times[index], control, attackers, 0.02)
            safe[index[~broken]] = True
        claimed = model.passively_safe(states, times)
        unattacked += int(safe.sum())
        agreed += int((safe & claimed).sum())
    print(
        f"{agreed} of {unattacked} states that no attacker broke are proven: "
        f"{agreed / unattacked:.3f}"
    )
    assert agreed > 0.5 * unattacked
