"""Robots as frozen data: limits, footprint, control and braking sets."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from passpmp_ti import door

Disc = tuple[float, float]
"""(offset along the robot's axis [m], radius [m])."""

CAR, DIFFERENTIAL = 0, 1
"""Kinds of motion model, as the kernels number them."""

FREE, BRAKE, BRAKE_IN_PROPORTION = 0, 1, 2
"""What a control does: accelerate freely; brake each input at its share of the limit; brake both
wheels in proportion, so that the path keeps its shape."""

Control = tuple[int, float, float]
"""(what it does, first input, second input): see `Robot.controls`."""


@dataclass(frozen=True, kw_only=True)
class Robot:
    """What every robot has: a body of discs on its axis, controls, and ways to brake."""

    discs: tuple[Disc, ...] = ((0.0, 1.0),)
    """Discs that together cover the body; all of one radius."""
    controls: tuple[Control, ...] = field(init=False)
    """Controls that grow the tree (U_ctrl of Algorithm 2)."""
    braking: tuple[Control, ...] = field(init=False)
    """Controls that bring the robot to rest (the braking set of eq. 6)."""
    kind: int = field(init=False)

    def _check_body(self) -> None:
        owner = type(self).__name__
        if not self.discs:
            raise ValueError(f"{owner}.discs must hold at least one (offset, radius)")
        for i, (offset, radius) in enumerate(self.discs):
            door.finite(owner, f"discs[{i}].offset", offset, unit="m")
            door.finite(owner, f"discs[{i}].radius", radius, above=0.0, unit="m")
        if len({radius for _, radius in self.discs}) > 1:
            raise ValueError(
                f"{owner}.discs must share one radius, the grid is grown by it once;"
                f" got {self.discs!r}; cover a rectangle with `cover_rectangle`"
            )

    @property
    def disc_radius(self) -> float:
        """Radius of each disc of the body [m]."""
        return self.discs[0][1]

    @property
    def radius(self) -> float:
        """Radius of the disc about (x, y) that covers the body [m]."""
        return max(abs(offset) + radius for offset, radius in self.discs)

    @property
    def overhang(self) -> float:
        """Greatest distance of a disc's centre from the reference point [m]."""
        return max(abs(offset) for offset, _ in self.discs)

    @property
    def top_speed(self) -> float:
        """Greatest speed of the reference point [m/s]."""
        raise NotImplementedError

    @property
    def top_turn_rate(self) -> float:
        """Greatest turn rate [rad/s]."""
        raise NotImplementedError

    @property
    def sharpest_curvature(self) -> float:
        """Greatest turn a metre of the reference point's way [rad/m]; infinite on the spot."""
        return math.inf

    @property
    def top_acceleration(self) -> float:
        """Bound on the acceleration of any disc's centre, curving way included [m/s^2]."""
        raise NotImplementedError

    @property
    def longest_braking(self) -> float:
        """T_h, the longest time that any control of the braking set takes to rest [s] (eq. 21)."""
        raise NotImplementedError

    @property
    def deceleration(self) -> float:
        """How hard it brakes on a straight line [m/s^2]."""
        raise NotImplementedError

    def within_limits(self, state: np.ndarray) -> np.ndarray:
        """The nearest state that the robot's limits allow; state [5]. Only for a last resort: what
        is proven for a clipped state is not proven for the state itself."""
        clipped = np.array(state, dtype=np.float64)
        for column, _, limit, _ in self._limits():
            clipped[column] = np.clip(clipped[column], -limit, limit)
        return clipped

    @property
    def turn_time(self) -> float:
        """About how long a turn by a right angle takes [s]; for the guide only."""
        raise NotImplementedError

    def integration_error(self, time_step: float) -> float:
        """Bound on what the midpoint rule is off by over the longest braking [m]."""
        raise NotImplementedError

    def parameters(self) -> np.ndarray:
        """[6] float32, what the motion kernels need of this robot (see kernels/motion.py)."""
        raise NotImplementedError

    def speed(self, states: np.ndarray) -> np.ndarray:
        """Speed of the reference point, signed [m/s]; states [..., 5]."""
        raise NotImplementedError

    def at_rest(self, states: np.ndarray) -> np.ndarray:
        """Whether nothing on the robot moves; states [..., 5]."""
        raise NotImplementedError

    def check_states(self, owner: str, states: object) -> np.ndarray:
        """Return states as float64 [n, 5], or refuse those beyond the robot's limits.

        A speed that is clipped silently would make a safety check unsound.

        Raises:
            ValueError: wrong shape, not finite, or beyond a limit.
        """
        given = door.array(owner, "states", states, (None, 5))
        for column, name, limit, unit in self._limits():
            bad = np.flatnonzero(np.abs(given[:, column]) > limit * (1 + 1e-5) + 1e-6)
            if len(bad):
                raise ValueError(
                    f"{owner}.states[{bad[0]}]: |{name}| = {abs(given[bad[0], column]):.6g} {unit}"
                    f" is beyond the robot's limit {limit:g} {unit} ({len(bad)} of {len(given)}"
                    " bad); nothing is proven for a robot that can do what it does not declare"
                )
        return given

    def _limits(self) -> tuple[tuple[int, str, float, str], ...]:
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class CarLike(Robot):
    """A car: state (x, y, theta, v, xi), inputs (u_alpha, u_xi). Eq. 22, limits of Sec. 5.1.1."""

    discs: tuple[Disc, ...] = ((0.0, 1.5),)
    v_max: float = 20.0
    """Greatest speed forwards [m/s]."""
    v_reverse: float = 5.0
    """Greatest speed backwards [m/s]; 0: it cannot reverse."""
    acceleration: float = 7.0
    """Greatest |u_alpha| [m/s^2]."""
    xi_max: float = 0.314
    """Greatest steering angle [rad]."""
    xi_rate: float = 0.314
    """Greatest |u_xi| [rad/s]."""
    wheelbase: float = 2.5
    """L [m]."""

    def __post_init__(self) -> None:
        name = "CarLike"
        self._check_body()
        door.finite(name, "v_max", self.v_max, above=0.0, unit="m/s")
        door.finite(name, "v_reverse", self.v_reverse, least=0.0, most=self.v_max, unit="m/s")
        door.finite(name, "acceleration", self.acceleration, above=0.0, unit="m/s^2")
        # the kernels' tangent is accurate to 1e-6 up to 1 rad
        door.finite(name, "xi_max", self.xi_max, above=0.0, most=1.0, unit="rad")
        door.finite(name, "xi_rate", self.xi_rate, above=0.0, unit="rad/s")
        door.finite(name, "wheelbase", self.wheelbase, above=0.0, unit="m")
        a, w = self.acceleration, self.xi_rate
        object.__setattr__(self, "kind", CAR)
        object.__setattr__(
            self, "controls", tuple((FREE, u, s) for u in (a, 0.0, -a) for s in (0.0, -w, w))
        )
        object.__setattr__(self, "braking", tuple((BRAKE, a, s) for s in (0.0, -w, w)))

    @property
    def top_speed(self) -> float:
        return self.v_max

    @property
    def top_turn_rate(self) -> float:
        return self.v_max * self.sharpest_curvature

    @property
    def sharpest_curvature(self) -> float:
        return math.tan(self.xi_max) / self.wheelbase

    @property
    def top_acceleration(self) -> float:
        # along, across, and the swing of an offset disc: theta'' = (a tan xi + v xi' / cos^2) / L
        across = self.v_max * self.top_turn_rate
        turning = self.acceleration * math.tan(self.xi_max)
        turning += self.v_max * self.xi_rate / math.cos(self.xi_max) ** 2
        swing = self.top_turn_rate**2 + turning / self.wheelbase
        return self.acceleration + across + self.overhang * swing

    @property
    def longest_braking(self) -> float:
        return self.v_max / self.acceleration

    @property
    def deceleration(self) -> float:
        return self.acceleration

    @property
    def turn_time(self) -> float:
        # a quarter of the tightest circle at the speed at which it takes no more than the
        # acceleration limit sideways, or the top speed, and the time to steer
        radius = self.wheelbase / math.tan(self.xi_max)
        speed = min(self.v_max, math.sqrt(self.acceleration * radius))
        return 0.5 * math.pi * radius / speed + self.xi_max / self.xi_rate

    def integration_error(self, time_step: float) -> float:
        # theta' = v tan(xi) / L. A step's error is dt^3 / 24 of its second derivative, and once
        # dt^2 / 4 of the jump of its first where the steering stops; the position is off by the
        # heading's error times the way, and by the chord of each step's arc.
        v, a, dt = self.v_max, self.acceleration, time_step
        slope = self.xi_rate / math.cos(self.xi_max) ** 2
        bend = 2 * math.tan(self.xi_max) * slope * self.xi_rate
        second = (v * bend + 2 * a * slope) / self.wheelbase
        heading = second * dt**2 / 24 * self.longest_braking
        heading += v * slope / self.wheelbase * dt**2 / 4
        way = v * v / (2 * a)
        return way * (heading + (self.top_turn_rate * dt) ** 2 / 24) + heading * self.overhang

    def parameters(self) -> np.ndarray:
        return np.array(
            [self.v_max, -self.v_reverse, self.xi_max, 0.5 / self.wheelbase, self.acceleration, 0],
            dtype=np.float32,
        )

    def speed(self, states: np.ndarray) -> np.ndarray:
        return np.asarray(states)[..., 3]

    def at_rest(self, states: np.ndarray) -> np.ndarray:
        return np.asarray(states)[..., 3] == 0.0

    def _limits(self) -> tuple[tuple[int, str, float, str], ...]:
        return ((3, "v", self.v_max, "m/s"), (4, "xi", self.xi_max, "rad"))


@dataclass(frozen=True, kw_only=True)
class DifferentialDrive(Robot):
    """A wheelchair: state (x, y, theta, v_r, v_l), inputs (u_r, u_l). Eq. 23, Sec. 5.2.1."""

    discs: tuple[Disc, ...] = ((0.0, 0.4),)
    wheel_speed: float = 4.16
    """Greatest |v_r|, |v_l| [m/s]."""
    acceleration: float = 1.35
    """Greatest |u_r|, |u_l| [m/s^2]."""
    track: float = 0.54
    """Distance between the driven wheels, L [m]."""

    def __post_init__(self) -> None:
        name = "DifferentialDrive"
        self._check_body()
        door.finite(name, "wheel_speed", self.wheel_speed, above=0.0, unit="m/s")
        door.finite(name, "acceleration", self.acceleration, above=0.0, unit="m/s^2")
        door.finite(name, "track", self.track, above=0.0, unit="m")
        a = self.acceleration
        free = [(FREE, r, left) for r in (a, 0.0, -a) for left in (a, 0.0, -a)]
        stop = (BRAKE_IN_PROPORTION, a, a)
        object.__setattr__(self, "kind", DIFFERENTIAL)
        object.__setattr__(self, "controls", (*free, stop))
        object.__setattr__(
            self, "braking", (stop, (BRAKE, a, a), (BRAKE, a, 0.5 * a), (BRAKE, 0.5 * a, a))
        )

    @property
    def top_speed(self) -> float:
        return self.wheel_speed

    @property
    def top_turn_rate(self) -> float:
        return 2 * self.wheel_speed / self.track

    @property
    def top_acceleration(self) -> float:
        # along, across ((v_r^2 - v_l^2) / 2 L at most), and the swing of an offset disc
        across = self.wheel_speed**2 / (2 * self.track)
        swing = self.top_turn_rate**2 + 2 * self.acceleration / self.track
        return self.acceleration + across + self.overhang * swing

    @property
    def longest_braking(self) -> float:
        return 2 * self.wheel_speed / self.acceleration

    @property
    def deceleration(self) -> float:
        return self.acceleration

    @property
    def turn_time(self) -> float:
        # on the spot: half of it speeding up, half of it slowing down
        return 2 * math.sqrt(0.5 * math.pi * self.track / (2 * self.acceleration))

    def integration_error(self, time_step: float) -> float:
        # Wheel speeds are linear, so the heading is exact but in the step in which a wheel stops;
        # each step's arc is off by way (turn)^2 / 24. Way and turn share the wheels' speed: their
        # product is greatest at a third of the top speed.
        v, a, dt = self.wheel_speed, self.acceleration, time_step
        turning = v / 3 * (2 / 3 * self.top_turn_rate) ** 2 * dt**2 / 24
        way = v * self.longest_braking / 2
        stops = 2 * a / self.track * dt**2 / 4
        return turning * self.longest_braking / 2 + (way + self.overhang) * stops

    def parameters(self) -> np.ndarray:
        return np.array(
            [self.wheel_speed, -self.wheel_speed, 0.0, 0.5 / self.track, self.acceleration, 0],
            dtype=np.float32,
        )

    def speed(self, states: np.ndarray) -> np.ndarray:
        states = np.asarray(states)
        return 0.5 * (states[..., 3] + states[..., 4])

    def at_rest(self, states: np.ndarray) -> np.ndarray:
        states = np.asarray(states)
        return (states[..., 3] == 0.0) & (states[..., 4] == 0.0)

    def _limits(self) -> tuple[tuple[int, str, float, str], ...]:
        return (
            (3, "v_r", self.wheel_speed, "m/s"),
            (4, "v_l", self.wheel_speed, "m/s"),
        )


def cover_rectangle(front: float, back: float, width: float, count: int) -> tuple[Disc, ...]:
    """Discs of one radius on the axis that cover a rectangular body.

    Args:
        front: from the reference point to the front edge [m], > 0 forwards.
        back: from the reference point to the rear edge [m], > 0 backwards.
        width: [m].
        count: how many discs; more discs fit tighter.

    Returns:
        (offset, radius) of each disc [m].

    Raises:
        ValueError: an empty rectangle, or no disc.
    """
    length = door.finite("cover_rectangle", "front", front, unit="m") + door.finite(
        "cover_rectangle", "back", back, unit="m"
    )
    if length <= 0:
        raise ValueError(f"cover_rectangle: front + back must be > 0 m; got {length:g} m")
    door.finite("cover_rectangle", "width", width, above=0.0, unit="m")
    door.whole("cover_rectangle", "count", count, least=1)
    share = length / count
    radius = math.hypot(share / 2, width / 2)
    return tuple((-back + (i + 0.5) * share, radius) for i in range(count))
