"""Premises broken on purpose: is it noticed in the cycle that first shows it, and braked for?"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from passpmp_ti import device
from passpmp_ti.faults.grounds import Ground
from passpmp_ti.faults.movers import SteppedMovers, places_for
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.kernels.arrival import NEVER
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.scan import Scan
from passpmp_ti.sim.drive import Drive
from passpmp_ti.sim.world import World

BORN, TOO_FAST, NOT_STATIC = "born inside", "faster than the bound", "declared static, moves"
PREMISES = (BORN, TOO_FAST, NOT_STATIC)
LONGEST = 160
"""Cycles of a trial at most."""
CROWD = 16
"""How many stand about, so that one is near."""
AFTER = 12
"""Cycles for which a broken premise is watched."""
FACTOR = (1.5, 4.0)
"""How many times faster than the bound somebody is."""


@dataclass
class Noticed:
    """What became of the premises of one kind."""

    trials: int = 0
    broken: int = 0
    """Trials in which a scan shows a return in space that memory had proven free."""
    in_time: int = 0
    """Of these, reported in the very cycle that first shows it beyond the comparison's margin."""
    late: int = 0
    missed: int = 0
    """Never reported, though it was shown beyond the margin."""
    shallow: int = 0
    """Trials whose returns never were deeper in free space than the margin: nobody can tell them
    from an error of range, pose or cell."""
    braked: int = 0
    """Reports that were answered by braking in the same cycle."""
    deferred: int = 0
    """Of these, braking that begins later on what was followed, since only from there it is proven,
    and before that the robot gets faster."""
    unanswered: int = 0
    """Reports that were not answered by braking."""
    false_alarms: int = 0
    """Reports before anything was broken."""
    shallow_cycles: int = 0
    """Cycles from the first return in free space to the first beyond the margin, in all."""
    contacts_moving: int = 0
    """Not promised to be none: the premise is broken."""
    contacts_at_rest: int = 0
    exceptions: int = 0
    cycles: int = 0
    distance: float = 0.0
    """[m]"""
    time_moving: float = 0.0
    """[s]"""

    def add(self, other: Noticed) -> None:
        """Count another one's counts too."""
        for entry in fields(self):
            setattr(self, entry.name, getattr(self, entry.name) + getattr(other, entry.name))

    @property
    def failures(self) -> int:
        """Everything that must not happen."""
        return self.late + self.missed + self.unanswered + self.false_alarms + self.exceptions

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def deepest_return(before: FutureModel, scans: list[Scan]) -> float:
    """How deep the deepest return stands in a disc that memory proved free until now [m].

    Apart from the kernels: for each return, every cell of the model before within a disc's radius,
    of which the model says that a disc centred there cannot be touched yet. The depth is the radius
    less the distance to its centre; < 0: no return stands in one.
    """
    points = np.concatenate([scan.points() for scan in scans])
    if not len(points):
        return -math.inf
    radius, cell = before.robot.disc_radius, before.cell
    now = math.floor(scans[0].stamp * 1000 + 1e-3) - before.base_ticks
    ticks = device.host(before.ticks).astype(np.int64)
    later = (ticks > now + 2) | (ticks == NEVER)
    span = math.ceil(radius / cell) + 1
    offsets = np.arange(-span, span + 1)
    at = np.floor((points - np.array(before.origin)) / cell).astype(int)
    i = at[:, 0, None, None] + offsets[None, None, :]
    j = at[:, 1, None, None] + offsets[None, :, None]
    size = before.window.size
    inside = (i >= 0) & (j >= 0) & (i < size) & (j < size)
    free = inside & later[np.clip(j, 0, size - 1), np.clip(i, 0, size - 1)]
    x = before.origin[0] + (i + 0.5) * cell - points[:, 0, None, None]
    y = before.origin[1] + (j + 0.5) * cell - points[:, 1, None, None]
    depth = np.where(free, radius - np.hypot(x, y), -np.inf)
    return float(depth.max())


def comparison_margin(before: FutureModel) -> float:
    """What a return must be deeper than to be told from errors [m]."""
    settings = before.settings
    return settings.range_noise + 2 * settings.localisation_error + before.cell


class PremiseTrial:
    """One drive in which somebody breaks a premise in front of the robot."""

    def __init__(
        self,
        ground: Ground,
        premise: str,
        seed: int,
        planner: Callable[..., Any] = Navigator,
    ) -> None:
        """Prepare a trial; `planner` is called like `Navigator`, and with its door."""
        scenario = ground.load()
        self.premise, self._rng = premise, np.random.default_rng([seed, 11])
        world, state, time = scenario.build(seed % 1000)
        still = scenario.still_world()
        count = 1 if premise == BORN else CROWD
        # what steps out from behind a small thing is allowed for, and hides that the thing moves
        size = ground.hunter_radius * (3.0 if premise == NOT_STATIC else 1.0)
        radius = np.full(count, size)
        away = (state[:2], 0.3 * ground.keep_out + size)
        places = places_for(still, count, 1.2 * size, away, self._rng)
        self._intruders = SteppedMovers(places, radius, FACTOR[1] * ground.object_speed, time)
        if premise == BORN:
            self._intruders.born[:] = np.inf
        self._world = World(world.bounds, world.polygons, world.segments, self._intruders)
        self._robot, self._cycle, self._lidars = (
            scenario.robot, scenario.settings.cycle, scenario.lidars,
        )  # fmt: skip
        self._bound, self._near = ground.object_speed, 0.6 * ground.range_max
        self._still = still
        self._navigator = planner(
            self._robot, scenario.settings, goal=scenario.goals, static_map=scenario.static_map,
            seed=seed,
        )  # fmt: skip
        self._errors = np.random.default_rng([seed, 1])
        self._drive = Drive(scenario, self._world, state, time)
        self._time = time
        self._chosen: int | None = None
        self._speed = np.zeros(2)
        self.found = Noticed(trials=1)

    def run(self) -> Noticed:
        """Drive until the premise is broken and answered, or nothing comes of it."""
        found = self.found
        first_shown: int | None = None
        deep_at: int | None = None
        noticed_at: int | None = None
        begun: int | None = None
        wait = int(self._rng.integers(8, 40))
        for k in range(LONGEST):
            state = self._drive.state_at(self._time)
            moving = not bool(self._robot.at_rest(state))
            if begun is None and k >= wait and moving and self._begin(state):
                begun = k
            before = self._navigator.model
            scans = self._scans(state)
            depth = -math.inf if before is None else deepest_return(before, scans)
            answer = self._answer(scans, state)
            record = self._navigator.record
            if before is not None and depth > 0 and first_shown is None:
                first_shown = k
            if before is not None and depth > comparison_margin(before) and deep_at is None:
                deep_at = k
            if len(record.broken_premises) and noticed_at is None:
                noticed_at = k
                found.false_alarms += begun is None
                found.braked += record.decision == "brake"
                found.unanswered += record.decision != "brake"
                found.deferred += _speeds_up(answer, self._robot)
            self._go_on(answer)
            if begun is not None and k - begun >= AFTER:
                break
            if noticed_at is not None and k - noticed_at >= AFTER:
                break
        self._judge(first_shown, deep_at, noticed_at)
        return found

    def _judge(self, shown: int | None, deep: int | None, noticed: int | None) -> None:
        found = self.found
        found.broken += shown is not None
        if deep is not None and shown is not None:
            found.shallow_cycles += deep - shown
        if deep is None:
            found.shallow += shown is not None and noticed is None
        elif noticed is None:
            found.missed += 1
        elif noticed > deep:
            found.late += 1
        if noticed is not None and (deep is None or noticed <= deep):
            found.in_time += 1
        for contact in self._drive.judge.contacts:
            found.contacts_moving += contact.moving
            found.contacts_at_rest += not contact.moving
        found.distance += self._drive.distance
        found.time_moving += self._drive.time_moving

    def _begin(self, state: np.ndarray) -> bool:
        """Break the premise now, if somebody is in the right place for it."""
        here, movers = state[:2], self._intruders
        if self.premise == BORN:
            far = float(self._rng.uniform(0.3, 1.0)) * self._near
            way = float(state[2] + self._rng.uniform(-0.8, 0.8))
            place = here + far * np.array([math.cos(way), math.sin(way)])
            clear = float(self._still.clearance(place[None])[0])
            if clear < movers.radius[0] or far < self._robot.radius + movers.radius[0]:
                return False
            movers.put(place[None])
            movers.born[:] = self._time
            self._chosen = 0
            return True
        apart = np.hypot(*(movers.now - here).T)
        nearest = int(np.argmin(apart))
        if apart[nearest] > self._near:
            return False
        target = here + 0.5 * self._robot.speed(state) * np.array(
            [math.cos(state[2]), math.sin(state[2])]
        )
        towards = (target - movers.now[nearest]) / max(float(apart[nearest]), 1e-6)
        fastest = self._bound * (
            float(self._rng.uniform(*FACTOR)) if self.premise == TOO_FAST else 1.0
        )
        self._speed = fastest * towards / max(float(np.hypot(*towards)), 1e-9)
        self._chosen = nearest
        return True

    def _scans(self, state: np.ndarray) -> list[Scan]:
        scans = [lidar.scan(self._world, state, self._time, self._errors) for lidar in self._lidars]
        if self.premise != NOT_STATIC:
            return scans
        # everything is declared to stay
        return [replace(scan, moving=np.zeros(len(scan.ranges), dtype=bool)) for scan in scans]

    def _answer(self, scans: list[Scan], state: np.ndarray) -> Any:
        self.found.cycles += 1
        try:
            return self._navigator.update(scans, state)
        except Exception:
            self.found.exceptions += 1
            return self._navigator.held

    def _go_on(self, answer: Any) -> None:
        end = self._time + self._cycle
        places = self._intruders.now.copy()
        if self._chosen is not None:
            places[self._chosen] += self._speed * self._cycle
        self._intruders.step(end, places)
        self._drive.go_on(self._time, end)
        self._drive.executing = answer
        self._time = end


def _speeds_up(answer: Any, robot: Any) -> bool:
    """Whether the robot gets faster anywhere on what it was given."""
    pace = np.abs(answer.states[:, 3:]).max(axis=1) if robot.kind else np.abs(answer.states[:, 3])
    return bool((np.diff(pace) > 1e-6).any())
