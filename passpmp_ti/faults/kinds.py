"""Every kind of fault: what a cycle is told instead of the truth, and what breaks inside it."""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any
from unittest import mock

import numpy as np

from passpmp_ti.faults.executor import Frame
from passpmp_ti.planner import navigator as cycle_module
from passpmp_ti.scan import Scan
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.world import World


@dataclass(kw_only=True)
class Senses:
    """The sensors of one robot at one moment, and what they said in the cycles before."""

    world: World
    lidars: Sequence[Lidar]
    errors: np.random.Generator
    cycle: float
    where: Callable[[float], np.ndarray]
    """The true state [5] at a time [s], now or before."""
    now: float = 0.0
    """[s] true time."""
    said: deque[Told] = field(default_factory=lambda: deque(maxlen=12))
    """What the last cycles were told, the newest last."""

    def told(
        self, frame: Frame, *, at: float | None = None, lidars: Sequence[Lidar] | None = None
    ) -> Told:
        """What is told of the moment `at` [s] (None: now) in a frame, maybe by other sensors."""
        time = self.now if at is None else at
        state = self.where(time)
        scans = [
            lidar.scan(self.world, state, time, self.errors) for lidar in lidars or self.lidars
        ]
        return Told(
            scans=[moved(scan, frame) for scan in scans], state=frame.told(state), frame=frame
        )


@dataclass(frozen=True, kw_only=True)
class Told:
    """What `Navigator.update` is called with, and how its call goes."""

    scans: Any
    state: Any
    frame: Frame
    late: float = 0.0
    """How long after t_k the answer comes [s]."""
    breaks: str = ""
    """What raises inside the planner; empty: nothing."""
    overruns: bool = False
    """The planner finds that its deadline is over."""


@dataclass
class Burst:
    """One fault over some cycles."""

    kind: str
    left: int
    """Cycles to come."""
    frame: Frame
    """What poses and stamps are off by already, before this fault."""
    memory: dict[str, Any] = field(default_factory=dict)
    """What was drawn for all of its cycles."""

    def drawn(self, name: str, draw: Callable[[], Any]) -> Any:
        """A value that is drawn once."""
        if name not in self.memory:
            self.memory[name] = draw()
        return self.memory[name]


Distort = Callable[[Senses, Burst, np.random.Generator], Told]


def moved(scan: Scan, frame: Frame) -> Scan:
    """A scan as it is told in a frame."""
    if frame == Frame():
        return scan
    pose = frame.told(np.array(scan.pose))
    return replace(scan, pose=(pose[0], pose[1], pose[2]), stamp=scan.stamp + frame.shift)


def _with_ranges(told: Told, change: Callable[[Scan], np.ndarray]) -> Told:
    return replace(told, scans=[replace(scan, ranges=change(scan)) for scan in told.scans])


def lost(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    nothing: list[Any] = [[], None, ()]
    return replace(senses.told(burst.frame), scans=nothing[int(rng.integers(3))])


def no_scan_type(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    rubbish: list[Any] = [3, "scan", [None], [np.zeros(9)], object()]
    return replace(senses.told(burst.frame), scans=rubbish[int(rng.integers(len(rubbish)))])


def late(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    lag = float(rng.uniform(0.2, 2.5)) * senses.cycle
    return senses.told(burst.frame, at=senses.now - lag)


def repeated(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    if not senses.said:
        return senses.told(burst.frame)
    state = senses.told(burst.frame).state
    return replace(senses.said[-1], state=state, frame=burst.frame)


def out_of_order(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    if len(senses.said) < 2:
        return senses.told(burst.frame)
    old = senses.said[-int(rng.integers(2, len(senses.said) + 1))]
    state = old.state if rng.uniform() < 0.5 else senses.told(burst.frame).state
    return replace(old, state=state, frame=burst.frame)


def apart(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    told = senses.told(burst.frame)
    first = told.scans[0]
    other = replace(first, stamp=first.stamp - float(rng.uniform(0.01, 1.0)))
    return replace(told, scans=[*told.scans, other])


def all_nan(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    return _with_ranges(senses.told(burst.frame), lambda s: np.full(len(s.ranges), np.nan))


def all_zero(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    value = float(rng.choice([0.0, -1.0, -np.inf]))
    return _with_ranges(senses.told(burst.frame), lambda s: np.full(len(s.ranges), value))


def some_lost(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    share = float(rng.uniform(0.05, 0.95))
    return _with_ranges(
        senses.told(burst.frame),
        lambda s: np.where(rng.uniform(size=len(s.ranges)) < share, np.nan, s.ranges),
    )


def beyond_range(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    """Where there is no echo, numbers that no echo can have."""

    def change(scan: Scan) -> np.ndarray:
        odd = rng.choice([1e9, np.inf, 1e300, 1.5 * scan.range_max], len(scan.ranges))
        return np.where(scan.returned | scan.lost, scan.ranges, odd)

    return _with_ranges(senses.told(burst.frame), change)


def no_echo(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    """Every beam beyond the range, whatever is there: a sensor that has gone blind and lies."""
    value = burst.drawn("value", lambda: float(rng.choice([1e9, np.inf, 1e5])))
    return _with_ranges(senses.told(burst.frame), lambda s: np.full(len(s.ranges), value))


def beam_count(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    def other(lidar: Lidar) -> Lidar:
        count = rng.choice([2, 3, lidar.beams // 3, lidar.beams // 2, lidar.beams + 7, 500])
        return replace(lidar, beams=max(int(count), 2))

    return senses.told(burst.frame, lidars=[other(lidar) for lidar in senses.lidars])


def field_of_view(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    def other(lidar: Lidar) -> Lidar:
        return replace(
            lidar,
            field_of_view=float(rng.uniform(0.1, 2 * math.pi)),
            range_max=lidar.range_max * float(rng.uniform(0.3, 1.5)),
        )

    return senses.told(burst.frame, lidars=[other(lidar) for lidar in senses.lidars])


def pose_jump(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    """Localisation jumps: sensors and robot together, about where the robot is."""

    def draw() -> Frame:
        here = burst.frame.told(senses.where(senses.now))
        turn = float(rng.uniform(-math.pi, math.pi)) if rng.uniform() < 0.5 else 0.0
        far, way = float(rng.uniform(0.3, 8.0)), float(rng.uniform(-math.pi, math.pi))
        c, s = math.cos(turn), math.sin(turn)
        # turned about the robot, then moved; after what the frame was off by already
        x = here[0] - c * here[0] + s * here[1] + far * math.cos(way)
        y = here[1] - s * here[0] - c * here[1] + far * math.sin(way)
        old = burst.frame
        return Frame(
            c * old.x - s * old.y + x, s * old.x + c * old.y + y, old.turn + turn, old.shift
        )

    return senses.told(burst.drawn("frame", draw))


def scan_pose_jump(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    told = senses.told(burst.frame)
    other = pose_jump(senses, burst, rng)
    return replace(told, scans=other.scans)


def state_jump(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    told = senses.told(burst.frame)
    other = pose_jump(senses, burst, rng)
    return replace(told, state=other.state)


def no_state(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    told = senses.told(burst.frame)
    bad = np.array(told.state)
    bad[int(rng.integers(5))] = rng.choice([np.nan, np.inf, -np.inf, 1e300, 1e7])
    rubbish: list[Any] = [bad, bad, None, "state", np.zeros(3), [[0.0] * 5]]
    return replace(told, state=rubbish[int(rng.integers(len(rubbish)))])


def _clock(senses: Senses, burst: Burst, jump: Callable[[], float]) -> Told:
    by = burst.drawn("by", jump)
    return senses.told(replace(burst.frame, shift=burst.frame.shift + by))


def clock_back(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    return _clock(senses, burst, lambda: -_jump(rng))


def clock_forward(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    return _clock(senses, burst, lambda: _jump(rng))


def mad_stamp(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    told = senses.told(burst.frame)
    stamp = float(rng.choice([1e300, -1e300, 1e15, -1e12, 4.3e9]))
    return replace(told, scans=[replace(scan, stamp=stamp) for scan in told.scans])


def _jump(rng: np.random.Generator) -> float:
    """From less than a second to an hour [s]."""
    return float(10 ** rng.uniform(-0.5, 3.5))


def overrun(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    return replace(senses.told(burst.frame), overruns=True)


def late_answer(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
    return replace(senses.told(burst.frame), late=float(rng.uniform(1.0, 3.0)) * senses.cycle)


def raising(where: str) -> Distort:
    def fault(senses: Senses, burst: Burst, rng: np.random.Generator) -> Told:
        return replace(senses.told(burst.frame), breaks=where)

    return fault


INSIDE = {
    "model": ("FutureModel", "from_scan"),
    "guide": ("Guide", "field"),
    "tree": ("TreeGrower", "grow"),
    "choice": ("Navigator", "_choose"),
    "plan": (None, "trajectory_to"),
    "second check": (None, "still_clear"),
}
"""Where the planner can be made to raise: the class (None: the module) and the name."""

ERRORS = (RuntimeError, ValueError, MemoryError, ZeroDivisionError, IndexError, AssertionError)


@contextlib.contextmanager
def broken_inside(where: str, rng: np.random.Generator) -> Iterator[None]:
    """Let a part of the planner raise for one call; nothing breaks where `where` is empty."""
    if not where:
        yield
        return
    owner, name = INSIDE[where]
    target: Any = cycle_module if owner is None else getattr(cycle_module, owner)
    error = ERRORS[int(rng.integers(len(ERRORS)))]("put in by the fault harness")
    with mock.patch.object(target, name, side_effect=error):
        yield


KINDS: dict[str, Distort] = {
    "scan lost": lost,
    "no scan but rubbish": no_scan_type,
    "scan late": late,
    "scan repeated": repeated,
    "scans out of order": out_of_order,
    "scans of different instants": apart,
    "all nan": all_nan,
    "all zero": all_zero,
    "some beams lost": some_lost,
    "no echo, beyond the range": beyond_range,
    "blind: all beyond the range": no_echo,
    "beam count changes": beam_count,
    "field of view changes": field_of_view,
    "pose jumps": pose_jump,
    "scan's pose jumps": scan_pose_jump,
    "state jumps": state_jump,
    "no state": no_state,
    "clock jumps back": clock_back,
    "clock jumps forward": clock_forward,
    "stamp is mad": mad_stamp,
    "deadline overrun": overrun,
    "answer comes late": late_answer,
    **{f"raises: {where}": raising(where) for where in INSIDE},
}
"""Every kind by its name."""

STAYS = ("clock jumps back", "clock jumps forward")
"""Kinds that may stay for good: the clock goes on where it jumped to."""
