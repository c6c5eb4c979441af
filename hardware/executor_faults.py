"""Breaks everything around a moving robot's executor, at random moments, over real processes.

    python -m hardware.executor_faults --runs 100

A simulated base in this process, an executor in its own, a planner of random motions in another.
Each run breaks one thing while the robot moves, and asks: is it at rest by when it was said to be,
does it stay so, does it drive again once the fault is over? Times are the base's and the executor's
own. Where the machine itself stood still meanwhile, that long is allowed on top, and told. The exit
code is 1 if anything failed.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hardware.base import Odometry
from hardware.executor import Tick
from hardware.executor_kinds import Kind, kinds
from hardware.executor_rig import NATURE, Rig
from hardware.executor_settings import ExecutorSettings
from hardware.status import State
from passpmp_ti import door

MOVING = 0.25
"""Wheels that turn faster than this are worth stopping [m/s]."""
AT_REST = 0.02
"""Wheels that turn more slowly than this are at rest [m/s]."""
STALL = 1.5 * NATURE.period
"""Of a longer gap between two ticks, what is beyond a period is the machine's own [s]."""
RESTS = 0.15
"""At rest for this long is at rest [s]; less than before it may drive again."""
SETTLED = 0.5
"""A fault is forgotten this long after its end [s]."""
PATIENCE = 30.0
"""[s] for what should take a second."""


class Tormented(Protocol):
    """What things break around: a rig, or the whole chain on the twin."""

    @property
    def settings(self) -> ExecutorSettings:
        """Of its executor."""

    @property
    def truth(self) -> Sequence[Odometry]:
        """Where the robot was so far."""

    @property
    def fastest(self) -> float:
        """Ground speed of the faster wheel, in truth [m/s]."""

    def ticks(self) -> list[Tick]:
        """What its executor did lately."""

    def wait(self, condition: Callable[[], bool], within: float) -> bool:
        """Whether it came to hold within a time [s]."""


@dataclass(frozen=True, slots=True)
class Run:
    """What became of one."""

    kind: str
    took: float
    """From the fault to rest [s]."""
    allowed: float
    """[s]."""
    stalled: float
    """How long the machine stood still meanwhile; it is in `allowed` [s]."""
    error: float
    """Greatest distance from the path just before the fault, by the executor [m]."""
    back: float
    """From the fault's end until it moved again [s]."""
    failure: str = ""


def try_once(rig: Tormented, kind: Kind, rng: np.random.Generator) -> Run:
    """Wait until the robot moves, break one thing, look what becomes of it, and mend it."""
    failed = Run(kind.name, math.inf, 0.0, 0.0, 0.0, math.inf)
    if not rig.wait(lambda: rig.fastest > MOVING, PATIENCE):
        return _with(failed, "it did not move")
    time.sleep(SETTLED + rng.uniform(0.0, 1.0))
    if not rig.wait(lambda: rig.fastest > MOVING, PATIENCE):
        return _with(failed, "it did not move any more")
    seen, began = len(rig.truth), time.monotonic()
    kind.begin(rig)
    rested = rig.wait(lambda: _rest_at(rig.truth[seen:], began) is not None, PATIENCE)
    time.sleep(rng.uniform(0.0, 0.5))
    ticks = rig.ticks()
    ended = time.monotonic()
    truth = [o for o in rig.truth[max(seen - 5, 0) :] if o.stamp <= ended]
    kind.end(rig)
    rest_at = _rest_at(truth, began)
    if not rested or rest_at is None:
        return _with(failed, "it did not come to rest")
    stalled = _stalled([o.stamp for o in truth], began, rest_at)
    if kind.ticks:
        stalled += _stalled([t.time for t in ticks], began, rest_at)
    by = _allowed(rig, kind, began, truth, ticks)
    back = rig.wait(lambda: rig.fastest > AT_REST * 5, PATIENCE)
    moved_again = time.monotonic() - ended
    error = max(
        (t.error for t in ticks if began - SETTLED < t.time < began and t.state == State.FOLLOWING),
        default=0.0,
    )
    took, allowed = rest_at - began, by - began + stalled
    failure = ""
    if took > allowed:
        failure = f"at rest after {took:.3f} s, and {allowed:.3f} s were allowed"
    elif kind.stays and any(_fastest(o) > AT_REST for o in truth if o.stamp > rest_at):
        failure = "it moved while the fault lasted"
    elif not back:
        failure = "it did not drive again"
    return Run(kind.name, took, allowed, stalled, error, moved_again, failure)


def _with(run: Run, failure: str) -> Run:
    return Run(run.kind, run.took, run.allowed, run.stalled, run.error, run.back, failure)


def _fastest(truth: Odometry) -> float:
    return max(abs(truth.right), abs(truth.left))


def _rest_at(truth: Sequence[Odometry], began: float) -> float | None:
    """When it came to rest [s]; None: it has not been at rest for `RESTS` yet."""
    rest_at = began
    for now in truth:
        if now.stamp > began:
            if _fastest(now) > AT_REST:
                rest_at = now.stamp
            elif now.stamp > rest_at + RESTS:
                return rest_at
    return None


def _stalled(times: Sequence[float], began: float, until: float) -> float:
    """How long the machine stood still between two times [s]."""
    gaps = np.diff([t for t in times if began - STALL <= t <= until + STALL])
    return float((gaps[gaps > STALL] - NATURE.period).sum())


def _allowed(
    rig: Tormented, kind: Kind, began: float, truth: Sequence[Odometry], ticks: Sequence[Tick]
) -> float:
    """When it has to be at rest, at the latest [s]."""
    known = began + kind.detection
    late = rig.settings.rest_late
    if not kind.brakes:
        return max((t.rests_from for t in ticks if t.time <= known), default=began) + late
    if not kind.obeys:
        known = next((t.time for t in ticks if t.time > began and t.state == State.BRAKING), known)
    # it may speed up until it is known, and orders go ahead of what the wheels do
    speeds = [_fastest(o) for o in truth if o.stamp <= known]
    speeds += [max(abs(t.right), abs(t.left)) for t in ticks if began - 0.1 < t.time <= known]
    rest = max(speeds) / NATURE.limits.acceleration + late
    return known + (rest if kind.obeys else 2 * rest)


def campaign(
    runs: int,
    rng: np.random.Generator,
    only: Sequence[str] = (),
    settings: ExecutorSettings | None = None,
    see: Callable[[list[Run]], None] = lambda done: None,
) -> list[Run]:
    """Each kind of fault so often.

    Args:
        runs: of each kind.
        rng: decides moments and motions; the machine's own timing does too.
        only: names of kinds; none: all.
        settings: of the executor.
        see: shown what is done, after each run.

    Raises:
        ValueError: no fault has that name.
    """
    done: list[Run] = []
    with Rig(rng, settings=settings) as rig:
        known = {kind.name: kind for kind in kinds(rig)}
        for name in only:
            door.choice("campaign", "only", name, known)
        chosen = [known[name] for name in (only or known)]
        for _ in range(runs):
            for kind in chosen:
                done.append(try_once(rig, kind, rng))
                see(done)
    return done


def table(done: Sequence[Run]) -> str:
    """What became of them, a row for each kind."""
    rows = [
        "| fault | runs | failed | to rest: median, longest [s] | least to spare [s] |"
        " drives again after: median, longest [s] |",
        "|---|---|---|---|---|---|",
    ]
    for name in dict.fromkeys(run.kind for run in done):
        these = [run for run in done if run.kind == name]
        took, back = [r.took for r in these], [r.back for r in these]
        spare = min(r.allowed - r.took for r in these)
        rows.append(
            f"| {name} | {len(these)} | {sum(bool(r.failure) for r in these)} |"
            f" {np.median(took):.2f}, {max(took):.2f} | {spare:.2f} |"
            f" {np.median(back):.2f}, {max(back):.2f} |"
        )
    return "\n".join(rows)


def _show(done: list[Run]) -> None:
    if done[-1].failure:
        print(f"{done[-1].kind}: {done[-1].failure}", file=sys.stderr)
    failed = sum(bool(run.failure) for run in done)
    if sys.stderr.isatty() or len(done) % 100 == 0:
        end = "\r" if sys.stderr.isatty() else "\n"
        print(f"{len(done)} runs, {failed} failed: {done[-1].kind:30s}", end=end, file=sys.stderr)


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Break everything around a moving robot's executor, over real processes.",
        epilog="example: python -m hardware.executor_faults --runs 3 --seed 7",
    )
    parser.add_argument("--runs", type=int, default=3, help="of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=(), help="names of kinds")
    given = parser.parse_args()
    with contextlib.suppress(OSError, AttributeError):
        # the base must keep time as one of its own would
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    try:
        rng = np.random.default_rng(given.seed)
        done = campaign(given.runs, rng, given.only, see=_show)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    print(table(done))
    stalls = [run.stalled for run in done if run.stalled]
    farthest = max(done, key=lambda run: run.error)
    print(
        f"{len(done)} runs; farthest off the path {1000 * farthest.error:.0f} mm, before:"
        f" {farthest.kind};"
        f" the machine stood still in {len(stalls)} runs, {max(stalls, default=0.0):.2f} s at most"
    )
    return 1 if any(run.failure for run in done) else 0


if __name__ == "__main__":
    sys.exit(main())
