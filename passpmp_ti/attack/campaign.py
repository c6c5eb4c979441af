"""Many attacks at once: told apart by their names, written down as they end, resumed."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import signal
import time as clock
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from passpmp_ti.attack.case import HUNTERS, Case

EPISODES = "episodes.jsonl"
Result = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """Which attacks are wanted."""

    robots: Sequence[str]
    kinds: Sequence[str]
    episodes: int | None = None
    """Per robot; None: until `cycles`."""
    cycles: int | None = None
    """Per robot: no new episode begins once so many cycles are done."""
    seed: int = 0
    """Of the first episode; the others count on."""
    duration: float = 45.0
    """Of an episode [s]."""
    cheat_speed: float = 1.0
    changes: dict[str, Any] = field(default_factory=dict)

    def cases(self, robot: str) -> Iterator[Case]:
        """The attacks on a robot in order: each kind in turn, each with a seed of its own."""
        number = 0
        while self.episodes is None or number < self.episodes:
            yield Case(
                robot=robot,
                kind=self.kinds[number % len(self.kinds)],
                seed=self.seed + number,
                duration=self.duration,
                cheat_speed=self.cheat_speed,
                changes=self.changes,
            )
            number += 1


def key_of(found: Result | Case) -> tuple[Any, ...]:
    """What tells one episode from another."""
    if isinstance(found, Case):
        return (found.robot, found.kind, found.seed, found.duration, found.cheat_speed,
                json.dumps(dict(found.changes), sort_keys=True))  # fmt: skip
    case = found["case"]
    return (case["robot"], case["kind"], case["seed"], case["duration"], case["cheat_speed"],
            json.dumps(case["changes"], sort_keys=True))  # fmt: skip


def failed(found: Result) -> bool:
    """Whether an episode speaks against the guarantee."""
    return bool(found["contacts_moving"] or found["held_unsafe"] or found["exception"])


def carry_out(case: Case) -> Result:
    """One attack in numbers; an exception is a number too."""
    from passpmp_ti.attack.attempt import outcome, run

    began = clock.perf_counter()
    told: Result = {"case": asdict(case)}
    try:
        told |= outcome(run(case))
    except Exception:  # a planner that raises is what an attack is to find
        told |= _nothing(case) | {"exception": traceback.format_exc()}
    told["seconds_computed"] = clock.perf_counter() - began
    return told


def _nothing(case: Case) -> Result:
    return {
        "robot": case.robot, "kind": case.kind, "seed": case.seed, "cycles": 0, "duration": 0.0,
        "metres": 0.0, "seconds_moving": 0.0, "top_speed": 0.0, "contacts_moving": 0,
        "contacts_at_rest": 0, "held_unsafe": 0, "held_unsafe_after_broken": 0,
        "broken_premises": 0, "lost_scans": 0, "nearest_moving": None, "digest": "",
    }  # fmt: skip


def read_results(folder: Path) -> list[Result]:
    """Finished episodes of a folder, in the order in which they ended; a line that was cut short
    is dropped."""
    path = folder / EPISODES
    found = []
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            with contextlib.suppress(json.JSONDecodeError):
                found.append(json.loads(line))
    return found


def write_failure(folder: Path, found: Result) -> Path:
    """Write a failed episode so that `--replay` finds all it needs in the file."""
    path = folder / f"failed-{found['robot']}-{found['kind']}-{found['seed']}.json"
    path.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return path


def carry_out_all(
    campaign: Campaign,
    folder: Path,
    workers: int,
    on_result: Callable[[Sequence[Result]], None],
) -> list[Result]:
    """Carry out what is not done yet; every episode is written as it ends.

    Args:
        campaign: what is wanted.
        folder: where `episodes.jsonl` and failures go; what it holds already is not done again.
        workers: processes at once, each with one thread.
        on_result: shown all results so far, those of earlier runs too, after each episode.

    Returns:
        Every result, those of earlier runs first.

    Raises:
        KeyboardInterrupt: Ctrl-C; what is finished is written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    results = read_results(folder)
    path = folder / EPISODES
    path.write_text("".join(json.dumps(r) + "\n" for r in results), encoding="utf-8")
    context = multiprocessing.get_context("spawn")
    pool = context.Pool(workers, initializer=_start_worker)
    try:
        with path.open("a", encoding="utf-8") as file:
            for found in _in_pool(pool, _wanted(campaign, results), workers):
                results.append(found)
                file.write(json.dumps(found) + "\n")
                file.flush()
                if failed(found):
                    write_failure(folder, found)
                on_result(results)
        pool.close()
    finally:
        pool.terminate()
        pool.join()
    return results


def _wanted(campaign: Campaign, results: list[Result]) -> Iterator[Case]:
    """Cases still to be done, robots in turn; `results` grows meanwhile."""
    done = {key_of(r) for r in results}
    streams = {robot: campaign.cases(robot) for robot in campaign.robots}
    while streams:
        for robot in list(streams):
            cycles = sum(r["cycles"] for r in results if r["robot"] == robot)
            case = next((c for c in streams[robot] if key_of(c) not in done), None)
            if case is None or (campaign.cycles is not None and cycles >= campaign.cycles):
                del streams[robot]
            else:
                yield case


def _in_pool(pool: Any, cases: Iterator[Case], workers: int) -> Iterator[Result]:
    """Results as they come, never more cases under way than workers."""
    waiting: list[Any] = []
    more = True
    while more or waiting:
        while more and len(waiting) < workers:
            case = next(cases, None)
            if case is None:
                more = False
            else:
                waiting.append(pool.apply_async(carry_out, (case,)))
        ready = [w for w in waiting if w.ready()]
        waiting = [w for w in waiting if not w.ready()]
        if not ready and waiting:
            waiting[0].wait(0.1)
        for one in ready:
            yield one.get()


def _start_worker() -> None:
    """A worker leaves Ctrl-C to its parent and has one thread for everything."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["OMP_NUM_THREADS"] = "1"
    import cv2

    from passpmp_ti import backend

    cv2.setNumThreads(1)
    backend.init("cpu", threads=1)


def default_kinds() -> tuple[str, ...]:
    """Hunters of every kind: safety is scored among them."""
    return tuple(HUNTERS)
