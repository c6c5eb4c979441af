"""How far something has to walk from where it may come out, when what does not let through bars it.

Whoever is at a place that the views prove empty came there, from the last source that he passed, by
a way that lies wholly in what they prove empty and in the strips before surfaces that stay. So only
cells that this touches are open to the way. `open_cells` marks too many rather than too few.

The shortest way over open cells is bounded from below without a root. Its pieces turn at corners of
cells. Measured by a polygon norm that is nowhere longer than the Euclidean one, a straight piece
between two corners is as long as the best chain of 16 moves (1, 0), (1, 1) and (2, 1) over the very
cells that the piece crosses: the chain that rounds the piece down, in which every rise follows a
level move where it is flat, and every level move precedes a rise where it is steep. So chains of
moves between corners, by whole numbers, are never longer than the way; docs/geodesic-cones.md.

Arrays of corners and of cells are padded: [j, i] is kept at [j + ROWS, i + COLUMNS].
"""

import taichi as ti

from passpmp_ti.kernels.arrival import (
    LANES,
    NO_SEED,
    SAMPLING,
    Arrival,
    Cells,
    aged,
    arrival_ticks,
    row_of,
)
from passpmp_ti.kernels.beams import LOST, SHUT, SLACK
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.visibility import Counts, Views, Wedges, wedges_across

ROWS, COLUMNS = 2, LANES
"""Padding on every side; no cell of it is open."""
UNIT = 1024
"""Of lengths, in a cell."""
LEVEL, DIAGONAL, KNIGHT = 996, 1442, 2228
"""Lengths of the moves (1, 0), (1, 1), (2, 1) [1 / UNIT cells]. They span a norm whose gradients
are (996, 236), (786, 656) and their mirror images, none longer than UNIT: no way is shorter than by
its norm, which is at most 2.8 % less."""
FAR = 1 << 28
"""Length of what is not reached, and of a move that is barred."""
ENDS = 4 * (LEVEL + DIAGONAL - KNIGHT)
"""[1 / UNIT cells] by which a chain between corners of two cells may be longer than a way between
any points of them: at either end two moves may find no partner to make a knight's move with."""
BLOCK, SMALLEST_BLOCK = 8, 4
TURNS = 4
"""Rounds of moves in one launch; an even number."""

Lengths = ti.types.ndarray(dtype=ti.i32, ndim=2)


@ti.func
def beam_told(met: ti.template(), v, n, beam, way):
    """The nearest beam from `beam` on that is not lost, going round."""
    at = beam % n
    passed = 0
    while passed < n and met[v, at] == LOST:
        at = (at + way + n) % n
        passed += 1
    return at


@ti.func
def reached(view: ti.template(), beams: ti.template(), far: ti.template(), behind, x, y, radius):
    """Whether any view's wedges reach into a disc, or `behind` beyond a view's range."""
    found = False
    for v in range(view.shape[0]):
        if not found:
            dx = x - view[v, 0]
            dy = y - view[v, 1]
            r = ti.sqrt(dx * dx + dy * dy)
            if r - radius <= view[v, 5] + behind + SLACK:
                first, count = wedges_across(view, beams[v], v, r, ti.atan2(dy, dx), radius)
                k = 0
                while k < count and not found:
                    w = first + k
                    if w >= beams[v]:
                        w -= beams[v]
                    found = far[v, w] >= r - radius
                    k += 1
    return found


@ti.func
def open_block(
    view: ti.template(),
    beams: ti.template(),
    far: ti.template(),
    seen: ti.template(),
    toll: ti.template(),
    i0,
    j0,
    corner_i,
    corner_j,
    cell,
    behind,
    pad,
    side: ti.template(),
):
    """Write what a block of cells costs to cross: nothing where it is open, else FAR."""
    all_seen = ti.u8(1)
    for dj in range(side):
        for di in range(side):
            all_seen &= seen[j0 + dj, i0 + di]
    touched = True
    if all_seen == 0:
        x = (corner_i + i0 + 0.5 * side) * cell
        y = (corner_j + j0 + 0.5 * side) * cell
        touched = reached(view, beams, far, behind, x, y, 0.7071068 * side * cell + pad)
    if all_seen == 1 or not touched:
        price = ti.select(touched, 0, FAR)
        for dj in range(side):
            for di in range(side):
                toll[j0 + dj + ROWS, i0 + di + COLUMNS] = price
    elif ti.static(side > SMALLEST_BLOCK):
        for quarter in range(4):
            open_block(
                view, beams, far, seen, toll, i0 + quarter % 2 * (side // 2),
                j0 + quarter // 2 * (side // 2), corner_i, corner_j, cell, behind, pad, side // 2,
            )  # fmt: skip
    else:
        for dj in range(side):
            for di in range(side):
                price = 0
                if seen[j0 + dj, i0 + di] == 0:
                    x = (corner_i + i0 + di + 0.5) * cell
                    y = (corner_j + j0 + dj + 0.5) * cell
                    if not reached(view, beams, far, behind, x, y, 0.7071068 * cell + pad):
                        price = FAR
                toll[j0 + dj + ROWS, i0 + di + COLUMNS] = price


@kernel
def open_cells(
    # in
    view: Views,  # [V, 8]
    beams: Counts,  # [V]
    ranges: Views,  # [V, n_max]
    met: Wedges,  # [V, n_max]
    reach: Views,  # [V, n_max]
    far_side: Wedges,  # [V, n_max]
    seen: Cells,  # [J, I]; multiples of BLOCK
    sources: ti.types.ndarray(dtype=ti.u8, ndim=3),  # [5, J, I]: 0 marks; the first are sources
    corner_i: ti.i32,
    corner_j: ti.i32,
    cell: ti.f32,
    behind: ti.f32,  # how far behind the chord of a shut wedge something may be [m]
    apart: ti.f32,  # by how much views may disagree [m]
    # scratch
    far: Views,  # [V, n_max] where each wedge ends for what may walk in it [m]
    # in / out
    toll: Lengths,  # [J + 2 ROWS + 1, I + 3 COLUMNS] of cells: 0 open, else FAR, as the padding is
    # out
    way: Lengths,  # the same of corners: 0 about sources, else FAR
):
    """Which cells a way may lead through, and where it may begin."""
    n_max = reach.shape[1]
    for task in range(view.shape[0] * n_max):
        v = task // n_max
        w = task % n_max
        if w < beams[v]:
            end = reach[v, w]
            if far_side[v, w] == SHUT:
                # any point between two returns is no farther than the farther one
                a = beam_told(met, v, beams[v], w, -1)
                b = beam_told(met, v, beams[v], w + 1, 1)
                end = ti.max(ti.max(ranges[v, a], ranges[v, b]) + behind, end)
            far[v, w] = end + SLACK

    for j, i in way:
        way[j, i] = FAR

    columns = seen.shape[1] // BLOCK
    for block in range((seen.shape[0] // BLOCK) * columns):
        open_block(
            view, beams, far, seen, toll, block % columns * BLOCK, block // columns * BLOCK,
            corner_i, corner_j, cell, behind, apart + SLACK, BLOCK,
        )  # fmt: skip

    for j, b in ti.ndrange(seen.shape[0], seen.shape[1] // LANES):
        unmarked = ti.u8(1)
        for lane in ti.static(range(LANES)):
            unmarked &= sources[0, j, b * LANES + lane]
        if unmarked == 0:
            for lane in range(LANES):
                i = b * LANES + lane
                if sources[0, j, i] == 0:
                    # whoever else writes here writes the same
                    for corner in ti.static(range(4)):
                        way[j + ROWS + corner // 2, i + COLUMNS + corner % 2] = 0
                    toll[j + ROWS, i + COLUMNS] = 0


@kernel
def begin_at(
    # in
    marks: ti.types.ndarray(dtype=ti.u8, ndim=3),  # [5, J, I]: 0 marks
    kind: ti.i32,  # of the marks at which ways may begin too
    before: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [J, I] cells that were walked by then
    # in / out
    toll: Lengths,
    way: Lengths,
):
    """Let ways begin about other marks as well, with what was walked before."""
    for j, i in before:
        if marks[kind, j, i] == 0:
            toll[j + ROWS, i + COLUMNS] = 0
            # a sample's spacing less for each of the two marks
            walked = ti.max(before[j, i] - 1e-3 - SAMPLING, 0.0) * UNIT
            walked = ti.min(walked, ti.cast(FAR, ti.f32))
            for corner in ti.static(range(4)):
                ti.atomic_min(
                    way[j + ROWS + corner // 2, i + COLUMNS + corner % 2],
                    ti.cast(ti.floor(walked), ti.i32),
                )


@ti.func
def taken_from(array: ti.template(), j, i, lanes: ti.template()):
    """[lanes] of a row from column i on."""
    found = ti.Vector.zero(ti.i32, lanes)
    for lane in ti.static(range(lanes)):
        found[lane] = array[j, i + lane]
    return found


@ti.func
def from_side(toll: ti.template(), way: ti.template(), j, i, side, lanes: ti.template()):
    """[lanes] lengths to a row's corners by a move from the rows on one side; side: -1 or 1."""
    near = j + side
    # cells between the two rows of corners, and beyond the nearer one
    here = j + (side - 1) // 2
    beyond = here + side
    left = taken_from(toll, here, i - 1, lanes)
    right = taken_from(toll, here, i, lanes)
    least = taken_from(way, near, i, lanes) + (left & right) + LEVEL
    least = ti.min(least, taken_from(way, near, i - 1, lanes) + left + DIAGONAL)
    least = ti.min(least, taken_from(way, near, i + 1, lanes) + right + DIAGONAL)
    wide = left | taken_from(toll, here, i - 2, lanes)
    least = ti.min(least, taken_from(way, near, i - 2, lanes) + wide + KNIGHT)
    wide = right | taken_from(toll, here, i + 1, lanes)
    least = ti.min(least, taken_from(way, near, i + 2, lanes) + wide + KNIGHT)
    tall = left | taken_from(toll, beyond, i - 1, lanes)
    least = ti.min(least, taken_from(way, near + side, i - 1, lanes) + tall + KNIGHT)
    tall = right | taken_from(toll, beyond, i, lanes)
    return ti.min(least, taken_from(way, near + side, i + 1, lanes) + tall + KNIGHT)


@ti.func
def spread_along(toll: ti.template(), way: ti.template(), stirred: ti.template(), j, step, turn):
    """Hand the lengths that fell in a turn on along their row of corners, to the right for step 1
    or to the left for -1, for as long as they fall."""
    blocks = way.shape[1] // LANES
    handed = False
    for k in range(1, blocks - 1):
        b = k
        if step < 0:
            b = blocks - 1 - k
        if handed or stirred[j, b] == turn:
            i = b * LANES
            if step < 0:
                i += LANES - 1
            carried = way[j, i - step]
            fell = False
            for _ in range(LANES):
                between = ti.min(i, i - step)
                carried += LEVEL + (toll[j, between] & toll[j - 1, between])
                old = way[j, i]
                fell = fell or carried < old
                carried = ti.min(carried, old)
                way[j, i] = carried
                i += step
            # the next block hears of it through this one's end
            handed = fell or stirred[j, b] == turn
            if fell:
                stirred[j, b] = turn


@kernel
def walk(
    # in
    toll: Lengths,
    most_sweeps: ti.i32,
    # in / out
    way: Lengths,  # as `open_cells` leaves it; least lengths to corners [1 / UNIT cells]
    stirred: Lengths,  # [rows, columns / LANES] scratch: sweep in which each block fell last
) -> ti.i32:
    """Sweep down and up, each row both ways, until no length falls; returns the sweeps it took.

    A block is looked at only where one of those that it hears of fell since. More sweeps than
    `most_sweeps`: lengths are not final, and bound nothing.
    """
    rows = way.shape[0]
    blocks = way.shape[1] // LANES
    sweeps = 1
    ti.loop_config(serialize=True)
    for _ in range(1):
        for j in range(rows):
            for b in range(blocks):
                # what is given counts as fallen in the first sweep: both directions hear of it
                stirred[j, b] = ti.select(taken_from(way, j, b * LANES, LANES).min() < FAR, 2, 0)
        for j in range(ROWS, rows - ROWS):
            spread_along(toll, way, stirred, j, 1, 2)
            spread_along(toll, way, stirred, j, -1, 2)
        busy = True
        while busy and sweeps <= most_sweeps:
            sweeps += 1
            busy = sweeps == 2
            for jj in range(ROWS, rows - ROWS):
                j = jj
                side = -1
                if sweeps % 2 == 1:
                    j = rows - 1 - jj
                    side = 1
                fell = False
                for b in range(1, blocks - 1):
                    heard = 0
                    for near in ti.static(range(1, 3)):
                        for beside in ti.static(range(-1, 2)):
                            heard = ti.max(heard, stirred[j + side * near, b + beside])
                    if heard >= sweeps - 1:
                        old = taken_from(way, j, b * LANES, LANES)
                        new = ti.min(old, from_side(toll, way, j, b * LANES, side, LANES))
                        if (old - new).max() > 0:
                            fell = True
                            stirred[j, b] = sweeps
                            for lane in ti.static(range(LANES)):
                                way[j, b * LANES + lane] = new[lane]
                if fell:
                    busy = True
                    spread_along(toll, way, stirred, j, 1, sweeps)
                    spread_along(toll, way, stirred, j, -1, sweeps)
    return sweeps


@ti.func
def step_apart(toll: ti.template(), before: ti.template(), after: ti.template(), j, i):
    """The least length to a corner by one move from what lengths were; whether it fell."""
    left = taken_from(toll, j, i - 1, 1) & taken_from(toll, j - 1, i - 1, 1)
    right = taken_from(toll, j, i, 1) & taken_from(toll, j - 1, i, 1)
    new = ti.min(from_side(toll, before, j, i, -1, 1), from_side(toll, before, j, i, 1, 1))
    new = ti.min(new, taken_from(before, j, i - 1, 1) + left + LEVEL)
    new = ti.min(new, taken_from(before, j, i + 1, 1) + right + LEVEL)
    old = before[j, i]
    after[j, i] = ti.min(old, new[0])
    return new[0] < old


@kernel
def walk_apart(
    # in
    toll: Lengths,
    # in / out
    way: Lengths,  # as for `walk`
    other: Lengths,  # scratch, as `way` as it begins
) -> ti.i32:
    """The same by a thread for every corner, for `TURNS` rounds of one move each; returns how many
    lengths fell in the last of them. They end where those of `walk` do."""
    fell = 0
    for t in ti.static(range(TURNS)):
        for row, column in ti.ndrange(way.shape[0] - 2 * ROWS, way.shape[1] - 2 * COLUMNS):
            j = row + ROWS
            i = column + COLUMNS
            if ti.static(t % 2 == 0):
                step_apart(toll, way, other, j, i)
            elif step_apart(toll, other, way, j, i):
                if ti.static(t == TURNS - 1):
                    fell += 1
    return fell


@kernel
def arrival_round_walls(
    # in
    way: Lengths,  # final
    previous: Arrival,
    shift_i: ti.i32,  # as in `arrival_times`
    shift_j: ti.i32,
    age: ti.i32,
    cell: ti.f32,
    clearance: ti.f32,
    speed: ti.f32,
    stamp_error: ti.f32,
    # in / out
    arrival: Arrival,  # [J, I] by the straight way, nothing remembered; then by the longer one
):
    """What the length of the way makes of the time of arrival; memory is laid over it.

    A place that is free as the crow flies keeps a disc of the clearance that is all seen, so all of
    it is open, and what comes near the robot comes as near to the place by the way as straight.
    """
    taken = 1e-3 * cell + SLACK + SAMPLING * cell + clearance
    for j, b in ti.ndrange(arrival.shape[0], arrival.shape[1] // LANES):
        i = b * LANES
        ticks = row_of(arrival, j, i)
        # 0: not free, or reached at once: neither is asked about again
        if ticks.max() > 0:
            # to any point of a cell no less than to the nearest of its corners
            least = ti.min(
                taken_from(way, j + ROWS, i + COLUMNS, LANES),
                taken_from(way, j + ROWS, i + COLUMNS + 1, LANES),
            )
            least = ti.min(least, taken_from(way, j + ROWS + 1, i + COLUMNS, LANES))
            least = ti.min(least, taken_from(way, j + ROWS + 1, i + COLUMNS + 1, LANES))
            cells = ti.select(least < FAR, ti.cast(least - ENDS, ti.f32) / UNIT, NO_SEED)
            length = cells * cell - taken
            later = ti.max(ticks, arrival_ticks(length, speed, stamp_error))
            ticks = ti.select(ticks > 0, later, 0)
        pj = j + shift_j
        if age >= 0 and pj >= 0 and pj < previous.shape[0]:
            ticks = ti.max(ticks, aged(row_of(previous, pj, i + shift_i), age))
        for lane in ti.static(range(LANES)):
            arrival[j, i + lane] = ti.cast(ticks[lane], ti.u16)
