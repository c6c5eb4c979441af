"""Risk promised against risk met: what would have become of a trajectory, in the true world."""

from __future__ import annotations

import numpy as np

from passpmp_ti.robots import Robot
from passpmp_ti.sim.contacts import gaps_to_movers
from passpmp_ti.sim.episode import CycleInfo
from passpmp_ti.sim.movers import Movers
from passpmp_ti.trajectory import Trajectory


def moves(robot: Robot, trajectory: Trajectory, since: float) -> bool:
    """Whether the robot moves on a trajectory after `since` [s]."""
    _, states = _from(trajectory, since)
    return not bool(robot.at_rest(states).all())


def would_touch(robot: Robot, trajectory: Trajectory, movers: Movers, since: float) -> bool:
    """Whether the robot, following a trajectory to rest, touches a mover while it moves.

    Counterfactual: most trajectories are replaced by a better one a cycle later. The answer is
    exact where the movers' way does not depend on the robot's, as in every scenario: splines,
    scripts and recordings are functions of time.

    Args:
        robot: whose discs.
        trajectory: judged on straight lines between its samples, robot and movers alike.
        movers: of the true world.
        since: judged from then on [s].
    """
    times, states = _from(trajectory, since)
    rest = robot.at_rest(states)
    moving = ~(rest[:-1] & rest[1:])
    if not moving.any():
        return False
    here = np.array([movers.present(float(t)) for t in times])
    numbers = np.flatnonzero(here.any(axis=0))
    positions = movers.positions(times)[:, numbers]
    gaps = gaps_to_movers(robot, states, positions, movers.radius[numbers])
    present = here[:-1, numbers] | here[1:, numbers]
    return bool((moving[:, None] & present & (gaps <= 0)).any())


def _from(trajectory: Trajectory, since: float) -> tuple[np.ndarray, np.ndarray]:
    """(times [m], states [m, 5]) of a trajectory from `since` [s] on."""
    later = trajectory.times > since
    times = np.concatenate([[max(since, trajectory.start)], trajectory.times[later]])
    states = np.concatenate([trajectory.at(times[0])[None], trajectory.states[later]])
    return times, states


class Promises:
    """Judges what is chosen in every n-th cycle, beside the risk that its record promises."""

    def __init__(self, every: int) -> None:
        self.promised: list[float] = []
        """[n] chance of a contact while moving, along each trajectory."""
        self.met: list[int] = []
        """[n] 1: following it would have touched somebody."""
        self._every = every
        self._cycle = 0

    def see(self, info: CycleInfo) -> None:
        """Judge one cycle of `simulate`; who stands still promises nothing."""
        due = self._cycle % self._every == 0
        self._cycle += 1
        navigator = info.navigator
        chosen = navigator.record.chosen
        since = info.time + navigator.settings.cycle
        if not due or chosen is None or not moves(navigator.robot, chosen, since):
            return
        self.promised.append(float(getattr(navigator.record, "risk", 0.0)))
        self.met.append(int(would_touch(navigator.robot, chosen, info.world.movers, since)))
