"""What a robot declares of itself: a body of discs, limits, and how its state moves it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

POSITION_ROUNDING = 2e-4
"""[m] What a planner in single precision may be off by in one step."""
HEADING_ROUNDING = 2e-5
"""[rad]"""
SPEED_ROUNDING = 1e-5
"""[m/s] and [rad], of speeds and steering angles."""


@dataclass(frozen=True)
class Robot:
    """Body and limits. States are [n, 5]: (x, y, theta, and two numbers of its own)."""

    discs: np.ndarray
    """[D, 2] offset along the robot's axis and radius [m]."""

    @property
    def limits(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(least, greatest) of each of the state's two last numbers."""
        raise NotImplementedError

    @property
    def rates(self) -> tuple[float, float]:
        """Greatest change of each of them in a second."""
        raise NotImplementedError

    def speed(self, states: np.ndarray) -> np.ndarray:
        """[n] of the reference point, signed [m/s]."""
        raise NotImplementedError

    def turn_rate(self, states: np.ndarray) -> np.ndarray:
        """[n] [rad/s]."""
        raise NotImplementedError

    def at_rest(self, states: np.ndarray) -> np.ndarray:
        """[n] bool: nothing on the robot moves."""
        raise NotImplementedError

    def braking_inputs(self, states: np.ndarray) -> np.ndarray:
        """[n, k] the speeds that braking brings to zero."""
        raise NotImplementedError

    def heading_doubt(self, states: np.ndarray, dt: np.ndarray) -> np.ndarray:
        """[n - 1] how far the turn of a step may be from its mean turn rate's [rad]: a steering
        angle that reaches its limit inside the step."""
        return np.zeros(len(states) - 1)

    def turn_acceleration(self, states: np.ndarray, dt: np.ndarray) -> np.ndarray:
        """[n - 1] greatest change of the turn rate inside each step [rad/s^2]."""
        raise NotImplementedError

    def top_turn_rate(self, states: np.ndarray, dt: np.ndarray) -> np.ndarray:
        """[n - 1] greatest turn rate that the limits allow inside each step [rad/s]."""
        turn = np.abs(self.turn_rate(states))
        return np.maximum(turn[1:], turn[:-1]) + 0.5 * dt * self.turn_acceleration(states, dt)

    def top_speed(self, states: np.ndarray, dt: np.ndarray) -> np.ndarray:
        """[n - 1] greatest speed that the limits allow inside each step [m/s]."""
        speed = np.abs(self.speed(states))
        return np.maximum(speed[1:], speed[:-1]) + 0.5 * dt * self.rates[0]

    def wobble(self, states: np.ndarray, dt: np.ndarray, offset: float) -> np.ndarray:
        """[n - 1] how far the centre of a disc may be from the straight line between two samples,
        passed at constant pace, if the robot keeps its limits [m]: |p''| dt^2 / 8."""
        v, w = self.top_speed(states, dt), self.top_turn_rate(states, dt)
        own = self.rates[0] + v * w
        swing = abs(offset) * (w * w + self.turn_acceleration(states, dt))
        return (own + swing) * dt * dt / 8


@dataclass(frozen=True)
class Car(Robot):
    """State (x, y, theta, v, xi): x' = v cos theta, y' = v sin theta, theta' = v tan(xi) / L."""

    v_max: float
    v_reverse: float
    acceleration: float
    xi_max: float
    xi_rate: float
    wheelbase: float

    @property
    def limits(self) -> tuple[tuple[float, float], tuple[float, float]]:
        return (-self.v_reverse, self.v_max), (-self.xi_max, self.xi_max)

    @property
    def rates(self) -> tuple[float, float]:
        return self.acceleration, self.xi_rate

    def speed(self, states: np.ndarray) -> np.ndarray:
        return states[:, 3]

    def turn_rate(self, states: np.ndarray) -> np.ndarray:
        return states[:, 3] * np.tan(states[:, 4]) / self.wheelbase

    def at_rest(self, states: np.ndarray) -> np.ndarray:
        return states[:, 3] == 0

    def braking_inputs(self, states: np.ndarray) -> np.ndarray:
        return states[:, 3:4]

    def heading_doubt(self, states: np.ndarray, dt: np.ndarray) -> np.ndarray:
        way = self.top_speed(states, dt) * dt
        return way * 0.25 * self.xi_rate * dt / (np.cos(self.xi_max) ** 2 * self.wheelbase)

    def turn_acceleration(self, states: np.ndarray, dt: np.ndarray) -> np.ndarray:
        bend = np.tan(self.xi_max)
        v = self.top_speed(states, dt)
        return (self.acceleration * bend + v * (1 + bend**2) * self.xi_rate) / self.wheelbase


@dataclass(frozen=True)
class Differential(Robot):
    """State (x, y, theta, v_r, v_l): v = (v_r + v_l) / 2, theta' = (v_r - v_l) / L."""

    wheel_speed: float
    acceleration: float
    track: float

    @property
    def limits(self) -> tuple[tuple[float, float], tuple[float, float]]:
        return (-self.wheel_speed, self.wheel_speed), (-self.wheel_speed, self.wheel_speed)

    @property
    def rates(self) -> tuple[float, float]:
        return self.acceleration, self.acceleration

    def speed(self, states: np.ndarray) -> np.ndarray:
        return 0.5 * (states[:, 3] + states[:, 4])

    def turn_rate(self, states: np.ndarray) -> np.ndarray:
        return (states[:, 3] - states[:, 4]) / self.track

    def at_rest(self, states: np.ndarray) -> np.ndarray:
        return (states[:, 3] == 0) & (states[:, 4] == 0)

    def braking_inputs(self, states: np.ndarray) -> np.ndarray:
        return states[:, 3:5]

    def turn_acceleration(self, states: np.ndarray, dt: np.ndarray) -> np.ndarray:
        return np.full(len(dt), 2 * self.acceleration / self.track)
