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
    ends = np.append(trajectory.times[1:], np.inf)
    return not touched(model, trajectory)[ends > since + 1e-9].any()


def touched(model: FutureModel, trajectory: Trajectory) -> np.ndarray:
    """[m] bool: samples from which on something could touch the moving robot, by the look-ups that
    verified it."""
    return model.touched(trajectory.states, trajectory.times)


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
