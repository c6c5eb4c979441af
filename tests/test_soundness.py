"""Whatever the model proves, hidden attackers try to break (the guarantee, eq. 6).

A scan is cast exactly in a random world. Attackers are discs that change no beam of it: most of
them stand as near as their bearing allows. What is believed of poses, ranges and stamps is wrong by
up to what the settings declare. Everything is judged in continuous float64 without a grid (see
oracle/). One broken proof fails the test.

A long campaign: PASSPMP_CAMPAIGN=2000000 PASSPMP_SEED=10000 pytest -m campaign -s. Processes that
share a campaign begin at seeds a million apart.
"""

import os
from dataclasses import replace

import numpy as np
import pytest
from oracle import attack, cases, exact, hidden, worlds

from passpmp_ti import Settings

SCANS, STATES, ATTACKERS = 200, 110, 300
CAMPAIGN = int(os.environ.get("PASSPMP_CAMPAIGN", "2000000"))
SEED = int(os.environ.get("PASSPMP_SEED", "10000"))


def broken_proofs(seed, states_each, attackers_each):
    """(states asked, proofs given, descriptions of the proofs that an attacker breaks)."""
    generator = np.random.default_rng(seed)
    return broken_proofs_of(cases.random_case(generator), generator, states_each, attackers_each)


def broken_proofs_of(case, generator, states_each, attackers_each):
    """The same of one case."""
    model = case.model()
    attackers = hidden.hidden_discs(case, attackers_each, generator)
    states, times = cases.random_states(case, states_each, generator)
    proof = model.proving_brakes(states, times)
    true_states = case.true_states(states, generator)
    found = []
    for k, control in enumerate(case.robot.braking):
        mine = np.flatnonzero(proof == k)
        broken = attack.breaks(case, true_states[mine], times[mine], control, attackers)
        found += [f"state {n}, braking control {k}" for n in mine[broken]]
    return len(states), int((proof >= 0).sum()), found


def run(seeds, states_each, attackers_each, told_every=0):
    asked, proven, found = 0, 0, []
    for done, seed in enumerate(seeds, start=1):
        a, p, f = broken_proofs(seed, states_each, attackers_each)
        found += [f"seed {seed}, {one}" for one in f]
        asked, proven = asked + a, proven + p
        if f or (told_every and done % told_every == 0) or done == len(seeds):
            print(f"{asked} states, {proven} proven p-safe, {len(found)} broken", *f, flush=True)
    return asked, proven, found


def test_no_proof_of_passive_safety_is_broken():
    asked, proven, found = run(range(SCANS), STATES, ATTACKERS)
    assert asked >= 20_000
    assert proven > 0.2 * asked, "nothing is tested where nothing is proven"
    assert not found


@pytest.mark.campaign
def test_no_proof_of_passive_safety_is_broken_in_a_long_campaign():
    each = 1000
    _, _, found = run(range(SEED, SEED + max(CAMPAIGN // each, 1)), each, 500, told_every=50)
    assert not found


def test_nothing_can_be_where_the_model_says_that_nothing_can():
    checked = 0
    for seed in range(1000, 1060):
        generator = np.random.default_rng(seed)
        case = cases.random_case(generator)
        model = case.model()
        states, times = cases.random_states(case, 400, generator)
        free = ~model.occupied(states[:, :2], times)
        attackers = hidden.hidden_discs(case, ATTACKERS, generator)
        radius = case.robot.disc_radius
        points, age = case.true_states(states[free], generator)[:, :2], case.age(times[free])
        touched = attack.reaches(points, age, attackers, radius, case.blockers)
        touched |= exact.box_distance(points, case.world) < radius
        assert not touched.any(), f"seed {seed}"
        checked += int(free.sum())
    assert checked > 5_000


@pytest.mark.parametrize(("x", "y", "turn"), [(6.57, 1.0, 0.3), (6.91, 1.5, 0.0)])
def test_somebody_who_leans_on_a_mapped_wall_is_not_taken_for_wall(x, y, turn):
    """One beam of a sparse sensor meets him, where he is nearest to the wall."""
    wall, width = exact.box(15.0, -0.25, 40.0, 0.5), 0.4
    world = exact.world_of([wall], [(x, 0.5 * width + 1e-6, 0.5 * width)])
    settings = Settings.for_robot(cases.CHAIR, object_speed=1.0, object_width=width)
    pose = (0.0, y, turn * np.pi / 60)
    scan = exact.sweep(world, pose, 120, 2 * np.pi, 12.0, 0.0, labelled=False)
    case = cases.Case(
        cases.CHAIR, settings, world, [scan], pose, worlds.map_of(exact.world_of([wall]), 0.05)
    )
    mover = hidden.attackers_of(case, world.discs[:, :2], world.discs[:, 2])
    radius = cases.CHAIR.disc_radius
    bearing, apart = np.meshgrid(np.linspace(0.5, np.pi - 0.5, 24), (0.02, 0.1, 0.3, 0.6))
    away = 0.5 * width + radius + apart - 1e-3
    places = world.discs[0, :2] + np.stack(
        [(away * np.cos(bearing)).ravel(), (away * np.sin(bearing)).ravel()], axis=1
    )
    ages = apart.ravel() / settings.object_speed
    assert attack.reaches(places, ages, mover, radius, case.blockers).all()
    assert case.model().occupied(places, ages).all()


def test_memory_is_sound_against_attackers_that_use_every_cycle():
    """A population of attackers moves towards the robot as fast as it may, unseen by every scan;
    the error of poses is another one every cycle."""
    proven = 0
    for seed in range(2000, 2014):
        generator = np.random.default_rng(seed)
        case = cases.random_case(generator)
        # who is in a blind bearing now may have been in another one before: one bound for all
        case = replace(case, settings=case.settings.changed(blind_speed=None, clear_radius=0.0))
        settings = case.settings
        labelled = case.scans[0].moving is not None
        mounts, fov = worlds.random_mounts(generator)
        scale = 5.0 if case.robot.kind == exact.CAR else 1.0
        stamp = case.scans[0].stamp
        attackers = hidden.hidden_discs(case, 800, generator)
        model = case.model()
        x, y, theta = case.true_position
        ahead = 2.0 if case.robot.kind == exact.CAR else 0.5
        for _ in range(5):
            # the robot goes where nobody stands: what is asked is not whether it drives well
            stamp += settings.cycle
            step = ahead * settings.cycle
            x, y = x + step * np.cos(theta), y + step * np.sin(theta)
            if exact.box_distance(np.array([[x, y]]), case.world)[0] < case.robot.radius:
                break
            scans = worlds.random_scans(
                generator, case.world, (x, y, theta), settings, scale, case.robot, stamp,
                mounts=mounts, fov=fov, labelled=labelled,
            )  # fmt: skip
            case = cases.believed(replace(case, scans=scans, position=(x, y, theta)), generator)
            model = case.model(model)
            attackers = advanced(case, attackers, generator)
        states, times = cases.random_states(case, 150, generator)
        proof = model.proving_brakes(states, times)
        true_states = case.true_states(states, generator)
        proven += int((proof >= 0).sum())
        for k, control in enumerate(case.robot.braking):
            mine = proof == k
            broken = attack.breaks(case, true_states[mine], times[mine], control, attackers)
            assert not broken.any(), f"seed {seed}"
    assert proven > 400


def advanced(case, attackers, generator):
    """Attackers a cycle later: the move nearest to the robot that no scan contradicts."""
    c, rho, speed = attackers
    moved = []
    left = np.ones(len(c), dtype=bool)
    toward = np.array(case.true_position[:2]) - c
    toward /= np.linalg.norm(toward, axis=1)[:, None]
    most = speed * case.settings.cycle
    moves = ((1, 0), (1, 0.8), (1, -0.8), (0.5, 0), (0.2, 0), (0, 0), (1, 1.6), (1, -1.6))
    for share, turn in moves:
        spin = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        index = np.flatnonzero(left)
        to = c[index] + share * most[index, None] * toward[index] @ spin
        good = ~exact.sweep_blocked(c[index], to, rho[index], case.blockers)
        good &= exact.box_distance(to, case.world) >= rho[index]
        for x, y, r in case.body:
            good &= np.hypot(to[:, 0] - x, to[:, 1] - y) >= rho[index] + r
        for scan in case.true_scans:
            good &= hidden.consistent(scan, to, rho[index], case.settings.range_noise)
        kept = index[good]
        moved.append(hidden.Attackers(to[good], rho[kept], speed[kept]))
        left[kept] = False
    return hidden.Attackers(*(np.concatenate(parts) for parts in zip(*moved, strict=True)))


def test_most_states_that_nobody_can_attack_are_proven_safe():
    """The price of the margins: the share of truly safe states that the planner also calls safe."""
    unattacked = agreed = 0
    for seed in range(3000, 3016):
        generator = np.random.default_rng(seed)
        case = cases.random_case(generator, plain=True)
        model = case.model()
        attackers = hidden.hidden_discs(case, 500, generator)
        states, times = cases.random_states(case, 60, generator)
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
