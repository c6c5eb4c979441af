"""Whether attackers break a proof: the braking path against everything that may come."""

from __future__ import annotations

import numpy as np

from oracle import exact

LOOKS = 12
"""Samples of a path at the first look; what may be near then is looked at every `FINE` seconds."""
FINE = 0.005
PAIRS = 600
"""Most ways of one state's attackers that are looked at; evenly chosen where there are more."""


def breaks(case, states, times, control, attackers, step=FINE):
    """[n] bool: braking by `control`, while the robot moves, a box or an attacker can touch it.

    Args:
        states: [n, 5] where the robot truly is.
        times: [n] absolute, by the clock of the case [s].
    """
    broken = np.zeros(len(states), dtype=bool)
    rest = exact.rest_time(case.robot, states, control)
    order = np.argsort(rest)
    order = order[rest[order] > 0]
    # paths of about one length share an array
    for some in np.array_split(order, max(len(order) // 200, 1)):
        if len(some):
            broken[some] = _broken(case, states[some], times[some], control, attackers, step)
    return broken


def _broken(case, states, times, control, attackers, step):
    robot, radius = case.robot, case.robot.disc_radius
    rest = exact.rest_time(robot, states, control)
    t, poses = exact.braking_path(robot, states, control, step)
    centres = exact.disc_centres(robot, poses)  # [n, T, D, 2]
    elapsed = case.age(times)[:, None] + t[None]
    last = np.minimum(np.ceil(rest / step - 1e-9).astype(int), len(t)) - 1  # still moving then
    own = _fastest(robot, states)
    broken = _hit_by_boxes(case, states, centres, elapsed, last, own * rest)
    c, rho, speed = attackers
    if not len(c):
        return broken

    looks = np.round(np.linspace(0, 1, LOOKS) * last[:, None]).astype(int)
    rows = np.arange(len(states))
    least = np.full((len(states), len(c)), np.inf)
    for look in looks.T:
        ahead = speed * elapsed[rows, look][:, None]
        for d in range(centres.shape[2]):
            w = centres[rows, look, d]
            apart = _apart(w, c)
            np.minimum(least, apart - ahead, out=least)
    least -= rho + radius
    apart_in_time = 0.5 * last * step / (LOOKS - 1) + step
    close = least <= apart_in_time[:, None] * (own[:, None] + speed)
    for n in np.flatnonzero(~broken & close.any(axis=1)):
        points = centres[n, : last[n] + 1].reshape(-1, 2)
        when = np.repeat(elapsed[n, : last[n] + 1], centres.shape[2])
        # the nearest first: one attacker is enough
        order = np.flatnonzero(close[n])[np.argsort(least[n, close[n]])]
        for some in np.split(order, [3, 20]):
            if not broken[n] and len(some):
                chosen = attackers.chosen(some)
                found = reaches(points, when, chosen, radius, case.blockers, PAIRS)
                broken[n] = found.any()
    return broken


def _apart(points, others):
    """[n, m] distances: by their squares, since hypot takes several times as long."""
    dx = points[:, :1] - others[:, 0]
    dy = points[:, 1:] - others[:, 1]
    dx *= dx
    dy *= dy
    dx += dy
    return np.sqrt(dx, out=dx)


def _fastest(robot, states):
    """[n] bound on the speed of any disc's centre while a robot brakes [m/s]."""
    if robot.kind == exact.CAR:
        fastest, turning = np.abs(states[:, 3]), np.tan(robot.xi_max) / robot.wheelbase
    else:
        fastest, turning = np.abs(states[:, 3:5]).max(axis=1), 2 / robot.track
    return fastest * (1 + turning * robot.overhang)


def _hit_by_boxes(case, states, centres, elapsed, last, way):
    """[n] bool: the robot drives into a box, or a box that nothing declares static rushes it."""
    broken = np.zeros(len(states), dtype=bool)
    if not len(case.world.boxes):
        return broken
    robot = case.robot
    radius, rush = robot.disc_radius, case.settings.object_speed if case.boxes_rush else 0.0
    reach = way + robot.overhang + radius + rush * elapsed[np.arange(len(last)), last]
    near = np.flatnonzero(exact.box_distance(states[:, :2], case.world) < reach)
    moving = np.arange(centres.shape[1])[None] <= last[near][:, None]
    flat = centres[near][moving].reshape(-1, 2)
    which, _ = np.nonzero(moving)
    which = np.repeat(near[which], centres.shape[2])
    limit = np.repeat(radius + rush * elapsed[near][moving], centres.shape[2])
    broken[which[exact.box_distance(flat, case.world) < limit]] = True
    return broken


def reaches(points, elapsed, attackers, radius, blockers, most=None):
    """[N] bool: an attacker can touch a disc at `points` [N, 2], `elapsed` [N] s after the scan.

    Straight ways only: an attacker whose way a box of `blockers` crosses does not count.

    Args:
        most: ways to look at, evenly chosen; None: all.
    """
    c, rho, speed = attackers
    result = np.zeros(len(points), dtype=bool)
    if not len(c) or not len(points):
        return result
    apart = _apart(points, c)
    n, k = np.nonzero(apart - rho - radius <= speed * elapsed[:, None])
    if not len(blockers.boxes):
        result[n] = True
        return result
    if most is not None and len(n) > most:
        some = np.linspace(0, len(n) - 1, most).astype(int)
        n, k = n[some], k[some]
    gap = np.maximum(apart[n, k], 1e-12)
    share = np.clip((gap - rho[k] - radius) / gap, 0, 1)
    end = c[k] + share[:, None] * (points[n] - c[k])
    free = ~exact.sweep_blocked(c[k], end, rho[k], blockers)
    result[n[free]] = True
    return result
