"""The tree of drivable, passively safe primitives (Algorithm 2)."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.body import to_poses, to_states
from passpmp_ti.grid.model import TICK, FutureModel
from passpmp_ti.kernels.check import trace
from passpmp_ti.kernels.tree import (
    BOTH,
    BRAKED,
    CHECK,
    CHILDREN,
    CONTROL,
    FIRST,
    PARENT,
    PLACE,
    STEPS,
    WHAT,
    grow_level,
    plant,
    trail,
)
from passpmp_ti.kernels.tree import TICK as TICK_COLUMN
from passpmp_ti.kernels.weighing import begin_risk, multiply_weights, weigh_children
from passpmp_ti.planner.guide import GuideField
from passpmp_ti.planner.roads import Roads
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings

ROOT = 0
NO_PARENT = -1


CHUNK = 1 << 16
"""Most children that are checked in one launch: what is kept of them fits the processor's cache."""
GRAIN, ROADS_GRAIN, BLOCKS = 16, device.SHARE, 16
"""Children that a thread of a CPU checks in one go, the same along roads, and blocks of parents
that are given their slots side by side."""
LEAST = 64
"""Parents of a chunk that is no larger than what room is left for: a launch costs as much."""
DEVICE_CHUNK, DEVICE_BLOCKS, DEVICE_LEAST = 1 << 20, 1024, 1 << 14
"""The same on a device, where each thread checks one child."""
LONGEST = 0.004
"""[s] that a chunk may take where there is a deadline: the clock is looked at between chunks."""
FILLED = 0.5
"""Share of the memory that a tree may fill: the rest is for the model, the swarm and others."""
STILL = 1e-5
"""Places that are no farther apart are one [m]."""
DEEPEST = 64
"""Levels that a plan is read back from."""


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Nodes as rows of flat arrays, parents before children, siblings side by side.

    The arrays lie where the kernels run. On a device they have room for more nodes than there are,
    and NumPy reads them by `on_host`.
    """

    model: FutureModel
    pose: device.Array
    """[n, 7] float32, on the device's anchor."""
    link: device.Array
    """[n, 8] int32, see kernels/tree.py."""
    cost: device.Array
    """[n, 6] float32: the guide along the plan, at the node, and along its braking; see there."""
    root: np.ndarray
    """[7] float32 pose of the root."""
    count: int
    """Nodes, the root among them."""
    start: float
    """Absolute time of the root, t_{k+1} [s]."""
    depth: int
    stopped_by: str
    """"depth", "capacity", "time" or "unsafe"."""

    def on_host(self) -> Tree:
        """The same tree in NumPy's arrays; on the CPU it is one."""
        if isinstance(self.link, np.ndarray):
            return self
        pose, link, cost = (
            device.host(a)[: self.count] for a in (self.pose, self.link, self.cost)
        )
        return replace(self, pose=pose, link=link, cost=cost)

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

    def trail(self, node: int) -> np.ndarray:
        """[m, 9] int32: the nodes from the root to `node`, each with its row of `link`."""
        rows = device.empty((DEEPEST, 9), np.int32)
        count = trail(self.link, int(node), rows)
        return device.host(rows)[:count][::-1]

    def lineage(self, node: int) -> list[int]:
        """Nodes from the root to `node` (Traj_IDs of Algorithm 1)."""
        return [int(n) for n in self.trail(node)[:, 0]]

    def controls_to(self, node: int) -> list[tuple[np.ndarray, int]]:
        """(control, steps) of each primitive from the root to `node`."""
        body = self.model.body
        return [
            (
                (body.braking if row[1 + WHAT] == BRAKED else body.controls)[row[1 + CONTROL]],
                int(row[1 + STEPS]),
            )
            for row in self.trail(node)[1:]
        ]

    def primitive(self, node: int) -> np.ndarray:
        """[m, 2] world points of the primitive that leads to `node`."""
        if node == ROOT:
            return self.states[:1, :2]
        parent = int(self.link[node, PARENT])
        path = follow(self.model, self.pose[parent], self.controls_to(node)[-1:])
        return to_states(path, self.model.window.anchor)[:, :2]

    @property
    def stays(self) -> bool:
        """Whether every motion that was kept ends where the root is."""
        places = device.host(self.pose)[: self.count, :2]
        return bool(np.abs(places - self.root[:2]).max() < STILL)

    def path(self, node: int) -> np.ndarray:
        """[m, 2] world points of the plan that leads to `node`."""
        path = follow(self.model, self.root, self.controls_to(node))
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
    trace(model.there.kind, model.there.numbers, pose[None].copy(), controls, steps, path, length)
    return path[: length[0]]


def tree_bytes(capacity: int) -> int:
    """What a tree of `capacity` nodes takes, and the gaits of its nodes [bytes]."""
    return capacity * 4 * (7 + 8 + 6 + 1)


class TreeGrower:
    """Grows trees; owns what is kept of children between their check and their place in a tree.

    Args:
        robot: that drives.
        settings: levels and capacity.
        worth: nodes of a level for each gait from which on it is grown along roads; None: as
            measured (planner/roads.py).

    Raises:
        ValueError: a tree of `Settings.capacity` does not fit the memory where it would be grown.
    """

    def __init__(self, robot: Robot, settings: Settings, *, worth: float | None = None) -> None:
        self._settings = settings
        fan = len(robot.controls)
        room, wanted = device.memory(), tree_bytes(settings.capacity)
        if wanted > FILLED * room:
            raise ValueError(
                f"Settings.capacity = {settings.capacity} nodes take {wanted / 2**30:.1f} GiB, and"
                f" {FILLED:.0%} of the {room / 2**30:.1f} GiB of memory may be filled; at most"
                f" {int(FILLED * room / tree_bytes(1))} nodes fit"
            )
        # never less than one parent's, nor more than the largest level could need
        resident = device.resident()
        self._chunk = max(1, min(settings.capacity, (DEVICE_CHUNK if resident else CHUNK) // fan))
        self._blocks = DEVICE_BLOCKS if resident else BLOCKS
        self._least = DEVICE_LEAST if resident else LEAST
        self._grains = (1, 1) if resident else (GRAIN, ROADS_GRAIN)
        self._weighed = settings.mode == "probabilistic" and settings.risk == "any"
        self._risk = device.empty((settings.capacity if self._weighed else 1, 2), np.float32)
        self._child = device.empty((self._chunk * fan, 12), np.float32)
        self._child_proof = device.empty((self._chunk * fan,), np.int32)
        self._block = device.empty((self._blocks + 1,), np.int32)
        self._grown = device.empty((2,), np.int32)
        self._roads = Roads(robot, settings.capacity, worth)

    def grow(
        self, model: FutureModel, guide: GuideField, root: np.ndarray, start: float, proof: int,
        *, until: float | None = None, weight: float = 1.0,
    ) -> Tree:
        """Grow a tree from `root`, level by level, until depth, capacity or time ends it.

        Args:
            model: W(t_k).
            guide: cost to go.
            root: [5] state s_{k+1}.
            start: t_{k+1}, absolute [s].
            proof: index of a braking control that proves the root; -1: none known.
            weight: w_ps of that braking (eqs. 8 and 9).
            until: on `time.perf_counter`'s clock [s]; no chunk of parents is begun that would
                probably end later. None: no deadline.
        """
        settings, body = self._settings, model.there
        began = time.perf_counter()
        if settings.exploration_time is not None:
            budget = began + settings.exploration_time
            until = budget if until is None else min(until, budget)
        here = guide.at(root[None])[0]
        root_pose = to_poses(root[None], model.window.anchor)[0]
        arrays = planted(
            settings.capacity,
            root_pose,
            np.array([NO_PARENT, 0, 0, model.ticks_of(start), proof, -1, 0, 0], dtype=np.int32),
            np.array([0.0, here, 0.0, here, 0.0, weight], dtype=np.float32),
        )
        fixed = (
            model.ticks, model.spans, guide.time, guide.ahead, guide.frame, body.numbers,
            model.counts, body.braking, body.controls,
        )  # fmt: skip
        weights: tuple[device.Array, ...] = ()
        if self._weighed:
            assert model.chances is not None
            weights = model.hidden_ticks, model.hidden_spans, *model.chances.hazard
            begin_risk(
                body.kind, body.numbers, model.counts, *model.chances.hazard,
                device.put(root_pose[None]), int(model.ticks_of(start)), self._risk,
            )  # fmt: skip
        roads = self._roads
        roads.clear()
        level_begin, count, depth, stopped_by = ROOT, 1, 0, "depth"
        pace, fan = 0.0, float(len(model.body.controls))
        for steps in settings.levels:
            first, level_end, short = level_begin, count, 0
            # by the whole level before, however its chunks were: the choice is part of the tree
            likely = _parents_for(settings.capacity - count, fan)
            by_roads = not self._weighed and roads.lay(
                model, arrays[0], first, level_end, steps, likely
            )
            while first < level_end and not short:
                now = time.perf_counter()
                # what will find no room need not be checked
                wanted = max(self._least, _parents_for(settings.capacity - count, fan))
                parents = min(self._chunk, level_end - first, wanted)
                if until is not None:
                    parents = _in_time(parents, until - now, pace)
                    if not parents:
                        stopped_by = "time"
                        break
                before = count
                chunk = (
                    *fixed, first, first + parents, count, steps, roads.number, roads.links,
                    roads.rows, *arrays, roads.gait, self._risk, self._child, self._child_proof,
                    self._block, self._grown,
                )  # fmt: skip
                how = body.kind, by_roads, device.share(), self._grains[by_roads]
                if self._weighed:
                    grow_level(*how, CHECK, *chunk)
                    weigh_children(
                        body.kind, device.share(), model.ticks, model.spans, body.numbers,
                        model.counts, body.braking, body.controls, *weights,
                        settings.allowed_risk, settings.allowed_risk_rate, first, first + parents,
                        steps, *arrays[:2], self._risk, self._child, self._child_proof,
                    )  # fmt: skip
                    grow_level(*how, PLACE, *chunk)
                else:
                    grow_level(*how, BOTH, *chunk)
                count, short = (int(n) for n in device.host(self._grown))
                fan = (count - before) / parents
                first += parents
                pace = max(0.5 * pace, (time.perf_counter() - now) / parents)
            fan = (count - level_end) / (level_end - level_begin)
            depth += count > level_end
            if short:
                stopped_by = "capacity"
            elif count == level_end and stopped_by == "depth":
                stopped_by = "unsafe"
            if stopped_by != "depth":
                break
            level_begin = level_end
        if settings.mode == "probabilistic" and settings.risk == "paper":
            _weigh_as_printed(model, count, *arrays)
        if not device.resident():
            arrays = tuple(array[:count] for array in arrays)
        return Tree(model, *arrays, root_pose, count, start, depth, stopped_by)


def _weigh_as_printed(
    model: FutureModel, count: int, pose: device.Array, link: device.Array, cost: device.Array
) -> None:
    """w_ps of every plan by eqs. 9 to 17 as printed; nothing is pruned by it."""
    poses, links = device.host(pose)[:count], device.host(link)[:count]
    states = np.array(
        [model.robot.within_limits(state) for state in to_states(poses, model.window.anchor)]
    )
    times = model.base + links[:, TICK_COLUMN] * TICK
    chance = model.collision_probability(states, times).astype(np.float32)
    multiply_weights(count, link, device.put(chance), cost)


def _parents_for(room: int, fan: float) -> int:
    """How many parents are likely to fill the room for some nodes, at `fan` children each."""
    return int(1.1 * room / max(fan, 0.1)) + 1


def _in_time(parents: int, left: float, pace: float) -> int:
    """How many of some parents can be grown in the time left [s], at `pace` seconds each; 0: none.

    A third of the time is kept back, and no chunk is to take long, for what takes longer than the
    last ones did.
    """
    if left <= 0:
        return 0
    if pace == 0.0:
        return parents
    return min(parents, int(left / (1.5 * pace)), max(int(LONGEST / pace), 1))


def planted(
    capacity: int, pose: np.ndarray, link: np.ndarray, cost: np.ndarray
) -> tuple[device.Array, device.Array, device.Array]:
    """Arrays of `capacity` nodes whose first is the root. Memory that no node comes to use costs
    nothing on the CPU: it is never touched."""
    arrays = tuple(device.empty((capacity, len(row)), row.dtype) for row in (pose, link, cost))
    if device.resident():
        plant(pose, link, cost, *arrays)
    else:
        for array, row in zip(arrays, (pose, link, cost), strict=True):
            array[ROOT] = row
    return arrays
