"""Distances to arrival times, and what is remembered of the model before.

T(p) = t_k + max(0, (dist(p, sources) - clearance) / v_b), never free where
dist(p, static or unseen) <= clearance: DESIGN of the conservative model, Fig. 4 of the paper.
"""

import taichi as ti

from passpmp_ti.kernels.beams import SLACK
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.spread import evens_first

NEVER = 65535
LATEST = 65534
TICK_SLACK = 0.05  # [ticks] f32 rounding of a time must never free a cell

SAMPLING = 0.25  # [cells] between what may come out and the nearest mark

LANES = 16
"""Cells of a row that are worked on together; vectors of them become the CPU's own."""
CHUNK = 8
"""Rows that are passed over together where none of them is near enough to matter."""
RUNS, TILES = 8, 256
"""Chunks of whole rows, and blocks of them, that one thread is handed at a time."""
NONE, SOME, ALL = range(3)
"""Of a block's cells are marked."""
ALL_MARKED = -1
"""As the least square of a chunk's block: all of its cells are marked."""
FAR = 1 << 14
"""[cells] farther than any window is wide; its square and another's still fit an i32."""
NO_SEED = 1e6
"""[cells] where nothing is marked anywhere."""
UNSEEN, SOURCE, SOURCE_LEFT, BLIND, BLIND_LEFT = range(5)
KINDS = 5
"""Of marks that distances are taken to."""

Distances = ti.types.ndarray(dtype=ti.f32, ndim=2)  # [J, I] cells
Arrival = ti.types.ndarray(dtype=ti.u16, ndim=2)  # [J, I] ticks
Cells = ti.types.ndarray(dtype=ti.u8, ndim=2)  # [J, I]
Marks = ti.types.ndarray(dtype=ti.u8, ndim=3)  # [5, J, I]: 0 marks
vec = ti.types.vector(LANES, ti.i32)


@ti.func
def arrival_ticks(distance, speed, stamp_error):
    """Ticks until something that moves at `speed` has come `distance` nearer."""
    exact = (distance / ti.select(speed > 0.0, speed, 1.0) - stamp_error) * 1000.0 - TICK_SLACK
    later = ti.cast(ti.floor(ti.min(ti.max(exact, 0.0), ti.cast(LATEST, ti.f32))), ti.i32)
    return ti.select(distance > 0.0, ti.select(speed > 0.0, later, NEVER), 0)


@ti.func
def aged(ticks, age):
    """Remembered ticks, counted from the new base; what is never reached never will be."""
    return ti.select(ticks != NEVER, ti.max(ticks - age, 0), NEVER)


@ti.func
def unmarked(seen: ti.template(), marks: ti.template(), left: ti.template(), kind, j, i):
    """[LANES] 0 where the row's cells from i on are marked."""
    cells = vec(0)
    if kind == UNSEEN:
        for lane in ti.static(range(LANES)):
            cells[lane] = ti.cast(seen[j, i + lane], ti.i32)
    elif kind % 2 == 1:
        for lane in ti.static(range(LANES)):
            cells[lane] = ti.cast(marks[kind // BLIND, j, i + lane], ti.i32)
    else:
        for lane in ti.static(range(LANES)):
            cells[lane] = ti.cast(left[kind // BLIND, j, i + lane], ti.i32)
    return cells


@ti.func
def square_along_row(
    seen: ti.template(),
    marks: ti.template(),
    left: ti.template(),
    squares: ti.template(),
    least: ti.template(),
    kind,
    chunk,
    row,
    border,
):
    """Squared distance to the nearest mark of the same row, less the border of both cells.

    The least of a chunk's rows is kept too; they have to come in order. Most blocks are marked
    nowhere: how far their ends are from a mark tells all of them.
    """
    blocks = least.shape[2]
    j = chunk * CHUNK + row
    first = (kind * least.shape[1] + chunk) * blocks * CHUNK + row
    away = FAR
    for b in range(blocks):
        cells = unmarked(seen, marks, left, kind, j, b * LANES)
        holds = NONE
        last = LANES - 1
        if cells.max() == 0:
            holds = ALL
        elif cells.min() == 0:
            holds = SOME
            for lane in ti.static(range(LANES)):
                last = ti.select(cells[lane] == 0, lane, last)
        # for the way back: how far the last mark before the block is, and what the block holds
        at = first + b * CHUNK
        squares[at][0] = away
        squares[at][1] = holds
        away = ti.select(holds == NONE, ti.min(away + LANES, FAR), LANES - 1 - last)
    away = FAR
    for back in range(blocks):
        b = blocks - 1 - back
        at = first + b * CHUNK
        before = squares[at][0]
        holds = squares[at][1]
        steps = vec(0)
        if holds == ALL:
            away = 0
        elif holds == SOME:
            cells = unmarked(seen, marks, left, kind, j, b * LANES)
            for lane in ti.static(range(LANES)):
                before = ti.select(cells[lane] == 0, 0, before + 1)
                steps[lane] = before
            for back_lane in ti.static(range(LANES)):
                lane = ti.static(LANES - 1 - back_lane)
                away = ti.select(cells[lane] == 0, 0, away + 1)
                steps[lane] = ti.min(steps[lane], away)
        else:
            for lane in ti.static(range(LANES)):
                steps[lane] = ti.min(before + 1 + lane, away + LANES - lane)
            away += LANES
        away = ti.min(away, FAR)
        apart = ti.max(ti.min(steps, FAR) - border, 0)
        squares[at] = apart * apart
        low = ti.select(holds == ALL, ALL_MARKED, apart.min() ** 2)
        if row > 0:
            before_it = least[kind, chunk, b]
            low = ti.select(low == before_it, low, ti.max(ti.min(low, before_it), 0))
        least[kind, chunk, b] = low


@ti.func
def free_of_unseen(least: ti.template(), chunk, b, border, unseen_square):
    """1: all cells of a chunk's block are farther than that from what is unseen; 0: all of them
    are unseen; -1: look closer."""
    verdict = 1
    step = 0
    gap = 0
    while verdict == 1 and gap <= unseen_square:
        for way in ti.static(range(2)):
            other = chunk + (2 * way - 1) * step
            if other >= 0 and other < least.shape[1]:
                if least[UNSEEN, other, b] + gap <= unseen_square:
                    verdict = -1
        step += 1
        gap = ti.max((step - 1) * CHUNK + 1 - border, 0) ** 2
    if least[UNSEEN, chunk, b] == ALL_MARKED:
        verdict = 0
    return verdict


@ti.func
def nearest(squares: ti.template(), least: ti.template(), kind: ti.template(), j, b, border, best):
    """The least squared distances of a row's cells, no more than `best`: see `arrival_times`.

    Rows are asked from the nearest on, and passed over by chunks that cannot matter any more.
    """
    blocks = least.shape[2]
    worst = best.max()
    going = worst > 0
    step = 0
    while going:
        going = False
        for way in ti.static(range(2)):
            chunk = j // CHUNK + (2 * way - 1) * step
            gap = chunk * CHUNK - j
            if ti.static(way == 0):
                gap = j - chunk * CHUNK - (CHUNK - 1)
            gap = ti.max(gap - border, 0)
            gap *= gap
            if chunk >= 0 and chunk < least.shape[1] and (way == 0 or step > 0) and gap < worst:
                going = True
                if least[kind, chunk, b] + gap < worst:
                    # unrolled: only then do lanes become the CPU's own vectors
                    first = ((kind * least.shape[1] + chunk) * blocks + b) * CHUNK
                    for row in ti.static(range(CHUNK)):
                        apart = ti.max(ti.abs(chunk * CHUNK + row - j) - border, 0)
                        best = ti.min(best, squares[first + row] + apart * apart)
                    worst = best.max()
        step += 1
    return best


@ti.func
def row_of(ticks: ti.template(), j, i):
    """[LANES] of a row from cell i on; 0 beyond the map."""
    found = vec(0)
    if i >= 0 and i + LANES <= ticks.shape[1]:
        for lane in ti.static(range(LANES)):
            found[lane] = ti.cast(ticks[j, i + lane], ti.i32)
    else:
        for lane in ti.static(range(LANES)):
            if i + lane >= 0 and i + lane < ticks.shape[1]:
                found[lane] = ti.cast(ticks[j, i + lane], ti.i32)
    return found


@ti.func
def is_wanted(kind, opened, blind_speed):
    """Whether there are marks of a kind to be asked about."""
    return (kind < BLIND or blind_speed > 0.0) and (kind % 2 == 1 or kind == UNSEEN or opened == 1)


@ti.func
def way_to(square, border):
    """[cells] from a squared distance."""
    none = (FAR - border) * (FAR - border)
    return ti.select(square >= none, NO_SEED, ti.sqrt(ti.cast(square, ti.f32)))


@kernel
def arrival_times(
    # in
    seen: Cells,
    marks: Marks,  # from the sources on
    left: Marks,  # the same, where only what objects of a size can come out of is left
    previous: Arrival,
    shift_i: ti.i32,  # cell [j, i] now was [j + shift_j, i + shift_i] before
    shift_j: ti.i32,
    age: ti.i32,  # ticks since the previous base; < 0: nothing is remembered
    border: ti.i32,  # 1: between any points of two cells; 0: between their centres
    unseen_square: ti.i32,  # squared distance [cells] to what is unseen of cells that are not free
    opened: ti.i32,  # 1: what comes out must have come by both sets of marks
    cell: ti.f32,
    clearance: ti.f32,
    speed: ti.f32,
    blind_speed: ti.f32,
    stamp_error: ti.f32,
    share: ti.i32,  # indices of a loop that one thread is handed at a time
    # scratch
    squares: ti.types.ndarray(dtype=vec, ndim=1),  # [KINDS x J / CHUNK x I / LANES x CHUNK]
    least: ti.types.ndarray(dtype=ti.i32, ndim=3),  # [KINDS, J / CHUNK, I / LANES] or ALL_MARKED
    # out
    arrival: Arrival,
):
    """Distances between cells, and what they make of the time of arrival.

    Along each row, then over the rows; J is a multiple of CHUNK, I of LANES.
    """
    rows = arrival.shape[0]
    blocks = arrival.shape[1] // LANES
    chunks = rows // CHUNK
    grain = (share + RUNS - 1) // RUNS
    for index in range(KINDS * chunks * grain):
        task = index // grain
        if index % grain == 0 and is_wanted(task % KINDS, opened, blind_speed):
            for row in range(CHUNK):
                square_along_row(
                    seen, marks, left, squares, least, task % KINDS, task // KINDS, row, border
                )

    # Distances are between cells, any point of either. A source's samples are an eighth of a cell
    # apart, so where another view takes over, what comes out may do so an eighth of a cell from
    # the last mark, and another eighth is forgiven behind a standing surface.
    taken = 1e-3 * cell + SLACK + SAMPLING * cell + clearance
    # down the columns: most of what one piece of work read is what the next one reads
    grain = (share + TILES - 1) // TILES
    for index in range(chunks * blocks * grain):
        chunk = index // grain % chunks
        b = evens_first(index // grain // chunks, blocks)
        verdict = -1
        own = 0
        if index % grain == 0:
            own = CHUNK
            verdict = free_of_unseen(least, chunk, b, border, unseen_square)
        for row in range(own):
            j = chunk * CHUNK + row
            most = vec(unseen_square + 1)
            ticks = vec(0)
            come = vec(0)
            for kind in range(KINDS):
                if most.max() > 0 and is_wanted(kind, opened, blind_speed):
                    square = vec(0)
                    if kind != UNSEEN or verdict < 0:
                        square = nearest(squares, least, kind, j, b, border, most)
                    if kind == UNSEEN:
                        free = square > unseen_square
                        if verdict > 0:
                            free = vec(1)
                        most = ti.select(free, FAR * FAR, 0)
                        ticks = ti.select(free, NEVER, 0)
                    else:
                        pace = ti.select(kind < BLIND, speed, blind_speed)
                        way = way_to(square, border) * cell - taken
                        after = arrival_ticks(way, pace, stamp_error)
                        # what comes out must have come by both sets of marks
                        come = ti.max(come, after)
                        if kind == SOURCE + opened or kind == BLIND + opened:
                            ticks = ti.min(ticks, come)
                            come = vec(0)
            pj = j + shift_j
            if age >= 0 and pj >= 0 and pj < previous.shape[0]:
                remembered = row_of(previous, pj, b * LANES + shift_i)
                ticks = ti.max(ticks, aged(remembered, age))
            for lane in ti.static(range(LANES)):
                arrival[j, b * LANES + lane] = ti.cast(ticks[lane], ti.u16)


@kernel
def cap_memory(
    # in
    to_intruder: Distances,
    previous: Arrival,
    cell: ti.f32,
    clearance: ti.f32,
    speed: ti.f32,
    stamp_error: ti.f32,
    age: ti.i32,
    # out
    remembered: Arrival,
):
    """Let memory promise nothing that the intruders seen now could break."""
    for j, i in remembered:
        distance = to_intruder[j, i] * cell - SLACK - clearance
        ticks = arrival_ticks(distance, speed, stamp_error)
        if ticks != NEVER:
            # counted from the old base, as the memory is
            ticks = ti.min(ticks + age, LATEST)
        kept = ti.cast(previous[j, i], ti.i32)
        if distance <= 0.0:
            ticks = 0
        remembered[j, i] = ti.cast(ti.min(kept, ticks), ti.u16)


@kernel
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
