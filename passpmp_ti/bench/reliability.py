"""What was predicted against what came to be: chances in bins, and how often it happened."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

NODES, WEIGHTS = np.polynomial.legendre.leggauss(48)
FAR = 8.0
"""Standard deviations beyond which a Gaussian is nothing."""
BINS = 10


def touch_chance(
    weight: np.ndarray,
    mean: np.ndarray,
    covariance: np.ndarray,
    place: np.ndarray,
    reach: np.ndarray,
) -> np.ndarray:
    """[Q] chance that a point drawn from a mixture lies within a disc.

    Along the longer axis of each Gaussian by 48 Gauss-Legendre nodes, across it in closed form.

    Args:
        weight: [Q, C]; rows sum to 1.
        mean: [Q, C, 2] [m].
        covariance: [Q, C, 2, 2] [m^2].
        place: [Q, 2] centre of the disc [m].
        reach: [Q] its radius [m].
    """
    variance, axes = np.linalg.eigh(covariance)
    narrow, wide = np.sqrt(np.moveaxis(variance, -1, 0))  # [Q, C] each
    off = np.einsum("qcd,qcde->qce", place[:, None] - mean, axes)
    across, along = off[..., 0], off[..., 1]
    low = np.maximum(along - reach[:, None], -FAR * wide)
    high = np.maximum(np.minimum(along + reach[:, None], FAR * wide), low)
    half = 0.5 * (high - low)
    x = (0.5 * (high + low))[..., None] + half[..., None] * NODES
    chord = np.sqrt(np.maximum(reach[:, None, None] ** 2 - (x - along[..., None]) ** 2, 0.0))
    inside = ndtr((across[..., None] + chord) / narrow[..., None])
    inside -= ndtr((across[..., None] - chord) / narrow[..., None])
    density = np.exp(-0.5 * (x / wide[..., None]) ** 2) / (np.sqrt(2 * np.pi) * wide[..., None])
    return np.einsum("qc,qc,qcn,n->q", weight, half, density * inside, WEIGHTS)


@dataclass(frozen=True, slots=True)
class Reliability:
    """Predicted chances in ten bins of equal width."""

    count: np.ndarray
    """[10] predictions in each bin."""
    promised: np.ndarray
    """[10] their mean chance; NaN where there are none."""
    met: np.ndarray
    """[10] share of them that came to be."""

    @classmethod
    def of(cls, chance: np.ndarray, came: np.ndarray) -> Reliability:
        """Bins of chances [Q] and outcomes [Q] bool."""
        which = np.clip((chance * BINS).astype(int), 0, BINS - 1)
        count = np.bincount(which, minlength=BINS)
        with np.errstate(invalid="ignore"):
            promised = np.bincount(which, chance, BINS) / count
            met = np.bincount(which, came, BINS) / count
        return cls(count, promised, met)

    @property
    def worst(self) -> float:
        """Greatest difference between promise and outcome of any bin that holds something."""
        held = self.count > 0
        return float(np.abs(self.promised - self.met)[held].max(initial=0.0))
