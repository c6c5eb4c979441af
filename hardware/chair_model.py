"""A wheelchair, walls and people as MuJoCo is told of them (MJCF)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from hardware.base import BaseLimits
from passpmp_ti import door
from passpmp_ti.sim.world import World

TIME_STEP = 2e-3
"""Of the physics [s]."""
WHEEL_RADIUS = 0.16
"""As the chair's own electronics believe it [m]."""
LIDAR_HEIGHT = 0.35
"""Above the floor [m]."""
TALL = 1.0
"""Half the height of walls and people [m]: no beam passes over or under them."""
WALL_HALF = 0.01
"""Half the thickness of a wall [m]: its surface is this much nearer than the line it stands for."""
AWAY = -50.0
"""Height at which people are kept who are not there [m]."""
FLOOR_GROUP, CHAIR_GROUP, WALL_GROUP, PEOPLE_GROUP = 0, 1, 2, 3
"""MuJoCo's groups of geoms; the chair's own are not seen by its range finders."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChairNature:
    """How a chair is made, and how it differs from what its electronics believe."""

    limits: BaseLimits = field(default_factory=BaseLimits)
    mass: float = 126.0
    """With whoever sits in it [kg]."""
    ahead: float = 0.10
    """Centre of mass, ahead of the driven wheels' axle [m]."""
    height: float = 0.45
    """Of the centre of mass above the floor [m]."""
    friction: float = 0.8
    """Of a driven wheel on the floor."""
    slippery: float = 0.0
    """Share of that by which it is less at times, at random, for each wheel."""
    slip_time: float = 0.1
    """Time for which a friction lasts [s]."""
    radius_error: tuple[float, float] = (0.0, 0.0)
    """By how much the right and the left wheel are larger than `WHEEL_RADIUS`, as a share."""
    torque: float = 60.0
    """Greatest, of a wheel's motor [N m]."""
    gains: tuple[float, float, float] = (200.0, 600.0, 0.0)
    """Of a wheel's speed loop, on its speed over ground: proportional [N m/(m/s)], integral
    [N m/m], derivative [N m/(m/s^2)]."""
    rolling: float = 1.0
    """Torque by which a turning wheel is braked by its bearings and tyre [N m]."""
    anti_tippers: bool = True
    """Whether two small wheels behind keep it from tipping over backwards."""
    pose_noise: float = 0.0
    """Standard deviation of x and of y as they are told; cut at three of them [m]."""
    heading_noise: float = 0.0
    """The same of the heading [rad]."""
    speed_noise: float = 0.0
    """The same of the wheels' speeds [m/s]."""
    period: float = 0.01
    """Time from one odometry to the next [s]."""

    def __post_init__(self) -> None:
        name = "ChairNature"
        for above_0 in ("mass", "height", "friction", "torque", "slip_time"):
            door.finite(name, above_0, getattr(self, above_0), above=0.0)
        door.finite(name, "ahead", self.ahead, least=-0.2, most=0.2, unit="m")
        door.finite(name, "slippery", self.slippery, least=0.0, most=0.9)
        door.finite(name, "period", self.period, least=TIME_STEP, unit="s")
        for least_0 in ("rolling", "pose_noise", "heading_noise", "speed_noise"):
            door.finite(name, least_0, getattr(self, least_0), least=0.0)
        for field_, count in (("radius_error", 2), ("gains", 3)):
            door.array(name, field_, getattr(self, field_), (count,))
        if max(map(abs, self.radius_error)) > 0.2:
            raise ValueError(
                f"{name}.radius_error must be shares within 0.2; got {self.radius_error!r}"
            )

    @property
    def localisation_error(self) -> float:
        """Bound on the error of a told place [m]: `Settings.localisation_error` holds it."""
        return 3.0 * math.sqrt(2.0) * self.pose_noise

    @property
    def heading_error(self) -> float:
        """Bound on the error of a told heading [rad]."""
        return 3.0 * self.heading_noise

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> ChairNature:
        """A chair as one of many: load, tyres, floor and sensors as they may be."""
        right, left = rng.uniform(-0.01, 0.01, 2)
        return cls(
            mass=float(rng.uniform(110.0, 140.0)),
            ahead=float(rng.uniform(0.08, 0.12)),
            friction=float(rng.uniform(0.7, 0.9)),
            slippery=0.2,
            radius_error=(float(right), float(left)),
            rolling=float(rng.uniform(0.5, 2.0)),
            pose_noise=0.002, heading_noise=0.002, speed_noise=0.004,
        )  # fmt: skip


def mjcf(world: World, nature: ChairNature) -> str:
    """The model's text: a floor, the world's fixed surfaces as thin tall walls, its movers as
    mocap cylinders, and the chair.

    Casters and anti-tippers are spheres without friction: they carry, and do not steer. The casters
    hang on a fork that rolls, so that both driven wheels carry, however large they are. Nobody
    pushes the chair: whether people and chair touch is for a judge to say, and who walks by a
    clock would drive a standing chair before him.
    """
    walls = "".join(_wall(n, *segment) for n, segment in enumerate(world.outline.tolist()))
    people = "".join(
        f'<body name="mover{n}" mocap="true" pos="0 0 {AWAY}"><geom type="cylinder"'
        f' size="{radius:.6f} {TALL}" group="{PEOPLE_GROUP}" contype="0" conaffinity="0"'
        ' rgba=".8 .3 .2 1"/></body>'
        for n, radius in enumerate(world.movers.radius.tolist())
    )
    return f"""
<mujoco model="wheelchair">
  <option timestep="{TIME_STEP}" integrator="implicitfast" cone="elliptic" impratio="5"/>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" group="{FLOOR_GROUP}"
     friction="1 .005 .0001"/>
    {walls}{people}
    {_chair(nature)}
  </worldbody>
  <actuator>
    <motor name="right" joint="right" ctrlrange="-{nature.torque} {nature.torque}"/>
    <motor name="left" joint="left" ctrlrange="-{nature.torque} {nature.torque}"/>
  </actuator>
</mujoco>"""


def _wall(n: int, x1: float, y1: float, x2: float, y2: float) -> str:
    half = 0.5 * math.hypot(x2 - x1, y2 - y1) + WALL_HALF
    turn = math.atan2(y2 - y1, x2 - x1)
    return (
        f'<geom name="wall{n}" type="box" size="{half:.6f} {WALL_HALF} {TALL}"'
        f' pos="{0.5 * (x1 + x2):.6f} {0.5 * (y1 + y2):.6f} {TALL}"'
        f' quat="{math.cos(turn / 2):.9f} 0 0 {math.sin(turn / 2):.9f}" group="{WALL_GROUP}"/>'
    )


def _chair(nature: ChairNature) -> str:
    """Its frame: midway between the driven wheels, at the height of their axle. All of it lies
    within 0.4 m of that, which is the disc that is planned with."""
    wheels = 0.06 * nature.mass
    body = nature.mass - 2 * wheels - 1.0  # the fork
    # the wheels' masses stand on the axle; the rest brings the whole's centre where it should be
    ahead = nature.ahead * nature.mass / body
    up = (nature.height - WHEEL_RADIUS) * nature.mass / body
    own = f'group="{CHAIR_GROUP}"'
    small, lifted = 0.05, 0.004
    low = small - WHEEL_RADIUS

    def sphere(name: str, x: float, y: float, z: float) -> str:
        return (
            f'<geom name="{name}" type="sphere" size="{small}" mass="0" condim="1" priority="2"'
            f' pos="{x} {y} {z}" {own}/>'
        )

    sides = (("r", -0.17), ("l", 0.17))
    casters = "".join(sphere(f"caster{side}", 0.0, y, low) for side, y in sides)
    tippers = "".join(sphere(f"tipper{side}", -0.27, y, low + lifted) for side, y in sides)
    driven = "".join(
        f'<body name="{name}" pos="0 {side * 0.5 * nature.limits.track} 0">'
        f'<joint name="{name}" type="hinge" axis="0 1 0" armature="0.05"'
        f' frictionloss="{nature.rolling}"/>'
        f'<geom name="{name}" type="cylinder" size="{WHEEL_RADIUS * (1 + error):.6f} 0.015"'
        f' euler="90 0 0" mass="{wheels}" friction="{nature.friction} .005 .0001" priority="1"'
        f" {own}/></body>"
        for name, side, error in zip(("right", "left"), (-1, 1), nature.radius_error, strict=True)
    )
    # a box of this size and mass turns as the chair does
    thick = body / 12 * (0.5**2 + 0.5**2), body / 12 * (0.5**2 + 0.8**2)
    return f"""
    <body name="chair" pos="0 0 {WHEEL_RADIUS}">
      <freejoint/>
      <inertial pos="{ahead} 0 {up}" mass="{body}"
       diaginertia="{thick[1]} {thick[1]} {thick[0]}"/>
      <geom name="frame" type="box" size="0.25 0.22 0.15" pos="0 0 0.12" mass="0" {own}/>
      <geom name="seat" type="box" size="0.2 0.2 0.3" pos="0 0 0.6" mass="0" {own}/>
      {tippers if nature.anti_tippers else ""}{driven}
      <body name="fork" pos="0.27 0 0">
        <joint type="hinge" axis="1 0 0" pos="0 0 {low}" range="-8 8" damping="2"/>
        <inertial pos="0 0 {low}" mass="1" diaginertia=".03 .01 .03"/>
        {casters}
      </body>
    </body>"""
