"""Where a scenario's movers come from: drawn at random, written down, or recorded."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from passpmp_ti.sim.movers import Movers, NoMovers, PathMovers, stretched
from passpmp_ti.sim.recordings import Recording, recorded_movers
from passpmp_ti.sim.splines import draw_spline_movers
from passpmp_ti.sim.world import Bounds, World

START_TIMES = 20  # seeds 0 .. 19 spread over a recording
GOLDEN = 0.6180339887498949


class MoverSource(Protocol):
    """Makes the movers of one episode."""

    @property
    def top_speed(self) -> float:
        """No mover is ever faster [m/s]."""

    def draw(
        self,
        still: World,
        start: tuple[float, float, float],
        duration: float,
        seed: int,
        generator: np.random.Generator,
    ) -> tuple[Movers, float]:
        """Movers for a world whose fixed things are known, and the episode's start time [s]."""

    def paced(self, top_speed: float) -> MoverSource:
        """The same movers with all speeds in proportion, the greatest now `top_speed` [m/s]."""


@dataclass(frozen=True)
class NobodyMoves:
    """A still world."""

    top_speed: float = 0.0

    def draw(
        self,
        still: World,
        start: tuple[float, float, float],
        duration: float,
        seed: int,
        generator: np.random.Generator,
    ) -> tuple[Movers, float]:
        return NoMovers(), 0.0

    def paced(self, top_speed: float) -> NobodyMoves:
        return self


@dataclass(frozen=True, kw_only=True)
class SplineSource:
    """Discs on random closed B-splines inside the bounds."""

    count: int
    radius: tuple[float, float]
    """Least and greatest radius [m]."""
    speed: tuple[float, float]
    """Least and greatest speed [m/s]."""
    keep_out: float = 10.0
    """No disc is nearer to the robot at the start [m]."""

    @property
    def top_speed(self) -> float:
        return self.speed[1]

    def draw(
        self,
        still: World,
        start: tuple[float, float, float],
        duration: float,
        seed: int,
        generator: np.random.Generator,
    ) -> tuple[Movers, float]:
        movers = draw_spline_movers(
            self.count,
            self.radius,
            self.speed,
            still.bounds,
            still.clearance,
            (start[0], start[1], self.keep_out),
            generator,
        )
        return movers, 0.0

    def paced(self, top_speed: float) -> SplineSource:
        factor = top_speed / self.speed[1] if self.speed[1] else 0.0
        return replace(self, speed=(self.speed[0] * factor, top_speed))


@dataclass(frozen=True, kw_only=True)
class ScriptSource:
    """Discs along waypoints that the scenario gives with their times."""

    paths: tuple[tuple[tuple[float, float, float], ...], ...]
    """Per disc rows (t, x, y) [s, m, m]; straight lines between them."""
    radius: tuple[float, ...]
    """Per disc [m]."""

    @property
    def top_speed(self) -> float:
        return self._movers.top_speed

    @property
    def _movers(self) -> PathMovers:
        return PathMovers([np.array(p) for p in self.paths], np.array(self.radius))

    def draw(
        self,
        still: World,
        start: tuple[float, float, float],
        duration: float,
        seed: int,
        generator: np.random.Generator,
    ) -> tuple[Movers, float]:
        return self._movers, 0.0

    def paced(self, top_speed: float) -> ScriptSource:
        now = self.top_speed
        if now == 0:
            return self
        if top_speed <= 0:
            stood = tuple((path[0],) for path in self.paths)
            return replace(self, paths=stood)
        return replace(self, paths=stretched(self.paths, now / top_speed))


@dataclass(frozen=True, kw_only=True)
class RecordingSource:
    """People as recorded; the seed chooses when the episode starts."""

    recording: Recording
    edge: Bounds
    """Where people come from and go to, beyond what the robot can see [m]."""
    radius: float = 0.25
    """Of a person's disc [m]."""
    keep_out: float = 1.5
    """The start waits until nobody is nearer to the robot [m]."""
    start_time: float | None = None
    """Time of the recording at which every episode starts [s]; None: by seed."""

    @cached_property
    def tracks(self) -> list[np.ndarray]:
        """The recording's own tracks."""
        return self.recording.tracks()

    @cached_property
    def top_speed(self) -> float:
        return PathMovers(self.tracks, np.ones(len(self.tracks))).top_speed

    def draw(
        self,
        still: World,
        start: tuple[float, float, float],
        duration: float,
        seed: int,
        generator: np.random.Generator,
    ) -> tuple[Movers, float]:
        movers = recorded_movers(self.tracks, self.edge, still.outline, self.radius)
        return movers, self._start(movers, start, duration, seed)

    def _start(
        self, movers: PathMovers, start: tuple[float, float, float], duration: float, seed: int
    ) -> float:
        first = min(float(track[0, 0]) for track in self.tracks)
        last = max(float(track[-1, 0]) for track in self.tracks)
        if self.start_time is not None:
            time = self.start_time
        else:
            lap, slot = divmod(seed, START_TIMES)
            share = ((slot + 0.5) / START_TIMES + lap * GOLDEN / START_TIMES) % 1.0
            time = first + share * max(last - duration - first, 0.0)
        time = math.floor(time * 1000) / 1000  # whole milliseconds, as stamps have
        while time < last:
            apart = np.hypot(*(movers.at(time) - start[:2]).T) - movers.radius
            if not (movers.present(time) & (apart < self.keep_out)).any():
                return time
            time = round(time + 0.1, 3)
        raise ValueError(
            f"{self.recording.path}: from the chosen time on somebody is always within"
            f" {self.keep_out:g} m of the robot's start {start[:2]}; move the start"
        )

    def paced(self, top_speed: float) -> RecordingSource:
        raise ValueError(
            "recorded people walk as they were recorded; change settings.object_speed instead of"
            " their speed"
        )
