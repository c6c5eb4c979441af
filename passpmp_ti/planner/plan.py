"""From a node of the tree to what the robot executes: a plan and the braking that proves it."""

from __future__ import annotations

import numpy as np

from passpmp_ti.grid.body import to_poses, to_states
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.kernels.tree import PROOF
from passpmp_ti.planner.tree import ROOT, Tree, follow
from passpmp_ti.trajectory import Trajectory


def trajectory_to(tree: Tree, leaf: int) -> Trajectory:
    """The plan that ends at `leaf`, then the braking trajectory that proved the leaf p-safe."""
    parts = tree.controls_to(leaf)
    planned = sum(steps for _, steps in parts)
    tail = tree.model.body.braking[max(int(tree.link[leaf, PROOF]), 0)]
    return _as_trajectory(tree.model, tree.pose[ROOT], [*parts, (tail, -1)], tree.start, planned)


def braking_from(model: FutureModel, state: np.ndarray, start: float, control: int) -> Trajectory:
    """Braking at once from `state` [5] at `start` [s] by one control of the braking set."""
    pose = to_poses(state[None], model.window.anchor)[0]
    return _as_trajectory(model, pose, [(model.body.braking[control], -1)], start, 0)


def longest_clear_braking(model: FutureModel, state: np.ndarray, start: float) -> Trajectory:
    """The braking that stays clear longest: what is left when none is proven."""
    best, best_clear = None, -1.0
    for control in range(len(model.body.braking)):
        candidate = braking_from(model, state, start, control)
        taken = model.occupied(candidate.states[:, :2], np.maximum(candidate.times, model.stamp))
        clear = float(candidate.times[np.argmax(taken)]) if taken.any() else np.inf
        if clear > best_clear:
            best, best_clear = candidate, clear
    assert best is not None
    return best


def still_clear(model: FutureModel, trajectory: Trajectory, since: float = -np.inf) -> bool:
    """Whether the model, asked at the trajectory's own samples from `since` on, finds it free.

    The same look-ups that verified it: each sample while the robot moves, judged half a step
    later. This is a second opinion on the whole path, not a new proof at other times.
    """
    robot, states = model.robot, trajectory.states
    resting = robot.at_rest(states)
    # a sample matters if the robot moves into it or out of it
    moves = ~resting
    moves[:-1] |= ~resting[1:]
    moves[1:] |= ~resting[:-1]
    moves &= trajectory.times >= since - 1e-9
    if not moves.any():
        return True
    half = 0.5 * model.settings.time_step
    times = np.maximum(trajectory.times[moves] + half, model.stamp)
    x, y, theta = states[moves, 0], states[moves, 1], states[moves, 2]
    for offset, _ in robot.discs:
        points = np.stack([x + offset * np.cos(theta), y + offset * np.sin(theta)], axis=1)
        if model.occupied(points, times).any():
            return False
    return True


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
