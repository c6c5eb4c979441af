"""The `movers` of a scenario file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from passpmp_ti import door
from passpmp_ti.sim.data_files import find_data
from passpmp_ti.sim.document import Section
from passpmp_ti.sim.patrol import PatrolSource
from passpmp_ti.sim.recordings import FORMATS, Recording
from passpmp_ti.sim.sources import (
    MoverSource,
    NobodyMoves,
    RecordingSource,
    ScriptSource,
    SplineSource,
)


def read_movers(root: Section) -> MoverSource:
    """The movers of a scenario; nobody where there are none or where they are wrong."""
    section = root.section("movers")
    if section is None:
        return NobodyMoves()
    readers = {
        "spline": _splines,
        "scripted": _script,
        "patrol": _patrol,
        "recording": _recording,
    }
    kind = section.choice("type", readers)
    if kind not in readers:
        return NobodyMoves()
    source = readers[kind](section)
    section.finish()
    return source


def _splines(section: Section) -> MoverSource:
    count = section.whole("count", least=1, most=10_000)
    radius = section.take("radius", _span(section, "radius", above=0.0))
    speed = section.take("speed", _span(section, "speed", least=0.0))
    keep_out = section.number("keep_out", 10.0, least=0.0, unit="m")
    if count is None or radius is None or speed is None:
        return NobodyMoves()
    return SplineSource(count=count, radius=radius, speed=speed, keep_out=keep_out)


def _span(section: Section, key: str, **limits: Any) -> Callable[[Any], tuple[float, float]]:
    def check(value: Any) -> tuple[float, float]:
        low, high = door.array(section.name, key, value, (2,)).tolist()
        door.finite(section.name, f"{key}[0]", low, **limits)
        if low > high:
            raise ValueError(f"{section.name}.{key} must be [least, greatest]; got {value!r}")
        return low, high

    return check


def _script(section: Section) -> MoverSource:
    paths, radii = [], []
    for disc in section.sections("discs"):
        radii.append(disc.number("radius", 0.25, above=0.0, unit="m"))
        paths.append(disc.take("waypoints", _waypoints(disc)))
        disc.finish()
    if not paths and "discs" not in section:
        section.document.blame(section.line, f"{section.name}.discs is missing")
    if not paths or any(p is None for p in paths):
        return NobodyMoves()
    return ScriptSource(paths=tuple(paths), radius=tuple(radii))


def _patrol(section: Section) -> MoverSource:
    script = _script(section)
    if not isinstance(script, ScriptSource):
        return script
    try:
        return PatrolSource(paths=script.paths, radius=script.radius)
    except ValueError as problem:
        section.document.blame(section.line, problem)
        return NobodyMoves()


def _waypoints(disc: Section) -> Callable[[Any], tuple[tuple[float, float, float], ...]]:
    def check(value: Any) -> tuple[tuple[float, float, float], ...]:
        rows = door.array(disc.name, "waypoints", value, (None, 3))
        if not len(rows) or (np.diff(rows[:, 0]) <= 0).any():
            raise ValueError(f"{disc.name}.waypoints must be rows [t, x, y] with t increasing")
        return tuple((float(t), float(x), float(y)) for t, x, y in rows)

    return check


def _recording(section: Section) -> MoverSource:
    path = section.take("file", lambda text: find_data(str(text), section.document.path))
    format_ = section.choice("format", FORMATS)
    clock = section.number("clock", above=0.0, unit="frames/s")
    edge = section.array("edge", (4,))
    radius = section.number("radius", 0.25, above=0.0, unit="m")
    keep_out = section.number("keep_out", 1.5, least=0.0, unit="m")
    start_time = section.number("start_time", None, unit="s")
    if path is None or format_ is None or clock is None or edge is None:
        return NobodyMoves()
    return RecordingSource(
        recording=Recording(path=path, format=format_, clock=clock),
        edge=tuple(edge.tolist()),
        radius=radius,
        keep_out=keep_out,
        start_time=start_time,
    )
