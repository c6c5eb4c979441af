"""The eikonal equation solved by one thread that sweeps to and fro; see kernels/eikonal.py."""

import taichi as ti

from passpmp_ti.kernels.eikonal import Field, Whole, fallen
from passpmp_ti.kernels.launch import kernel


@ti.func
def include(span: ti.template(), j, first, last):
    """Let the columns from `first` to `last` of row j be looked at again."""
    if j >= 0 and j < span.shape[0] and first <= last:
        span[j, 0] = ti.min(span[j, 0], ti.max(first, 0))
        span[j, 1] = ti.max(span[j, 1], last)


@ti.func
def sweep_row(
    slowness: ti.template(), time: ti.template(), span: ti.template(), j, first, last, step
):
    """Look at a row's cells from `first` to `last`, from the left for step 1, from the right for
    -1, and on as long as times fall; whether one did."""
    rows, columns = time.shape[0], time.shape[1]
    # at the border a cell stands for its own neighbour, which tells it nothing
    below = ti.max(j - 1, 0)
    above = ti.min(j + 1, rows - 1)
    i = first
    if step < 0:
        i = last
    left = last - first + 1
    behind = time[j, ti.min(ti.max(i - step, 0), columns - 1)]
    # what has to be looked at again of this row, the one below and the one above
    least = ti.Vector([columns, columns, columns])
    most = ti.Vector([-1, -1, -1])
    fell = False
    while left > 0:
        ahead = time[j, ti.min(ti.max(i + step, 0), columns - 1)]
        under = time[below, i]
        over = time[above, i]
        old = time[j, i]
        new = fallen(old, ti.min(behind, ahead), ti.min(under, over), slowness[j, i])
        left -= 1
        if new < old:
            fell = True
            time[j, i] = new
            # only what is later can hear of it; what lies ahead comes next
            if behind > new:
                least[0] = ti.min(least[0], i - step)
                most[0] = ti.max(most[0], i - step)
            if under > new:
                least[1] = ti.min(least[1], i)
                most[1] = ti.max(most[1], i)
            if over > new:
                least[2] = ti.min(least[2], i)
                most[2] = ti.max(most[2], i)
            if left == 0 and i + step >= 0 and i + step < columns:
                left = 1
        behind = new
        i += step
    include(span, j, least[0], most[0])
    include(span, below, least[1], most[1])
    include(span, above, least[2], most[2])
    return fell


@kernel
def sweep(
    # in
    slowness: Field,  # [J, I]
    goal_j: ti.i32,
    goal_i: ti.i32,
    most_sweeps: ti.i32,
    # in / out
    time: Field,  # [J, I] as `lay_out` leaves it
    span: Whole,  # [J, 2] scratch: first and last column of each row that has to be looked at
) -> ti.i32:
    """Sweep up and down, each row both ways, until nothing changes; returns the sweeps it took.

    A row is looked at only from the first to the last cell with a neighbour that changed since.
    """
    rows, columns = time.shape[0], time.shape[1]
    sweeps = 0
    ti.loop_config(serialize=True)
    for _ in range(1):
        for j in range(rows):
            span[j, 0] = columns
            span[j, 1] = -1
        include(span, goal_j, goal_i - 1, goal_i + 1)
        include(span, goal_j - 1, goal_i, goal_i)
        include(span, goal_j + 1, goal_i, goal_i)
        busy = True
        while busy and sweeps < most_sweeps:
            busy = False
            for jj in range(rows):
                j = jj
                if sweeps % 2 == 1:
                    j = rows - 1 - jj
                for way in range(2):
                    first = span[j, 0]
                    last = ti.min(span[j, 1], columns - 1)
                    start = first
                    # at first times grow away from the goal's column, as a rule
                    if sweeps < 2 and way == 0:
                        start = ti.max(first, goal_i)
                    if start <= last:
                        span[j, 0] = columns
                        span[j, 1] = -1
                        include(span, j, first, start - 1)
                        if sweep_row(slowness, time, span, j, start, last, 1 - 2 * way):
                            busy = True
            sweeps += 1
    return sweeps
