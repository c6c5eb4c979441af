"""What a plan is worth by the size of its tree, and what else could have filled the tree."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from passpmp_ti import device
from passpmp_ti.bench.situations import Situation
from passpmp_ti.kernels.tree import CHILDREN, PARENT, TICK
from passpmp_ti.planner.objective import objective_numbers
from passpmp_ti.planner.swarm import Branches, Swarm, best_leaf, leaf_costs
from passpmp_ti.planner.tree import TreeGrower
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

RULES = ("order", "spread", "cheapest")
"""Which parents get children first where not all can: `order`: those of lower index; `spread`:
evenly over the level; `cheapest`: those whose own plan costs least."""


def by_size(
    situation: Situation, settings: Settings, sizes: Sequence[int], searches: int, seed: int = 0
) -> list[dict[str, Any]]:
    """Grow trees of growing capacity from one situation, and choose from each.

    Args:
        situation: where.
        settings: of tree, objective and swarm, but for the capacity.
        sizes: capacities in growing order; once a tree has room left, larger ones are the same.
        searches: of the swarm in each tree, each with its own random numbers.
        seed: of those.

    Returns:
        One row a size, ready for JSON: `best`: cost of the exhaustive optimum [s], `swarm`: costs
        that the searches found [s], `median_leaf` [s], `nodes`, `leaves`, `depth`, seconds of
        `tree`, `scan` (of all leaves) and `search`, and `whole`: nothing was left to grow.
    """
    rows: list[dict[str, Any]] = []
    for size in sizes:
        if rows and rows[-1]["whole"]:
            rows.append({**rows[-1], "capacity": size})
            continue
        sized = settings.changed(capacity=size)
        grower, swarm = TreeGrower(situation.robot, sized), Swarm(situation.robot, sized)
        began = time.perf_counter()
        tree = situation.grow(grower)
        grown = time.perf_counter()
        _, best = best_leaf(tree, situation.robot, sized)
        scanned = time.perf_counter()
        found = [
            swarm.choose(tree, np.random.default_rng([seed, k]))[2] if tree.count > 1 else best
            for k in range(searches)
        ]
        searched = time.perf_counter()
        costs = leaf_costs(tree, situation.robot, sized)
        costs = costs[np.isfinite(costs)]
        rows.append(
            {
                "capacity": size, "nodes": tree.count, "leaves": len(costs), "depth": tree.depth,
                "whole": tree.stopped_by != "capacity", "best": best, "swarm": found,
                "median_leaf": float(np.median(costs)), "tree": grown - began,
                "scan": scanned - grown, "search": (searched - scanned) / max(searches, 1),
            }
        )  # fmt: skip
    return rows


def filled_by(
    tree: Branches, robot: Robot, settings: Settings, sizes: Sequence[int], rule: str
) -> list[float]:
    """What the best plan would cost [s] had a smaller tree been filled by some rule.

    Levels are whole as long as they fit; in the last one parents get all their children, or none,
    in the order of the rule (one of `RULES`). With `order` it is what `TreeGrower` makes.

    Args:
        tree: whole, or so large that no level is cut that follows one of `sizes`: with at most n
            children a node, n + 1 times the size is enough.
        robot: whose tree it is.
        settings: of the objective.
        sizes: capacities.
        rule: one of `RULES`.
    """
    link, cost = (device.host(a)[: tree.count] for a in (tree.link, tree.cost))
    costs = costs_as_leaves(link, cost, objective_numbers(settings, robot))
    edges = level_edges(link)
    found = []
    for size in sizes:
        level = max(k for k in range(len(edges) - 1) if k == 0 or edges[k + 1] <= size)
        begin, end = edges[level : level + 2]
        extended = link[:, CHILDREN] > 0
        if end < tree.count:
            parents = begin + np.flatnonzero(extended[begin:end])
            parents = parents[_turns(costs[parents], rule)]
            taken = np.cumsum(link[parents, CHILDREN])
            # from the first parent that does not fit, none does
            extended[parents[taken > size - end]] = False
            extended[end:] = False
        inside = np.zeros(tree.count, dtype=bool)
        inside[:end] = True
        if end < tree.count:
            inside[end : edges[level + 2]] = extended[link[end : edges[level + 2], PARENT]]
        found.append(float(costs[inside & ~extended].min()))
    return found


def costs_as_leaves(link: np.ndarray, cost: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """[n] what the plan to each node costs, if it ended there: kernels/objective.py in NumPy.

    Only for a cost averaged along the plan.
    """
    w_d, w_t, span, final, tick = (float(n) for n in numbers)
    if final:
        raise ValueError('costs_as_leaves needs distance="mean"')
    elapsed = (link[:, TICK] - link[0, TICK]) * tick
    rest = np.maximum(span - elapsed - cost[:, 4], 0.0)
    return w_d * (cost[:, 0] + cost[:, 2] + rest * cost[:, 3]) / span + w_t * span


def level_edges(link: np.ndarray) -> list[int]:
    """Where the levels of a tree begin, and where the last one ends: [0, 1, ..., nodes]."""
    edges = [0, 1]
    while edges[-1] < len(link):
        # children lie behind their parents, in order
        begin, end = edges[-2:]
        edges.append(end + int(link[begin:end, CHILDREN].sum()))
    return edges


def _turns(costs: np.ndarray, rule: str) -> np.ndarray:
    """[n] the order in which parents of some costs [n] are served."""
    index = np.arange(len(costs))
    if rule == "order":
        return index
    if rule == "cheapest":
        return np.argsort(costs, kind="stable")
    if rule == "spread":
        # bits of the index backwards: any beginning of it lies evenly over the level
        bits = max(len(index) - 1, 1).bit_length()
        back = np.zeros_like(index)
        for bit in range(bits):
            back |= (index >> bit & 1) << (bits - 1 - bit)
        return np.argsort(back, kind="stable")
    raise ValueError(f"rule must be one of {', '.join(RULES)}; got {rule!r}")
