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
    candidates = [
        braking_from(model, state, start, control) for control in range(len(model.body.braking))
    ]
    clear_until = [
        float(c.times[np.argmax(taken)]) if (taken := touched(model, c)).any() else np.inf
        for c in candidates
    ]
    return candidates[int(np.argmax(clear_until))]


def still_clear(model: FutureModel, trajectory: Trajectory, since: float = -np.inf) -> bool:
    """Whether the model, asked at the trajectory's own samples from `since` on, finds it free.

    A second opinion on the whole path, not a new proof at other times.
    """
    return not touched(model, trajectory)[trajectory.times >= since - 1e-9].any()


def touched(model: FutureModel, trajectory: Trajectory) -> np.ndarray:
    """[m] bool: samples at which something could touch the moving robot.

    The look-ups that verified it: each sample that the robot moves into or out of, judged half a
    step later, for every disc of its body.
    """
    robot, states = model.robot, trajectory.states
    resting = robot.at_rest(states)
    moves = ~resting
    moves[:-1] |= ~resting[1:]
    moves[1:] |= ~resting[:-1]
    result = np.zeros(len(states), dtype=bool)
    times = np.maximum(trajectory.times[moves] + 0.5 * model.settings.time_step, model.stamp)
    x, y, theta = states[moves, 0], states[moves, 1], states[moves, 2]
    for offset, _ in robot.discs:
        points = np.stack([x + offset * np.cos(theta), y + offset * np.sin(theta)], axis=1)
        result[moves] |= model.occupied(points, times)
    return result


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
