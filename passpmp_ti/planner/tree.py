"""The tree of drivable, passively safe primitives (Algorithm 2)."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from passpmp_ti.grid.body import to_poses, to_states
from passpmp_ti.grid.model import TICK, FutureModel
from passpmp_ti.kernels.check import trace
from passpmp_ti.kernels.tree import (
    BRAKED,
    CHILDREN,
    CONTROL,
    FIRST,
    PARENT,
    STEPS,
    WHAT,
    grow_level,
)
from passpmp_ti.kernels.tree import TICK as TICK_COLUMN
from passpmp_ti.planner.guide import GuideField
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

ROOT = 0
NO_PARENT = -1


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Nodes as rows of flat arrays, parents before children, siblings side by side."""

    model: FutureModel
    pose: np.ndarray
    """[n, 7] float32, on the device's anchor."""
    link: np.ndarray
    """[n, 8] int32, see kernels/tree.py."""
    cost: np.ndarray
    """[n, 5] float32: the guide along the plan, at the node, and along its braking; see there."""
    start: float
    """Absolute time of the root, t_{k+1} [s]."""
    depth: int
    stopped_by: str
    """"depth", "capacity", "time" or "unsafe"."""

    @property
    def count(self) -> int:
        """Nodes, the root among them."""
        return len(self.pose)

    @property
    def states(self) -> np.ndarray:
        """[n, 5] robot states in the world."""
        return to_states(self.pose, self.model.window.anchor)

    @property
    def elapsed(self) -> np.ndarray:
        """[n] time from the root [s] (Cost_t, eq. 19)."""
        return (self.link[:, TICK_COLUMN] - self.link[ROOT, TICK_COLUMN]) * TICK

    @property
    def times(self) -> np.ndarray:
        """[n] absolute time of each node [s]."""
        return self.start + self.elapsed

    @property
    def parent(self) -> np.ndarray:
        """[n] index of each node's parent; the root has none (-1)."""
        return self.link[:, PARENT]

    @property
    def braking(self) -> np.ndarray:
        """[n] bool: the node is the rest at the end of a braking trajectory."""
        return self.link[:, WHAT] == BRAKED

    @property
    def leaves(self) -> np.ndarray:
        """[m] indices of the nodes without children."""
        return np.flatnonzero(self.link[:, CHILDREN] == 0)

    def lineage(self, node: int) -> list[int]:
        """Nodes from the root to `node` (Traj_IDs of Algorithm 1)."""
        nodes = [int(node)]
        while nodes[-1] != ROOT:
            nodes.append(int(self.link[nodes[-1], PARENT]))
        return nodes[::-1]

    def controls_to(self, node: int) -> list[tuple[np.ndarray, int]]:
        """(control, steps) of each primitive from the root to `node`."""
        body = self.model.body
        return [
            (
                (body.braking if self.link[n, WHAT] == BRAKED else body.controls)[
                    self.link[n, CONTROL]
                ],
                int(self.link[n, STEPS]),
            )
            for n in self.lineage(node)[1:]
        ]

    def primitive(self, node: int) -> np.ndarray:
        """[m, 2] world points of the primitive that leads to `node`."""
        if node == ROOT:
            return self.states[:1, :2]
        parent = int(self.link[node, PARENT])
        path = follow(self.model, self.pose[parent], self.controls_to(node)[-1:])
        return to_states(path, self.model.window.anchor)[:, :2]

    def path(self, node: int) -> np.ndarray:
        """[m, 2] world points of the plan that leads to `node`."""
        path = follow(self.model, self.pose[ROOT], self.controls_to(node))
        return to_states(path, self.model.window.anchor)[:, :2]

    @property
    def rejected(self) -> list[np.ndarray]:
        """[m, 2] world points of each primitive that was tried and is not safe."""
        body = self.model.body
        steps_at = {0: self.model.settings.levels[0]}
        found = []
        depths = np.zeros(self.count, dtype=int)
        for n in range(1, self.count):
            depths[n] = depths[self.link[n, PARENT]] + 1
        for node in range(self.count):
            first, children = self.link[node, FIRST], self.link[node, CHILDREN]
            if self.link[node, WHAT] == BRAKED or first < 0:
                continue
            kept = {
                int(self.link[c, CONTROL])
                for c in range(first, first + children)
                if self.link[c, WHAT] != BRAKED
            }
            level = int(depths[node])
            if level >= len(self.model.settings.levels):
                continue
            steps = steps_at.setdefault(level, self.model.settings.levels[level])
            for k in range(len(body.controls)):
                if k not in kept:
                    path = follow(self.model, self.pose[node], [(body.controls[k], steps)])
                    found.append(to_states(path, self.model.window.anchor)[:, :2])
        return found


def follow(model: FutureModel, pose: np.ndarray, parts: list[tuple[np.ndarray, int]]) -> np.ndarray:
    """Poses along some controls in turn, by the integrator that verified them.

    Args:
        model: whose robot moves.
        pose: [7] where it starts.
        parts: (control, steps); steps -1: until at rest.

    Returns:
        [m, 7] float32, the start first.
    """
    settings = model.settings
    longest = settings.steps_of(model.robot.longest_braking) + 4
    rows = 1 + sum(steps if steps >= 0 else longest for _, steps in parts)
    path = np.empty((rows, 7), dtype=np.float32)
    length = np.zeros(1, dtype=np.int32)
    controls = np.array([c for c, _ in parts], dtype=np.float32).reshape(-1, 3)
    steps = np.array([s for _, s in parts], dtype=np.int32)
    if not parts:
        return pose[None].copy()
    trace(model.body.kind, model.body.numbers, pose[None].copy(), controls, steps, path, length)
    return path[: length[0]]


class TreeGrower:
    """Owns the arrays that trees are grown in; they live as long as the planner."""

    def __init__(self, robot: Robot, settings: Settings) -> None:
        self._settings = settings
        capacity, fan = settings.capacity, len(robot.controls)
        # the last level that can still be grown has at most capacity / 2 parents of fan children
        most = capacity * fan
        self._pose = np.zeros((capacity, 7), dtype=np.float32)
        self._link = np.zeros((capacity, 8), dtype=np.int32)
        self._cost = np.zeros((capacity, 5), dtype=np.float32)
        self._child_pose = np.zeros((most, 7), dtype=np.float32)
        self._child_proof = np.zeros(most, dtype=np.int32)
        self._child_cost = np.zeros((most, 2), dtype=np.float32)

    def grow(
        self, model: FutureModel, guide: GuideField, root: np.ndarray, start: float, proof: int
    ) -> Tree:
        """Grow a tree from `root`, level by level, until depth, capacity or time ends it.

        Args:
            model: W(t_k).
            guide: cost to go.
            root: [5] state s_{k+1}.
            start: t_{k+1}, absolute [s].
            proof: index of a braking control that proves the root; -1: none known.
        """
        settings, body = self._settings, model.body
        began = time.perf_counter()
        self._pose[0] = to_poses(root[None], model.window.anchor)[0]
        self._link[0] = (NO_PARENT, 0, 0, model.ticks_of(start), proof, -1, 0, 0)
        here = guide.at(root[None])[0]
        self._cost[0] = (0.0, here, 0.0, here, 0.0)
        counts = model.counts
        grown = np.zeros(2, dtype=np.int32)
        first, last, depth, stopped_by = 0, 1, 0, "depth"
        for steps in settings.levels:
            budget = settings.exploration_time
            if budget is not None and time.perf_counter() - began > budget:
                stopped_by = "time"
                break
            grow_level(
                body.kind, model.ticks, guide.time, guide.ahead, guide.frame, body.numbers, counts,
                body.braking, body.controls, first, last, steps, self._pose, self._link,
                self._cost, self._child_pose, self._child_proof, self._child_cost, grown,
            )  # fmt: skip
            first, last = last, int(grown[0])
            if last == first:
                stopped_by = "capacity" if grown[1] else "unsafe"
                break
            depth += 1
            if grown[1]:
                stopped_by = "capacity"
                break
        return Tree(
            model,
            self._pose[:last].copy(),
            self._link[:last].copy(),
            self._cost[:last].copy(),
            start,
            depth,
            stopped_by,
        )
