"""What one planning cycle saw and decided."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from passpmp_ti.grid.model import FutureModel
    from passpmp_ti.planner.tree import Tree
    from passpmp_ti.trajectory import Trajectory


class Later:
    """A number in a frozen dataclass that may be given as the way to work it out, which is gone
    once, when somebody asks for the number."""

    def __init__(self, default: float) -> None:
        self._default = default

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, record: object | None, owner: type) -> float:
        if record is None:
            return self._default
        value = self.unasked(record)
        if callable(value):
            value = vars(record)[self._name] = value()
        return value

    def __set__(self, record: object, value: float | Callable[[], float]) -> None:
        vars(record)[self._name] = value

    def unasked(self, record: object) -> float | Callable[[], float]:
        """What was given, or the number where somebody asked already."""
        given: float | Callable[[], float] = vars(record)[self._name]
        return given


@dataclass(frozen=True, kw_only=True)
class CycleRecord:
    """One cycle of `Navigator`, for logs, pictures and judges."""

    stamp: float
    """t_k [s]."""
    decision: str
    """"new": a plan of this cycle's tree; "held": the remainder of the plan held; "brake": braking
    at once, after a broken premise, off its plan, or where a track made what is held too risky and
    nothing better was found; "arrived": at rest at the last goal."""
    reason: str = ""
    """Why the plan is not a new one; empty where it is."""
    timings: dict[str, float] = field(default_factory=dict)
    """Seconds spent: "model", "guide", "tree", "choice", "bookkeeping", "total"."""
    time_left: float = float("inf")
    """Wall clock time between the answer and `Settings.deadline` [s]; negative: it came late; inf:
    there is no deadline."""
    tree_nodes: int = 0
    tree_depth: int = 0
    tree_stopped_by: str = ""
    """"depth", "capacity", "time" or "unsafe" (no node left that could be grown)."""
    cost: float = float("inf")
    """Objective of what was chosen (eq. 5)."""
    cost_new: float = float("inf")
    """Objective of the best plan of this cycle's tree."""
    cost_held: float = float("inf")
    """Objective of the remainder of the held plan."""
    plan_time: float = 0.0
    """Duration of the chosen trajectory, to rest [s]."""
    decision_time: Later = Later(math.inf)
    """delta_d of eq. 20 [s]: from t_k until the held motion, kept on, could no longer be braked.
    Worked out when it is first asked for, or a copy made: no cycle waits for it."""
    risk: float = 0.0
    """Promised: greatest chance that the chosen trajectory, followed to rest, touches something
    while the robot moves. 0 in conservative mode; "hybrid": that some tracked mover is not where it
    should be; "probabilistic": by eqs. 11 and 12, see docs/risk.md."""
    held_risk: float = 0.0
    """The same of what was held, as this cycle sees it."""
    root_proved: bool = True
    """Whether a fresh check of s_{k+1} finds a braking control that proves it. In the middle of a
    primitive none needs to: what is held ends at rest another way, see `held_clear`."""
    held_clear: bool = True
    """Whether what was held, judged by this cycle's model at its own sample times, is still free
    to its end: the certificate. In conservative mode only a broken premise may make it False; in
    the others a track that turns out differently may as well. True where it was not asked: without
    a scan, or off the plan, where memory's coordinates mean nothing."""
    broken_premises: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    """[n, 2] places [m] where a return stood in space proven free."""
    lost_scan: str = ""
    """Why the scan was not used; empty where it was."""
    fault: str = ""
    """What the planner itself raised in this cycle, type and message; empty where nothing was."""
    not_taken: bool = False
    """The executor told that it follows something else than the last answer."""
    forgot: str = ""
    """Why this cycle's model knows nothing of the ones before; empty where it does, and in the
    first cycle."""
    deviation: float = 0.0
    """Distance between the robot and its plan at t_k [m]."""
    turn_deviation: float = 0.0
    """Angle between the robot's heading and its plan's at t_k [rad]."""
    stalled: bool = False
    """The robot stood about one place for longer than `Settings.patience`, and that place still
    costs more: it backs out, or comes from elsewhere."""
    goal: tuple[float, float] = (0.0, 0.0)
    """The goal that this cycle drove to [m]."""

    # what pictures are made of; None where nothing was planned
    model: FutureModel | None = None
    tree: Tree | None = None
    particle_leaves: tuple[int, ...] = ()
    """Distinct nodes of the tree at which the particles' plans end."""
    chosen: Trajectory | None = None

    def ended(self, timings: dict[str, float], time_left: float) -> CycleRecord:
        """The same with what the clock said at the end of the cycle; nothing else is worked out."""
        unasked = vars(type(self))["decision_time"].unasked(self)
        return replace(self, timings=timings, time_left=time_left, decision_time=unasked)

    def __getstate__(self) -> dict[str, object]:
        # what is packed is the number, not the way to it
        return {**vars(self), "decision_time": self.decision_time}

    @property
    def particles(self) -> tuple[np.ndarray, ...]:
        """Each distinct particle's plan: [m, 2] points [m]."""
        if self.tree is None:
            return ()
        return tuple(self.tree.path(leaf) for leaf in self.particle_leaves)
