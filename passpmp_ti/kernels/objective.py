"""What the plan to a leaf costs: eqs. 5, 8, 18 and 19, one leaf at a time or all of them."""

import taichi as ti

from passpmp_ti.kernels.launch import kernel
from passpmp_ti.kernels.tree import CHILDREN, TICK, Links

WEIGHT_DISTANCE, WEIGHT_TIME, SPAN, FINAL, TICK_LENGTH = range(5)
"""What `plan_cost` is told: w_d, w_t, the time over which plans are compared [s], 1 where the last
state alone is judged (eq. 18), a tick [s]."""
BLOCK = 64  # nodes that one thread of `cheapest` looks through

Numbers = ti.types.ndarray(dtype=ti.f32, ndim=1)
Counts = ti.types.ndarray(dtype=ti.i32, ndim=1)
Costs = ti.types.ndarray(dtype=ti.f32, ndim=2)


@ti.func
def plan_cost(leaf, link: ti.template(), cost: ti.template(), numbers: ti.template()):
    """f of eq. 5 for the plan that ends at `leaf`.

    Nodes that are not safe enough are not in the tree: w_ps is finite for every plan of it.
    """
    elapsed = ti.cast(link[leaf, TICK] - link[0, TICK], ti.f32) * numbers[TICK_LENGTH]
    distance = cost[leaf, 1]
    if numbers[FINAL] == 0.0:
        # what is held is the plan and its braking, and rest after it: judged over one time for all
        span = numbers[SPAN]
        rest = ti.max(span - elapsed - cost[leaf, 4], 0.0)
        distance = (cost[leaf, 0] + cost[leaf, 2] + rest * cost[leaf, 3]) / span
        elapsed = span
    spent = numbers[WEIGHT_DISTANCE] * distance + numbers[WEIGHT_TIME] * elapsed
    return cost[leaf, 5] * spent


@kernel
def every_cost(
    # in
    count: ti.i32,
    link: Links,
    cost: Costs,
    numbers: Numbers,
    # out
    f: Numbers,  # [>= count]
):
    """What the plan to each leaf costs; infinitely much where no plan ends."""
    for n in range(count):
        f[n] = ti.math.inf
        if link[n, CHILDREN] == 0:
            f[n] = plan_cost(n, link, cost, numbers)


@kernel
def cheapest(
    # in
    count: ti.i32,  # nodes in the tree
    link: Links,  # [>= count, 8]
    cost: Costs,  # [>= count, 6]
    numbers: Numbers,  # [5]
    # out
    block_leaf: Counts,  # [ceil(count / BLOCK)]
    block_cost: Numbers,  # [ceil(count / BLOCK)]
):
    """The cheapest leaf of each block of nodes, the first of equals; the root where there is none.

    A block is one thread's, and blocks are in order: the first of the cheapest blocks holds the
    first of the cheapest leaves, whatever the threads do.
    """
    for b in range((count + BLOCK - 1) // BLOCK):
        least = ti.math.inf
        found = 0
        for n in range(b * BLOCK, ti.min((b + 1) * BLOCK, count)):
            if link[n, CHILDREN] == 0:
                f = plan_cost(n, link, cost, numbers)
                if f < least:
                    least = f
                    found = n
        block_leaf[b] = found
        block_cost[b] = least
