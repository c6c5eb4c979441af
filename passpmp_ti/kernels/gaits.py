"""Gaits: nodes of a tree with the same speeds, sorted out one after the other.

    gaits f32 [G, 2]: the speeds (a, b) of each, as in kernels/motion.py
    slots i32 [a power of two, more than the gaits]: where a gait's number is found by its speeds
"""

import taichi as ti

from passpmp_ti.kernels.check import Counts, Numbers, Table
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.motion import CAR, A, B, sign

SAME = 5e-7
"""Speeds and angles that differ by less than this share of the greatest are taken for one."""


@ti.func
def key_of(value, greatest):
    """Equal for speeds that are taken for one. Rest is like nothing but rest, and forwards is
    unlike backwards."""
    rounded = ti.cast(ti.round(value / (SAME * greatest)), ti.i32)
    return 2 * rounded + ti.cast(sign(value), ti.i32)


@ti.func
def gait_for(
    kind: ti.template(),
    numbers: ti.template(),
    a,
    b,
    number,
    gaits: ti.template(),
    slots: ti.template(),
):
    """(gait of the speeds a and b, gaits now); -1 where there is no room for another."""
    greatest = numbers[2]
    if ti.static(kind == CAR):
        greatest = numbers[4]
    key_a = key_of(a, numbers[2])
    key_b = key_of(b, greatest)
    mask = slots.shape[0] - 1
    slot = (key_a * 73856093 ^ key_b * 19349663) & mask
    found = -1
    looking = True
    while looking:
        gait = slots[slot]
        if gait < 0:
            looking = False
            if number < gaits.shape[0]:
                slots[slot] = number
                gaits[number, 0] = a
                gaits[number, 1] = b
                found = number
                number += 1
        elif key_of(gaits[gait, 0], numbers[2]) == key_a:
            if key_of(gaits[gait, 1], greatest) == key_b:
                found = gait
                looking = False
        slot = (slot + 1) & mask
    return found, number


@kernel
def sort_gaits(
    # in
    kind: ti.template(),
    numbers: Numbers,
    pose: Table,  # [cap, 7]
    first: ti.i32,  # nodes [first, last) are sorted
    last: ti.i32,
    # scratch
    slots: Counts,  # [a power of two, more than the gaits]
    # out
    gait: Counts,  # [cap]
    gaits: Table,  # [G, 2]: their speeds
    found: Counts,  # [1]: how many gaits there are; -1: more than there is room for
):
    ti.loop_config(serialize=True)
    for slot in range(slots.shape[0]):
        slots[slot] = -1
    ti.loop_config(serialize=True)
    for _ in range(1):
        n = first
        number = 0
        while n < last and number >= 0:
            its_gait, number_now = gait_for(
                kind, numbers, pose[n, A], pose[n, B], number, gaits, slots
            )
            gait[n] = its_gait
            number = number_now
            if its_gait < 0:
                number = -1
            n += 1
        found[0] = number
