"""The Jackal of BARN and DynaBARN: its body, its limits, and its range finder."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from passpmp_ti import door
from passpmp_ti.robots import DifferentialDrive, cover_rectangle
from passpmp_ti.scan import Scan
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.world import World

LENGTH, WIDTH = 0.508, 0.43
"""Of the body, wheels and fenders included [m]; the reference point is its middle."""
DISCS = 5
"""On the axis; together they stick out of the body by 6 mm at the sides."""
ACCELERATION_LIMITS = (10.0, 20.0)
"""acc_lim_x [m/s^2] and acc_lim_theta [rad/s^2] of the benchmark's planner parameters
(jackal_base_local_planner_params.yaml)."""
TURN_RATE = 4.0
"""Angular limit of the robot's own velocity controller [rad/s] (jackal_control/config/control.yaml,
which also has the 2 m/s)."""
TRACK = 0.37559
"""[m] (jackal_description/urdf/jackal.urdf.xacro)."""


@dataclass(frozen=True, kw_only=True)
class Jackal(DifferentialDrive):
    """A differential drive that turns no faster than its controller allows."""

    turn_rate: float = TURN_RATE
    """Greatest [rad/s]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        door.finite("Jackal", "turn_rate", self.turn_rate, above=0.0, unit="rad/s")
        # braking one wheel harder than the other could turn it faster than it may
        even = tuple(control for control in self.braking if control[1] == control[2])
        object.__setattr__(self, "braking", even)

    @property
    def top_turn_rate(self) -> float:
        return min(self.turn_rate, super().top_turn_rate)

    def integration_error(self, time_step: float) -> float:
        # once more a jump of the turn's acceleration within a step: where the limit is reached
        jump = 2 * self.acceleration / self.track * time_step**2 / 4
        way = self.wheel_speed * self.longest_braking / 2
        return super().integration_error(time_step) + (way + self.overhang) * jump

    def parameters(self) -> np.ndarray:
        numbers = super().parameters()
        numbers[2] = self.top_turn_rate * self.track
        return numbers

    def check_states(self, owner: str, states: object) -> np.ndarray:
        given = super().check_states(owner, states)
        turn = np.abs(given[:, 3] - given[:, 4]) / self.track
        bad = np.flatnonzero(turn > self.top_turn_rate * (1 + 1e-5) + 1e-6)
        if len(bad):
            raise ValueError(
                f"{owner}.states[{bad[0]}]: |v_r - v_l| / track = {turn[bad[0]]:.6g} rad/s is"
                f" beyond the robot's limit {self.top_turn_rate:g} rad/s ({len(bad)} of"
                f" {len(given)} bad); nothing is proven for a robot that can do what it does not"
                " declare"
            )
        return given


JACKAL = Jackal(
    discs=cover_rectangle(LENGTH / 2, LENGTH / 2, WIDTH, DISCS),
    wheel_speed=2.0,
    # the turn is what limits the wheels: 2 a / track stays below 20 rad/s^2, and a below 10 m/s^2
    acceleration=3.75,
    track=TRACK,
)
SWEEP = math.radians(270.0)
NOISE = 1e-3
"""Standard deviation of a range [m]; the simulated sensor's errors end at three of them."""
RANGE = 30.0
MOUNT = (0.12, 0.0, 0.0)
"""Of the sensor on the robot: the front mount of jackal.urdf.xacro [m, m, rad]."""


@dataclass(frozen=True, kw_only=True)
class StillLidar(Lidar):
    """A range finder in a world that is known to stand still: every surface met stays."""

    def scan(
        self,
        world: World,
        robot_pose: np.ndarray,
        stamp: float,
        generator: np.random.Generator | None = None,
    ) -> Scan:
        seen = super().scan(world, robot_pose, stamp, generator)
        return replace(seen, moving=np.zeros(len(seen.ranges), dtype=bool))


def front_lidar(*, still: bool = False) -> Lidar:
    """The benchmarks' range finder: 720 beams over 270 degrees.

    Its least range, 0.1 m, is left out: from the mount, what is nearer is inside the body.

    Args:
        still: every return is declared to stay; else every one may move.
    """
    kind = StillLidar if still else Lidar
    return kind(range_max=RANGE, beams=720, field_of_view=SWEEP, mount=MOUNT, noise=NOISE)


def rear_lidar() -> Lidar:
    """The same looking backwards. The benchmarks have none."""
    x, y, theta = MOUNT
    return Lidar(
        range_max=RANGE, beams=720, field_of_view=SWEEP, mount=(-x, y, theta + math.pi), noise=NOISE
    )
