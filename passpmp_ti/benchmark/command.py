"""`passpmp benchmark`: which benchmarks there are. Each is a module here with `add_options(parser)`
and `run(given)`, and imports what is heavy inside its functions."""

from __future__ import annotations

import argparse
from importlib import import_module

EXAMPLE = """passpmp benchmark crowd --counts 10 20 --trials 20 --workers 2
  passpmp benchmark barn --worlds all/5 --trials 1"""
NAMES = {
    "crowd": "a route through a crowd, with people who step out from behind things",
    "barn": "BARN: narrow worlds in which nothing moves, by the challenge's score",
    "dynabarn": "DynaBARN: worlds of moving cylinders, by class",
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """What `benchmark` takes: a benchmark's name, and that benchmark's options."""
    parsers = parser.add_subparsers(required=True, metavar="name", dest="benchmark")
    for name, what in NAMES.items():
        module = import_module(f"passpmp_ti.benchmark.{name}")
        own = parsers.add_parser(
            name,
            help=what,
            description=what[0].upper() + what[1:] + ".",
            epilog=f"example:\n  {module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_options(own)


def run(given: argparse.Namespace) -> int:
    """Run the benchmark that was named; returns its exit code."""
    return int(import_module(f"passpmp_ti.benchmark.{given.benchmark}").run(given))
