"""Where tracks will be: Gaussian mixtures at later times."""

from __future__ import annotations

from dataclasses import InitVar, dataclass

import numpy as np

from passpmp_ti import door
from passpmp_ti.tracking import modes
from passpmp_ti.tracking.imm import Bank

SUM_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Forecast:
    """N tracks, each a mixture of C Gaussians, at L times."""

    times: np.ndarray
    """[L] absolute [s]."""
    weight: np.ndarray
    """[N, C]; rows sum to 1, components not used have 0."""
    mean: np.ndarray
    """[N, C, L, 4] (x, y, vx, vy) [m, m/s]."""
    covariance: np.ndarray
    """[N, C, L, 4, 4]."""
    radius: np.ndarray
    """[N] disc about a track's centre that covers its object [m]."""
    trusted: InitVar[bool] = False
    """Whether the values were worked out here: they are not looked through once more."""

    def __post_init__(self, trusted: bool) -> None:
        if trusted:
            return
        name = "Forecast"
        times = door.array(name, "times", self.times, (None,))
        weight = door.array(name, "weight", self.weight, (None, None))
        (n, c), steps = weight.shape, len(times)
        mean = _shaped("mean", self.mean, (n, c, steps, 4))
        covariance = _shaped("covariance", self.covariance, (n, c, steps, 4, 4))
        radius = _shaped("radius", self.radius, (n,))
        if (weight < 0).any() or (np.abs(weight.sum(axis=1) - 1.0) > SUM_TOLERANCE).any():
            row = int(np.argmax((weight < 0).any(axis=1) | (abs(weight.sum(axis=1) - 1) > 1e-6)))
            raise ValueError(
                f"Forecast.weight[{row}] = {weight[row]} must be >= 0 and sum to 1;"
                " divide it by its sum"
            )
        if (radius < 0).any():
            row = int(np.argmax(radius < 0))
            raise ValueError(f"Forecast.radius[{row}] = {radius[row]:g} m must be >= 0")
        _check_covariances(covariance)
        for field_, value in (
            ("times", times),
            ("weight", weight),
            ("mean", mean),
            ("covariance", covariance),
            ("radius", radius),
        ):
            value.setflags(write=False)
            object.__setattr__(self, field_, value)

    def reduced(self) -> Forecast:
        """Each track of three components as two: the pair that loses least by it becomes one
        Gaussian of the same mean and covariance (Runnalls' bound on what is lost, in places, half
        way).

        Less work for whatever is laid out of it; docs/tracking.md tells how it calibrates beside
        the mixture.
        """
        if self.weight.shape[1] != 3 or not len(self.weight):
            return self
        half = len(self.times) // 2
        pairs = [(0, 1), (0, 2), (1, 2)]
        places = self.mean[:, :, half, :2], self.covariance[:, :, half, :2, :2]
        spread = np.log(np.maximum(np.linalg.det(places[1]), 1e-30))
        lost = np.stack([self._lost(*places, spread, pair) for pair in pairs], axis=1)
        choice = np.argmin(lost, axis=1)
        weight = np.empty((len(self.weight), 2))
        mean = np.empty((len(weight), 2, *self.mean.shape[2:]))
        covariance = np.empty((len(weight), 2, *self.covariance.shape[2:]))
        for n, pair in enumerate(pairs):
            mine = choice == n
            kept = 3 - sum(pair)
            both = self.weight[mine][:, pair]
            weight[mine, 0], weight[mine, 1] = self.weight[mine, kept], both.sum(axis=1)
            mean[mine, 0], covariance[mine, 0] = self.mean[mine, kept], self.covariance[mine, kept]
            mean[mine, 1], covariance[mine, 1] = _matched(
                both, self.mean[mine][:, pair], self.covariance[mine][:, pair]
            )
        return Forecast(
            times=self.times, weight=weight, mean=mean, covariance=covariance, radius=self.radius,
            trusted=True,
        )  # fmt: skip

    def _lost(
        self, mean: np.ndarray, covariance: np.ndarray, spread: np.ndarray, pair: tuple[int, int]
    ) -> np.ndarray:
        """[N] what is lost at most if a pair of components becomes one (Runnalls 2007, eq. 16)."""
        weight = self.weight[:, pair]
        _, both = _matched(weight, mean[:, pair], covariance[:, pair])
        whole = weight.sum(axis=1) * np.log(np.maximum(np.linalg.det(both), 1e-30))
        return 0.5 * (whole - (weight * spread[:, pair]).sum(axis=1))


def _matched(
    weight: np.ndarray, mean: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean [N, ..., d] and covariance [N, ..., d, d] of mixtures: weight [N, C], mean
    [N, C, ..., d], covariance [N, C, ..., d, d]."""
    share = weight / np.maximum(weight.sum(axis=1, keepdims=True), 1e-30)
    share = share.reshape(*share.shape, *(1,) * (mean.ndim - 2))
    middle = (share * mean).sum(axis=1)
    apart = mean - middle[:, None]
    spread = covariance + apart[..., :, None] * apart[..., None, :]
    both = (share[..., None] * spread).sum(axis=1)
    return middle, 0.5 * (both + both.swapaxes(-1, -2))


def _shaped(name: str, value: object, shape: tuple[int, ...]) -> np.ndarray:
    found = door.array("Forecast", name, value, shape)
    return np.array(found) if np.asarray(value) is found and not found.flags.owndata else found


def _check_covariances(covariance: np.ndarray) -> None:
    """Refuse what is not symmetric and positive definite."""
    if not covariance.size:
        return
    scale = np.abs(covariance).max(axis=(-1, -2), keepdims=True)
    skew = np.abs(covariance - covariance.swapaxes(-1, -2)) > 1e-9 * scale
    if skew.any():
        at = tuple(int(i) for i in np.argwhere(skew.any(axis=(-1, -2)))[0])
        raise ValueError(
            f"Forecast.covariance{list(at)} must be symmetric ({int(skew.any(axis=(-1, -2)).sum())}"
            " bad); take (P + P.T) / 2"
        )
    try:
        np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        least = np.linalg.eigvalsh(covariance)[..., 0]
        at = tuple(int(i) for i in np.argwhere(least <= least.min())[0])
        raise ValueError(
            f"Forecast.covariance{list(at)} must be positive definite; its least eigenvalue is"
            f" {least[at]:.3g} ({int((least <= 0).sum())} bad); give every state some variance,"
            " for example by process noise"
        ) from None


def forecast(
    bank: Bank, radius: np.ndarray, stamp: float, times: np.ndarray, speed: float
) -> Forecast:
    """Propagate every mode of every track by its own F and Q, step by step.

    A component's speed is at most the bound v_b already (the filter cuts it), and no mode adds to
    it. Its spread is bounded, too: by v_b / 2 along each axis in the velocity, and by what it is at
    the stamp plus v_b t / 2 in the place, which is what somebody has of whom only the bound is
    known. What is wider is narrowed, its correlation kept.

    Args:
        bank: at `stamp`.
        radius: [N] [m].
        stamp: absolute [s].
        times: [L] absolute, increasing, none before `stamp` [s].
        speed: v_b [m/s].

    Raises:
        ValueError: times that decrease or lie before the stamp.
    """
    times = door.array("Tracks.forecast", "times", times, (None,))
    steps = np.diff(times, prepend=stamp)
    if (steps < 0).any():
        row = int(np.argmax(steps < 0))
        raise ValueError(
            f"Tracks.forecast.times[{row}] = {times[row]:g} s is before"
            f" {times[row] - steps[row]:g} s; times must not decrease, and none may lie before the"
            " tracks' stamp"
        )
    if not len(times) or not len(bank):
        kinds, count = len(modes.MODES), len(bank)
        return Forecast(
            times=times,
            weight=bank.weight,
            mean=np.zeros((count, kinds, len(times), 4)),
            covariance=np.zeros((count, kinds, len(times), 4, 4)),
            radius=radius,
        )
    # whole microseconds: steps that differ by rounding are one, and need no new matrices
    F, Q = modes.propagation(tuple(np.round(steps, 6).tolist()))
    pace = modes.pace(*bank.combined(), speed)[:, None, None, None, None]
    mean = (F @ bank.mean[:, :, None, :, None])[..., 0]
    covariance = F @ bank.covariance[:, :, None] @ F.swapaxes(-1, -2) + pace**2 * Q
    _narrow(covariance, bank.covariance, times - stamp, speed)
    return Forecast(
        times=times,
        weight=bank.weight @ modes.switching(modes.CHANGE),
        mean=mean,
        covariance=covariance,
        radius=radius,
        trusted=True,
    )


def _narrow(covariance: np.ndarray, now: np.ndarray, ahead: np.ndarray, speed: float) -> None:
    """Bound the spread of places and velocities, in place."""
    bound = 0.5 * max(speed, modes.SLOWEST)
    most = np.sqrt(_greatest(now[..., :2, :2]))[..., None] + bound * ahead
    for part, limit in ((slice(0, 2), most), (slice(2, 4), bound)):
        wide = np.sqrt(_greatest(covariance[..., part, part]))
        factor = np.minimum(1.0, limit / wide)[..., None]
        covariance[..., part, :] *= factor[..., None]
        covariance[..., :, part] *= factor[..., None, :]


def _greatest(matrix: np.ndarray) -> np.ndarray:
    """Greater eigenvalue of symmetric matrices [..., 2, 2]."""
    half = 0.5 * (matrix[..., 0, 0] + matrix[..., 1, 1])
    return half + np.hypot(0.5 * (matrix[..., 0, 0] - matrix[..., 1, 1]), matrix[..., 0, 1])
