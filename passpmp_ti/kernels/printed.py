"""The risk of motions as the paper prints it, eqs. 10-17: products over time steps, a minimum over
objects. To be compared with kernels/risk.py; it bounds nothing (docs/risk.md)."""

import taichi as ti

from passpmp_ti.kernels.chances import touch_chance
from passpmp_ti.kernels.check import arrival_at, control_of, robot_of
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.motion import at_rest, step
from passpmp_ti.kernels.risk import (
    SCANNED,
    Arrival,
    Counts,
    Links,
    Numbers,
    Table,
    disc_at,
    hidden_chance,
    needed_share,
    pose_in,
)


@ti.func
def printed_chance(
    arrival: ti.template(),
    numbers: ti.template(),
    counts: ti.template(),
    rows: ti.template(),
    places: ti.template(),
    near: ti.template(),
    pool: ti.template(),
    starts: ti.template(),
    odds: ti.template(),
    tally: ti.template(),
    q,
    tick,
):
    """Eqs. 14 and 17: the greatest over the discs of the least over the objects; what is hidden is
    one object more."""
    greatest = 0.0
    for d in range(counts[5]):
        p = disc_at(numbers, d, q)
        ticks = arrival_at(arrival, counts, numbers[0], p[0], p[1])
        least = hidden_chance(odds, tally, needed_share(ticks, tick, odds[SCANNED]))
        for n in range(tally[0]):
            least = ti.min(
                least, touch_chance(rows, places, near, pool, starts, odds, tally, n, p, tick)
            )
        greatest = ti.max(greatest, least)
    return greatest


@kernel
def printed_states_risk(
    # in
    kind: ti.template(),
    arrival: Arrival,  # [J, I]
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
    braking: Table,  # [B, 3]
    rows: Table,
    places: Links,
    near: Table,
    pool: Numbers,
    starts: Counts,
    odds: Numbers,
    tally: Counts,
    poses: Table,  # [N, 7]
    ticks: Counts,  # [N]
    # out
    chance: Numbers,  # [N]: eqs. 11 and 12, over the time steps to rest
    control: Counts,  # [N]: the braking control that it is of
):
    for n in range(poses.shape[0]):
        robot = robot_of(numbers)
        least = 2.0
        for b in range(counts[6]):
            q = pose_in(poses, n)
            tick = ticks[n]
            product = 1.0
            going = True
            while going:
                product *= printed_chance(
                    arrival, numbers, counts, rows, places, near, pool, starts, odds, tally, q, tick
                )
                going = not at_rest(kind, q)
                if going:
                    q = step(kind, robot, q, control_of(braking, b), 0.0, numbers[1])
                    tick += counts[4]
            if product < least:
                least = product
                control[n] = b
        chance[n] = least


@kernel
def printed_path_risk(
    # in
    arrival: Arrival,  # [J, I]
    numbers: Numbers,  # [38]
    counts: Counts,  # [15]
    rows: Table,
    places: Links,
    near: Table,
    pool: Numbers,
    starts: Counts,
    odds: Numbers,
    tally: Counts,
    poses: Table,  # [M, 7]
    ticks: Counts,  # [M]
    # out
    chances: Numbers,  # [M]: of each pose for itself; eq. 12 is their product
):
    for m in range(poses.shape[0]):
        chances[m] = printed_chance(
            arrival, numbers, counts, rows, places, near, pool, starts, odds, tally,
            pose_in(poses, m), ticks[m],
        )  # fmt: skip
