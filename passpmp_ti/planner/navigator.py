"""The planning cycle: one scan in, one verified trajectory out (Algorithm 2, Fig. 2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from passpmp_ti import backend, door
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.budget import Budget, Reserve, without_collector
from passpmp_ti.planner.coast import decision_time
from passpmp_ti.planner.followed import trouble_with
from passpmp_ti.planner.guide import Guide, GuideField
from passpmp_ti.planner.intake import Heard, Intake, standing
from passpmp_ti.planner.objective import trajectory_cost
from passpmp_ti.planner.place import allowed_gap, carried_on, gap, stitched
from passpmp_ti.planner.plan import (
    allowed_brake,
    brake_at_once,
    braking_off,
    calmest,
    roomiest,
    still_clear,
    trajectory_to,
)
from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.planner.rehearsal import rehearse
from passpmp_ti.planner.risk import risk_of, safety_weight
from passpmp_ti.planner.stall import Hill, Stall
from passpmp_ti.planner.swarm import Swarm, best_leaf
from passpmp_ti.planner.tree import ROOT, Tree, TreeGrower
from passpmp_ti.planner.vanished import BELIEVED_AT_LAST, Belief
from passpmp_ti.robots import Robot
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

TIE, TIE_SHARE = 1e-5, 3e-6
"""A new plan must cost less than the held one by more than this, and by more than this share, which
is what f32 sums can tell: the held one wins ties. Small against the least progress worth having,
since a cost to go of a minute is no reason to stand."""
LONGEST_MEMORY = 60.0
"""[s] What is older is forgotten: ticks end at 65.5 s, and an age that overflows would promise."""


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
        running = backend.init()
        if settings.mode == "probabilistic" and not backend.has_doubles():
            raise ValueError(
                'Settings.mode = "probabilistic" works out its Gaussians in double precision, which'
                f' the backend "{running}" may not have; take mode="conservative" or "hybrid", or'
                ' init("cpu") or init("cuda") in a new process'
            )
        self.robot = robot
        self.settings = settings
        self.static_map = static_map
        self.goals = _goals_of(goal)
        self.held: Trajectory | None = None
        """The trajectory that is being executed, or will be from its start."""
        self.model: FutureModel | None = None
        """The last model of the future; the memory of the next one."""
        self.record = CycleRecord(stamp=-math.inf, decision="held", reason="no cycle yet")
        self._intake = Intake(robot, settings)
        self._belief = Belief()
        self._road: Trajectory  # what is held, and what was followed until it begins
        self._started = -math.inf  # stamp of the first cycle
        self._heard_at = -math.inf  # stamp of the last model
        self._laid = False  # whether what is held was verified by memory that had to be dropped
        self._modelled = False  # whether there ever was a model
        self._generator = np.random.default_rng(seed)
        self._under_way = settings.changed(clear_radius=0.0)
        self._grower = TreeGrower(robot, settings)
        self._swarm = Swarm(robot, settings) if settings.optimizer == "pso" else None
        self._guide: Guide | None = None
        self._stall = Stall(robot, settings)
        self._next_goal = 0
        self._reserve = Reserve()
        if settings.deadline is not None:
            rehearse(Navigator, robot, settings)

    @property
    def goal(self) -> tuple[float, float]:
        """The goal it drives to now, or the last one [m]."""
        return self.goals[min(self._next_goal, len(self.goals) - 1)]

    @property
    def reached(self) -> bool:
        """Whether the robot came to rest at the last goal."""
        return self._next_goal >= len(self.goals)

    def head_for(self, goal: tuple[float, float] | Sequence[tuple[float, float]]) -> None:
        """Drive to another goal, or to others in turn, from the next cycle on. What is held stays
        held, and what is known stays known.

        Args:
            goal: (x, y) [m], or several.

        Raises:
            ValueError: there is none, or numbers that are none.
        """
        self.goals = _goals_of(goal)
        self._next_goal = 0
        self._guide = None
        self._stall.forget()

    def update(
        self,
        scan: Scan | Sequence[Scan],
        state: np.ndarray,
        *,
        following: Trajectory | None = None,
    ) -> Trajectory:
        """Plan one cycle.

        Args:
            scan: what the sensors saw at t_k, one scan or several of one instant.
            state: [5] the robot's state then.
            following: what the robot really follows, where that is not the last answer: an
                answer that comes after its own start must not be taken, since the robot is not
                there any more. None: the last answer was taken.

        Returns:
            What to execute from t_{k+1} = t_k + cycle on. It ends at rest. Until then the robot
            goes on with what was held before.

        Raises:
            ValueError: in the first cycle, no scan, a robot that is not at rest, or a state that
                is none. Later cycles raise nothing, whatever comes in and whatever breaks inside:
                what cannot be used is an unseen world, a planner that raises has found no plan
                (`record.fault`), and the robot goes on to rest on what it holds.
        """
        deadline = self.settings.deadline
        with without_collector(deadline is not None):
            budget = Budget(deadline, self._reserve)
            if self.held is None:
                self.held = self._road = standing(scan, state, self.robot)
                self._started = self.held.start
            try:
                record = self._cycle(scan, state, following, budget)
            except Exception as error:  # whatever it is: what is held ends at rest by itself
                self._guide = None
                record = self._holding(math.nan, _told(error), fault=_told(error))
            # the last cycle's tree goes, and that takes time too
            self.record = record
            budget.close()
            self.record = record.ended(budget.timings, budget.left())
        return self.held

    def _cycle(
        self, scan: object, state: object, following: Trajectory | None, budget: Budget
    ) -> CycleRecord:
        """Hear, model, judge, plan. What is kept is replaced whole, or not at all."""
        assert self.held is not None
        not_taken = following is not None and following is not self.held
        stray = trouble_with(following, self.robot) if not_taken else ""
        if following is not None and not_taken and not stray:
            self.held = self._road = following
            self._laid = False
        heard = self._intake.hear(scan, state, self._road)
        if heard.trouble:
            return self._holding(heard.stamp, heard.trouble, unheard=True, not_taken=not_taken)
        assert heard.state is not None
        stamp, forgot = heard.stamp, heard.anew
        still = Trajectory.resting(self.robot.within_limits(heard.state), stamp)
        deviation, turn = gap(still if heard.anew else self._road, heard.state, stamp)
        allowed = allowed_gap(self.robot, self.settings)
        # what follows something that nobody knows is nowhere on its plan
        lost = bool(stray) or deviation > allowed[0] or turn > allowed[1]
        if lost:
            forgot = "off its plan"
        if self.model is not None and not forgot and stamp - self.model.stamp > LONGEST_MEMORY:
            forgot = "too long ago"
        witness = None if lost else self.model
        if forgot:
            # where memory was, or when, is not known any more
            self._forget()
        model = self._model(heard, lost)
        budget.lap("model")
        if witness is not None and not len(model.broken_premises):
            rests = bool(heard.anew) or stamp >= self.held.end
            doubt = self._belief.doubt(witness, model, timeless=bool(forgot), rests=rests)
            if doubt == BELIEVED_AT_LAST:
                self._forget()
                model, forgot = self._model(heard, lost), doubt
                budget.lap("model")
            elif doubt:
                self.model = witness
                return self._holding(stamp, doubt, unheard=True, not_taken=not_taken)
        if heard.anew:
            self._hold(still, anew=True)
        start = stamp + self.settings.cycle
        root = self._road.at(start)
        proof = int(model.proving_brakes(root[None], np.array([start]))[0])
        record = CycleRecord(
            stamp=stamp, decision="held", goal=self.goal, deviation=deviation,
            turn_deviation=turn, not_taken=not_taken, forgot=forgot if self._modelled else "",
            root_proved=proof >= 0, fault=stray,
            held_clear=lost or still_clear(model, self.held, start),
            broken_premises=model.broken_premises, model=model,
            held_risk=1.0 if lost else risk_of(model, self.held, start),
        )  # fmt: skip
        alarm = stray or self._alarm(record, lost, allowed)
        if alarm:
            self._brake(model, heard, start, lost)
            record = replace(
                record, decision="brake", reason=alarm, chosen=self.held,
                plan_time=max(self.held.end - start, 0.0), decision_time=0.0,
                risk=risk_of(model, self.held, start),
            )  # fmt: skip
        self.model, self._modelled = model, True
        self._heard_at = stamp
        self._intake.used(heard)
        budget.lap("bookkeeping")
        if not alarm:
            try:
                record = self._plan(record, model, heard.state, root, proof, start, budget)
            except Exception as error:  # as above; the model is whole, and memory keeps it
                self._guide = None
                record = replace(
                    record, reason=_told(error), fault=_told(error), chosen=self.held,
                    plan_time=max(self.held.end - start, 0.0),
                )  # fmt: skip
        return record

    def _model(self, heard: Heard, lost: bool) -> FutureModel:
        """W(t_k). A disc is declared clear about the start, and then, only; a map's coordinates
        mean nothing while the robot is not where it should be."""
        assert heard.state is not None
        x, y, theta = (float(v) for v in heard.state[:3])
        at_the_start = heard.stamp == self._started and not lost
        settings = self.settings if at_the_start else self._under_way
        return FutureModel.from_scan(
            heard.scans, self.robot, settings, self.model, None if lost else self.static_map,
            position=(x, y, theta), speed=abs(float(self.robot.speed(heard.state))),
        )  # fmt: skip

    def _alarm(self, record: CycleRecord, lost: bool, allowed: tuple[float, float]) -> str:
        """Why the robot has to brake at once; empty where it need not."""
        if lost and record.deviation > allowed[0]:
            return f"{record.deviation:.2f} m off its plan"
        if lost:
            return f"turned {record.turn_deviation:.2f} rad off its plan"
        if len(record.broken_premises):
            return f"{len(record.broken_premises)} returns where nothing could be"
        # What was laid anew was verified by memory that is gone: nothing since speaks against it.
        # A track may always turn out differently: that is weighed with the plans.
        if not record.held_clear and not self._laid and not self.settings.tracks:
            return "what is held is not clear any more"
        return ""

    def _holding(
        self,
        stamp: float,
        reason: str,
        *,
        unheard: bool = False,
        fault: str = "",
        not_taken: bool = False,
    ) -> CycleRecord:
        """The record of a cycle that goes on with what is held."""
        assert self.held is not None
        return CycleRecord(
            stamp=self.record.stamp if math.isnan(stamp) else stamp, decision="held",
            reason=reason, lost_scan=reason if unheard else "", fault=fault, not_taken=not_taken,
            goal=self.goal, plan_time=self.held.duration, chosen=self.held,
            risk=self.record.risk,  # as far as anybody knows
        )  # fmt: skip

    def _plan(
        self,
        record: CycleRecord,
        model: FutureModel,
        state: np.ndarray,
        root: np.ndarray,
        proof: int,
        start: float,
        budget: Budget,
    ) -> CycleRecord:
        """Choose what to hold from t_{k+1} on."""
        assert self.held is not None
        settings = self.settings
        if self._arrive(state, root, start):
            return replace(record, decision="arrived", chosen=self.held)

        if budget.explored():
            return self._without_tree(record, root, "the model left no time to plan")
        hill = self._stall.look(record.stamp, float(state[0]), float(state[1]))
        record = replace(record, stalled=hill is not None)
        guide = self._guide_field(model, state, hill)
        budget.lap("guide")
        if budget.explored():
            return self._without_tree(record, root, "the guide left no time to plan")
        weight = 1.0
        if settings.mode == "probabilistic":
            proof, weight = allowed_brake(model, root, start)
        tree = self._grower.grow(
            model, guide, root, start, proof, until=budget.until, weight=weight
        )
        budget.lap("tree")
        budget.grown()
        leaf, particles, cost_new = self._choose(tree)
        weight = self._held_weight(record, start)
        cost_held = math.inf
        if math.isfinite(weight):
            cost_held = trajectory_cost(self.held, start, guide, settings, self.robot) * weight
        budget.lap("choice")
        plan, reason = None, "no safe plan was found"
        if leaf != ROOT:
            reason = "the held plan is at least as good"
            if math.isinf(cost_held) or cost_new < cost_held - max(TIE, TIE_SHARE * cost_held):
                plan = trajectory_to(tree, leaf)
                if not still_clear(model, plan):
                    plan, reason = None, "the new plan did not stand its second check"
        # no hill moves a robot that can go nowhere, or only where it came from
        locked = plan is None and hill is not None and (tree.stays or self._stall.stuck)
        if locked and self.robot.at_rest(root):
            plan = roomiest(model, root, start)
            if plan is not None:
                reason, cost_new = "", trajectory_cost(plan, start, guide, settings, self.robot)
        calmed = plan is None and math.isinf(cost_held)
        if calmed:
            plan = calmest(model, self.held, root, start)
        chosen = self.held if plan is None else plan
        if plan is not None and budget.late():
            plan, reason, chosen = None, "planning took longer than the deadline", self.held
        decision = "held" if plan is None or plan is self.held else "brake" if calmed else "new"
        if plan is not None and plan is not self.held:
            self._hold(plan)
        budget.lap("bookkeeping")
        return replace(
            record, decision=decision, reason="" if decision == "new" else reason, tree=tree,
            risk=record.held_risk if decision == "held" else risk_of(model, chosen, start),
            tree_nodes=tree.count, tree_depth=tree.depth, tree_stopped_by=tree.stopped_by,
            cost=cost_new if decision == "new" else cost_held, cost_new=cost_new,
            cost_held=cost_held,
            plan_time=max(chosen.end - start, 0.0),
            decision_time=partial(decision_time, model, chosen, record.stamp, start),
            particle_leaves=particles, chosen=chosen,
        )  # fmt: skip

    def _held_weight(self, record: CycleRecord, start: float) -> float:
        """w_ps of what is held (eqs. 8 and 9); infinite where a track made it too risky to keep."""
        assert self.held is not None
        if self.settings.tracks and not record.held_clear and not self._laid:
            return math.inf
        return safety_weight(self.settings, record.held_risk, self.held.end - start)

    def _without_tree(self, record: CycleRecord, root: np.ndarray, reason: str) -> CycleRecord:
        """There was no time to look for anything better before the deadline: what is held is kept,
        or, where it is too risky to keep, whatever has the least risk."""
        assert self.held is not None
        assert record.model is not None
        start = record.stamp + self.settings.cycle
        chosen = self.held
        if math.isinf(self._held_weight(record, start)):
            chosen = calmest(record.model, self.held, root, start)
        decision = "held" if chosen is self.held else "brake"
        if chosen is not self.held:
            self._hold(chosen)
        return replace(
            record, decision=decision, reason=f"{reason} before the deadline", chosen=chosen,
            plan_time=max(chosen.end - start, 0.0), risk=risk_of(record.model, chosen, start),
        )  # fmt: skip

    def _arrive(self, state: np.ndarray, root: np.ndarray, start: float) -> bool:
        """At rest at a goal: go on to the next one, or stay for good at the last."""
        still = bool(self.robot.at_rest(state)) and bool(self.robot.at_rest(root))
        if not still or math.dist(root[:2], self.goal) > self.settings.goal_tolerance:
            return self.reached
        if self._next_goal < len(self.goals):
            self._next_goal += 1
            self._stall.forget()
        if self.reached:
            self._hold(Trajectory.resting(root, start))
        return self.reached

    def _brake(self, model: FutureModel, heard: Heard, start: float, lost: bool) -> None:
        """Hold braking at once.

        Off the plan, it brakes from where the robot will be at t_{k+1} if it goes on as it does
        (`carried_on`). Where no braking is proven there, and it is farther off than it can have
        gone, its pose or its clock jumped and not the robot: its motion is still the one that was
        verified, and the rest of that is laid where the robot is told to be.
        """
        assert heard.state is not None
        if not lost:
            self._hold(braking_off(model, self._road, start))
            return
        allowed = allowed_gap(self.robot, self.settings)
        root, rest = carried_on(
            model, self._road, heard.state, heard.stamp, allowed, self._heard_at
        )
        if rest is not None and model.proving_brakes(root[None], np.array([start])) < 0:
            self._hold(rest, anew=True)
            self._laid = True
        else:
            self._hold(brake_at_once(model, root, start), anew=True)

    def _hold(self, trajectory: Trajectory, *, anew: bool = False) -> None:
        """Hold it from its start on; `anew`: it has nothing to do with what was followed."""
        self._road = trajectory if anew else stitched(self._road, trajectory)
        self.held = trajectory
        self._laid = False

    def _forget(self) -> None:
        """Of all that has a place in it."""
        self.model = self._guide = None
        self._stall.forget()

    def _guide_field(
        self, model: FutureModel, state: np.ndarray, hill: Hill | None
    ) -> GuideField:
        if self._guide is None or self._guide.anchor != model.window.anchor:
            self._guide = Guide(
                self.robot, self.settings, (float(state[0]), float(state[1])), self.goals,
                model.window.anchor, model.window.inner_radius, self.static_map,
            )  # fmt: skip
        return self._guide.field(model, self.goal, state[:2], hill)

    def _choose(self, tree: Tree) -> tuple[int, tuple[int, ...], float]:
        """(leaf, distinct leaves of the particles, its cost); the root where nothing grew."""
        if tree.count == 1:
            return ROOT, (), math.inf
        if self._swarm is None:
            leaf, cost = best_leaf(tree, self.robot, self.settings)
            return leaf, (), cost
        return self._swarm.choose(tree, self._generator)


def _goals_of(goal: object) -> list[tuple[float, float]]:
    """One goal, or several, as a list of (x, y) [m].

    Raises:
        ValueError: there is none, or numbers that are none.
    """
    goals = np.atleast_2d(np.asarray(goal, dtype=np.float64))
    goals = door.array("Navigator", "goal", goals, (None, 2))
    if not len(goals):
        raise ValueError("Navigator.goal holds no goal; give (x, y), or a list of them")
    return [(float(x), float(y)) for x, y in goals]


def _told(error: Exception) -> str:
    """An error in one line."""
    return f"{type(error).__name__}: {error}".splitlines()[0][:300]
