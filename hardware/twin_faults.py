"""Breaks everything around the chair on the twin while it drives, through the whole chain.

    python -m hardware.twin_faults --runs 100 --out out/twin-faults

The chair drives to and fro in a corridor. At a random moment while it moves one thing breaks; it
has to be at rest by when that was said, to stay so, to touch nothing while it moves, and to drive
again once the thing is mended; after an emergency stop only when it is let go. What is in the
folder is not run again. A run in which the twin itself was late is run again, and counted.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import os
import signal
import sys
import time
from collections.abc import Callable, Generator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hardware import twin_process, twin_wrong
from hardware.base import Odometry
from hardware.executor import ADDRESS, Tick
from hardware.executor_faults import try_once
from hardware.executor_kinds import Kind
from hardware.executor_process import ROW
from hardware.executor_settings import ExecutorSettings
from hardware.letterbox import Letterbox
from hardware.stop_button import StopButton
from hardware.twin import Chain
from hardware.twin_experiments import LATE, TRIES, circumstances
from hardware.twin_process import TruthReader
from passpmp_ti import door
from passpmp_ti.compare.job import Key, Result
from passpmp_ti.compare.ledger import Ledger

SCENARIO, CYCLE, OBJECT_SPEED = "corridor", 0.1, 0.5
"""Where it drives, the planner's cycle [s], and the bound on the speed of objects [m/s]."""
TURNS = ((11.8, 0.0), (0.0, 0.0))
"""Goals, in turn [m]."""
LEGS = 400
"""Ways from goal to goal; more than a round of faults ever needs."""
ROUNDS = 5
"""Faults of each kind before all processes are started anew."""
LATELY = 60.0
"""Ticks of so long are looked at [s]."""
STEP = 100.0
"""By so much a clock is off [s]."""
SWEEP = 0.025
"""Time of a turn of a lidar's mirror [s]."""


class TwinRig:
    """A chain that things break around."""

    def __init__(self, seed: int) -> None:
        """
        Args:
            seed: of the chair and all noise.
        """
        self.chain = Chain(
            SCENARIO, seed=seed, cycle=CYCLE, object_speed=OBJECT_SPEED, threads=1,
            goals=TURNS * (LEGS // 2), obeys=True,
        )  # fmt: skip
        self.settings: ExecutorSettings = self.chain.executor_settings
        self.truth: list[Odometry] = []
        self._steps = itertools.cycle((STEP, -STEP))
        self.late = 0.0
        """The twin's worst since this was set to 0 [s]."""

    def __enter__(self) -> TwinRig:
        self.chain.__enter__()
        self._reader = TruthReader(self.chain.directory / twin_process.TRUTH)
        self._orders = Letterbox(self.chain.directory / "rig")
        return self

    def __exit__(self, *_: object) -> None:
        self._orders.close()
        self.chain.__exit__()

    @property
    def fastest(self) -> float:
        """Ground speed of the faster wheel, in truth [m/s]."""
        self._look()
        return max(abs(self.truth[-1].right), abs(self.truth[-1].left)) if self.truth else 0.0

    def wait(self, condition: Callable[[], bool], within: float) -> bool:
        """Whether it came to hold within a time [s]."""
        until = time.monotonic() + within
        while not condition():
            if time.monotonic() > until:
                return False
            time.sleep(0.01)
            self._look()
        return True

    def ticks(self) -> list[Tick]:
        """What the executor did lately."""
        size = self.chain.log.stat().st_size // ROW.size
        count = min(size, round(LATELY / self.settings.period))
        with self.chain.log.open("rb") as file:
            file.seek((size - count) * ROW.size)
            return [Tick(*row) for row in ROW.iter_unpack(file.read(count * ROW.size))]

    def twin(self, wrong: str) -> None:
        """One of `twin_process.WRONGS`."""
        door.choice("TwinRig.twin", "wrong", wrong, twin_process.WRONGS)
        self._orders.post(self.chain.directory / twin_process.ORDERS, wrong.encode())

    def planner(self, wrong: str) -> None:
        """As `twin_wrong.py` says."""
        self._orders.post(self.chain.directory / twin_wrong.ORDERS, wrong.encode())

    def step_clock(self) -> None:
        """The planner's, ahead and back in turn."""
        self.planner(f"{twin_wrong.CLOCK} {next(self._steps):g}")

    def kill_planner(self) -> None:
        """It is gone at once."""
        self.chain.planner.process.send_signal(signal.SIGKILL)
        self.chain.planner.process.wait()

    def stop_planner(self, number: int) -> None:
        """SIGSTOP, or SIGCONT."""
        self.chain.planner.process.send_signal(number)

    def cut(self, *, cut: bool) -> None:
        """Take the executor's address away, or give it back."""
        here, away = self.chain.directory / ADDRESS, self.chain.directory / "cut"
        with contextlib.suppress(FileNotFoundError):
            os.rename(*((here, away) if cut else (away, here)))

    def press(self) -> bool:
        """Press the emergency stop; whether it was obeyed."""
        with StopButton(self.chain.directory) as button:
            return button.press()

    def release(self) -> bool:
        """Let it go; whether the chair may drive."""
        with StopButton(self.chain.directory) as button:
            return button.release()

    def _look(self) -> None:
        rows = self._reader.new()
        if len(rows):
            self.late = max(self.late, float(rows[:, 7].max()))
            self.truth += [Odometry(*row) for row in rows[:, :6].tolist()]


def kinds(settings: ExecutorSettings, period: float) -> list[Kind]:
    """All faults, with the times that are promised.

    Args:
        settings: of the executor.
        period: of the base's odometry [s].
    """
    # from the base's measurement to the executor's tick to the base's next look
    hop = period + 2 * settings.period
    # who is told to go wrong does so in its next cycle; a scan that is there is planned on still
    told = 2 * CYCLE

    def twin(wrong: str) -> Callable[[TwinRig], object]:
        return lambda rig: rig.twin(wrong)

    def planner(wrong: str) -> Callable[[TwinRig], object]:
        return lambda rig: rig.planner(wrong)

    return [
        Kind("planner killed", TwinRig.kill_planner, lambda rig: rig.chain.revive(), hop, False),
        Kind(
            "planner stopped", lambda rig: rig.stop_planner(signal.SIGSTOP),
            lambda rig: rig.stop_planner(signal.SIGCONT), hop, False,
        ),
        Kind("lidars' cable pulled", twin("cable"), twin(""), told + SWEEP, False),
        Kind("lidars frozen on a scan", twin("frozen"), twin(""), told + SWEEP, False),
        # it ends by itself, `twin_process.BOOT` later
        Kind("lidars rebooted", twin("reboot"), twin(""), told + SWEEP, False),
        Kind("base's feedback lost", twin("silent"), twin(""),
             settings.feedback_timeout + hop, True),
        Kind("planner's clock stepped", TwinRig.step_clock, planner(""), told, False),
        Kind("executor's link cut", lambda rig: rig.cut(cut=True),
             lambda rig: rig.cut(cut=False), hop, False),
        Kind("numbers that are none", planner(twin_wrong.NAN), planner(""), told, False),
        Kind("emergency stop", TwinRig.press, TwinRig.release, hop, True),
    ]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Job:
    """One fault."""

    kind: str
    number: int

    @property
    def key(self) -> Key:
        """(scenario, kind, number)."""
        return (SCENARIO, self.kind, self.number)


def carry_out(rig: TwinRig, kind: Kind, number: int, rng: np.random.Generator) -> Result:
    """Break one thing, and again where the twin was disturbed."""
    disturbed = []
    judge = rig.chain.drive.judge
    while True:
        rig.late = 0.0
        before = sum(contact.moving for contact in judge.contacts)
        run = try_once(rig, kind, rng)
        rig.chain.see()
        touched = sum(contact.moving for contact in judge.contacts) - before
        if rig.late <= LATE:
            break
        disturbed.append({"late": rig.late, "failure": run.failure, "touched": touched})
        if len(disturbed) == TRIES:
            break
    return {
        **asdict(run), "scenario": SCENARIO, "variant": kind.name, "seed": number,
        "error": None, "touched": touched, "late": rig.late, "disturbed": disturbed,
        "quiet": len(disturbed) < TRIES,
        "timings": circumstances(),
    }  # fmt: skip


def drive(left: list[Job], seed: int) -> Generator[Result, None, None]:
    """Each of these faults, in one drive after the other; after one that failed all is started
    anew, so that it fails alone."""
    rng = np.random.default_rng([seed, len(left)])
    waiting = list(left)
    while waiting:
        with TwinRig(seed=waiting[0].number) as rig:
            known = {k.name: k for k in kinds(rig.settings, rig.chain.config.nature().period)}
            for job in waiting[: ROUNDS * len(known)]:
                found = carry_out(rig, known[job.kind], job.number, rng)
                waiting.pop(0)
                yield found
                if found["failure"]:
                    break


def line(found: dict[str, Any]) -> str:
    """One line of progress."""
    return (
        f"{found['kind']:26s} {found['seed']:3d}   at rest after {found['took']:.2f} of"
        f" {found['allowed']:.2f} s   drives again after {found['back']:.2f} s   touched"
        f" {found['touched']}   twin late {1e3 * found['late']:.0f} ms, disturbed"
        f" {len(found['disturbed'])}   {found['failure']}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Break everything around the chair on the twin while it drives.",
        epilog="example: python -m hardware.twin_faults --runs 5 --out out/twin-faults",
    )
    parser.add_argument("--runs", type=int, default=5, help="of each kind (default: 5)")
    parser.add_argument("--seed", type=int, default=0, help="of the moments (default: 0)")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--only", nargs="*", default=(), help="names of kinds")
    given = parser.parse_args()
    names = [kind.name for kind in kinds(ExecutorSettings(), 0.01)]
    try:
        runs = door.whole("twin_faults", "runs", given.runs, least=1)
        wanted = [door.choice("twin_faults", "only", name, names) for name in given.only] or names
        ledger = Ledger(given.out, {"tries": TRIES, "late": LATE})
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2

    def each(left: list[Job]) -> Generator[Result, None, None]:
        for found in drive(left, given.seed):
            print(line(found), file=sys.stderr)
            yield found

    try:
        jobs = [Job(name, number) for number in range(runs) for name in wanted]
        ledger.fill(jobs, each, lambda done: None)
    except KeyboardInterrupt:
        print("stopped; what was run is kept", file=sys.stderr)
        return 130
    failed = [f for f in ledger.results.values() if f["failure"] or f["touched"]]
    print(f"{len(ledger.results)} faults, {len(failed)} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
