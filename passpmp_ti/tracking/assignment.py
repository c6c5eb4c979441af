"""Which detection is which track's."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

GATE = 13.8
"""Squared Mahalanobis distance beyond which nothing is assigned: 99.9 % of two dimensions."""
TIE = 1e-9
FORBIDDEN = 1e6


def assign(
    mean: np.ndarray,
    covariance: np.ndarray,
    centre: np.ndarray,
    deviation: np.ndarray,
    farthest: np.ndarray,
) -> np.ndarray:
    """[M] the track of each detection, or -1: least sum of Mahalanobis distances plus log volumes.

    Args:
        mean: [N, 2] predicted places [m].
        covariance: [N, 2, 2] of them [m^2].
        centre: [M, 2] of the detections [m].
        deviation: [M] standard deviations of these [m].
        farthest: [N] distance that nothing of the track can have gone beyond [m].
    """
    n, m = len(mean), len(centre)
    found = np.full(m, -1)
    if not n or not m:
        return found
    S = covariance[:, None] + deviation[None, :, None, None] ** 2 * np.eye(2)
    off = centre[None] - mean[:, None]
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] ** 2
    distance = (
        S[..., 1, 1] * off[..., 0] ** 2
        - 2.0 * S[..., 0, 1] * off[..., 0] * off[..., 1]
        + S[..., 0, 0] * off[..., 1] ** 2
    ) / det
    gated = (distance <= GATE) & (np.hypot(*np.moveaxis(off, -1, 0)) <= farthest[:, None])
    cost = distance + np.log(det / det.min())
    # Of equal assignments the one of the lowest tracks and detections, pairs in one order.
    i, j = np.arange(n)[:, None], np.arange(m)[None]
    cost = cost + TIE * ((n + m) * (i + j) - i * j)
    rows, columns = linear_sum_assignment(np.where(gated, cost, FORBIDDEN))
    good = gated[rows, columns]
    found[columns[good]] = rows[good]
    return found
