"""The primitives of a tree as lines, all of them traced in a few launches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.grid.body import to_states
from passpmp_ti.kernels.check import trace
from passpmp_ti.kernels.tree import BRAKED, CONTROL, FIRST, PARENT, STEPS, WHAT
from passpmp_ti.planner.tree import ROOT, Tree

SMOOTH = 0.1
"""Time between the points of a line, at most about [s]."""
LEAST_POINTS, MOST_POINTS = 9, 33


@dataclass(frozen=True, slots=True, eq=False)
class Branches:
    """Lines [n, points, 2] through the world [m]."""

    nodes: np.ndarray
    """[n] node that each of `safe` leads to."""
    safe: np.ndarray
    """P-safe primitives."""
    braking: np.ndarray
    """Braking trajectories, where no primitive was p-safe."""
    rejected: np.ndarray
    """Primitives that were tried and are not p-safe."""

    def through(self, tree: Tree, leaves: tuple[int, ...]) -> np.ndarray:
        """[m, points, 2] the p-safe primitives on the way from the root to any of `leaves`."""
        tree = tree.on_host()
        on_the_way = np.zeros(tree.count, dtype=bool)
        for leaf in leaves:
            node = int(leaf)
            while node != ROOT and not on_the_way[node]:
                on_the_way[node] = True
                node = int(tree.link[node, PARENT])
        return self.safe[on_the_way[self.nodes]]


def branches_of(tree: Tree) -> Branches:
    """Trace every primitive of a tree, kept or rejected."""
    tree = tree.on_host()
    body, link = tree.model.body, tree.link
    braked = link[:, WHAT] == BRAKED
    grown = np.flatnonzero(~braked & (link[:, PARENT] >= 0))
    ended = np.flatnonzero(braked)
    parents, controls, steps = _rejected(tree)
    return Branches(
        grown,
        _lines(tree, link[grown, PARENT], body.controls[link[grown, CONTROL]], link[grown, STEPS]),
        _lines(tree, link[ended, PARENT], body.braking[link[ended, CONTROL]], link[ended, STEPS]),
        _lines(tree, parents, body.controls[controls], steps),
    )


def _rejected(tree: Tree) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(parents, controls, steps) of the primitives that were tried and not kept."""
    link, settings = tree.link, tree.model.settings
    levels = np.array(settings.levels)
    depth = np.zeros(tree.count, dtype=int)
    for _ in levels:
        depth[1:] = depth[link[1:, PARENT]] + 1
    braked = link[:, WHAT] == BRAKED
    # a node whose children were never written has no first child
    tried = ~braked & (link[:, FIRST] >= 0) & (depth < len(levels))
    kept = np.zeros((tree.count, len(tree.model.robot.controls)), dtype=bool)
    grown = np.flatnonzero(~braked & (link[:, PARENT] >= 0))
    kept[link[grown, PARENT], link[grown, CONTROL]] = True
    parents, controls = np.nonzero(tried[:, None] & ~kept)
    return parents, controls, levels[depth[parents]]


def _lines(tree: Tree, parents: np.ndarray, controls: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """[n, points, 2] the motions from `parents` under `controls` [n, 3] for `steps` [n]."""
    model, count = tree.model, len(parents)
    longest_primitive = max((model.settings.cycle, *model.settings.primitives))
    points = int(np.clip(longest_primitive / SMOOTH, LEAST_POINTS, MOST_POINTS))
    if not count:
        return np.zeros((0, points, 2))
    longest = model.settings.steps_of(model.robot.longest_braking) + 4
    rows = 1 + (longest if (steps < 0).any() else int(steps.max()))
    path = np.empty((count * rows, 7), dtype=np.float32)
    length = np.zeros(count, dtype=np.int32)
    trace(
        model.there.kind, model.there.numbers, np.ascontiguousarray(tree.pose[parents]),
        np.ascontiguousarray(controls, dtype=np.float32), steps.astype(np.int32), path, length,
    )  # fmt: skip
    share = np.linspace(0.0, 1.0, points)
    picked = np.round(share * (length[:, None] - 1)).astype(int) + rows * np.arange(count)[:, None]
    return to_states(path[picked.ravel()], model.window.anchor)[:, :2].reshape(count, points, 2)
