"""A band of movers that hunt the robot: hide, strike, leave, again."""

from __future__ import annotations

import numpy as np

from passpmp_ti.attack import spots
from passpmp_ti.attack.hunted import Hunted
from passpmp_ti.attack.pursuit import around, meeting, shortfall, towards
from passpmp_ti.attack.roadmap import Roadmap, crossed

WALK, INTERCEPT, AMBUSH, RIM, CUT_IN, CROWD, SHADOW = range(7)
"""What a mover is; `case.HUNTERS` says what each does."""
HIDE, STRIKE, LEAVE = range(3)
"""What it is doing."""

SKIN = 0.05  # nearer than this to the robot a walker is in its way [m]
SIDESTEP = 0.3  # who does not strike goes round the robot at this distance [m]


class Band:
    """Decides where each mover goes. `think` once a cycle: ways and hiding places; `steer` every
    tick: where to run, and whether now is the moment."""

    def __init__(
        self,
        kinds: np.ndarray,
        speed: np.ndarray,
        radius: np.ndarray,
        roadmap: Roadmap,
        outline: np.ndarray,
        sensor_range: float,
        braking_time: float,
        tick: float,
        generator: np.random.Generator,
    ) -> None:
        """Form a band.

        Args:
            kinds: [m] WALK, INTERCEPT, ...
            speed: [m] greatest speed of each [m/s].
            radius: [m] [m].
            roadmap: ways about what stands.
            outline: [s, 4] surfaces that stay [m].
            sensor_range: of the robot's sensors [m].
            braking_time: about how long the robot takes to stop [s].
            tick: time between two decisions [s].
            generator: where whims come from.
        """
        count = len(kinds)
        self.kinds, self.speed, self.radius = kinds, speed, radius
        self._roadmap, self._outline, self._range = roadmap, outline, sensor_range
        self._braking_time, self._tick, self._draw = braking_time, tick, generator
        self.phase = np.where(kinds == WALK, LEAVE, HIDE)
        self._since = np.zeros(count)
        self._until = np.zeros(count)
        self._refresh = np.zeros(count)
        self._patience = np.ones(count)
        self._slack = np.zeros(count)
        self._lead = np.zeros(count)
        self._coasting = np.zeros(count, dtype=bool)
        self._routed = np.ones(count, dtype=bool)
        self._leaning = np.zeros(count)
        self._aim = np.full((count, 2), np.nan)
        self._rest: list[list[np.ndarray]] = [[] for _ in range(count)]
        self._bearing = 2 * np.pi * np.arange(count) / max(count, 1)
        self._ring, self._thought = 0.0, 0.0
        for n in range(count):
            self._whims(n)

    def _whims(self, n: int) -> None:
        """Draw anew how one strikes: when it thinks it has a chance, and how it aims."""
        draw = self._draw
        scale = float(self.speed[n]) * self._braking_time
        most = {AMBUSH: 1.5, CUT_IN: 1.5, SHADOW: 0.5}.get(int(self.kinds[n]), np.inf)
        self._slack[n] = draw.uniform(0.0, 1.0) * most * scale if np.isfinite(most) else np.inf
        self._patience[n] = draw.uniform(0.3, 2.0)
        self._lead[n] = draw.uniform(0.0, 1.0) * scale
        self._coasting[n] = draw.uniform() < 0.6

    def think(self, robot: Hunted, places: np.ndarray) -> None:
        """Ways, hiding places, and who gives up; once a cycle.

        Args:
            robot: as it is and as it will go.
            places: [m, 2] where they are now [m].
        """
        if np.isnan(self._aim).any():
            self._aim = places.copy()
        here = robot.state[:2]
        walled = crossed(here, places, self._outline)
        gap = np.sqrt(((places - here) ** 2).sum(axis=1)) - robot.radius - self.radius
        if (self.kinds == CROWD).any():
            self._close_in(robot)
        for n in range(len(places)):
            arrived = not self._rest[n] and bool(np.allclose(places[n], self._aim[n], atol=1e-3))
            phase = self.phase[n]
            if self.kinds[n] == WALK:
                self._walk(n, robot, places, float(gap[n]), arrived)
            elif phase == STRIKE:
                if robot.still_for > self._patience[n]:
                    self._leave(n, robot, places)
                else:
                    self._follow(n, robot, places, bool(walled[n]))
            elif phase == LEAVE and (arrived or robot.time > self._until[n]):
                self._whims(n)
                self.phase[n], self._refresh[n] = HIDE, -1.0
            if self.phase[n] == HIDE:
                self._hide(n, robot, places)

    def steer(self, robot: Hunted, places: np.ndarray) -> np.ndarray:
        """[m, 2] velocities [m/s]; every tick."""
        if not len(places):
            return np.zeros((0, 2))
        ahead = np.maximum(robot.ways.times - robot.time, 0.0)
        reach = self.radius + robot.radius
        coast = shortfall(places, self.speed, reach, robot.ways.coast, ahead)
        if robot.moving:
            chance = (self.phase == HIDE) & (coast.min(axis=1) < self._slack)
            chance &= self.kinds != RIM
            self._strike(chance, robot.time)
        direct = (self.phase == STRIKE) & ~self._routed
        if direct.any():
            held = shortfall(places, self.speed, reach, robot.ways.held, ahead)
            on_coast = robot.ways.coast[meeting(coast)]
            on_held = robot.ways.held[meeting(held)]
            aim = np.where(self._coasting[:, None], on_coast, on_held)
            heading = np.array([np.cos(robot.state[2]), np.sin(robot.state[2])])
            front = (reach + self._lead)[:, None] * heading * np.sign(robot.speed)
            aim = np.where((self.kinds == CUT_IN)[:, None], on_coast + front, aim)
            if (self.kinds == CROWD).any():
                bearing = np.stack([np.cos(self._bearing), np.sin(self._bearing)], axis=1)
                ring = robot.state[:2] + (reach[:, None] + self._ring) * bearing
                aim = np.where((self.kinds == CROWD)[:, None], ring, aim)
            self._aim = np.where(direct[:, None], aim, self._aim)
        velocity = towards(places, self._aim, self.speed, self._tick)
        self._next_points(places)
        keep = self.radius + robot.cover + SIDESTEP
        aside = around(velocity, places, robot.state[:2], keep)
        return np.where((self.phase == STRIKE)[:, None], velocity, aside)

    def _strike(self, chance: np.ndarray, now: float) -> None:
        self.phase = np.where(chance, STRIKE, self.phase)
        self._since = np.where(chance, now, self._since)
        self._routed = self._routed & ~chance

    def _next_points(self, places: np.ndarray) -> None:
        waiting = (self.phase != STRIKE) | self._routed
        gap = self._aim - places
        near = waiting & ((gap * gap).sum(axis=1) < (self.speed * self._tick + 1e-3) ** 2)
        for n in np.flatnonzero(near):
            if self._rest[n]:
                self._aim[n] = self._rest[n].pop(0)

    def _go(self, n: int, way: list[np.ndarray]) -> None:
        self._aim[n], self._rest[n] = way[0], list(way[1:])
        self._routed[n] = True

    def _follow(self, n: int, robot: Hunted, places: np.ndarray, walled: bool) -> None:
        """Straight at it, or round the corner that is between."""
        if not walled:
            self._routed[n], self._rest[n] = False, []
        elif robot.time >= self._refresh[n] or not self._routed[n]:
            nearest = spots.nearest(self._roadmap, robot.state[:2])
            self._go(n, self._roadmap.way(places[n], nearest))
            self._refresh[n] = robot.time + 0.5

    def _leave(self, n: int, robot: Hunted, places: np.ndarray) -> None:
        """Away from a robot that stands, so that it moves again."""
        least = self._draw.uniform(0.4, 1.1) * self._range
        goal = spots.away(self._roadmap, robot.state[:2], least, self._draw)
        self._go(n, self._roadmap.way(places[n], goal))
        self.phase[n] = LEAVE
        self._until[n] = robot.time + self._draw.uniform(4.0, 12.0)

    def _hide(self, n: int, robot: Hunted, places: np.ndarray) -> None:
        kind, draw = self.kinds[n], self._draw
        if kind == RIM and robot.moving and draw.uniform() < 0.02:
            self._strike(np.arange(len(places)) == n, robot.time)
        if robot.time < self._refresh[n]:
            return
        self._refresh[n] = robot.time + draw.uniform(0.4, 1.2)
        if kind == AMBUSH:
            # a post is kept while it lies ahead
            self._refresh[n] = robot.time + draw.uniform(2.0, 6.0)
            goal = spots.post(self._roadmap, self._outline, robot, self._range, draw)
            self._go(n, self._roadmap.way(places[n], goal))
        elif kind == CUT_IN:
            goal = spots.beside(self._roadmap, robot, self._range, draw)
            self._go(n, self._roadmap.way(places[n], goal))
        elif kind == RIM:
            self._go(n, [spots.rim(robot, self._range + self.radius[n] + 0.05, draw)])
        elif kind == SHADOW:
            spot = spots.shadow(self._roadmap, self._outline, robot, places, self.radius, n, draw)
            clear = self._roadmap.clear(places[n][None], spot[None])[0]
            way = (
                [spot]
                if clear
                else self._roadmap.way(places[n], spots.nearest(self._roadmap, spot))
            )
            self._go(n, way)

    def _close_in(self, robot: Hunted) -> None:
        """The ring shrinks while anybody strikes, and opens when all have left."""
        crowd = self.kinds == CROWD
        if not (crowd & (self.phase == STRIKE)).any():
            self._ring = self._draw.uniform(0.5, 1.0) * self._range
            self._thought = robot.time
            return
        since = robot.time - float(self._since[crowd & (self.phase == STRIKE)].min())
        if since > 0.5:
            closing = 0.5 * float(self.speed[crowd].min())
            self._ring = max(self._ring - closing * (robot.time - self._thought), 0.0)
        self._thought = robot.time

    def _walk(self, n: int, robot: Hunted, places: np.ndarray, gap: float, arrived: bool) -> None:
        """From place to place; who stands at the robot's skin turns away."""
        self._leaning[n] = self._leaning[n] + 1 if gap < SKIN else 0
        if arrived or self._leaning[n] > 5:
            self._leaning[n] = 0
            least = 0.3 * self._range
            goal = spots.away(self._roadmap, robot.state[:2], least, self._draw)
            self._go(n, self._roadmap.way(places[n], goal))
