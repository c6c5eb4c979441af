"""States to be checked: the same for every rival."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from passpmp_ti.bench.scenes import Scene
from passpmp_ti.robots import CarLike

LATEST = 2.0
"""States lie at most this long after the scan [s]."""
AT_ONCE = 1_000_000


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """States of a car and their times after the scan: one float32 array [n] of each."""

    x: np.ndarray
    y: np.ndarray
    theta: np.ndarray
    v: np.ndarray
    xi: np.ndarray
    t: np.ndarray

    def __len__(self) -> int:
        return len(self.x)

    def first(self, count: int) -> States:
        """The first `count` of them, not copied."""
        return States(*(getattr(self, f.name)[:count] for f in fields(self)))

    @property
    def columns(self) -> tuple[np.ndarray, ...]:
        """x, y, theta, v, xi, t."""
        return self.x, self.y, self.theta, self.v, self.xi, self.t

    @property
    def poses(self) -> np.ndarray:
        """[n, 7] float32 as our kernels read them."""
        return np.stack(
            [self.x, self.y, np.cos(self.theta), np.sin(self.theta), self.theta, self.v, self.xi],
            axis=1,
        )

    @property
    def ticks(self) -> np.ndarray:
        """[n] int32 [ms], rounded up: later is less safe."""
        return np.ceil(self.t.astype(np.float64) * 1000).astype(np.int32)


def draw(scene: Scene, arrival: np.ndarray, count: int) -> States:
    """States that are not occupied at their own time; arrival [J, I] in seconds."""
    robot = scene.robot
    if not isinstance(robot, CarLike):
        raise ValueError("states are drawn for a car")
    generator = np.random.default_rng(17)
    span = 0.7 * scene.range_max
    places: list[np.ndarray] = []
    found = 0
    while found < count:
        drawn = generator.uniform((-span, -span, 0.0), (span, span, LATEST), (AT_ONCE, 3))
        drawn = drawn.astype(np.float32)
        i, j = np.floor(drawn[:, :2].T / scene.cell).astype(int) + scene.size // 2
        places.append(drawn[arrival[j, i] > drawn[:, 2]])
        found += len(places[-1])
    x, y, t = np.concatenate(places)[:count].T

    def spread(low: float, high: float) -> np.ndarray:
        return generator.uniform(low, high, count).astype(np.float32)

    return States(
        np.ascontiguousarray(x),
        np.ascontiguousarray(y),
        spread(-math.pi, math.pi),
        spread(0.0, robot.v_max),
        spread(-robot.xi_max, robot.xi_max),
        np.ascontiguousarray(t),
    )
