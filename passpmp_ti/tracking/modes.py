"""How objects move: the modes of the IMM, as filterpy's Kalman filters. State (x, y, vx, vy)."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from filterpy.common import van_loan_discretization
from filterpy.kalman import KalmanFilter

SLOWEST = 0.01
"""Where a bound of 0 says that nothing moves, noises are those of this bound [m/s]."""
CALM = 0.2
"""Noises are at least those of an object at this share of the speed bound: who stands may start."""


@dataclass(frozen=True, slots=True)
class Mode:
    """One way of moving: dv = -v / settling dt + white noise."""

    name: str
    settling: float
    """Time constant in which the velocity dies away [s]; inf: constant velocity."""
    restlessness: float
    """Spectral density of the acceleration's noise over the square of the object's own pace [1/s]:
    who is twice as fast changes his velocity twice as much."""
    stays: float
    """How long the mode lasts, on average [s]."""


MODES = (
    Mode("still", settling=0.3, restlessness=0.03, stays=4.0),
    Mode("walking", settling=np.inf, restlessness=0.008, stays=4.0),
    Mode("turning", settling=np.inf, restlessness=0.13, stays=1.0),
)
SWITCH = np.array([[0.0, 0.5, 0.5], [0.3, 0.0, 0.7], [0.2, 0.8, 0.0]])
"""[C, C] where a mode that ends goes on."""
START = np.array([0.2, 0.4, 0.4])
"""[C] chances of the modes of something just met."""


def pace(mean: np.ndarray, covariance: np.ndarray, speed: float) -> np.ndarray:
    """[N] root mean square of each object's speed, between `CALM` of the bound and the bound [m/s].

    Args:
        mean: [N, 4] all modes together.
        covariance: [N, 4, 4].
        speed: bound on every object's speed [m/s].
    """
    speed = max(speed, SLOWEST)
    square = mean[:, 2] ** 2 + mean[:, 3] ** 2 + covariance[:, 2, 2] + covariance[:, 3, 3]
    return np.clip(np.sqrt(square), CALM * speed, speed)


def filters(dt: float, pace: float = 1.0) -> tuple[KalmanFilter, ...]:
    """One filterpy filter a mode, its F, Q and H made for a step.

    Args:
        dt: of the step [s].
        pace: of the object [m/s]; Q is proportional to its square.
    """
    found = []
    for mode in MODES:
        filter_ = KalmanFilter(dim_x=4, dim_z=2)
        drift = np.zeros((4, 4))
        drift[:2, 2:] = np.eye(2)
        if np.isfinite(mode.settling):
            drift[2:, 2:] = -np.eye(2) / mode.settling
        noise = np.zeros((4, 2))
        noise[2:] = np.eye(2) * np.sqrt(mode.restlessness) * pace
        filter_.F, Q = van_loan_discretization(drift, noise, dt)
        filter_.Q = 0.5 * (Q + Q.T)
        filter_.H = np.eye(2, 4)
        found.append(filter_)
    return tuple(found)


@functools.lru_cache(maxsize=4096)
def matrices(dt: float) -> tuple[np.ndarray, np.ndarray]:
    """F [C, 4, 4] and Q [C, 4, 4] of `filters` at a pace of 1 m/s."""
    modes = filters(dt)
    return np.stack([m.F for m in modes]), np.stack([m.Q for m in modes])


@functools.lru_cache(maxsize=4096)
def switching(dt: float) -> np.ndarray:
    """[C, C] chance of going from mode i (row) to mode j within a step of dt [s]."""
    leaves = -np.expm1(-dt / np.array([m.stays for m in MODES]))
    return np.diag(1.0 - leaves) + leaves[:, None] * SWITCH


@functools.lru_cache(maxsize=512)
def propagation(steps: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """F [C, L, 4, 4] and Q [C, L, 4, 4] from now to the end of each step, one after the other.

    Args:
        steps: durations [s]; Q is that of a pace of 1 m/s.
    """
    F, Q = np.tile(np.eye(4), (len(MODES), 1, 1)), np.zeros((len(MODES), 4, 4))
    all_F, all_Q = [], []
    for dt in steps:
        step_F, step_Q = matrices(dt)
        F = step_F @ F
        Q = step_F @ Q @ step_F.swapaxes(-1, -2) + step_Q
        all_F.append(F)
        all_Q.append(Q)
    return np.stack(all_F, axis=1), np.stack(all_Q, axis=1)
