"""The planning cycle: one scan in, one verified trajectory out (Algorithm 2, Fig. 2)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from passpmp_ti import backend, door
from passpmp_ti.grid.body import to_poses, to_states
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.guide import Guide, GuideField
from passpmp_ti.planner.objective import leaf_costs, trajectory_cost
from passpmp_ti.planner.plan import (
    braking_from,
    longest_clear_braking,
    still_clear,
    trajectory_to,
)
from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.planner.swarm import Swarm, best_leaf
from passpmp_ti.planner.tree import ROOT, Tree, TreeGrower, follow
from passpmp_ti.robots import Robot
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

TIE, TIE_SHARE = 1e-5, 3e-6
"""A new plan must cost less than the held one by more than this, and by more than this share, which
is what f32 sums can tell: the held one wins ties. Small against the least progress worth having,
since a cost to go of a minute is no reason to stand."""
COAST = 4.0
"""How far ahead the decision time looks [s]."""
COAST_PACE = 0.1
POSE_SLACK = 1e-3
"""[m] beyond the declared errors at which a robot is no longer where its plan has it."""


class Navigator:
    """Drives a robot to its goals, one cycle at a time; what it holds always ends at rest.

    Args:
        robot: limits, body, controls.
        settings: assumptions, resolution, objective.
        goal: (x, y) [m], or several to be reached in turn.
        static_map: surfaces that stay, known beforehand.
        seed: of everything random; or a NumPy Generator.
    """

    def __init__(
        self,
        robot: Robot,
        settings: Settings,
        goal: tuple[float, float] | Sequence[tuple[float, float]],
        static_map: StaticMap | None = None,
        *,
        seed: int | np.random.Generator = 0,
    ) -> None:
        backend.init()
        goals = np.atleast_2d(np.asarray(goal, dtype=np.float64))
        goals = door.array("Navigator", "goal", goals, (None, 2))
        if not len(goals):
            raise ValueError("Navigator.goal holds no goal; give (x, y), or a list of them")
        self.robot = robot
        self.settings = settings
        self.static_map = static_map
        self.goals = [(float(x), float(y)) for x, y in goals]
        self.held: Trajectory | None = None
        """The trajectory that is being executed, or will be from its start."""
        self.model: FutureModel | None = None
        """The last model of the future; the memory of the next one."""
        self.record = CycleRecord(stamp=-math.inf, decision="held", reason="no cycle yet")
        self._generator = np.random.default_rng(seed)
        self._grower = TreeGrower(robot, settings)
        self._swarm = Swarm(settings) if settings.optimizer == "pso" else None
        self._guide: Guide | None = None
        self._next_goal = 0

    @property
    def goal(self) -> tuple[float, float]:
        """The goal it drives to now, or the last one [m]."""
        return self.goals[min(self._next_goal, len(self.goals) - 1)]

    @property
    def reached(self) -> bool:
        """Whether the robot came to rest at the last goal."""
        return self._next_goal >= len(self.goals)

    def update(self, scan: Scan | Sequence[Scan], state: np.ndarray) -> Trajectory:
        """Plan one cycle.

        Args:
            scan: what the sensors saw at t_k, one scan or several of one instant.
            state: [5] the robot's state then.

        Returns:
            What to execute from t_{k+1} = t_k + cycle on. It ends at rest. Until then the robot
            goes on with what was held before.

        Raises:
            ValueError: in the first cycle, a robot that is not at rest or a state that is none.
                Later cycles raise nothing because of the world: a scan that cannot be used is an
                unseen world, and the robot goes on to rest on what it holds.
        """
        began = time.perf_counter()
        scans = [scan] if isinstance(scan, Scan) else list(scan)
        if not scans:
            return self._without_scan(state)
        stamp = scans[0].stamp
        if self.held is None:
            self._start(state, stamp)
        assert self.held is not None
        trouble = self._trouble(scans, state)
        if trouble:
            self.record = CycleRecord(
                stamp=stamp, decision="held", reason=trouble, lost_scan=trouble, goal=self.goal,
                plan_time=self.held.duration, chosen=self.held,
                timings={"total": time.perf_counter() - began},
            )  # fmt: skip
            return self.held
        state = np.asarray(state, dtype=np.float64)
        self.model = FutureModel.from_scan(
            scans, self.robot, self.settings, self.model, self.static_map,
            position=(float(state[0]), float(state[1]), float(state[2])),
        )  # fmt: skip
        modelled = time.perf_counter()
        record = self._decide(self.model, state, stamp, began)
        timings = {"model": modelled - began, **record.timings}
        timings["total"] = time.perf_counter() - began
        self.record = replace(record, timings=timings)
        return self.held

    def _without_scan(self, state: np.ndarray) -> Trajectory:
        """Nothing was sensed at all: the robot goes on with what it holds."""
        if self.held is None:
            raise ValueError(
                "Navigator.update: the first cycle needs a scan; without one there is no time to"
                f" start from; the robot is at {np.asarray(state)!r}"
            )
        trouble = "no scan at all"
        self.record = CycleRecord(
            stamp=self.record.stamp, decision="held", reason=trouble, lost_scan=trouble,
            goal=self.goal, plan_time=self.held.duration, chosen=self.held,
        )  # fmt: skip
        return self.held

    def _start(self, state: np.ndarray, stamp: float) -> None:
        given = self.robot.check_states("Navigator.update", np.asarray(state)[None])[0]
        if not self.robot.at_rest(given):
            raise ValueError(
                "Navigator.update: the first cycle needs a robot at rest, nothing is planned yet"
                f" that could stop it; got {given!r}"
            )
        self.held = Trajectory.resting(given, stamp)

    def _trouble(self, scans: list[Scan], state: np.ndarray) -> str:
        """Why this cycle cannot be planned; empty where it can."""
        stamp = scans[0].stamp
        if self.model is not None and stamp <= self.model.stamp:
            return f"scan of {stamp:.3f} s is not newer than the one of {self.model.stamp:.3f} s"
        if any(abs(s.stamp - stamp) > 1e-6 for s in scans):
            return "scans of different instants"
        given = np.asarray(state, dtype=np.float64)
        if given.shape != (5,) or not np.isfinite(given).all():
            return "the robot's state is not known"
        return ""

    def _decide(
        self, model: FutureModel, state: np.ndarray, stamp: float, began: float
    ) -> CycleRecord:
        """Choose what to hold from t_{k+1} on; `began`: wall clock at the cycle's start."""
        assert self.held is not None
        settings = self.settings
        timings: dict[str, float] = {}
        clock = _Clock(timings)
        start = stamp + settings.cycle
        deviation = float(np.hypot(*(state[:2] - self.held.at(stamp)[:2])))
        root = self.held.at(start)
        root_brake = int(model.proving_brakes(root[None], np.array([start]))[0])
        common = CycleRecord(
            stamp=stamp, decision="held", goal=self.goal, deviation=deviation,
            root_proved=root_brake >= 0, held_clear=still_clear(model, self.held, start),
            broken_premises=model.broken_premises, model=model,
        )  # fmt: skip
        allowed = settings.tracking_error + settings.localisation_error + POSE_SLACK
        lost = deviation > allowed
        if len(model.broken_premises) or lost:
            self._brake(model, state if lost else root, start)
            reason = (
                f"{deviation:.2f} m off its plan"
                if lost
                else f"{len(model.broken_premises)} returns where nothing could be"
            )
            return replace(
                common, decision="brake", reason=reason, chosen=self.held, timings=timings,
                plan_time=self.held.duration, decision_time=0.0,
            )  # fmt: skip
        if self._arrive(state, root, start):
            clock.lap("bookkeeping")
            return replace(common, decision="arrived", chosen=self.held, timings=timings)

        guide = self._guide_field(model, state)
        clock.lap("guide")
        tree = self._grower.grow(model, guide, root, start, root_brake)
        clock.lap("tree")
        leaf, particles, cost_new = self._choose(tree)
        cost_held = trajectory_cost(self.held, start, guide, settings, self.robot)
        clock.lap("choice")
        decision, reason = "held", "no safe plan was found"
        if leaf != ROOT:
            decision, reason = "held", "the held plan is at least as good"
            if cost_new < cost_held - max(TIE, TIE_SHARE * cost_held):
                plan = trajectory_to(tree, leaf)
                late = settings.deadline is not None and (
                    time.perf_counter() - began > settings.deadline
                )
                if late:
                    reason = "planning took longer than the deadline"
                elif still_clear(model, plan):
                    self.held, decision, reason = plan, "new", ""
                else:
                    reason = "the new plan did not stand its second check"
        decision_time = self._decision_time(model, self.held, stamp, start)
        clock.lap("bookkeeping")
        return replace(
            common, decision=decision, reason=reason, timings=timings, tree=tree,
            tree_nodes=tree.count, tree_depth=tree.depth, tree_stopped_by=tree.stopped_by,
            cost=cost_new if decision == "new" else cost_held, cost_new=cost_new,
            cost_held=cost_held, plan_time=max(self.held.end - start, 0.0),
            decision_time=decision_time, particle_leaves=particles, chosen=self.held,
        )  # fmt: skip

    def _arrive(self, state: np.ndarray, root: np.ndarray, start: float) -> bool:
        """At rest at a goal: go on to the next one, or stay for good at the last."""
        still = bool(self.robot.at_rest(state)) and bool(self.robot.at_rest(root))
        if not still or math.dist(root[:2], self.goal) > self.settings.goal_tolerance:
            return self.reached
        if self._next_goal < len(self.goals):
            self._next_goal += 1
        if self.reached:
            self.held = Trajectory.resting(root, start)
        return self.reached

    def _brake(self, model: FutureModel, root: np.ndarray, start: float) -> None:
        """Hold braking at once: by a proven control, or by the one that stays clear longest."""
        root = self.robot.within_limits(root)
        proof = int(model.proving_brakes(root[None], np.array([start]))[0])
        self.held = (
            braking_from(model, root, start, proof)
            if proof >= 0
            else longest_clear_braking(model, root, start)
        )

    def _guide_field(self, model: FutureModel, state: np.ndarray) -> GuideField:
        if self._guide is None:
            self._guide = Guide(
                self.robot, self.settings, (float(state[0]), float(state[1])), self.goals,
                model.window.anchor, model.window.inner_radius, self.static_map,
            )  # fmt: skip
        return self._guide.field(model, self.goal, state[:2])

    def _choose(self, tree: Tree) -> tuple[int, tuple[int, ...], float]:
        """(leaf, distinct leaves of the particles, its cost); the root where nothing grew."""
        if tree.count == 1:
            return ROOT, (), math.inf
        costs = leaf_costs(tree, self.settings)
        if self._swarm is None:
            leaf = best_leaf(tree, costs)
            return leaf, (), float(costs[leaf])
        leaf, particles = self._swarm.choose(tree, costs, self._generator)
        return leaf, particles, float(costs[leaf])

    def _decision_time(
        self, model: FutureModel, held: Trajectory, stamp: float, start: float
    ) -> float:
        """delta_d of eq. 20: until the held motion, kept on without braking, is first ICS^b."""
        turn = float(held.times[held.brakes_from])
        ahead = np.arange(start, turn, COAST_PACE)
        states = held.sampled(ahead) if len(ahead) else np.zeros((0, 5))
        last = held.at(max(turn, start))
        if bool(self.robot.at_rest(last)):
            times = ahead
        else:
            pace = self.settings.steps_of(COAST_PACE)
            steps = max(pace, 1) * round(COAST / COAST_PACE)
            coasting = follow(
                model,
                to_poses(last[None], model.window.anchor)[0],
                [(np.zeros(3, dtype=np.float32), steps)],
            )[:: max(pace, 1)]
            coast_times = max(turn, start) + self.settings.time_step * max(pace, 1) * np.arange(
                len(coasting)
            )
            states = np.concatenate([states, to_states(coasting, model.window.anchor)])
            times = np.concatenate([ahead, coast_times])
        if not len(times):
            return math.inf
        unsafe = ~model.passively_safe(states, times)
        return float(times[np.argmax(unsafe)] - stamp) if unsafe.any() else math.inf


class _Clock:
    """Writes the seconds since the lap before into a dict."""

    def __init__(self, timings: dict[str, float]) -> None:
        self._timings = timings
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self._timings[name] = now - self._last
        self._last = now
