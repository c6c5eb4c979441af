"""`passpmp bench`: its options, and what it prints. Heavy imports stand inside the functions."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passpmp_ti import door

if TYPE_CHECKING:
    from passpmp_ti.sim.scenario import Scenario

EXAMPLE = """passpmp bench check tree --quick
  passpmp bench --limit path/to/cpp --json all.json
  passpmp bench cycle --cycles 200 --json cycle.json
  passpmp bench anytime --cycles 10000 --deadline 0.05"""
NAMES = ("raster", "check", "tree", "swarm", "cycle", "modes", "anytime", "startup", "memory")
DRIVING = ("cycle", "modes", "anytime")
"""Those that can drive a scenario that is named after them."""
STRICT = 1
"""Exit code where a ratio fell and --strict was given."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What `bench` takes beside the scenario options, which only those that drive read."""
    add = parser.add_argument
    add(
        "names",
        nargs="*",
        metavar="name",
        help=f"{', '.join(NAMES)}; all if none is named. After `cycle` also a scenario that it,"
        " `modes` or `anytime` drives instead of its own",
    )
    add("--backend", default="auto", metavar="B", help="auto, cpu, cuda, vulkan or metal")
    add("--threads", type=int, metavar="N", help="of the kernels and their rivals (default: all)")
    add("--json", metavar="FILE", help="write the results there")
    add("--limit", metavar="DIR", help="a folder with the tuned C++ (perf.cpp) to compare with")
    add("--quick", action="store_true", help="smaller sizes, fewer rounds")
    add("--sizes", metavar="A,B", help="states, nodes or capacities instead of the usual ones")
    add(
        "--cycles",
        type=int,
        metavar="N",
        help="of `cycle` (1000), `modes` (150) and `anytime` (10000)",
    )
    add("--deadline", type=float, metavar="S", help="of a cycle of `anytime` [s] (default: 0.05)")
    add("--results", metavar="DIR", help="committed results (default: benchmarks/results)")
    add(
        "--commit-result",
        action="store_true",
        help="write the results there, to be committed: later runs are compared with them",
    )
    add("--strict", action="store_true", help="fail where a ratio fell by more than a quarter")


def run(given: argparse.Namespace, scenario_of: Callable[[str], Scenario]) -> int:
    """Measure, print, write and compare; returns the exit code.

    Args:
        given: the parsed command line.
        scenario_of: loads a scenario by name or path, with the command line's changes.
    """
    names, scenario = split(given.names)
    from passpmp_ti import backend
    from passpmp_ti.bench import baseline, found, suite

    sizes = None if not given.sizes else tuple(_size(s) for s in given.sizes.split(","))
    options = found.Options(
        quick=given.quick,
        threads=given.threads,
        limit=Path(given.limit) if given.limit else None,
        sizes=sizes,
        cycles=_asked(given.cycles, lambda n: door.whole("bench", "cycles", n, least=1)),
        deadline=_asked(
            given.deadline, lambda s: door.finite("bench", "deadline", s, above=0.0, unit="s")
        ),
        seed=given.seed,
        scenario=scenario_of(scenario) if scenario else None,
        see=_see,
    )
    try:
        running = backend.init(given.backend, given.threads)
    except RuntimeError as error:  # no trace where only the machine lacks what was asked for
        raise ValueError(str(error)) from error
    folder = Path(given.results) if given.results else baseline.RESULTS
    results, fallen = [], False
    for result in suite.carry_out(names, options):
        _see("")
        path = baseline.result_file(folder, result["benchmark"], running)
        then = baseline.read(path)
        print(found.report(result))
        print(f"\n{baseline.comparison(result, then)}\n")
        fallen |= bool(then and baseline.worse(result["ratios"], then["ratios"]))
        results.append(result)
        # after every benchmark: an interrupted run leaves what it has measured
        if given.json:
            baseline.write(Path(given.json), {"results": results})
        if given.commit_result:
            baseline.write(path, result)
            print(f"written to {path}: commit it\n")
    return STRICT if fallen and given.strict else 0


def split(given: Sequence[str]) -> tuple[tuple[str, ...], str | None]:
    """(benchmarks, scenario to drive) out of the names on the command line.

    Raises:
        ValueError: a name that is no benchmark, where no scenario can stand.
    """
    names = tuple(dict.fromkeys(name for name in given if name in NAMES))
    others = [name for name in given if name not in NAMES]
    if len(others) > 1 or (others and (len(names) != 1 or names[0] not in DRIVING)):
        door.choice("bench", "name", others[0], NAMES)
    return names or NAMES, others[0] if others else None


def _asked(given: Any, check: Callable[[Any], Any]) -> Any:
    """What was given, checked; None where nothing was."""
    return None if given is None else check(given)


def _size(text: str) -> int:
    try:
        size = int(float(text))
    except ValueError:
        size = 0
    if size < 1:
        raise ValueError(f"--sizes takes whole numbers > 0, for example 1000,1e5; got {text!r}")
    return size


def _see(what: str) -> None:
    """One line on standard error that is written over."""
    if sys.stderr.isatty():
        print(f"\r\033[K{what}", end="", file=sys.stderr, flush=True)
    elif what:
        print(what, file=sys.stderr)
