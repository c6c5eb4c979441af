"""From ranges to what each wedge between two beams proves empty.

A wedge lies between a beam and the next one that is not lost. Objects are no narrower than
`width` and their corners no sharper than a right angle. So nothing can stand inside a wedge,
before the nearer of its two returns, unless

- the wedge is wider there than the object: proof ends where the wedge's chord is `width`;
- it sticks out towards the sensor between the beams: by at most half the chord.

A wedge whose far side is one surface that stays (both returns static and no farther apart than
the narrowest object, or the map knows the wall between them) lets nothing through. All others do.
Neither does one whose returns are of movers that are tracked: behind them is their own body, which
is asked about by itself (grid/tubes.py, grid/chances.py).
Somebody who leans on a mapped wall may have one return that is taken for it. Another beam would
meet him farther from the wall, unless the wedge is nearly as wide as he is: such a wedge the map
does not shut.

A view is a polar region: views of scans, and discs that are known to be empty (the robot's own
body, a declared clearing). Rows of `view` (f32): 0 x, 1 y, 2 bearing of beam 0 in the world,
3 increment, 4 bearing of the closing wedge (from the last beam round to the first), 5 range.
"""

import taichi as ti

from passpmp_ti.kernels.launch import kernel

LOST, NOTHING, MOVABLE, TRACKED, STATIC, STATIC_BY_MAP = -1, 0, 1, 2, 3, 4
"""What a beam met."""
DOUBTED = -4
"""On its way from STATIC_BY_MAP to MOVABLE: it makes no other return doubted in turn."""

SHUT, OPEN, STANDING, UNCOVERED = 0, 1, 2, 3
"""What a wedge's far side lets through: nothing, anything, anything from behind a standing thing,
and what comes out of bearings that the sensor never covers."""

SLACK = 1e-3
"""[m] f32 rounding must never free a cell; enough within 1 km of the model's anchor."""

Floats = ti.types.ndarray(dtype=ti.f32, ndim=1)
Ints = ti.types.ndarray(dtype=ti.i32, ndim=1)
Bytes2 = ti.types.ndarray(dtype=ti.u8, ndim=2)


@ti.func
def mapped(map_static: ti.template(), frame: ti.template(), x, y):
    """Whether the static map holds a surface within its tolerance of (x, y).

    frame: 0 origin x, 1 origin y, 2 cos yaw, 3 sin yaw, 4 cells a metre, 5: 1 if there is a map.
    """
    result = False
    if frame[5] > 0.5:
        dx = x - frame[0]
        dy = y - frame[1]
        i = ti.cast(ti.floor((dx * frame[2] + dy * frame[3]) * frame[4]), ti.i32)
        j = ti.cast(ti.floor((-dx * frame[3] + dy * frame[2]) * frame[4]), ti.i32)
        if i >= 0 and j >= 0 and i < map_static.shape[1] and j < map_static.shape[0]:
            result = map_static[j, i] != 0
    return result


@ti.func
def stays(label):
    """Whether what a beam met is known to stay."""
    return label >= STATIC


@ti.func
def end_x(view: ti.template(), v, beam, r):
    return view[v, 0] + r * ti.cos(view[v, 2] + beam * view[v, 3])


@ti.func
def end_y(view: ti.template(), v, beam, r):
    return view[v, 1] + r * ti.sin(view[v, 2] + beam * view[v, 3])


@ti.func
def met_at(met: ti.template(), n, closed, beam):
    """What a beam met, counted round where the beams go all the way; beyond the field: nothing."""
    label = NOTHING
    if closed == 1:
        label = met[(beam % n + n) % n]
    elif beam >= 0 and beam < n:
        label = met[beam]
    return label


@kernel
def label_by_map(
    # in
    ranges: Floats,  # [n]
    view: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [V, 8]
    v: ti.i32,
    closed: ti.i32,  # 1: the beams go all the way round
    width: ti.f32,
    map_static: Bytes2,
    frame: Floats,  # [6]
    # in / out
    met: Ints,  # [n]
):
    n = ranges.shape[0]
    for beam in range(n):
        if met[beam] == MOVABLE and mapped(
            map_static,
            frame,
            end_x(view, v, beam, ranges[beam]),
            end_y(view, v, beam, ranges[beam]),
        ):
            met[beam] = STATIC_BY_MAP
    # Somebody who leans on a wall has returns within the map's tolerance of it: a return that is
    # near one which cannot be the wall is not taken for the wall either.
    for beam in range(n):
        if met[beam] == STATIC_BY_MAP:
            x = end_x(view, v, beam, ranges[beam])
            y = end_y(view, v, beam, ranges[beam])
            span = ti.cast(width / (ti.max(ranges[beam], 0.1) * view[v, 3]), ti.i32) + 1
            span = ti.min(span, n // 2)
            for k in range(-span, span + 1):
                other = beam + k
                if closed == 1:
                    other = (other + n) % n
                if other >= 0 and other < n:
                    if met[other] == MOVABLE:
                        dx = end_x(view, v, other, ranges[other]) - x
                        dy = end_y(view, v, other, ranges[other]) - y
                        if dx * dx + dy * dy < width * width:
                            met[beam] = DOUBTED
            # The rest of him may be where no beam tells: the wall is taken for wall only between
            # returns that are it too.
            for way in ti.static(range(2)):
                other = beam + 2 * way - 1
                passed = 0
                while passed < n and met_at(met, n, closed, other) == LOST:
                    other += 2 * way - 1
                    passed += 1
                beside = met_at(met, n, closed, other)
                if LOST <= beside <= MOVABLE:
                    met[beam] = DOUBTED
    for beam in range(n):
        if met[beam] == DOUBTED:
            met[beam] = MOVABLE


@kernel
def prove_wedges(
    # in
    ranges: Floats,  # [n]
    met: Ints,  # [n]
    owner: Ints,  # [n] which mover a TRACKED return belongs to
    view: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [V, 8]
    v: ti.i32,
    closed: ti.i32,  # 1: the beams go all the way round
    width: ti.f32,
    by_map_width: ti.f32,  # of the widest wedge that what the map alone calls static may shut
    noise: ti.f32,
    map_static: Bytes2,
    frame: Floats,  # [6]
    # out
    reach: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [V, n_max] proven empty up to here [m]
    far_side: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [V, n_max]
):
    n = ranges.shape[0]
    for beam in range(n):
        low = beam
        high = beam + 1
        angle = view[v, 3]
        if beam == n - 1:
            angle = view[v, 4]
        while low > -n and met[(low + n) % n] == LOST and (low > 0 or closed == 1):
            low -= 1
            if low == -1:
                angle += view[v, 4]
            else:
                angle += view[v, 3]
        while high < 2 * n and met[high % n] == LOST and (high < n - 1 or closed == 1):
            if high == n - 1:
                angle += view[v, 4]
            else:
                angle += view[v, 3]
            high += 1
        a = (low + n) % n
        b = high % n
        proven = 0.0
        side = OPEN
        if beam == n - 1 and closed == 0:
            side = UNCOVERED
        elif met[a] != LOST and met[b] != LOST and angle < 1.5:
            far = ti.min(ranges[a], ranges[b])
            limit = far
            if far * angle > width:
                limit = width / angle
            # the chord lies at limit cos(angle / 2), and a corner sticks out of it by half of it:
            # cos x - sin x > 1 - x - x^2 / 2. Noise: each range may be this much too long.
            half = 0.5 * angle
            proven = ti.max(limit * (1.0 - half - 0.5 * half * half) - noise - SLACK, 0.0)
            by_map = met[a] == STATIC_BY_MAP or met[b] == STATIC_BY_MAP
            narrow = not by_map or ti.max(ranges[a], ranges[b]) * angle <= by_map_width
            # between two movers somebody may come out as soon as they part
            both_tracked = met[a] == TRACKED and met[b] == TRACKED and owner[a] == owner[b]
            both_stay = stays(met[a]) and stays(met[b]) and narrow
            if (both_stay or both_tracked) and limit == far:
                xa = end_x(view, v, a, ranges[a])
                ya = end_y(view, v, a, ranges[a])
                dx = end_x(view, v, b, ranges[b]) - xa
                dy = end_y(view, v, b, ranges[b]) - ya
                gap = ti.sqrt(dx * dx + dy * dy)
                # the true gap may be wider than it looks by both ranges' noise
                if gap + 2.0 * noise <= width:
                    side = SHUT
                elif both_stay and frame[5] > 0.5:
                    # a wall at a grazing angle: the map must know it all the way, asked more
                    # densely than the narrowest door is wide on the map
                    side = SHUT
                    pieces = ti.cast(2.0 * gap * frame[4], ti.i32) + 1
                    for k in range(pieces):
                        share = (k + 0.5) / pieces
                        if not mapped(map_static, frame, xa + share * dx, ya + share * dy):
                            side = OPEN
            if side == OPEN:
                near = a
                if ranges[b] < ranges[a]:
                    near = b
                if stays(met[near]) and ti.abs(ranges[a] - ranges[b]) > width:
                    side = STANDING
        reach[v, beam] = proven
        far_side[v, beam] = side
