"""Views onto the grid: cells proven empty, and the places that something may come out of.

Views are described in kernels/beams.py. A cell is seen when one view proves all of it empty. The
border of what the views prove is walked piece by piece; a piece that is not shut marks the cells
it touches as sources, except where some view shows that no mover can be.
"""

import taichi as ti

from passpmp_ti.kernels.beams import MOVABLE, OPEN, SHUT, SLACK, STANDING, UNCOVERED, stays
from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.spread import spread, spread_over

TAU = 6.2831853
BLOCK, SMALLEST_BLOCK = 8, 4
"""Cells along the side of blocks that are first judged as a whole."""
BEARING_SLACK = 2e-5  # [rad] f32 bearings must not fall into the wrong wedge

Views = ti.types.ndarray(dtype=ti.f32, ndim=2)
Wedges = ti.types.ndarray(dtype=ti.i32, ndim=2)
Rays = ti.types.ndarray(dtype=ti.f32, ndim=3)
"""[V, n_max, 8] cosine and sine of a wedge's first bearing less what bearings may be off, of its
last and as much, of its own beam, and of the next one."""
Counts = ti.types.ndarray(dtype=ti.i32, ndim=1)
Cells = ti.types.ndarray(dtype=ti.u8, ndim=2)

SOURCES, BLIND_SOURCES, STANDING_SOURCES, STATIC_CELLS, MOVABLE_CELLS = range(5)


@ti.func
def wedge_at(view: ti.template(), n, v, bearing):
    """Wedge of view v that holds a bearing in the world."""
    relative = bearing - view[v, 2]
    relative -= TAU * ti.floor(relative / TAU)
    return ti.min(ti.cast(relative / view[v, 3], ti.i32), n - 1)


@ti.func
def wedges_across(view: ti.template(), n, v, r, bearing, pad):
    """(first wedge, count) that a disc of radius `pad` spans, r away as view v sees it."""
    first = 0
    count = n
    if 2.0 * pad < r:
        # asin(z) < 1.05 z up to z = 1/2: a wider span is a safer one
        half = 1.05 * pad / r + BEARING_SLACK
        first = wedge_at(view, n, v, bearing - half)
        last = wedge_at(view, n, v, bearing + half)
        count = last - first + 1
        if count <= 0:
            count += n
    return first, count


@ti.func
def way_out(c, s, dx, dy, half):
    """How far a ray along (c, s) is when it leaves a square centred at (dx, dy); 0: it misses."""
    enter = 0.0
    leave = 1e9
    for axis in ti.static(range(2)):
        direction = c
        middle = dx
        if ti.static(axis == 1):
            direction = s
            middle = dy
        if ti.abs(direction) > 1e-7:
            near = (middle - half) / direction
            far = (middle + half) / direction
            enter = ti.max(enter, ti.min(near, far))
            leave = ti.min(leave, ti.max(near, far))
        elif ti.abs(middle) > half:
            leave = 0.0
    if leave < enter:
        leave = 0.0
    return leave


@ti.func
def turn(view: ti.template(), beams: ti.template(), rays: ti.template(), v, w):
    """Fill in the directions of wedge w of view v, see `Rays`."""
    at = view[v, 2] + w * view[v, 3]
    low = at - BEARING_SLACK
    high = low + view[v, 3] + 2.0 * BEARING_SLACK
    end = at + view[v, 3]
    if w == beams[v] - 1:
        high = view[v, 2] + TAU + BEARING_SLACK
        end = view[v, 2]
    bearings = ti.Vector([low, high, at, end])
    for k in ti.static(range(4)):
        rays[v, w, 2 * k] = ti.cos(bearings[k])
        rays[v, w, 2 * k + 1] = ti.sin(bearings[k])


@ti.func
def proves_cell(view: ti.template(), n, reach: ti.template(), rays: ti.template(), v, x, y, cell):
    """Whether view v proves every point of the cell centred at (x, y) empty.

    Wedge by wedge: the farthest point of the cell in it must be within the wedge's reach. That
    point is where one of the wedge's two rays leaves the cell, or a corner between them.
    """
    half = 0.5 * cell
    dx = x - view[v, 0]
    dy = y - view[v, 1]
    r = ti.sqrt(dx * dx + dy * dy)
    ok = r <= view[v, 5]
    first, count = 0, 0
    far = 0.0
    if ok:
        # the wedge of its centre touches it for sure: most cells that are not seen end here
        bearing = ti.atan2(dy, dx)
        ok = reach[v, wedge_at(view, n, v, bearing)] >= r
        if ok:
            first, count = wedges_across(view, n, v, r, bearing, 0.7071068 * cell)
            far = ti.sqrt((ti.abs(dx) + half) ** 2 + (ti.abs(dy) + half) ** 2) + SLACK
    k = 0
    while ok and k < count:
        w = first + k
        if w >= n:
            w -= n
        if reach[v, w] < far:
            if w == n - 1:
                # what lies between two rays is told by their sides: for less than half a turn
                ok = view[v, 4] < 3.0
            cl = rays[v, w, 0]
            sl = rays[v, w, 1]
            ch = rays[v, w, 2]
            sh = rays[v, w, 3]
            farthest = ti.max(way_out(cl, sl, dx, dy, half), way_out(ch, sh, dx, dy, half))
            for corner in ti.static(range(4)):
                px = dx + half * (2 * (corner % 2) - 1)
                py = dy + half * (2 * (corner // 2) - 1)
                if cl * py - sl * px >= -SLACK and px * sh - py * ch >= -SLACK:
                    farthest = ti.max(farthest, ti.sqrt(px * px + py * py))
            # a wedge that does not touch the cell asks nothing of it
            if farthest > 0.0:
                ok = ok and reach[v, w] >= farthest + SLACK
        k += 1
    return ok


@ti.func
def before_wall(
    view: ti.template(),
    n,
    ranges: ti.template(),
    rays: ti.template(),
    v,
    w,
    x,
    y,
    tolerance,
    cell,
):
    """Whether (x, y) is on the sensor's side of the surface that shuts wedge w of view v.

    The surface is known as the chord between two returns. Its true course may lie behind the
    chord, in a corner, by half the chord's length; an eighth of a cell of that is forgiven, and
    charged in kernels/arrival.py.
    """
    last = w + 1
    if w == n - 1:
        last = 0
    ra = ranges[v, w]
    rb = ranges[v, last]
    result = False
    if ra > 0.0 and rb > 0.0:
        ax = ra * rays[v, w, 4]
        ay = ra * rays[v, w, 5]
        bx = rb * rays[v, w, 6] - ax
        by = rb * rays[v, w, 7] - ay
        px = x - view[v, 0] - ax
        py = y - view[v, 1] - ay
        length = ti.sqrt(bx * bx + by * by)
        forgiven = tolerance + ti.min(0.5 * length, 0.125 * cell)
        # the sensor lies to the left of the way from a to b (bearings grow counter-clockwise)
        result = bx * py - by * px >= -forgiven * length
    return result


@ti.func
def keeps_out(
    view: ti.template(),
    n,
    ranges: ti.template(),
    reach: ti.template(),
    far_side: ti.template(),
    rays: ti.template(),
    v,
    x,
    y,
    tolerance,
    cell,
):
    """Whether view v shows that no mover can be at (x, y).

    Either it proves the place empty, or the place is in a wedge that a standing surface shuts,
    on this side of it: nothing as wide as an object fits between two beams that both reached the
    surface.
    """
    dx = x - view[v, 0]
    dy = y - view[v, 1]
    r = ti.sqrt(dx * dx + dy * dy)
    # beyond its range a view shows nothing
    kept = r <= view[v, 5]
    bearing = 0.0
    if kept:
        bearing = ti.atan2(dy, dx)
    # A place on this view's own border is not kept out, to the last bit of it: two views of one
    # sensor share their borders, and each must not rely on the other.
    for half in range(2):
        if kept:
            w = wedge_at(view, n, v, bearing + (2 * half - 1) * BEARING_SLACK)
            kept = reach[v, w] >= r + 2.0 * SLACK
            if not kept and far_side[v, w] == SHUT:
                kept = before_wall(view, n, ranges, rays, v, w, x, y, tolerance, cell)
    return kept


@ti.func
def block_seen(view: ti.template(), beams: ti.template(), reach: ti.template(), x, y, radius):
    """1: all of a disc is proven empty by one view; 0: none of it by any; -1: look closer."""
    verdict = 0
    for v in range(view.shape[0]):
        dx = x - view[v, 0]
        dy = y - view[v, 1]
        r = ti.sqrt(dx * dx + dy * dy)
        if verdict != 1 and r - radius <= view[v, 5]:
            bearing = ti.atan2(dy, dx)
            first, count = wedges_across(view, beams[v], v, r, bearing, radius)
            least = view[v, 5]
            most = 0.0
            for k in range(count):
                w = first + k
                if w >= beams[v]:
                    w -= beams[v]
                least = ti.min(least, reach[v, w])
                most = ti.max(most, reach[v, w])
            if least >= r + radius:
                verdict = 1
            elif most >= r - radius:
                verdict = -1
    return verdict


@ti.func
def see_block(
    view: ti.template(),
    beams: ti.template(),
    reach: ti.template(),
    rays: ti.template(),
    seen: ti.template(),
    i0,
    j0,
    corner_i,
    corner_j,
    cell,
    side: ti.template(),
):
    """Write 1 for what is seen of a block of `side` x `side` cells; its quarters are judged as a
    whole first, then their cells."""
    x0 = (corner_i + i0 + 0.5 * side) * cell
    y0 = (corner_j + j0 + 0.5 * side) * cell
    verdict = block_seen(view, beams, reach, x0, y0, 0.7071068 * side * cell + SLACK)
    if verdict > 0:
        for dj in range(side):
            for di in range(side):
                seen[j0 + dj, i0 + di] = ti.u8(1)
    elif verdict < 0:
        if ti.static(side > SMALLEST_BLOCK):
            for quarter in range(4):
                i = i0 + quarter % 2 * (side // 2)
                j = j0 + quarter // 2 * (side // 2)
                see_block(view, beams, reach, rays, seen, i, j, corner_i, corner_j, cell, side // 2)
        else:
            for dj in range(side):
                for di in range(side):
                    x = (corner_i + i0 + di + 0.5) * cell
                    y = (corner_j + j0 + dj + 0.5) * cell
                    empty = False
                    for v in range(view.shape[0]):
                        if not empty:
                            empty = proves_cell(view, beams[v], reach, rays, v, x, y, cell)
                    if empty:
                        seen[j0 + dj, i0 + di] = ti.u8(1)


@ti.func
def covered(view: ti.template(), beams: ti.template(), scans, x, y):
    """Whether any scan's field of view holds the bearing of (x, y)."""
    result = False
    for v in range(scans):
        relative = ti.atan2(y - view[v, 1], x - view[v, 0]) - view[v, 2]
        relative -= TAU * ti.floor(relative / TAU)
        # the edges of the field belong to what lies beyond them
        if BEARING_SLACK < relative < (beams[v] - 1) * view[v, 3] - BEARING_SLACK:
            result = True
    return result


@ti.func
def mark_piece(
    view: ti.template(),
    beams: ti.template(),
    ranges: ti.template(),
    reach: ti.template(),
    far_side: ti.template(),
    rays: ti.template(),
    marks: ti.template(),
    v,
    scans,
    side,
    r,
    bearing,
    outwards,
    across,
    blind_apart,
    corner_i,
    corner_j,
    cell,
    tolerance,
):
    """Walk a border piece from (r, bearing), `outwards` metres and `across` radians, and mark the
    cells that hold its samples, except where a view keeps movers out."""
    apart = blind_apart == 1 and (side == UNCOVERED or v >= scans)
    c = ti.cos(bearing)
    s = ti.sin(bearing)
    pieces = ti.cast((outwards + r * across) / (0.125 * cell), ti.i32) + 1
    for k in range(pieces + 1):
        at_r = r + outwards * k / pieces
        if across > 0.0:
            at_bearing = bearing + across * k / pieces
            c = ti.cos(at_bearing)
            s = ti.sin(at_bearing)
        x = view[v, 0] + at_r * c
        y = view[v, 1] + at_r * s
        i = ti.cast(ti.floor(x / cell), ti.i32) - corner_i
        j = ti.cast(ti.floor(y / cell), ti.i32) - corner_j
        open_ = i >= 0 and j >= 0 and i < marks.shape[2] and j < marks.shape[1]
        if open_ and not apart:
            # most samples have one in the same cell before them that said all that they could say
            open_ = marks[SOURCES, j, i] != 0
            if side == STANDING and marks[STANDING_SOURCES, j, i] != 0:
                open_ = True
        w = 0
        while open_ and w < view.shape[0]:
            open_ = not keeps_out(
                view, beams[w], ranges, reach, far_side, rays, w, x, y, tolerance, cell
            )
            w += 1
        if open_:
            if apart and not covered(view, beams, scans, x, y):
                marks[BLIND_SOURCES, j, i] = ti.u8(0)
            else:
                marks[SOURCES, j, i] = ti.u8(0)
                if side == STANDING:
                    marks[STANDING_SOURCES, j, i] = ti.u8(0)


@ti.func
def lets_through(side, other):
    """What the step between two wedges lets through, at least one of which is not shut."""
    kind = OPEN
    if side == STANDING or other == STANDING:
        kind = STANDING
    if side == UNCOVERED or other == UNCOVERED:
        kind = UNCOVERED
    return kind


@kernel
def rasterise(
    # in
    view: Views,  # [V, 8]
    beams: Counts,  # [V]
    ranges: Views,  # [V, n_max]
    met: Wedges,  # [V, n_max]
    reach: Views,  # [V, n_max]
    far_side: Wedges,  # [V, n_max]
    scans: ti.i32,  # the first `scans` views are scans, the rest are discs known to be empty
    blind_apart: ti.i32,  # 1: uncovered bearings have their own bound of speed
    corner_i: ti.i32,
    corner_j: ti.i32,
    cell: ti.f32,
    tolerance: ti.f32,  # by how much two views of one surface may differ [m]
    # scratch
    rays: Rays,
    # in / out
    seen: Cells,  # [J, I] of 0; 1 where all of the cell is proven empty; multiples of BLOCK
    marks: ti.types.ndarray(dtype=ti.u8, ndim=3),  # [5, J, I] of 1; 0 marks
):
    """What the views prove empty, and where something may come out of the rest."""
    n_max = reach.shape[1]
    for task in range(view.shape[0] * n_max):
        if task % n_max < beams[task // n_max]:
            turn(view, beams, rays, task // n_max, task % n_max)

    columns = seen.shape[1] // BLOCK
    for block in range((seen.shape[0] // BLOCK) * columns):
        i0 = block % columns * BLOCK
        j0 = block // columns * BLOCK
        see_block(view, beams, reach, rays, seen, i0, j0, corner_i, corner_j, cell, BLOCK)

    for task in range(spread_over(view.shape[0] * n_max)):
        piece_of = spread(task, view.shape[0] * n_max)
        v = piece_of // n_max
        beam = piece_of % n_max
        n = 0
        if v < view.shape[0]:
            n = beams[v]
        if beam < n:
            bearing = view[v, 2] + beam * view[v, 3]
            angle = view[v, 3]
            before = beam - 1
            if beam == n - 1:
                angle = view[v, 4]
            if beam == 0:
                before = n - 1
            side = far_side[v, beam]
            other = far_side[v, before]
            near = ti.min(reach[v, beam], reach[v, before])
            far = ti.max(reach[v, beam], reach[v, before])
            if (side == SHUT) != (other == SHUT) and met[v, beam] > 0:
                # whoever stands in the shut wedge came along its face: the step goes up to it
                far = ti.max(far, ranges[v, beam])
            # the arc at the end of this wedge, and the step along this beam to the one before
            for piece in range(2):
                kind = side
                r = reach[v, beam]
                outwards = 0.0
                across = angle
                wanted = side != SHUT and r > 0.0
                if piece == 1:
                    kind = lets_through(side, other)
                    r = near
                    outwards = far - near
                    across = 0.0
                    wanted = (side != SHUT or other != SHUT) and far > near
                if wanted:
                    mark_piece(
                        view,
                        beams,
                        ranges,
                        reach,
                        far_side,
                        rays,
                        marks,
                        v,
                        scans,
                        kind,
                        r,
                        bearing,
                        outwards,
                        across,
                        blind_apart,
                        corner_i,
                        corner_j,
                        cell,
                        tolerance,
                    )
            # the surface itself
            if met[v, beam] >= MOVABLE:
                x = view[v, 0] + ranges[v, beam] * ti.cos(bearing)
                y = view[v, 1] + ranges[v, beam] * ti.sin(bearing)
                i = ti.cast(ti.floor(x / cell), ti.i32) - corner_i
                j = ti.cast(ti.floor(y / cell), ti.i32) - corner_j
                if i >= 0 and j >= 0 and i < marks.shape[2] and j < marks.shape[1]:
                    if stays(met[v, beam]):
                        marks[STATIC_CELLS, j, i] = ti.u8(0)
                    else:
                        marks[MOVABLE_CELLS, j, i] = ti.u8(0)
