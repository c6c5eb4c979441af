"""From a scenario's YAML file to a `Scenario`, every key checked."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from passpmp_ti import door
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.robots import CarLike, DifferentialDrive, Robot
from passpmp_ti.settings import Settings
from passpmp_ti.sim.data_files import find_data, read_lines
from passpmp_ti.sim.document import Document, Section
from passpmp_ti.sim.lidar import LABELS, Lidar
from passpmp_ti.sim.scenario import Scenario
from passpmp_ti.sim.scenario_movers import read_movers
from passpmp_ti.sim.sources import MoverSource, RecordingSource
from passpmp_ti.sim.world import World

ROBOTS: dict[str, type[Robot]] = {"car": CarLike, "differential": DifferentialDrive}


def read_scenario(path: Path) -> Scenario:
    """Read and validate one scenario file.

    Raises:
        ValueError: everything that is wrong, each with file, line and what is allowed.
    """
    document = Document(path)
    root = document.root
    robot = _robot(root)
    world, static_map = _world(root)
    movers = read_movers(root)
    lidars = tuple(_lidar(section) for section in root.sections("lidars"))
    if not lidars:
        document.blame(root.line_of("lidars"), "lidars must list at least one range finder")
    settings = _settings(root, robot, movers, lidars)
    start = root.array("start", (3,))
    spread = root.array("start_spread", (3,), np.zeros(3))
    goals = root.array("goals", (None, 2))
    if goals is not None and not len(goals):
        document.blame(root.line_of("goals"), "goals must hold at least one point [x, y]")
    duration = root.number("duration", above=0.0, unit="s")
    description = root.text("description", "")
    told = root.flag("static_map", False)
    root.finish()
    document.finish()
    if told and static_map is None:
        static_map = StaticMap.from_segments(world.outline)
    try:
        return Scenario(
            name=path.stem,
            description=description,
            robot=robot,
            settings=settings,
            lidars=lidars,
            bounds=world.bounds,
            polygons=tuple(world.polygons),
            walls=world.segments,
            movers=movers,
            start=tuple(start.tolist()),
            start_spread=tuple(spread.tolist()),
            goals=tuple(map(tuple, goals.tolist())),
            duration=duration,
            static_map=static_map if told else None,
        )
    except ValueError as problem:
        key = "start" if " start: " in str(problem) else "goals"
        raise ValueError(f"{path}:{root.line_of(key)}: {problem}") from problem


def _robot(root: Section) -> Robot:
    section = root.section("robot")
    if section is None:
        if "robot" not in root:
            root.document.blame(root.line, "robot is missing")
        return DifferentialDrive()
    kind = ROBOTS.get(section.choice("type", ROBOTS), DifferentialDrive)
    given = {}
    for field in dataclasses.fields(kind):
        if field.init and field.name in section:
            given[field.name] = section.take(field.name, lambda value: value)
        elif field.init:
            section.take(field.name, lambda value: value, None)
    section.finish()
    if "discs" in given:
        given["discs"] = _discs(section, given["discs"])
    try:
        return kind(**given)
    except ValueError as problem:
        at = next((key for key in given if f".{key}" in str(problem)), "type")
        section.document.blame(section.line_of(at), problem)
        return kind()


def _discs(section: Section, value: Any) -> tuple[tuple[float, float], ...]:
    try:
        rows = door.array(section.name, "discs", value, (None, 2))
    except ValueError as problem:
        section.document.blame(section.line_of("discs"), problem)
        return ((0.0, 0.4),)
    return tuple((float(offset), float(radius)) for offset, radius in rows)


def _lidar(section: Section) -> Lidar:
    beams = section.whole("beams", least=2)
    range_max = section.number("range_max", above=0.0, unit="m")
    degrees = section.number("field_of_view_deg", 360.0, above=0.0, most=360.0, unit="deg")
    mount = section.array("mount", (3,), np.zeros(3))
    noise = section.number("noise", 0.0, least=0.0, unit="m")
    labels = section.choice("labels", LABELS, "none")
    section.finish()
    return Lidar(
        range_max=range_max or 1.0,
        beams=beams or 2,
        field_of_view=math.radians(degrees),
        mount=tuple(mount.tolist()),
        noise=noise,
        labels=labels,
    )


def _settings(
    root: Section, robot: Robot, movers: MoverSource, lidars: tuple[Lidar, ...]
) -> Settings:
    own = Settings.for_robot(robot)
    section = root.section("settings")
    wanted: dict[str, Any] = {}
    noise = max((lidar.greatest_error for lidar in lidars), default=0.0)
    if noise > own.range_noise:
        wanted["range_noise"] = noise
    lines: dict[str, int] = {}
    for key, value, line in section.items() if section else []:
        if key == "object_speed" and value == "recording":
            if not isinstance(movers, RecordingSource):
                root.document.blame(line, "object_speed: recording needs movers that are recorded")
                continue
            try:
                value = movers.top_speed
            except ValueError as problem:
                root.document.blame(line, problem)
                continue
        wanted[key] = value
        lines[key] = line
    try:
        return own.changed(**wanted)
    except ValueError:
        # find who is to blame: some settings bound others, so those come first
        for key in sorted(lines, key=lambda k: k not in ("time_step", "object_speed")):
            try:
                own = own.changed(**{key: wanted[key]})
            except ValueError as problem:
                root.document.blame(lines[key], problem)
        return own


def _world(root: Section) -> tuple[World, StaticMap | None]:
    nowhere = (0.0, 0.0, 1.0, 1.0)
    section = root.section("world")
    if section is None:
        if "world" not in root:
            root.document.blame(root.line, "world is missing; it needs bounds at least")
        return World(nowhere), None
    bounds = section.array("bounds", (4,))
    polygons = section.take("polygons", _polygon_list(section), [])
    walls = section.array("walls", (None, 4), np.zeros((0, 4)))
    here = root.document.path
    static_map = section.take("map", lambda text: StaticMap.load(find_data(str(text), here)), None)
    lines = section.take("lines", lambda text: read_lines(find_data(str(text), here)), None)
    section.finish()
    parts = [walls]
    if static_map is not None:
        parts.append(static_map.segments())
    if lines is not None:
        parts.append(lines)
    if bounds is None:
        return World(nowhere), static_map
    try:
        world = World(tuple(bounds.tolist()), polygons, np.concatenate(parts))
    except ValueError as problem:
        key = "polygons" if "polygons" in str(problem) else "bounds"
        root.document.blame(section.line_of(key), problem)
        return World(nowhere), static_map
    # a map holds no more than itself: with other walls beside it the planner's is drawn from all
    alone = static_map is not None and not len(walls) and lines is None and not polygons
    return world, static_map if alone else None


def _polygon_list(section: Section) -> Callable[[Any], list[np.ndarray]]:
    def check(value: Any) -> list[np.ndarray]:
        if not isinstance(value, list):
            raise ValueError(f"{section.name}.polygons must be a list of polygons; got {value!r}")
        return [
            door.array(section.name, f"polygons[{n}]", polygon, (None, 2))
            for n, polygon in enumerate(value)
        ]

    return check
