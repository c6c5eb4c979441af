"""A motion that ends at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """States at the very times at which they were verified; the last one is at rest."""

    times: np.ndarray
    """[m] absolute times [s], increasing."""
    states: np.ndarray
    """[m, 5] robot states: (x, y, theta, v, xi) or (x, y, theta, v_r, v_l)."""
    brakes_from: int
    """Index at which the braking tail begins (the last index where there is none)."""

    @classmethod
    def resting(cls, state: np.ndarray, time: float) -> Trajectory:
        """The robot stands at `state` from `time` on."""
        return cls(np.array([time]), np.array([state], dtype=np.float64), 0)

    @property
    def start(self) -> float:
        """Time of the first state [s]."""
        return float(self.times[0])

    @property
    def end(self) -> float:
        """Time from which the robot is at rest [s]."""
        return float(self.times[-1])

    @property
    def duration(self) -> float:
        """From the first state to rest [s]."""
        return self.end - self.start

    def at(self, time: float) -> np.ndarray:
        """The state at `time` [s]: the first one before the start, rest after the end.

        Between samples the state is interpolated linearly; theta is continuous in `states`.
        """
        return np.array([np.interp(time, self.times, column) for column in self.states.T])

    def sampled(self, times: np.ndarray) -> np.ndarray:
        """[n, 5] states at several times [s]."""
        return np.stack([np.interp(times, self.times, column) for column in self.states.T], axis=1)
