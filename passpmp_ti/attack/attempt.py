"""One attack carried out: the planner drives, movers hunt, the judge counts."""

from __future__ import annotations

import hashlib
import math
import time as clock
from collections.abc import Callable
from typing import Any

import numpy as np

from passpmp_ti.attack import band as bands
from passpmp_ti.attack.band import Band
from passpmp_ti.attack.blind import uncovered, within_range
from passpmp_ti.attack.case import Attack, Case, draw
from passpmp_ti.attack.driver import Driver
from passpmp_ti.attack.errors import (
    START,
    UNDER,
    Drift,
    disturb_ranges,
    moved,
    pose_errors,
    scan_age,
    towards_nearest,
)
from passpmp_ti.attack.hunted import Ways, hunted_at, ways_of
from passpmp_ti.attack.movers import SteeredMovers
from passpmp_ti.attack.roadmap import Roadmap
from passpmp_ti.scan import Scan
from passpmp_ti.sim.drive import Drive
from passpmp_ti.sim.episode import CycleInfo, Episode, episode_of
from passpmp_ti.sim.world import World
from passpmp_ti.trajectory import Trajectory

TICK = 0.005
"""Time between two decisions of a mover [s]."""
GIVE_UP = 15.0
"""An episode ends when the robot has been at rest for so long [s]."""
PLACES = 120


class Attempt:
    """An attack while it runs."""

    def __init__(self, case: Case) -> None:
        """Draw the attack and put everybody in place.

        Raises:
            ValueError: a case that cannot be built, or a cycle that is not whole ticks.
        """
        self.attack: Attack = draw(case)
        scenario, settings = self.attack.scenario, self.attack.scenario.settings
        self.ticks = round(settings.cycle / TICK)
        if abs(self.ticks * TICK - settings.cycle) > 1e-9:
            raise ValueError(
                f"Settings.cycle = {settings.cycle:g} s must be a whole number of ticks of"
                f" {TICK:g} s: movers decide once a tick"
            )
        draws = case.generator(1)
        radius, speed = self.attack.radius, self.attack.speed
        roadmap = Roadmap(self.attack.arena.world, float(radius.max()), PLACES, draws)
        outline = self.attack.arena.world.outline
        self.movers = SteeredMovers(
            _first_places(self.attack, roadmap, draws), radius,
            settings.object_speed * case.cheat_speed, TICK, 0.0, outline,
        )  # fmt: skip
        self.world = World(scenario.bounds, scenario.polygons, scenario.walls, self.movers)
        reach = max(lidar.range_max for lidar in scenario.lidars)
        braking = min(settings.cruise_speed or 8.0, 8.0) / scenario.robot.deceleration
        self.band = Band(
            self.attack.kinds, speed, radius, roadmap, outline, reach, braking, TICK,
            case.generator(2),
        )  # fmt: skip
        self._errors = case.generator(3)
        turn = float(self._errors.uniform(0, 2 * math.pi))
        self._start_error = (
            UNDER * settings.localisation_error * np.array([math.cos(turn), math.sin(turn)])
        )
        self._drift = Drift(self.attack.errors.tracking, settings, case.generator(4))
        self.navigator = Driver(
            scenario.robot, settings, goal=scenario.goals, static_map=scenario.static_map,
            seed=case.seed,
        )  # fmt: skip
        state = np.array([*scenario.start, 0.0, 0.0])
        self.drive = Drive(scenario, self.world, state, 0.0)
        self.still_for = 0.0
        self.top_speed = 0.0
        """Greatest speed of the robot [m/s]."""
        self._past = (np.array([0.0]), state[None])
        self._stood = np.zeros(len(radius), dtype=bool)  # who was ever where no sensor looks

    def cycle(self, k: int, on_cycle: Callable[[CycleInfo], None] | None = None) -> None:
        """Scan, plan, and let everybody go on for one cycle."""
        settings, drive = self.attack.scenario.settings, self.drive
        now = k * settings.cycle
        state = self._past[1][-1]
        scans, told = self._sense(now, state)
        began = clock.perf_counter()
        answer = self.navigator.update(scans, told)
        drive.note(self.navigator.record, clock.perf_counter() - began)
        if on_cycle is not None:
            info = CycleInfo(
                time=now,
                world=self.world,
                navigator=self.navigator,
                state=state,
                scans=scans,
                contacts=drive.judge.contacts,
                executing=drive.executing,
            )
            on_cycle(info)
        self._go_on(now, answer)
        drive.executing = answer

    def _sense(self, now: float, state: np.ndarray) -> tuple[list[Scan], np.ndarray]:
        """What the planner is told: scans, each with its errors, and the robot's state."""
        attack, settings = self.attack, self.attack.scenario.settings
        errors, draws = attack.errors, self._errors
        when = now - scan_age(errors.stamps, settings.stamp_error, draws)
        times, states = self._past
        then = np.array([np.interp(when, times, column) for column in states.T])
        pull = towards_nearest(state[:2], self.movers.now)
        lidars = attack.scenario.lidars
        shifts, own = pose_errors(
            errors.poses, len(lidars), settings.localisation_error, pull, draws
        )
        if errors.poses == START:
            own = self._start_error
        elif now == 0.0:
            own = np.zeros(2)  # what is held begins where the robot is told to be
        scans = []
        for lidar, shift in zip(lidars, shifts, strict=True):
            scan = lidar.scan(self.world, then, when)
            scan = disturb_ranges(scan, errors.ranges, settings.range_noise, draws)
            scans.append(moved(scan, shift, now))
        told = state.copy()
        told[:2] += own
        return scans, told

    def _go_on(self, now: float, answer: Trajectory) -> None:
        scenario, drive, movers = self.attack.scenario, self.drive, self.movers
        robot, cycle = scenario.robot, scenario.settings.cycle
        times = now + TICK * np.arange(self.ticks + 1)
        times[-1] = now + cycle
        states = drive.executing.sampled(times)
        self._drift.carry_over(self._past[1][-1, :2] - states[0, :2])
        rest = robot.at_rest(states)
        ways: Ways = ways_of(robot, now, now + cycle, drive.executing, answer)
        states[0, :2] += self._drift.shift
        movers.survey(cycle)
        for tick in range(self.ticks):
            moving = not (rest[tick] and rest[tick + 1])
            self.still_for = 0.0 if moving else self.still_for + TICK
            hunted = hunted_at(
                robot, float(times[tick]), states[tick], moving, self.still_for, ways
            )
            places = movers.now
            if tick == 0:
                self.band.think(hunted, places)
            velocity = self.band.steer(hunted, places)
            if moving:
                self._drift.advance(TICK, towards_nearest(states[tick, :2], places))
            states[tick + 1, :2] += self._drift.shift
            limit = self.attack.speed
            if self.attack.covered != "all":
                blind = uncovered(scenario.lidars, states[tick + 1], places, movers.radius)
                slow = scenario.settings.unseen_speed * self.attack.case.cheat_speed
                self._stood |= blind & within_range(
                    scenario.lidars, states[tick + 1], places, movers.radius
                )
                limit = np.where(blind | self._stood, np.minimum(limit, slow), limit)
            after = hunted_at(robot, 0.0, states[tick + 1], moving, 0.0, ways)
            movers.advance(velocity, limit, after.discs, robot.disc_radius)
        drive.follow(times, states)
        self.top_speed = max(self.top_speed, float(np.abs(robot.speed(states)).max()))
        self._past = (times, states)

    def episode(self) -> Episode:
        """What happened so far."""
        return episode_of(self.drive, self.attack.scenario.settings, self.attack.case.seed)

    def digest(self) -> str:
        """The same for the same motion, to the last bit."""
        found = hashlib.sha256()
        for array in (*self.drive.times, *self.drive.states, self.movers.history):
            found.update(np.ascontiguousarray(array).tobytes())
        return found.hexdigest()[:16]


def _first_places(attack: Attack, roadmap: Roadmap, generator: np.random.Generator) -> np.ndarray:
    """[m, 2] nobody nearer than `keep_out`; hunters farther, so that the robot sets off."""
    start = np.array(attack.scenario.start[:2])
    apart = np.hypot(*(roadmap.places - start).T)
    reach = max(lidar.range_max for lidar in attack.scenario.lidars)
    places = []
    for kind, radius in zip(attack.kinds, attack.radius, strict=True):
        least = attack.keep_out + float(radius)
        wanted = least if kind == bands.WALK else max(least, 0.6 * reach)
        far = np.flatnonzero(apart > wanted)
        if not len(far):
            far = np.flatnonzero(apart >= min(least, float(apart.max())))
        places.append(roadmap.places[int(generator.choice(far))])
    return np.array(places)


def run(case: Case, on_cycle: Callable[[CycleInfo], None] | None = None) -> Attempt:
    """Carry out an attack from beginning to end."""
    attempt = Attempt(case)
    for k in range(math.ceil(case.duration / attempt.attack.scenario.settings.cycle)):
        attempt.cycle(k, on_cycle)
        if attempt.still_for > GIVE_UP or attempt.navigator.reached:
            break
    return attempt


def outcome(attempt: Attempt) -> dict[str, Any]:
    """An attack in numbers, SI units."""
    drive, case = attempt.drive, attempt.attack.case
    contacts = drive.judge.contacts
    broken = [len(r.broken_premises) > 0 for r in drive.records]
    # once a premise is broken, nothing that was proven before it need hold
    sound = np.cumsum(broken) == 0
    unclear = [not r.held_clear for r in drive.records]
    nearest = drive.judge.nearest_mover
    return {
        "robot": case.robot,
        "kind": case.kind,
        "seed": case.seed,
        "cycles": len(drive.records),
        "duration": len(drive.records) * attempt.attack.scenario.settings.cycle,
        "metres": drive.distance,
        "seconds_moving": drive.time_moving,
        "top_speed": attempt.top_speed,
        "contacts_moving": sum(c.moving for c in contacts),
        "contacts_at_rest": sum(not c.moving for c in contacts),
        "held_unsafe": int((np.array(unclear) & sound).sum()) if broken else 0,
        "held_unsafe_after_broken": int((np.array(unclear) & ~sound).sum()) if broken else 0,
        "broken_premises": sum(broken),
        "lost_scans": sum(bool(r.lost_scan) for r in drive.records),
        "nearest_moving": float(nearest) if math.isfinite(nearest) else None,
        "digest": attempt.digest(),
        "exception": None,
    }
