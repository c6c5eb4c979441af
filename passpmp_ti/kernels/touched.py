"""A picture of the risk: how likely anything touches a robot that stays in a cell for a while."""

import taichi as ti

from passpmp_ti.kernels.chances import touch_chance, touch_flow, vec2
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.risk import (
    SCANNED,
    Arrival,
    Counts,
    Links,
    Numbers,
    Table,
    hidden_chance,
    needed_share,
)


@kernel
def layer_chances(
    # in
    arrival: Arrival,  # [J, I]
    rows: Table,
    places: Links,
    near: Table,
    pool: Numbers,
    starts: Counts,
    odds: Numbers,
    tally: Counts,
    corner_i: ti.i32,
    corner_j: ti.i32,
    cell: ti.f32,
    begin: ti.f32,  # of the layer, and its end [ticks]
    end: ti.f32,
    looks: ti.i32,  # pieces that a layer is looked at in, no longer than a sample
    # out
    chances: Table,  # [J, I]: that anything touches a disc about the cell's middle in [begin, end)
):
    for j, i in chances:
        p = vec2((i + corner_i + 0.5) * cell, (j + corner_j + 0.5) * cell)
        none = ti.max(1.0 - odds[4], 0.0)
        piece = (end - begin) / looks
        for n in range(tally[0]):
            total = 0.0
            for look in range(looks + 1):
                tick = begin + look * piece
                weight = 1e-3 * piece
                if look == 0 or look == looks:
                    weight *= 0.5
                    total += 0.5 * touch_chance(
                        rows, places, near, pool, starts, odds, tally, n, p, tick
                    )
                flow = touch_flow(rows, places, near, pool, starts, odds, tally, n, p, tick)
                total += 0.5 * weight * flow
            none *= 1.0 - ti.min(total, 1.0)
        none *= ti.max(1.0 - odds[2] * 1e-3 * (end - begin), 0.0)
        # a layer does not hold its end
        last = ti.cast(ti.ceil(end - 1e-3), ti.i32) - 1
        need = needed_share(ti.cast(arrival[j, i], ti.i32), last, odds[SCANNED])
        chances[j, i] = 1.0 - none * (1.0 - hidden_chance(odds, tally, need))
