"""Scenarios: a robot, its range finders, a world and goals, as a YAML file says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from passpmp_ti import door
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.sources import MoverSource, NobodyMoves, RecordingSource
from passpmp_ti.sim.world import Bounds, World

SHIPPED = Path(__file__).parent / "scenarios"


@dataclass(frozen=True, kw_only=True, eq=False)
class Scenario:
    """All that an episode is made of but the seed."""

    name: str
    description: str = ""
    robot: Robot
    settings: Settings
    lidars: tuple[Lidar, ...]
    bounds: Bounds
    polygons: tuple[np.ndarray, ...] = ()
    """Solid things that stay, each [n, 2] [m]."""
    walls: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    """[n, 4] loose walls x1, y1, x2, y2 [m]."""
    movers: MoverSource = field(default_factory=NobodyMoves)
    start: tuple[float, float, float]
    """(x, y, theta) of the robot, at rest [m, m, rad]."""
    start_spread: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Each seed moves the start by at most this, along x, y and theta [m, m, rad]."""
    goals: tuple[tuple[float, float], ...]
    """Places to be reached one after the other [m]."""
    duration: float
    """The episode's longest [s]."""
    static_map: StaticMap | None = None
    """What the planner is told of what stays; None: nothing."""

    def __post_init__(self) -> None:
        problem = self.problem_with_places()
        if problem:
            raise ValueError(f"Scenario {self.name!r}: {problem[1]}")

    def problem_with_places(self) -> tuple[str, str] | None:
        """(field, what is wrong) where the robot cannot stand at its start or a goal, else None."""
        still = self.still_world()
        for key, places in (("start", [self.start[:2]]), ("goals", self.goals)):
            for place, gap in zip(places, still.clearance(np.array(places)), strict=True):
                least = self.robot.radius if key == "start" else self.robot.disc_radius
                if gap <= least:
                    return key, (
                        f"{key}: ({place[0]:g}, {place[1]:g}) is {gap:.2f} m from something fixed;"
                        f" the robot needs more than {least:.2f} m"
                    )
        return None

    def still_world(self) -> World:
        """The world without its movers."""
        return World(self.bounds, self.polygons, self.walls)

    def build(self, seed: int = 0) -> tuple[World, np.ndarray, float]:
        """The world of one episode.

        Args:
            seed: chooses the movers, or the time at which a recording is entered, and where
                within `start_spread` the robot starts; >= 0.

        Returns:
            The world, the robot's state [5] at rest, and the start time [s].

        Raises:
            ValueError: a bad seed, or no room for the movers.
        """
        seed = door.whole("Scenario.build", "seed", seed, least=0)
        movers, start_time = self.movers.draw(
            self.still_world(), self.start, self.duration, seed, np.random.default_rng([seed, 0])
        )
        world = World(self.bounds, self.polygons, self.walls, movers)
        return world, np.array([*self._start_of(seed), 0.0, 0.0]), start_time

    def _start_of(self, seed: int) -> np.ndarray:
        """The start that a seed draws: seed 0 has the scenario's own."""
        if seed == 0:
            return np.array(self.start)
        generator = np.random.default_rng([seed, 1])
        still, spread = self.still_world(), np.array(self.start_spread)
        for _ in range(1000):
            start = np.array(self.start) + spread * generator.uniform(-1, 1, 3)
            if still.clearance(start[None, :2])[0] > self.robot.radius:
                return start
        return np.array(self.start)

    def changed(
        self,
        settings: Mapping[str, Any] | None = None,
        *,
        object_speed: float | None = None,
        movers_speed: float | None = None,
    ) -> Scenario:
        """This scenario with other settings, or at another speed.

        Args:
            settings: fields of `Settings` to replace.
            object_speed: the planner's bound v_b [m/s]; movers that would be faster are slowed
                down together to keep it. Recorded people walk as they did: who is faster than
                the bound is then an assumption broken on purpose.
            movers_speed: the fastest mover's speed [m/s], whatever the bound says.

        Raises:
            ValueError: an unknown or a bad setting; `movers_speed` of recorded people.
        """
        new = self.settings.changed(**(settings or {}))
        movers = self.movers
        if object_speed is not None:
            speed = door.finite(
                "Scenario.changed", "object_speed", object_speed, least=0.0, unit="m/s"
            )
            if new.blind_speed is not None:
                new = new.changed(blind_speed=min(new.blind_speed, speed))
            new = new.changed(object_speed=speed)
            if not self.recorded and movers.top_speed > speed:
                movers = movers.paced(speed)
        if movers_speed is not None:
            movers = movers.paced(
                door.finite("Scenario.changed", "movers_speed", movers_speed, least=0.0, unit="m/s")
            )
        return replace(self, settings=new, movers=movers)

    @property
    def recorded(self) -> bool:
        """Whether the movers are recorded people."""
        return isinstance(self.movers, RecordingSource)


def shipped() -> list[str]:
    """Names of the scenarios that come with the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def load_scenario(name: str | Path) -> Scenario:
    """Load a shipped scenario by its name, or a YAML file by its path.

    Raises:
        ValueError: no such scenario (the nearest name is suggested and all are listed), or
            everything that is wrong with the file, each with its line and what is allowed.
    """
    from passpmp_ti.sim.scenario_file import read_scenario

    path = Path(name)
    if path.suffix in (".yaml", ".yml") or path.is_file():
        return read_scenario(path)
    if str(name) in shipped():
        return read_scenario(SHIPPED / f"{name}.yaml")
    raise ValueError(
        f"no scenario {str(name)!r}{door.nearest(name, shipped())}; shipped: "
        f"{', '.join(shipped())}; or give the path of a YAML file"
    )
