"""The planning cycle of the planners that only look at the latest scan."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from passpmp_ti import backend, door
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.baselines.motion import Motion
from passpmp_ti.planner.intake import scans_in, standing
from passpmp_ti.planner.place import allowed_gap, gap
from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.robots import Robot
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

STOP_SHARE = 0.5
"""Of the goal's tolerance, within which braking at once is to end."""


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What a policy is told in one cycle."""

    scans: tuple[Scan, ...]
    """Of t_k."""
    root: np.ndarray
    """[5] the robot's state at t_{k+1}."""
    start: float
    """t_{k+1} [s]."""
    goal: tuple[float, float]
    """[m]."""


Policy = Callable[[Sight], Trajectory | None]
"""What to execute from t_{k+1} on, to rest; None: nothing fits, and the robot brakes."""


class Reactive:
    """Drives a robot by a policy, behind the navigator's door and on its timeline.

    Nothing that it answers is verified, but all of it ends at rest. It brakes by itself where that
    ends at the goal, unless `stops` is false, and where the policy finds nothing.

    Args:
        policy: makes each cycle's plan.
        robot: limits, body, controls.
        settings: cycle, time step, cell and tolerance are used.
        goal: (x, y) [m], or several to be reached in turn.
    """

    def __init__(
        self,
        policy: Policy,
        robot: Robot,
        settings: Settings,
        goal: tuple[float, float] | Sequence[tuple[float, float]],
        static_map: StaticMap | None = None,
        *,
        stops: bool = True,
    ) -> None:
        backend.init()
        owner = type(self).__name__
        goals = door.array(owner, "goal", np.atleast_2d(np.asarray(goal, float)), (None, 2))
        if not len(goals):
            raise ValueError(f"{owner}.goal holds no goal; give (x, y), or a list of them")
        self.robot = robot
        self.settings = settings
        self.static_map = static_map
        """Kept, not used: what stands is in the scan."""
        self.goals = [(float(x), float(y)) for x, y in goals]
        self.held: Trajectory | None = None
        """The trajectory that is being executed, or will be from its start."""
        self.record = CycleRecord(stamp=-math.inf, decision="held", reason="no cycle yet")
        self._policy = policy
        self._stops = stops
        self._motion = Motion(robot, settings)
        self._allowed = allowed_gap(robot, settings)
        self._next_goal = 0

    @property
    def goal(self) -> tuple[float, float]:
        """The goal it drives to now, or the last one [m]."""
        return self.goals[min(self._next_goal, len(self.goals) - 1)]

    @property
    def reached(self) -> bool:
        """Whether the robot came to rest at the last goal."""
        return self._next_goal >= len(self.goals)

    def update(
        self,
        scan: Scan | Sequence[Scan],
        state: np.ndarray,
        *,
        following: Trajectory | None = None,
    ) -> Trajectory:
        """Plan one cycle; see `Navigator.update`.

        Raises:
            ValueError: in the first cycle, no scan, a robot that is not at rest, or a state that
                is none.
        """
        began = time.perf_counter()
        if self.held is None:
            self.held = standing(scan, state, self.robot)
        if following is not None:
            self.held = following
        scans, trouble = scans_in(scan)
        if trouble:
            # the robot goes on to rest on what it holds
            self.record = CycleRecord(
                stamp=self.record.stamp, decision="held", reason=trouble, lost_scan=trouble,
                goal=self.goal, plan_time=self.held.duration, chosen=self.held,
            )  # fmt: skip
            return self.held
        record = self._planned(scans, np.asarray(state, dtype=np.float64))
        assert record.chosen is not None
        self.held = record.chosen
        spent = time.perf_counter() - began
        self.record = replace(record, timings={"choice": spent, "total": spent})
        return self.held

    def _planned(self, scans: tuple[Scan, ...], state: np.ndarray) -> CycleRecord:
        assert self.held is not None
        stamp = scans[0].stamp
        start = stamp + self.settings.cycle
        deviation, turn = gap(self.held, state, stamp)
        record = CycleRecord(
            stamp=stamp, decision="brake", goal=self.goal, deviation=deviation, turn_deviation=turn
        )
        if deviation > self._allowed[0] or turn > self._allowed[1]:
            # until the answer comes the robot goes on as it does: braking begins where it is
            stopping = self._motion.braking(self.robot.within_limits(state), start)
            return replace(record, reason=f"{deviation:.2f} m off its plan", chosen=stopping)
        root = self.robot.within_limits(self.held.at(start))
        if self._arrive(state, root):
            standing_still = Trajectory.resting(root, start)
            return replace(record, decision="arrived", chosen=standing_still)
        stopping = self._motion.braking(root, start)
        near = STOP_SHARE * self.settings.goal_tolerance
        if self._stops and math.dist(stopping.states[-1, :2], self.goal) <= near:
            return replace(record, decision="new", chosen=stopping, plan_time=stopping.duration)
        plan = self._policy(Sight(scans, root, start, self.goal))
        if plan is None:
            return replace(
                record, reason="no motion is free", chosen=stopping, plan_time=stopping.duration
            )
        decision = "held" if plan is self.held else "new"
        return replace(record, decision=decision, chosen=plan, plan_time=max(plan.end - start, 0.0))

    def _arrive(self, state: np.ndarray, root: np.ndarray) -> bool:
        """At rest at a goal: go on to the next one, or stay for good at the last."""
        still = bool(self.robot.at_rest(state)) and bool(self.robot.at_rest(root))
        at_goal = math.dist(root[:2], self.goal) <= self.settings.goal_tolerance
        if still and at_goal and not self.reached:
            self._next_goal += 1
        return self.reached
