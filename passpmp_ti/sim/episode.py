"""One drive through a scenario, and what became of it."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings
from passpmp_ti.sim.contacts import WALL, Contact
from passpmp_ti.sim.drive import Drive
from passpmp_ti.sim.scenario import Scenario, load_scenario
from passpmp_ti.sim.world import World
from passpmp_ti.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True, eq=False)
class CycleInfo:
    """What a watcher of `simulate` is shown once a cycle, after the planner has answered."""

    time: float
    """t_k, absolute [s]."""
    world: World
    navigator: Any
    state: np.ndarray
    """[5] the robot's state at t_k."""
    scans: Sequence[Scan]
    contacts: Sequence[Contact]
    """Every contact so far."""
    executing: Trajectory
    """What the robot follows until the next cycle."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Episode:
    """Everything that happened."""

    scenario: Scenario
    settings: Settings
    seed: int
    world: World
    start_time: float
    """[s]."""
    reached_at: float | None
    """When the last goal was reached [s]; None: it was not."""
    times: np.ndarray
    """[n] [s]."""
    states: np.ndarray
    """[n, 5] the robot's states then."""
    distance: float
    """Driven [m]."""
    time_moving: float
    """[s]."""
    contacts: tuple[Contact, ...]
    nearest_mover: float
    """Least gap to a mover while the robot moved [m]; inf: nobody or no motion."""
    nearest_wall: float
    """Least gap to something fixed while the robot moved [m]."""
    records: tuple[CycleRecord, ...]
    """One per cycle, without the pictures' models and trees."""
    update_times: np.ndarray
    """[cycles] wall clock time of each planning cycle, scan to trajectory [s]."""
    interrupted: bool = False
    """Ended by Ctrl-C, before the goal and before its time."""

    def summary(self) -> dict[str, Any]:
        """The episode in numbers, SI units; None where there is nothing to tell.

        Speeds, distances and contacts are the truth's, not the planner's belief. Contacts count
        once from touch to release; they count as moving if the robot moved at any moment of them.
        Cycle times leave out the first cycle, in which kernels may be compiled: it has its own.
        """
        moving = [c for c in self.contacts if c.moving]
        rest = [c for c in self.contacts if not c.moving]
        end = self.times[-1] if self.reached_at is None else self.reached_at
        duration = float(end - self.start_time)
        warm = self.update_times[1:] if len(self.update_times) > 1 else self.update_times
        bound = self.settings.object_speed
        return {
            "scenario": self.scenario.name,
            "mode": self.settings.mode,
            "seed": self.seed,
            "object_speed": bound,
            "cycle": self.settings.cycle,
            "reached_goal": self.reached_at is not None,
            "time_to_goal": None if self.reached_at is None else duration,
            "duration": duration,
            "collisions_moving": len(moving),
            "collisions_at_rest": len(rest),
            "collisions_fixed": sum(c.mover == WALL for c in self.contacts),
            "collisions_moving_beyond_bound": sum(c.mover_top_speed > bound for c in moving),
            "distance_driven": self.distance,
            "mean_speed": self.distance / duration if duration > 0 else 0.0,
            "mean_speed_under_way": self.distance / self.time_moving if self.time_moving else 0.0,
            "share_moving": self.time_moving / duration if duration > 0 else 0.0,
            "nearest_approach_moving": _told(self.nearest_mover),
            "nearest_fixed_moving": _told(self.nearest_wall),
            "cycles": len(self.records),
            "cycle_time_median": float(np.median(warm)),
            "cycle_time_p99": float(np.quantile(warm, 0.99)),
            "cycle_time_worst": float(warm.max()),
            "cycle_time_first": float(self.update_times[0]),
            "roots_unproved": sum(not r.root_proved for r in self.records),
            "held_unclear": sum(not r.held_clear for r in self.records),
            "broken_premises": sum(len(r.broken_premises) > 0 for r in self.records),
            "interrupted": self.interrupted,
            "lost_scans": sum(bool(r.lost_scan) for r in self.records),
        }

    def arrays(self) -> dict[str, np.ndarray]:
        """What happened as arrays, for `numpy.savez`; all times absolute [s]."""
        movers = self.world.movers
        present = np.array([movers.present(t) for t in self.times])
        positions = movers.positions(self.times)
        positions = np.where(present[:, :, None], positions, np.nan).astype(np.float32)
        fields = (
            "mover",
            "start",
            "end",
            "moving",
            "moving_at_start",
            "robot_speed",
            "mover_speed",
            "mover_top_speed",
        )
        told = (
            "stamp",
            "cost",
            "cost_new",
            "cost_held",
            "plan_time",
            "decision_time",
            "tree_nodes",
            "tree_depth",
            "root_proved",
            "held_clear",
            "deviation",
        )
        timings = sorted({key for r in self.records for key in r.timings})
        return {
            "times": self.times,
            "states": self.states,
            "mover_positions": positions,
            "mover_radius": movers.radius,
            "outline": self.world.outline,
            "goals": np.array(self.scenario.goals),
            **{f"contact_{k}": np.array([getattr(c, k) for c in self.contacts]) for k in fields},
            **{f"cycle_{k}": np.array([getattr(r, k) for r in self.records]) for k in told},
            **{
                f"seconds_{key}": np.array([r.timings.get(key, np.nan) for r in self.records])
                for key in timings
            },
            "cycle_decision": np.array([r.decision for r in self.records]),
            "cycle_broken_premises": np.array([len(r.broken_premises) for r in self.records]),
            "seconds_update": self.update_times,
        }

    def save(self, path: str | Path) -> None:
        """Write `arrays` to a compressed .npz file."""
        np.savez_compressed(path, **self.arrays())  # type: ignore[arg-type]


def simulate(
    scenario: Scenario | str | Path,
    mode: str | None = None,
    seed: int = 0,
    *,
    settings: Settings | Mapping[str, Any] | None = None,
    on_cycle: Callable[[CycleInfo], None] | None = None,
    planner: Callable[..., Any] | None = None,
) -> Episode:
    """Drive once through a scenario.

    Each cycle: scan at t_k, let the planner answer, meanwhile execute until t_{k+1} what was held
    before. Ends where the planner says the last goal is reached, or with the scenario's duration,
    or early by Ctrl-C with what was done so far.

    Args:
        scenario: a scenario, a shipped name, or the path of a YAML file.
        mode: safety mode; None: the scenario's.
        seed: chooses the movers (or the time at which a recording is entered), the range
            finders' errors and the planner's random numbers.
        settings: all of them, or some to change.
        on_cycle: called once a cycle.
        planner: makes what is driven; called like `Navigator` (the default) and with its door.

    Raises:
        ValueError: an unknown scenario or setting, or a world that cannot be built.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    chosen = (
        settings
        if isinstance(settings, Settings)
        else scenario.settings.changed(**(settings or {}))
    )
    if mode is not None:
        chosen = chosen.changed(mode=mode)
    if planner is None:
        from passpmp_ti.planner.navigator import Navigator

        planner = Navigator
    world, state, start_time = scenario.build(seed)
    navigator = planner(
        scenario.robot, chosen, goal=scenario.goals, static_map=scenario.static_map, seed=seed
    )
    drive = Drive(scenario, world, state, start_time)
    errors = np.random.default_rng([seed, 1])
    reached_at, interrupted = None, False
    try:
        for k in range(math.ceil(scenario.duration / chosen.cycle)):
            stamp = start_time + k * chosen.cycle
            answer = _cycle(scenario, world, navigator, drive, stamp, errors, on_cycle)
            if navigator.reached:
                reached_at = stamp
                break
            drive.go_on(stamp, stamp + chosen.cycle)
            drive.executing = answer
    except KeyboardInterrupt:
        # what was done so far is worth telling; before the first cycle there is nothing
        if not drive.records:
            raise
        interrupted = True
    return episode_of(drive, chosen, seed, reached_at, interrupted)


def episode_of(
    drive: Drive,
    settings: Settings,
    seed: int,
    reached_at: float | None = None,
    interrupted: bool = False,
) -> Episode:
    """What a drive came to so far; see `Episode` for the rest."""
    return Episode(
        scenario=drive.scenario,
        settings=settings,
        seed=seed,
        world=drive.world,
        start_time=drive.start_time,
        reached_at=reached_at,
        times=np.concatenate(drive.times),
        states=np.concatenate(drive.states),
        distance=drive.distance,
        time_moving=drive.time_moving,
        contacts=tuple(drive.judge.contacts),
        nearest_mover=drive.judge.nearest_mover,
        nearest_wall=drive.judge.nearest_wall,
        records=tuple(drive.records),
        update_times=np.array(drive.update_times),
        interrupted=interrupted,
    )


def _cycle(
    scenario: Scenario,
    world: World,
    navigator: Any,
    drive: Drive,
    stamp: float,
    errors: np.random.Generator,
    on_cycle: Callable[[CycleInfo], None] | None,
) -> Trajectory:
    """Scan at `stamp`, let the planner answer, show the watcher; returns the answer."""
    state = drive.state_at(stamp)
    scans = [lidar.scan(world, state, stamp, errors) for lidar in scenario.lidars]
    began = clock.perf_counter()
    answer = navigator.update(scans, state)
    drive.note(navigator.record, clock.perf_counter() - began)
    if on_cycle is not None:
        on_cycle(
            CycleInfo(
                time=stamp,
                world=world,
                navigator=navigator,
                state=state,
                scans=scans,
                contacts=drive.judge.contacts,
                executing=drive.executing,
            )
        )
    return answer


def _told(gap: float) -> float | None:
    """A gap for a summary: None where nothing was ever near."""
    return float(gap) if math.isfinite(gap) else None
