"""Distances to arrival times, and what is remembered of the model before.

T(p) = t_k + max(0, (dist(p, sources) - clearance) / v_b), never free where
dist(p, static or unseen) <= clearance: DESIGN of the conservative model, Fig. 4 of the paper.
"""

import taichi as ti

from passpmp_ti.kernels.beams import SLACK

NEVER = 65535
LATEST = 65534
TICK_SLACK = 0.05  # [ticks] f32 rounding of a time must never free a cell

SAMPLING = 0.25  # [cells] between what may come out and the nearest mark

Distances = ti.types.ndarray(dtype=ti.f32, ndim=2)  # [J, I] cells
Arrival = ti.types.ndarray(dtype=ti.u16, ndim=2)  # [J, I] ticks


@ti.func
def arrival_ticks(distance, speed, stamp_error):
    """Ticks until something that moves at `speed` has come `distance` nearer."""
    ticks = NEVER
    if speed > 0.0 or distance <= 0.0:
        ticks = 0
        if distance > 0.0:
            exact = (distance / speed - stamp_error) * 1000.0 - TICK_SLACK
            ticks = ti.cast(ti.floor(ti.min(ti.max(exact, 0.0), ti.cast(LATEST, ti.f32))), ti.i32)
    return ticks


@ti.func
def aged(ticks, age):
    """Remembered ticks, counted from the new base; what is never reached never will be."""
    result = ticks
    if ticks != NEVER:
        result = ti.max(ticks - age, 0)
    return result


@ti.kernel
def arrival_times(
    # in
    to_source: Distances,
    to_blind: Distances,
    to_unseen: Distances,
    previous: Arrival,
    shift_i: ti.i32,  # cell [j, i] now was [j + shift_j, i + shift_i] before
    shift_j: ti.i32,
    age: ti.i32,  # ticks since the previous base; < 0: nothing is remembered
    cell: ti.f32,
    clearance: ti.f32,
    speed: ti.f32,
    blind_speed: ti.f32,
    stamp_error: ti.f32,
    # out
    arrival: Arrival,
):
    # Distances are between cells, any point of either. A source's samples are an eighth of a cell
    # apart, so where another view takes over, what comes out may do so an eighth of a cell from
    # the last mark, and another eighth is forgiven behind a standing surface.
    rounding = 1e-3 * cell + SLACK
    for j, i in arrival:
        ticks = 0
        if to_unseen[j, i] * cell - rounding > clearance:
            taken = rounding + SAMPLING * cell + clearance
            ticks = ti.min(
                arrival_ticks(to_source[j, i] * cell - taken, speed, stamp_error),
                arrival_ticks(to_blind[j, i] * cell - taken, blind_speed, stamp_error),
            )
        if age >= 0:
            pi = i + shift_i
            pj = j + shift_j
            if pi >= 0 and pj >= 0 and pi < previous.shape[1] and pj < previous.shape[0]:
                remembered = aged(ti.cast(previous[pj, pi], ti.i32), age)
                ticks = ti.max(ticks, remembered)
        arrival[j, i] = ti.cast(ticks, ti.u16)


@ti.kernel
def cap_memory(
    # in
    to_intruder: Distances,
    cell: ti.f32,
    clearance: ti.f32,
    speed: ti.f32,
    stamp_error: ti.f32,
    age: ti.i32,
    # in / out
    remembered: Arrival,
):
    """Let memory promise nothing that the intruders seen now could break."""
    for j, i in remembered:
        distance = to_intruder[j, i] * cell - SLACK - clearance
        ticks = arrival_ticks(distance, speed, stamp_error)
        if ticks != NEVER:
            # counted from the old base, as the memory is
            ticks = ti.min(ticks + age, LATEST)
        kept = ti.cast(remembered[j, i], ti.i32)
        if distance <= 0.0:
            ticks = 0
        remembered[j, i] = ti.cast(ti.min(kept, ticks), ti.u16)


@ti.kernel
def contradicted(
    # in
    points: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [N, 2] returns
    remembered: Arrival,
    age: ti.i32,
    corner_i: ti.i32,
    corner_j: ti.i32,
    cell: ti.f32,
    radius: ti.f32,  # what memory keeps free about a free cell
    # out
    broken: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [N]
):
    """A return inside a disc that memory says nothing can have reached yet."""
    span = ti.cast(radius / cell, ti.i32) + 1
    for n in range(points.shape[0]):
        x = points[n, 0]
        y = points[n, 1]
        ci = ti.cast(ti.floor(x / cell), ti.i32)
        cj = ti.cast(ti.floor(y / cell), ti.i32)
        first = ti.max(ci - span - corner_i, 0)
        last = ti.min(ci + span - corner_i, remembered.shape[1] - 1)
        j = ti.max(cj - span - corner_j, 0)
        last_j = ti.min(cj + span - corner_j, remembered.shape[0] - 1)
        found = 0
        while found == 0 and j <= last_j:
            latest = 0
            for i in range(first, last + 1):
                latest = ti.max(latest, ti.cast(remembered[j, i], ti.i32))
            # later than now by more than a tick: not yet reachable, yet somebody is there
            if latest > age + 2:
                dy = ti.abs((j + corner_j + 0.5) * cell - y)
                for i in range(first, last + 1):
                    dx = ti.abs((i + corner_i + 0.5) * cell - x)
                    if dx * dx + dy * dy < radius * radius:
                        if ti.cast(remembered[j, i], ti.i32) > age + 2:
                            found = 1
            j += 1
        broken[n] = found
