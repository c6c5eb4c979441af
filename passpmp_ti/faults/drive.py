"""One drive with faults put into its cycles."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from typing import Any
from unittest import mock

import numpy as np

from passpmp_ti.faults.executor import Executor, Frame
from passpmp_ti.faults.grounds import Ground, peopled
from passpmp_ti.faults.kinds import KINDS, STAYS, Burst, Senses, Told, broken_inside
from passpmp_ti.faults.movers import hunt
from passpmp_ti.faults.tally import NO_FAULT, Tallies, Tally
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.planner.plan import still_clear
from passpmp_ti.scan import Scan
from passpmp_ti.sim.drive import Drive

PATIENCE = 12
"""Cycles for which a fault waits for a robot that moves."""
CALM = (1, 5)
"""Fewest and most cycles between two faults."""
STAY_SHARE = 0.3
CALM_AT_END = 15
"""Cycles after the last fault."""


class FaultyDrive:
    """Drives a ground, cycle by cycle, and puts in one fault after the other."""

    def __init__(
        self,
        ground: Ground,
        kinds: Sequence[str],
        seed: int,
        planner: Callable[..., Any] = Navigator,
    ) -> None:
        """Prepare a drive.

        Args:
            ground: where.
            kinds: names of the faults, in their order.
            seed: of everything random.
            planner: makes what is driven; called like `Navigator`, and with its door.
        """
        scenario = ground.load()
        self._rng = np.random.default_rng([seed, 7])
        world, self._still, self._hunters, state, time = peopled(
            scenario, ground, seed % 1000, self._rng
        )
        self._robot, self._cycle = scenario.robot, scenario.settings.cycle
        self._navigator = planner(
            self._robot, scenario.settings, goal=scenario.goals, static_map=scenario.static_map,
            seed=seed,
        )  # fmt: skip
        self._drive = Drive(scenario, world, state, time)
        self._executor = Executor(self._robot, state, time)
        self._senses = Senses(
            world=world, lidars=scenario.lidars, errors=np.random.default_rng([seed, 1]),
            cycle=self._cycle, where=self._executor.at, now=time,
        )  # fmt: skip
        self._waiting = list(kinds)
        self._frame = Frame()
        self._burst: Burst | None = None
        self._calm = 8
        self._busy_until = -np.inf
        self._begun: list[tuple[float, str]] = [(-np.inf, NO_FAULT)]
        self._unproven: Any = None
        self._unsettled: tuple[Tally, bool] | None = None
        self.tallies: Tallies = {}

    @property
    def time(self) -> float:
        """True time [s]."""
        return self._senses.now

    def run(self) -> Tallies:
        """Put in all faults, then drive on for a while."""
        left = CALM_AT_END
        while self._waiting or self._burst or left:
            if not self._waiting and self._burst is None:
                left -= 1
            self.step()
        self._settle(False)
        self._count_contacts()
        return self.tallies

    def step(self) -> None:
        """One cycle."""
        now, end = self.time, self.time + self._cycle
        moving = not bool(self._robot.at_rest(self._executor.at(now)))
        self._choose(moving)
        kind = self._begun[-1][1]
        tally = self.tallies.setdefault(kind, Tally())
        tally.cycles += 1
        if now >= self._busy_until - 1e-9:
            self._call(tally, now)  # a planner that still works hears nothing
        there = self._executor.at(end)[:2]
        hunt(self._hunters, self._still, end, self._cycle, there, self._robot.radius)
        before = self._drive.distance, self._drive.time_moving
        self._go_on(now, end, tally)
        tally.distance += self._drive.distance - before[0]
        tally.time_moving += self._drive.time_moving - before[1]
        if bool(self._robot.at_rest(self._executor.at(end))):
            self._settle(True)
        self._senses.now = end

    def _choose(self, moving: bool) -> None:
        """Begin, go on with or end a fault."""
        if self._burst is not None and self._burst.left == 0:
            burst, self._burst = self._burst, None
            if burst.kind in STAYS and self._rng.uniform() < STAY_SHARE:
                self._frame = Frame(
                    self._frame.x, self._frame.y, self._frame.turn,
                    self._frame.shift + burst.memory.get("by", 0.0),
                )  # fmt: skip
            self._calm = int(self._rng.integers(CALM[0], CALM[1] + 1))
        elif self._burst is None and self._waiting:
            self._calm -= 1
            if self._calm < 0 and (moving or self._calm < -PATIENCE):
                self._begin(moving)

    def _begin(self, moving: bool) -> None:
        kind = self._waiting.pop(0)
        kinds_of_length = self._rng.uniform()
        if kinds_of_length < 0.6:
            length = 1
        elif kinds_of_length < 0.85:
            length = int(self._rng.integers(2, 6))
        else:
            length = int(self._rng.integers(6, 21))
        self._settle(False)
        self._burst = Burst(kind, length, self._frame)
        self._begun.append((self.time, kind))
        tally = self.tallies.setdefault(kind, Tally())
        tally.times += 1
        tally.while_moving += moving
        self._unsettled = (tally, moving)

    def _settle(self, rests: bool) -> None:
        """Say once how the last burst ended: at rest, or driven through."""
        if self._unsettled is None:
            return
        tally, moving = self._unsettled
        if rests or not moving:
            tally.rested += 1
        else:
            tally.went_on += 1
        self._unsettled = None

    def _call(self, tally: Tally, now: float) -> None:
        """Let the planner answer, and judge its answer."""
        told = self._senses.told(self._frame)
        if self._burst is not None:
            self._burst.left -= 1
            tally.faulty_cycles += 1
            told = KINDS[self._burst.kind](self._senses, self._burst, self._rng)
        elif _sound(told):
            self._senses.said.append(told)
        navigator = self._navigator
        held = navigator.held
        answer = held
        try:
            with self._harm(told):
                answer = navigator.update(told.scans, told.state, following=self._executor.answer)
        except Exception:
            tally.exceptions += 1
        if answer is None:
            return
        self._judge(tally, told, answer, held)
        self._executor.offer(answer, told.frame, now + told.late)
        if told.late:
            self._busy_until = now + told.late

    @contextlib.contextmanager
    def _harm(self, told: Told) -> Any:
        navigator = self._navigator
        with contextlib.ExitStack() as stack:
            stack.enter_context(broken_inside(told.breaks, self._rng))
            if told.overruns:
                hurried = navigator.settings.changed(deadline=0.0)
                stack.enter_context(mock.patch.object(navigator, "settings", hurried))
            yield

    def _judge(self, tally: Tally, told: Told, answer: Any, held: Any) -> None:
        navigator, record = self._navigator, self._navigator.record
        tally.endless += not bool(self._robot.at_rest(answer.states[-1]))
        tally.caught += bool(record.fault)
        broken = len(record.broken_premises) > 0
        tally.premises += broken
        # what no control proved when it was chosen promises nothing
        tally.held_unclear += not (record.held_clear or broken or held is self._unproven)
        usable = _sound(told) and not told.breaks
        tally.unrecorded += not usable and not (record.lost_scan or record.fault or record.reason)
        model = navigator.model
        if answer is not held and model is not None and len(answer.times) > 1:
            clear = still_clear(model, answer, answer.start)
            if record.decision == "brake":
                tally.unproven_brakes += not clear
                self._unproven = None if clear else answer
            else:
                tally.unverified += not clear

    def _go_on(self, now: float, end: float, tally: Tally) -> None:
        """Follow what is followed, and what takes over, under the judge's eyes."""
        executor, breaks = self._executor, self._executor.breaks
        while now < end - 1e-9:
            switch = executor.switch(now, end)
            until = end if switch is None else switch
            self._drive.executing = executor.true_path
            if until > now + 1e-9:
                self._drive.go_on(now, until)
            if switch is not None:
                executor.take(switch)
            now = until
        tally.breaks += executor.breaks - breaks

    def _count_contacts(self) -> None:
        for contact in self._drive.judge.contacts:
            kind = next(k for t, k in reversed(self._begun) if t <= contact.start)
            tally = self.tallies.setdefault(kind, Tally())
            if contact.moving:
                tally.contacts_moving += 1
            else:
                tally.contacts_at_rest += 1


def _sound(told: Told) -> bool:
    """Whether it is scans that were told, in a list."""
    return (
        isinstance(told.scans, list)
        and all(isinstance(s, Scan) for s in told.scans)
        and bool(told.scans)
    )
