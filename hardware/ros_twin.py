"""A chair that is none, as a node: range finders and odometry out, cmd_vel in.

With MuJoCo it is the physics twin's chair, without it plain kinematics; the world and its people
are a scenario's. It judges itself: what touches it while it moves is counted.
"""

from __future__ import annotations

import importlib.util
import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hardware.base import Odometry
from hardware.chair_model import WALL_HALF, ChairNature
from hardware.priority import put_forward
from hardware.ros_clock import RosClock
from hardware.ros_messages import (
    Pose,
    Untrusted,
    laser_scan,
    map_message,
    odometry_message,
    transforms,
    wheels_from,
)
from hardware.ros_port import DIAGNOSTICS, GRID, ODOMETRY, SCAN, TRANSFORMS, TWIST, Port
from hardware.ros_show import ERROR, OK, diagnostics
from hardware.simulated_base import BaseNature, SimulatedBase
from passpmp_ti import door
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.scan import Scan
from passpmp_ti.sim.drive import Drive
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.scenario import Scenario, load_scenario

LOOK = 0.002
"""It moves on this often [s]."""
SCANNING = 0.025
"""From one sweep to the next [s]."""
AT_ONCE = 0.001
"""A sweep without physics is told to last so long [s]: one that tells nothing may last as long as
any, and would not be over when it comes."""
TELL = 1.0
"""From one look of the judge to the next [s]."""
PRIORITY = 5
"""Of SCHED_FIFO, where it is granted: the world is never late."""
STANDING = 0.01
"""Wheels that go no faster over ground than this are at rest, to the judge [m/s]."""
KINDS = ("auto", "mujoco", "plain")
ODOM, BASE = "odom", "base_link"
"""Frames."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RosTwinSettings:
    """Which world, and which chair."""

    scenario: str = "corridor_person"
    """A shipped name, or a file."""
    seed: int = 0
    """Of the world, of the chair and of all noise."""
    object_speed: float | None = None
    """Bound on the speed of objects [m/s]; faster movers are slowed down. None: the scenario's."""
    chair: str = "auto"
    """"mujoco", "plain" kinematics, or "auto": MuJoCo where it is installed."""
    greeting: float = 5.0
    """People begin to walk this long after the node has started [s]."""
    summary: str = ""
    """File that tells, at the end, what it came to; empty: none."""

    def __post_init__(self) -> None:
        for name in ("scenario", "summary"):
            door.text("RosTwinSettings", name, getattr(self, name))
        if self.object_speed is not None:
            door.finite("RosTwinSettings", "object_speed", self.object_speed, least=0.0, unit="m/s")
        door.choice("RosTwinSettings", "chair", self.chair, KINDS)
        door.whole("RosTwinSettings", "seed", self.seed, least=0)
        door.finite("RosTwinSettings", "greeting", self.greeting, least=0.0, unit="s")

    @classmethod
    def from_parameters(cls, given: Mapping[str, Any]) -> RosTwinSettings:
        """From plain values.

        Raises:
            ValueError: an unknown name (the nearest is suggested), or a value out of its range.
        """
        for name in given:
            door.choice("RosTwinSettings", "field", name, [f.name for f in fields(cls)])
        return cls(**given)

    @property
    def physical(self) -> bool:
        """Whether MuJoCo moves the chair."""
        there = importlib.util.find_spec("mujoco") is not None
        if self.chair == "mujoco" and not there:
            raise ValueError(
                "RosTwinSettings.chair = 'mujoco', which is not installed; pip install"
                " 'passpmp_ti[twin]', or take 'plain'"
            )
        return there and self.chair != "plain"


class Chair(Protocol):
    """What moves: as a `Base`."""

    def drive(self, right: float, left: float) -> None: ...
    def odometry(self) -> Odometry | None: ...
    def advance(self) -> None: ...


class Eye(Protocol):
    """A range finder on the chair."""

    lasts: float
    """A sweep, from its first beam to its last [s]."""

    def look(self, begin: float) -> Scan:
        """The sweep that began at a time of the monotonic clock [s]; it is over. Its stamp is when
        its first beam was measured, by that clock; its pose means nothing."""


class RosTwin:
    """The node, without its middleware."""

    def __init__(self, port: Port, settings: RosTwinSettings) -> None:
        """
        Raises:
            ValueError: no such scenario, or one that no chair can drive.
        """
        self.settings = settings
        scenario = load_scenario(settings.scenario).changed(object_speed=settings.object_speed)
        if not isinstance(scenario.robot, DifferentialDrive):
            raise ValueError(
                f"RosTwinSettings.scenario {scenario.name!r} drives a"
                f" {type(scenario.robot).__name__}; take one with `robot: {{type: differential}}`"
            )
        world, state, start = scenario.build(settings.seed)
        self._ahead = start - (time.monotonic() + settings.greeting)
        self._drive = Drive(scenario, world, state, start)
        self._rows: list[Odometry] = []
        self._last: Odometry | None = None
        self._told: Odometry | None = None
        rng = np.random.default_rng([settings.seed, 3])
        own, *others = rng.spawn(1 + len(scenario.lidars))
        make = physical_chair if settings.physical else plain_chair
        self._chair, self._eyes, self._track = make(
            scenario, world, state, self._ahead, own, others, settings.seed, self._rows.append
        )
        self._times = RosClock()
        self._frames = [f"laser_{n}" for n in range(len(scenario.lidars))]
        mounts = [
            (BASE, frame, lidar.mount)
            for frame, lidar in zip(self._frames, scenario.lidars, strict=True)
        ]
        self._scans = [
            port.publisher("scan" if n == 0 else f"scan_{n}", SCAN) for n in range(len(mounts))
        ]
        self._odometry = port.publisher("odom", ODOMETRY)
        self._moving = port.publisher("/tf", TRANSFORMS)
        self._diagnostics = port.publisher("/diagnostics", DIAGNOSTICS)
        port.publisher("/tf_static", TRANSFORMS, latched=True)(
            transforms(mounts, self._times.theirs(time.monotonic()))
        )
        if len(world.outline):
            known = StaticMap.from_segments(world.outline, thickness=2 * WALL_HALF)
            stamp = self._times.theirs(time.monotonic())
            port.publisher("map", GRID, latched=True)(map_message(known, stamp, ODOM))
        port.subscribe("cmd_vel", TWIST, self._hear)
        self._wanted: tuple[float, float] | None = None

    def run(self, leave: Callable[[], bool]) -> None:
        """Be a chair until `leave` says so; then write the summary."""
        put_forward("the twin", PRIORITY)
        begin = time.monotonic()
        # turned on one after the other, they turn apart
        turns = [begin + n * SCANNING / len(self._eyes) for n in range(len(self._eyes))]
        judged_at = begin
        try:
            while not leave():
                wanted, self._wanted = self._wanted, None
                if wanted is not None:
                    self._chair.drive(*wanted)
                self._chair.advance()
                self._times.look()
                self._tell_odometry()
                for n, eye in enumerate(self._eyes):
                    if time.monotonic() > turns[n] + eye.lasts + LOOK:
                        self._tell_scan(n, eye, turns[n])
                        # one that was missed is not made up for
                        late = time.monotonic() - turns[n]
                        turns[n] += SCANNING * max(1, math.floor(late / SCANNING))
                if time.monotonic() - judged_at >= TELL:
                    judged_at = time.monotonic()
                    self._judge()
                time.sleep(LOOK)
        finally:
            self._judge()
            if self.settings.summary:
                Path(self.settings.summary).write_text(json.dumps(self.told(), indent=2) + "\n")

    def told(self) -> dict[str, Any]:
        """What it came to so far, SI units."""
        contacts = self._drive.judge.contacts
        moving = sum(contact.moving for contact in contacts)
        x, y = (float(v) for v in self._drive.states[-1][-1, :2])
        goal = self._drive.scenario.goals[-1]
        near = self._drive.judge
        return {
            "scenario": self._drive.scenario.name, "chair": type(self._chair).__name__,
            "collisions_moving": moving, "collisions_at_rest": len(contacts) - moving,
            "distance_driven": self._drive.distance, "time_moving": self._drive.time_moving,
            "nearest_mover_moving": finite_or_none(near.nearest_mover),
            "nearest_fixed_moving": finite_or_none(near.nearest_wall),
            "x": x, "y": y, "to_goal": math.dist((x, y), goal),
        }  # fmt: skip

    def _hear(self, message: Any) -> None:
        try:
            self._wanted = wheels_from(message, self._track)
        except Untrusted:
            return  # as if nothing had been said

    def _tell_odometry(self) -> None:
        odometry = self._chair.odometry()
        if odometry is None or odometry is self._told:
            return
        self._told = odometry
        stamp = self._times.theirs(odometry.stamp)
        self._odometry(odometry_message(odometry, stamp, ODOM, BASE, self._track))
        pose: Pose = (odometry.x, odometry.y, odometry.theta)
        self._moving(transforms([(ODOM, BASE, pose)], stamp))

    def _tell_scan(self, n: int, eye: Eye, begin: float) -> None:
        scan = eye.look(begin)
        stamp = self._times.theirs(scan.stamp)
        self._scans[n](laser_scan(scan, stamp, self._frames[n], lasts=eye.lasts))

    def _judge(self) -> None:
        rows, self._rows[:] = list(self._rows), []
        if self._last is not None:
            rows.insert(0, self._last)
        if len(rows) < 2:
            return
        self._last = rows[-1]
        table = np.array(rows)
        states = table[:, 1:].copy()
        states[:, 2] = np.unwrap(states[:, 2])
        states[np.abs(states[:, 3:]).max(axis=1) <= STANDING, 3:] = 0.0
        self._drive.follow(table[:, 0] + self._ahead, states)
        told = self.told()
        level = ERROR if told["collisions_moving"] else OK
        self._diagnostics(
            diagnostics(
                "passpmp twin", level, told["scenario"], told,
                self._times.theirs(time.monotonic()),
            )
        )  # fmt: skip


def finite_or_none(gap: float) -> float | None:
    """A gap as JSON has it: None where nothing was ever near."""
    return gap if math.isfinite(gap) else None


def physical_chair(
    scenario: Scenario,
    world: Any,
    state: np.ndarray,
    ahead: float,
    rng: np.random.Generator,
    others: list[np.random.Generator],
    seed: int,
    log: Callable[[Odometry], None],
) -> tuple[Chair, list[Eye], float]:
    """(chair, range finders, distance between its wheels [m]) of the physics twin."""
    from hardware.chair_lidar import ChairLidar
    from hardware.mujoco_chair import MujocoChair
    from hardware.scip_sweep import UST_10LX

    nature = ChairNature.drawn(np.random.default_rng([seed, 2]))
    x, y, theta = (float(v) for v in state[:3])
    chair = MujocoChair(world, nature, rng=rng, pose=(x, y, theta), begin=ahead, log=log)

    class Turning:
        lasts = UST_10LX.after(UST_10LX.last)

        def __init__(self, lidar: Lidar, rng: np.random.Generator) -> None:
            self._cast = ChairLidar(chair, lidar.mount, rng)
            self._range_max = lidar.range_max

        def look(self, begin: float) -> Scan:
            ranges = self._cast(begin)
            step = 2 * math.pi / UST_10LX.steps_per_turn
            low = (UST_10LX.first - UST_10LX.front) * step
            return Scan(ranges, low, step, self._range_max, pose=(0.0, 0.0, 0.0), stamp=begin)

    eyes: list[Eye] = [Turning(lidar, r) for lidar, r in zip(scenario.lidars, others, strict=True)]
    return chair, eyes, nature.limits.track


def plain_chair(
    scenario: Scenario,
    world: Any,
    state: np.ndarray,
    ahead: float,
    rng: np.random.Generator,
    others: list[np.random.Generator],
    seed: int,
    log: Callable[[Odometry], None],
) -> tuple[Chair, list[Eye], float]:
    """The same without physics: a sweep is of one instant."""
    nature = BaseNature(slip=0.05, pose_noise=0.002, heading_noise=0.002, speed_noise=0.004)
    x, y, theta = (float(v) for v in state[:3])
    chair = SimulatedBase(nature, rng=rng, pose=(x, y, theta), log=log)

    class Still:
        lasts = AT_ONCE

        def __init__(self, lidar: Lidar, rng: np.random.Generator) -> None:
            self._lidar, self._rng = lidar, rng

        def look(self, begin: float) -> Scan:
            truth = chair.truth
            scan = self._lidar.scan(world, np.array(truth[1:]), truth.stamp + ahead, self._rng)
            return replace(scan, stamp=truth.stamp)

    eyes: list[Eye] = [Still(lidar, r) for lidar, r in zip(scenario.lidars, others, strict=True)]
    return chair, eyes, nature.limits.track
