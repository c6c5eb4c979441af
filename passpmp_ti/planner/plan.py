"""From a node of the tree to what the robot executes: a plan and the braking that proves it."""

from __future__ import annotations

import math

import numpy as np

from passpmp_ti.grid.body import to_poses, to_states
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.kernels.tree import PROOF
from passpmp_ti.planner.risk import risk_of, safety_weight
from passpmp_ti.planner.tree import Tree, follow
from passpmp_ti.trajectory import Trajectory

NUDGES = (2, 3, 4)
"""What is over before a primitive would be gathers speed for one of these parts of a cycle."""
MORE_ROOM = 1e-4
"""[s] of time left that a motion has to gain."""


def trajectory_to(tree: Tree, leaf: int) -> Trajectory:
    """The plan that ends at `leaf`, then the braking trajectory that proved the leaf p-safe."""
    parts = tree.controls_to(leaf)
    planned = sum(steps for _, steps in parts)
    tail = tree.model.body.braking[max(int(tree.trail(leaf)[-1, 1 + PROOF]), 0)]
    return _as_trajectory(tree.model, tree.root, [*parts, (tail, -1)], tree.start, planned)


def braking_from(model: FutureModel, state: np.ndarray, start: float, control: int) -> Trajectory:
    """Braking at once from `state` [5] at `start` [s] by one control of the braking set."""
    pose = to_poses(state[None], model.window.anchor)[0]
    return _as_trajectory(model, pose, [(model.body.braking[control], -1)], start, 0)


def roomiest(model: FutureModel, root: np.ndarray, start: float) -> Trajectory | None:
    """Out of where nothing else is free, from rest at `root` [5] at `start` [s]: of all motions
    that are over before a primitive and its braking would be, the one that leads to where most time
    is left until something may come; None where none is free, or leads to more.

    Where something may come out right beside the robot every primitive lasts too long, however
    slowly it leaves. What is shorter is checked as every plan is; a few millimetres later there is
    time for more.
    """
    pose = to_poses(root[None], model.window.anchor)[0]
    cycle, brake = model.settings.levels[0], (model.body.braking[0], -1)
    ways = [
        _as_trajectory(model, pose, [(control, cycle // part), brake], start, cycle // part)
        for part in NUDGES if cycle // part
        for control in model.body.controls
    ]  # fmt: skip
    rooms = model.room(np.stack([root, *(way.states[-1] for way in ways)]))
    for n in np.argsort(-rooms[1:], kind="stable"):
        if rooms[1 + n] <= rooms[0] + MORE_ROOM:
            return None
        risk = risk_of(model, ways[n], start)
        allowed = math.isfinite(safety_weight(model.settings, risk, ways[n].duration))
        if allowed and still_clear(model, ways[n]):
            return ways[n]
    return None


def brake_at_once(model: FutureModel, state: np.ndarray, start: float) -> Trajectory:
    """Braking from `state` [5] at `start` [s] by a proven control; where none is, by the one that
    stays clear longest: all that is left then."""
    state = model.robot.within_limits(state)
    proof = int(model.proving_brakes(state[None], np.array([start]))[0])
    if proof >= 0:
        return braking_from(model, state, start, proof)
    brakes = _every_brake(model, state, start)
    return max(brakes, key=lambda brake: _clear_until(model, brake, start))


def calmest(model: FutureModel, held: Trajectory, root: np.ndarray, start: float) -> Trajectory:
    """Of what is held, and of braking from `root` [5] at `start` [s] by each control: what has the
    least risk, and of equals what stays clear longest; the held one of those."""
    ways = [held, *_every_brake(model, model.robot.within_limits(root), start)]
    return min(ways, key=lambda way: (risk_of(model, way, start), -_clear_until(model, way, start)))


def _every_brake(model: FutureModel, state: np.ndarray, start: float) -> list[Trajectory]:
    """Braking at once from `state` [5] at `start` [s] by each control of the braking set."""
    return [braking_from(model, state, start, k) for k in range(len(model.body.braking))]


def _clear_until(model: FutureModel, way: Trajectory, since: float) -> float:
    """When something could first touch the robot on a way, asked about from `since` on [s]; inf:
    nothing can."""
    taken = _touched_since(model, way, since)
    return float(way.times[np.argmax(taken)]) if taken.any() else math.inf


def allowed_brake(model: FutureModel, root: np.ndarray, start: float) -> tuple[int, float]:
    """(first braking control from `root` [5] at `start` [s] that is clear of what is there for sure
    and risks no more than is allowed, its w_ps); -1 where there is none."""
    state = model.robot.within_limits(root)
    for control in range(len(model.body.braking)):
        brake = braking_from(model, state, start, control)
        weight = safety_weight(model.settings, risk_of(model, brake, start), brake.duration)
        if math.isfinite(weight) and still_clear(model, brake):
            return control, weight
    return -1, 1.0


def braking_off(model: FutureModel, road: Trajectory, start: float) -> Trajectory:
    """Leave what is followed by braking: at `start` [s] if that is proven, else as soon as it is.

    In the middle of a primitive no braking need be proven, while the road itself is: then it is
    followed up to the first sample from which one is. Where the model finds it free, there always
    is one, its own tail at the latest. Where it does not, and braking is proven nowhere on the free
    part of it, the robot brakes at once.
    """
    root = model.robot.within_limits(road.at(start))
    proof = int(model.proving_brakes(root[None], np.array([start]))[0])
    if proof >= 0:
        return braking_from(model, root, start, proof)
    later = np.flatnonzero(road.times > start + 1e-9)
    proofs = model.proving_brakes(road.states[later], road.times[later])
    good = np.flatnonzero(proofs >= 0)
    touches = _touched_since(model, road, start)
    if len(good) and not touches[: later[good[0]]].any():
        turn, begin = int(later[good[0]]), int(later[0])
        tail = braking_from(model, road.states[turn], float(road.times[turn]), int(proofs[good[0]]))
        return Trajectory(
            np.concatenate([[start], road.times[begin:turn], tail.times]),
            np.concatenate([[road.at(start)], road.states[begin:turn], tail.states]),
            1 + turn - begin,
        )
    return brake_at_once(model, root, start)


def _touched_since(model: FutureModel, trajectory: Trajectory, since: float) -> np.ndarray:
    """[m] bool: `touched`, where steps that end before `since` [s] are not asked about."""
    first = int((np.append(trajectory.times[1:], np.inf) <= since + 1e-9).sum())
    result = np.zeros(len(trajectory.times), dtype=bool)
    # the last state may be minutes old, more than ticks can tell; nothing is asked after it
    times = np.maximum(trajectory.times[first:], model.stamp - 1.0)
    result[first:] = model.touched(trajectory.states[first:], times)
    return result


def still_clear(model: FutureModel, trajectory: Trajectory, since: float = -np.inf) -> bool:
    """Whether the model, asked at the trajectory's own samples from `since` on, finds it free.

    A second opinion on the whole path, not a new proof at other times.
    """
    return not _touched_since(model, trajectory, since).any()


def _as_trajectory(
    model: FutureModel,
    pose: np.ndarray,
    parts: list[tuple[np.ndarray, int]],
    start: float,
    planned: int,
) -> Trajectory:
    path = follow(model, pose, parts)
    times = start + model.settings.time_step * np.arange(len(path))
    return Trajectory(times, to_states(path, model.window.anchor), min(planned, len(path) - 1))
