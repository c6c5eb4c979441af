"""Plans on recorded scans: what would the planner have done where a recorded robot was?

The robot goes where it went. In each cycle the planner is told that it follows what was recorded
until the cycle's end, and brakes from there; it answers with a plan of its own, which nobody
follows. So each cycle judges two things: whether the recorded motion, braked, was free of all that
could have come, and whether there was a plan.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hardware.bags_recording import Instant, Way
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.sim.contacts import Contact
from passpmp_ti.sim.world import World
from passpmp_ti.trajectory import Trajectory
from passpmp_ti.viz.region import braking_ics

AHEAD = 8.0
"""It drives to where the recorded robot was so much later [s] ..."""
RENEWED = 4.0
"""... and looks for that anew this often [s]."""
REGION, STATES = 4.0, 10_000
"""Half the side of the square whose p-safe share is told [m], and states that are checked in it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cycle:
    """A cycle, as pictures and progress take it: like `CycleInfo` of the simulator."""

    time: float
    world: World
    """The returns of this cycle as lines; nobody knows more of a recorded world."""
    navigator: Navigator
    state: np.ndarray
    scans: tuple[Scan, ...]
    executing: Trajectory
    """The recorded motion until the cycle's end, and braking from there."""
    contacts: tuple[Contact, ...] = ()
    share: float = math.nan
    """P-safe share of what is seen about the robot, for its heading and speed."""


@dataclass(kw_only=True)
class Replayed:
    """What it came to."""

    recorded: float = 0.0
    """Seconds of the recording that were replayed."""
    distance: float = 0.0
    """The recorded robot's way [m]."""
    records: list[CycleRecord] = field(default_factory=list)
    shares: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    """Wall clock time of each cycle, scan to trajectory [s]."""
    moving: list[bool] = field(default_factory=list)
    interrupted: bool = False

    def summary(self) -> dict[str, Any]:
        """In numbers, SI units; None where there is nothing to tell."""
        n = len(self.records)
        # the first cycle compiles kernels
        warm = np.array(self.seconds[1:] or self.seconds or [math.nan])
        moving = np.array(self.moving, dtype=bool)
        clear = np.array([r.held_clear for r in self.records], dtype=bool)
        kinds = Counter(r.decision for r in self.records)
        return {
            "recorded": self.recorded, "distance": self.distance, "cycles": n,
            "share_plan": _share([r.decision == "new" for r in self.records]),
            "share_rest": _share([r.decision in ("held", "brake") for r in self.records]),
            "decisions": dict(sorted(kinds.items())),
            "share_moving": _share(moving),
            "recorded_motion_clear": _share(clear[moving]) if n else None,
            "safe_share": _middle(self.shares),
            "safe_share_moving": _middle(np.array(self.shares)[moving]) if n else None,
            "broken_premises": sum(len(r.broken_premises) > 0 for r in self.records),
            "lost_scans": sum(bool(r.lost_scan) for r in self.records),
            "faults": sum(bool(r.fault) for r in self.records),
            "tree_nodes": _middle([r.tree_nodes for r in self.records]),
            "cycle_time_median": float(np.median(warm)),
            "cycle_time_p99": float(np.quantile(warm, 0.99)),
            "interrupted": self.interrupted,
        }  # fmt: skip


def replay(
    instants: Iterable[Instant],
    way: Way,
    robot: DifferentialDrive,
    settings: Settings,
    *,
    goal: tuple[float, float] | None = None,
    static_map: StaticMap | None = None,
    seconds: float = math.inf,
    seed: int = 0,
    see: Callable[[Cycle], None] | None = None,
) -> Replayed:
    """Plan once a cycle on what was recorded.

    Args:
        instants: what was seen.
        way: where the robot was.
        robot: as it is planned for; no slower than it was.
        settings: of the planner.
        goal: (x, y) [m]; None: where the recorded robot was a while later.
        static_map: what stays, in the frame of the poses.
        seconds: of the recording, at most.
        seed: of everything random.
        see: is shown each cycle.

    Raises:
        ValueError: the recorded robot was faster than `robot`.
    """
    if way.fastest > robot.wheel_speed:
        raise ValueError(
            f"replay: the recorded robot's wheels went up to {way.fastest:.2f} m/s, and"
            f" robot.wheel_speed = {robot.wheel_speed:g} m/s: it could not have followed; raise"
            " that, or leave it out"
        )
    navigator = Navigator(
        robot, settings, goal=goal or (0.0, 0.0), static_map=static_map, seed=seed
    )
    found = Replayed()
    bounds = _bounds(way, seconds)
    due = aimed = -math.inf
    begin, last = None, None
    try:
        for instant in instants:
            stamp = instant.stamp
            begin = stamp if begin is None else begin
            if stamp - begin > seconds:
                break
            if stamp < due:
                continue
            followed = recorded_motion(way, stamp, robot, settings)
            if followed is None:
                continue
            # a scan that comes a little early is waited for once, not every time
            due = max(due + settings.cycle, stamp)
            state = followed.states[0]
            if goal is None and stamp >= aimed:
                aimed = stamp + RENEWED
                later = int(np.searchsorted(way.times, stamp + AHEAD))
                x, y = (float(v) for v in way.states[min(later, len(way.times) - 1), :2])
                navigator.head_for((x, y))
            began = time.perf_counter()
            if navigator.held is None:
                # a first cycle begins at rest
                navigator.update(instant.scans, np.array([*state[:3], 0.0, 0.0]))
            else:
                navigator.update(instant.scans, state, following=followed)
            found.seconds.append(time.perf_counter() - began)
            record = navigator.record
            share = _safe_share(record, state, stamp + settings.cycle)
            found.shares.append(share)
            found.moving.append(not bool(robot.at_rest(state)))
            found.recorded = stamp - begin
            if last is not None:
                found.distance += math.dist(last[:2], state[:2])
            last = state
            if see is not None:
                see(
                    Cycle(
                        time=stamp, world=_world(instant.scans, bounds, settings),
                        navigator=navigator, state=state, scans=instant.scans, executing=followed,
                        share=share,
                    )
                )  # fmt: skip
            found.records.append(_light(record))
    except KeyboardInterrupt:
        if not found.records:
            raise
        found.interrupted = True
    return found


def recorded_motion(
    way: Way, stamp: float, robot: DifferentialDrive, settings: Settings
) -> Trajectory | None:
    """What was recorded from a time until a cycle later, and then braking on the circle that it is
    on; None where that is not known.

    Args:
        way: where the robot was.
        stamp: [s].
        robot: brakes.
        settings: cycle and time step.
    """
    step = settings.time_step
    times = [stamp + k * step for k in range(settings.steps_of(settings.cycle) + 1)]
    found = [way.at(t) for t in times]
    if any(state is None for state in found):
        return None
    states = [state for state in found if state is not None]
    state = states[-1]
    brakes_from = len(states) - 1
    while not robot.at_rest(state):
        state = _braked(state, step, robot)
        states.append(state)
        times.append(times[-1] + step)
    return Trajectory(np.array(times), np.array(states), brakes_from)


def _braked(state: np.ndarray, step: float, robot: DifferentialDrive) -> np.ndarray:
    """A step later, if both wheels are braked in proportion."""
    x, y, theta, right, left = (float(v) for v in state)
    fastest = max(abs(right), abs(left))
    kept = max(0.0, 1.0 - robot.acceleration * step / fastest) if fastest > 0 else 0.0
    mean = 0.5 * (1.0 + kept)
    turn = mean * (right - left) / robot.track * step
    way = mean * 0.5 * (right + left) * step
    middle = theta + 0.5 * turn
    return np.array(
        [x + way * math.cos(middle), y + way * math.sin(middle), theta + turn, kept * right,
         kept * left]
    )  # fmt: skip


def _safe_share(record: CycleRecord, state: np.ndarray, when: float) -> float:
    model = record.model
    if model is None:
        return math.nan
    x, y, heading = (float(v) for v in state[:3])
    speed = float(model.robot.speed(state))
    square = (x - REGION, y - REGION, x + REGION, y + REGION)
    region = braking_ics(model, square, heading, speed, when, STATES)
    return region.share(region.seen)


def _world(
    scans: tuple[Scan, ...], bounds: tuple[float, float, float, float], settings: Settings
) -> World:
    """Returns as lines: neighbours nearer than an object is wide are one surface, as in the
    planner; a return alone is a dash."""
    walls = []
    for scan in scans:
        hit = scan.returned
        r, a = np.where(hit, scan.ranges, 0.0), scan.bearings
        points = np.array(scan.pose[:2]) + np.stack([r * np.cos(a), r * np.sin(a)], axis=1)
        joined = hit[:-1] & hit[1:]
        joined &= np.hypot(*(points[1:] - points[:-1]).T) < settings.object_width
        walls.append(np.concatenate([points[:-1][joined], points[1:][joined]], axis=1))
        alone = hit.copy()
        alone[:-1] &= ~joined
        alone[1:] &= ~joined
        walls.append(np.concatenate([points[alone] - 0.02, points[alone] + 0.02], axis=1))
    return World(bounds, (), np.concatenate(walls))


def _bounds(way: Way, seconds: float) -> tuple[float, float, float, float]:
    """What pictures show: the way, and some metres about it."""
    shown = way.states[way.times <= way.times[0] + seconds, :2]
    low, high = shown.min(axis=0) - 5.0, shown.max(axis=0) + 5.0
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _light(record: CycleRecord) -> CycleRecord:
    """Without what only its own picture needs."""
    return replace(record, model=None, tree=None, particle_leaves=(), chosen=None)


def _share(flags: Any) -> float | None:
    flags = np.asarray(flags, dtype=bool)
    return float(flags.mean()) if len(flags) else None


def _middle(values: Any) -> float | None:
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) else None
