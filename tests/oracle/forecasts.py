"""Forecasts of objects with constant velocities, and the integrals and futures that belong to them.

Everything here is worked out in double precision, by dense sums or by drawing futures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import erf


@dataclass(frozen=True)
class Forecast:
    """A stand-in for what tracking hands out."""

    times: np.ndarray
    weight: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    radius: np.ndarray


@dataclass(frozen=True)
class Mover:
    """Starts at N(start, spread) and is pushed by white noise of intensity q [m^2/s^3]."""

    start: np.ndarray
    spread: np.ndarray
    q: float

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean [4] and covariance [4, 4] after t seconds."""
        move = np.eye(4)
        move[0, 2] = move[1, 3] = t
        return move @ self.start, move @ self.spread @ move.T + self.q * _pushed(t)

    def futures(self, count: int, step: float, steps: int, rng: np.random.Generator) -> np.ndarray:
        """[steps + 1, count, 2] places of so many futures, exact at each step."""
        states = self.start + rng.normal(size=(count, 4)) @ np.linalg.cholesky(self.spread).T
        root = np.sqrt(self.q) * np.linalg.cholesky(_pushed(step)[::2, ::2])
        places = np.empty((steps + 1, count, 2))
        places[0] = states[:, :2]
        for k in range(steps):
            push = rng.normal(size=(count, 2, 2)) @ root.T
            states[:, :2] += step * states[:, 2:] + push[:, :, 0]
            states[:, 2:] += push[:, :, 1]
            places[k + 1] = states[:, :2]
        return places


def _pushed(t: float) -> np.ndarray:
    block = np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])
    return np.kron(block, np.eye(2))


def forecast_of(movers: list[Mover], times: np.ndarray, radius: float = 0.3) -> Forecast:
    """What a perfect tracker would say of them at `times`, the first of which is their start."""
    moments = [[mover.at(t) for t in times - times[0]] for mover in movers]
    return Forecast(
        times,
        np.ones((len(movers), 1)),
        np.array([[[mean for mean, _ in row]] for row in moments]).reshape(-1, 1, len(times), 4),
        np.array([[[c for _, c in row]] for row in moments]).reshape(-1, 1, len(times), 4, 4),
        np.full(len(movers), radius),
    )


def any_mover(rng: np.random.Generator, where: np.ndarray, velocity: np.ndarray) -> Mover:
    """One whose covariance is correlated in every way, about a start [2] and a velocity [2]."""
    factor = rng.normal(size=(4, 4)) * rng.uniform(0.02, 0.25)
    own = np.diag([0.06**2] * 2 + [rng.uniform(0.1, 0.5) ** 2] * 2)
    return Mover(np.r_[where, velocity], factor @ factor.T + own, 10 ** rng.uniform(-2, 0))


def gaussian(places: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Density [...] at places [..., 2]."""
    off = places - mean
    inside = np.einsum("...i,ij,...j->...", off, np.linalg.inv(covariance), off)
    return np.exp(-0.5 * inside) / (2 * np.pi * np.sqrt(np.linalg.det(covariance)))


def disc_integral(p: np.ndarray, radius: float, mean: np.ndarray, covariance: np.ndarray) -> float:
    """Eq. 15 by polar sums: Gauss along the radius, a dense ring about it."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    r = 0.5 * radius * (nodes + 1)
    angle = 2 * np.pi * np.arange(160) / 160
    ring = np.stack([np.cos(angle), np.sin(angle)], -1)
    density = gaussian(p + r[:, None, None] * ring, mean[:2], covariance[:2, :2])
    return float(0.5 * radius * weights @ (density.mean(axis=1) * 2 * np.pi * r))


def ring_flow(
    p: np.ndarray, u: np.ndarray, radius: float, mean: np.ndarray, covariance: np.ndarray
) -> float:
    """How often a second a mover is expected to cross the border of a disc that moves at u: the
    contour integral of f E|(v - u).n| itself (Rice), no bound on it."""
    angle = 2 * np.pi * np.arange(720) / 720
    normal = np.stack([np.cos(angle), np.sin(angle)], -1)
    places = p + radius * normal
    gain = covariance[2:, :2] @ np.linalg.inv(covariance[:2, :2])
    rest = covariance[2:, 2:] - gain @ covariance[:2, 2:]
    across = ((mean[2:] + (places - mean[:2]) @ gain.T - u) * normal).sum(axis=1)
    deviation = np.sqrt(np.einsum("ni,ij,nj->n", normal, rest, normal))
    z = across / deviation
    size = deviation * np.sqrt(2 / np.pi) * np.exp(-0.5 * z * z) + across * erf(z / np.sqrt(2))
    density = gaussian(places, mean[:2], covariance[:2, :2])
    return float((density * size).mean() * 2 * np.pi * radius)
