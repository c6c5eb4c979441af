"""`passpmp doctor`: its options, and what it prints. Heavy imports stand inside the functions."""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from hardware.doctor_finding import FAIL, OK, WARN, Finding

if TYPE_CHECKING:
    from passpmp_ti.settings import Settings

EXAMPLE = """passpmp doctor
  passpmp doctor hardware/examples/wheelchair.yaml
  passpmp doctor hardware/examples/emulated.yaml --json"""
FAILED = 1
"""Exit code: something does not work."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What `doctor` takes."""
    add = parser.add_argument
    add("config", nargs="?", metavar="CONFIG", help="a robot's file: its devices are asked too")
    add("--quick", action="store_true", help="leave out what takes long: executor and planner")
    add("--json", action="store_true", help="one JSON list instead of lines")


def run(given: argparse.Namespace) -> int:
    """Look at everything; returns the exit code."""
    found = []
    for finding in findings(given.config, quick=given.quick):
        found.append(finding)
        if not given.json:
            print(finding.line(), flush=True)
    if given.json:
        print(json.dumps([dataclasses.asdict(finding) for finding in found], indent=2))
    else:
        count = {level: sum(f.level == level for f in found) for level in (OK, WARN, FAIL)}
        print(f"\n{count[OK]} ok, {count[WARN]} warn, {count[FAIL]} FAIL")
    return FAILED if any(finding.level == FAIL for finding in found) else 0


def findings(config: str | None, *, quick: bool = False) -> Iterator[Finding]:
    """Everything, as it is found.

    Args:
        config: a robot's file; None: the machine alone.
        quick: nothing is timed.
    """
    from hardware.config_file import read_config
    from hardware.doctor_machine import machine
    from hardware.doctor_robot import robot

    yield from machine()
    settings = own = None
    if config is not None:
        try:
            told = read_config(Path(config))
        except ValueError as problem:
            yield Finding("file", FAIL, str(problem), "every line says what is allowed")
        else:
            settings, own = told.planner_settings, told.robot
            yield Finding("file", OK, f"{config}: {_margins(settings)}")
            yield from robot(told)
    if not quick:
        from hardware.doctor_speed import speed

        yield from speed(settings, own)


def _margins(settings: Settings) -> str:
    return (
        f"margins tracking {settings.tracking_error:g} m, localisation"
        f" {settings.localisation_error:g} m, ranges {settings.range_noise:g} m, stamps"
        f" {settings.stamp_error:g} s"
    )
