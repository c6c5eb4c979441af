"""From a YAML file to a `DriveConfig`: every problem in it is told at once, with its line."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from hardware.base_kinds import KINDS
from hardware.config import MARGINS, DriveConfig, usual_directory
from hardware.config_parts import BaseConfig, Emulated, Lidar, Measured
from hardware.scip import PORT
from hardware.scip_settings import ScipSettings
from passpmp_ti import door
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.settings import Settings
from passpmp_ti.sim.document import REQUIRED, Document, Section

T = TypeVar("T")
FROZEN_AFTER = 20
"""Sweeps with the very same distances after which a real device is not believed: it has noise."""


def read_config(path: Path) -> DriveConfig:
    """Read and check a robot's file.

    Raises:
        ValueError: everything that is wrong, each with file, line and what is allowed.
    """
    document = Document(path, "config")
    root = document.root
    robot = _made(root, "robot", _robot)
    base = _made(root, "base", _base)
    measured = _made(root, "measured", lambda section: _read(section, Measured))
    planner = _made(root, "planner", lambda section: _planner(section, robot))
    lidars = tuple(filter(None, (_lidar(s, n) for n, s in enumerate(root.sections("lidars")))))
    if "lidars" not in root:
        document.blame(root.line, "lidars is missing: list one range finder or two")
    emulated = _emulated(root)
    goals = root.array("goals", (None, 2))
    map_ = root.text("map", None)
    directory = root.text("directory", None)
    button = root.text("stop_button", None)
    root.finish()
    document.finish()
    assert robot is not None
    assert base is not None
    assert measured is not None
    assert planner is not None
    try:
        return DriveConfig(
            name=path.stem,
            robot=robot,
            lidars=lidars,
            base=base,
            measured=measured,
            planner=planner,
            goals=tuple((float(x), float(y)) for x, y in goals),
            # beside the file, wherever the command is given
            map=None if map_ is None else path.parent / map_,
            directory=usual_directory() if directory is None else Path(directory),
            button=None if button is None else Path(button),
            emulated=emulated,
        )
    except ValueError as problem:
        raise ValueError(f"{path}:{_line(root, str(problem))}: {problem}") from problem


OWNERS = {"ExecutorSettings": "base", "BaseLimits": "base", "Settings": "planner"}
"""The section of what is refused by its name in the program."""


def _line(root: Section, problem: str) -> int:
    """Of the section that a problem of the whole is about: what it names first."""
    owner = problem.split(".")[0].split("[")[0].split(" ")[0]
    return root.line_of(OWNERS.get(owner, owner))


def _made(root: Section, key: str, read: Callable[[Section], T | None]) -> T | None:
    section = root.section(key)
    if section is None:
        if key not in root:
            root.document.blame(root.line, f"{key} is missing")
        return None
    return read(section)


def _read(section: Section, kind: type[T], **readers: Callable[[Any], Any]) -> T | None:
    """A dataclass whose fields are numbers, but for those that have a reader."""
    given: dict[str, Any] = {}
    before = len(section.document.problems)
    for field in dataclasses.fields(kind):  # type: ignore[arg-type]
        if not field.init:
            continue
        needed = field.default is dataclasses.MISSING and (
            field.default_factory is dataclasses.MISSING
        )
        default = REQUIRED if needed else None
        reader = readers.get(field.name)
        value = (
            section.number(field.name, default)
            if reader is None
            else section.take(field.name, reader, default)
        )
        if value is not None:
            given[field.name] = value
    section.finish()
    return None if len(section.document.problems) > before else _built(section, kind, given)


def _built(section: Section, kind: Callable[..., T], given: dict[str, Any]) -> T | None:
    try:
        return kind(**given)
    except ValueError as problem:
        at = next((key for key in given if f".{key}" in str(problem)), "")
        section.document.blame(section.line_of(at), problem)
        return None


def _robot(section: Section) -> DifferentialDrive | None:
    # what the program has for a wheelchair says nothing of this one: a body that is taken for too
    # small hits what its plans pass by
    for field in dataclasses.fields(DifferentialDrive):
        if field.init and field.name not in section:
            section.document.blame(section.line, f"robot.{field.name} is missing: measure it")
    return _read(section, DifferentialDrive, discs=_discs)


def _discs(value: Any) -> tuple[tuple[float, float], ...]:
    rows = door.array("robot", "discs", value, (None, 2))
    return tuple((float(offset), float(radius)) for offset, radius in rows)


def _base(section: Section) -> BaseConfig | None:
    before = len(section.document.problems)
    kind = section.choice("kind", KINDS)
    given: dict[str, Any] = {
        key: section.number(key, above=0.0) for key in ("wheel_speed", "command_timeout", "runs_on")
    }
    given["odometry_period"] = section.number("odometry_period", 0.01, above=0.0, unit="s")
    fields: dict[str, Any] = {}
    for key, (type_, what) in (KINDS[kind].fields if kind else {}).items():
        fields[key] = section.take(key, _of(type_, key, what))
    if kind:  # what else is there cannot be judged without it
        section.finish()
    if len(section.document.problems) > before:
        return None
    return _built(section, BaseConfig, {"kind": kind, "fields": fields, **given})


def _of(kind: type, name: str, what: str) -> Callable[[Any], Any]:
    """A check of a field of one kind of base."""

    def check(value: Any) -> Any:
        if kind is float:
            return door.finite("base", name, value)
        if not isinstance(value, kind):
            raise ValueError(f"base.{name} must be {what}; got {value!r}")
        return value

    return check


def _planner(section: Section, robot: DifferentialDrive | None) -> Settings | None:
    given: dict[str, Any] = {}
    before = len(section.document.problems)
    for key in ("cycle", "object_speed"):
        if key not in section:
            section.document.blame(section.line, f"{section.name}.{key} is missing")
    for key, value, line in section.items():
        if key in MARGINS:
            section.document.blame(
                line,
                f"{section.name}.{key} is not to be set: it is reckoned from `measured`, the range"
                " finders and the cycle; leave it out",
            )
        given[key] = tuple(value) if isinstance(value, list) else value
    if robot is None or len(section.document.problems) > before:
        return None
    try:
        return Settings.for_robot(robot, **given)
    except ValueError as problem:
        at = next((key for key in given if f".{key}" in str(problem) or f"{key!r}" in str(problem)),
                  "")  # fmt: skip
        section.document.blame(section.line_of(at), problem)
        return None


def _lidar(section: Section, number: int) -> Lidar | None:
    before = len(section.document.problems)
    name = section.text("name", ("front", "rear")[min(number, 1)])
    host = section.text("host", None)
    port = section.whole("port", PORT, least=1, most=65535)
    mount = section.array("mount", (3,))
    range_max = section.number("range_max", 10.0, above=0.0, unit="m")
    noise = section.number("range_noise", 0.04, least=0.0, unit="m")
    upside_down = section.flag("upside_down", False)
    frozen = section.whole("frozen_after", FROZEN_AFTER, least=0)
    section.finish()
    if len(section.document.problems) > before:
        return None
    scip = None
    if host is not None:
        scip = _built(section, ScipSettings, {
            "host": host, "port": port, "range_max": range_max, "upside_down": upside_down,
            "frozen_after": frozen,
        })  # fmt: skip
        if scip is None:
            return None
    x, y, theta = map(float, mount)
    return Lidar(name=name, scip=scip, mount=(x, y, theta), range_max=range_max, range_noise=noise)


def _emulated(root: Section) -> Emulated | None:
    section = root.section("emulated")
    if section is None:
        return None
    scenario = section.text("scenario")
    seed = section.whole("seed", 0, least=0)
    known = section.flag("walls_known", False)
    section.finish()
    return Emulated(scenario=scenario, seed=seed, walls_known=known)
