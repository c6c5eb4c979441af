"""The interacting multiple model over all tracks at once, as filterpy's IMMEstimator does for one.

filterpy's estimator takes about a millisecond a track and step in Python. Here its equations run
over arrays of tracks, with the matrices of filterpy's filters; the tests hold the two together.

Axes [N, C, ...] are tracks and modes. Source: Bar-Shalom, Li & Kirubarajan, Estimation with
Applications to Tracking and Navigation, 2001, Sec. 11.6.6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.tracking import modes


@dataclass(frozen=True, slots=True)
class Bank:
    """What the filters of all tracks know."""

    mean: np.ndarray
    """[N, C, 4] (x, y, vx, vy) [m, m/s]."""
    covariance: np.ndarray
    """[N, C, 4, 4]."""
    weight: np.ndarray
    """[N, C] chances of the modes; rows sum to 1."""

    def __len__(self) -> int:
        return len(self.mean)

    def taken(self, index: np.ndarray) -> Bank:
        """The tracks of an index or mask."""
        return Bank(self.mean[index], self.covariance[index], self.weight[index])

    def joined(self, other: Bank) -> Bank:
        """These tracks, then the other's."""
        return Bank(
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.covariance, other.covariance]),
            np.concatenate([self.weight, other.weight]),
        )

    def combined(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean [N, 4] and covariance [N, 4, 4] of each track, all modes together."""
        mean = np.einsum("nc,ncd->nd", self.weight, self.mean)
        off = self.mean - mean[:, None]
        spread = self.covariance + off[..., :, None] * off[..., None, :]
        return mean, np.einsum("nc,ncde->nde", self.weight, spread)


def born(centre: np.ndarray, deviation: np.ndarray, speed: float) -> Bank:
    """Tracks of what was just met.

    Nothing is known of the velocity but its bound v_b: a velocity anywhere in the disc of radius
    v_b has a standard deviation of v_b / 2 along each axis. In the mode "still" it is the mode's
    own.

    Args:
        centre: [N, 2] [m].
        deviation: [N] standard deviation of the centres [m].
        speed: bound on every object's speed [m/s].
    """
    count, kinds = len(centre), len(modes.MODES)
    mean = np.zeros((count, kinds, 4))
    mean[:, :, :2] = centre[:, None]
    covariance = np.zeros((count, kinds, 4, 4))
    covariance[:, :, [0, 1], [0, 1]] = deviation[:, None, None] ** 2
    for c, mode in enumerate(modes.MODES):
        spread = (0.5 * max(speed, modes.SLOWEST)) ** 2
        if np.isfinite(mode.settling):
            # what the noise and the settling come to in the long run
            spread *= 2.0 * mode.restlessness * mode.settling
        covariance[:, c, [2, 3], [2, 3]] = spread
    return Bank(mean, covariance, np.tile(modes.START, (count, 1)))


def predicted(bank: Bank, dt: float, speed: float) -> Bank:
    """The tracks a step of dt [s] later: modes mixed, then each mode's own motion."""
    switching = modes.switching(dt)
    F, Q = modes.matrices(dt)
    pace = modes.pace(*bank.combined(), speed)[:, None, None, None]
    weight = bank.weight @ switching
    share = bank.weight[:, :, None] * switching / weight[:, None, :]  # [N, from, to]
    mean = np.einsum("nij,nid->njd", share, bank.mean)
    off = bank.mean[:, :, None] - mean[:, None]  # [N, from, to, 4]
    covariance = np.einsum("nij,nide->njde", share, bank.covariance)
    covariance += np.einsum("nij,nijd,nije->njde", share, off, off)
    mean = np.einsum("cde,nce->ncd", F, mean)
    return Bank(mean, F @ covariance @ F.swapaxes(-1, -2) + pace**2 * Q, weight)


def updated(bank: Bank, centre: np.ndarray, deviation: np.ndarray, speed: float) -> Bank:
    """The tracks after each was met at a place.

    A mean velocity above the bound is cut to it, its direction kept.

    Args:
        bank: predicted.
        centre: [N, 2] [m].
        deviation: [N] standard deviation of the centres [m].
        speed: bound on every object's speed [m/s].
    """
    H = np.eye(2, 4)
    R = deviation[:, None, None, None] ** 2 * np.eye(2)
    residual = centre[:, None] - bank.mean[..., :2]
    S = bank.covariance[..., :2, :2] + R
    inverse = np.linalg.inv(S)
    K = bank.covariance[..., :2] @ inverse
    mean = bank.mean + (K @ residual[..., None])[..., 0]
    rest = np.eye(4) - K @ H
    # Joseph's form, as filterpy's: symmetric and positive whatever the rounding
    covariance = rest @ bank.covariance @ rest.swapaxes(-1, -2) + K @ R @ K.swapaxes(-1, -2)
    distance = np.einsum("ncd,ncde,nce->nc", residual, inverse, residual)
    # relative to the likeliest mode, so that no row underflows as a whole
    score = np.log(bank.weight) - 0.5 * (distance + np.log(np.linalg.det(S)))
    weight = np.exp(score - score.max(axis=1, keepdims=True))
    weight = np.maximum(weight / weight.sum(axis=1, keepdims=True), LEAST_WEIGHT)
    weight /= weight.sum(axis=1, keepdims=True)
    fast = np.hypot(mean[..., 2], mean[..., 3])
    mean[..., 2:] *= np.minimum(1.0, speed / np.maximum(fast, modes.SLOWEST))[..., None]
    return Bank(mean, 0.5 * (covariance + covariance.swapaxes(-1, -2)), weight)


LEAST_WEIGHT = 1e-6
"""No mode is ever ruled out."""
