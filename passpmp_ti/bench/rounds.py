"""Timing of rivals side by side: what else the machine does meets all of them alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from passpmp_ti import device

LEAST = 0.02
"""What is shorter is carried out so often that it takes this long [s]."""
LONG = 10.0
"""What takes longer at first is not tried again before it counts [s]."""
MOST_ROUNDS, LEAST_ROUNDS = 15, 3


@dataclass(frozen=True, slots=True)
class Rounds:
    """Seconds a call of each rival, round by round."""

    seconds: dict[str, list[float]] = field(default_factory=dict)

    def median(self, rival: str) -> float:
        """[s]"""
        return float(np.median(self.seconds[rival]))

    def faster(self, rival: str, than: str) -> float:
        """How many times `rival` is as fast as `than`: the median over the rounds' own ratios."""
        pairs = zip(self.seconds[than], self.seconds[rival], strict=True)
        return float(np.median([theirs / own for theirs, own in pairs]))


def interleaved(rivals: Mapping[str, Callable[[], object]], budget: float) -> Rounds:
    """Time the rivals in turn, round after round.

    Args:
        rivals: each carries out its whole work when called.
        budget: about how long all rounds together may take [s]; at least three are made.

    Returns:
        Their seconds; a first call of each, which may compile, is left out.
    """
    calls = {}
    whole = 0.0
    for name, rival in rivals.items():
        taken = _seconds(rival, 1)
        if taken < LONG:
            # it may have compiled, or waited for memory
            taken = _seconds(rival, 1)
        calls[name] = max(int(LEAST / max(taken, 1e-7)), 1)
        whole += calls[name] * taken
    count = int(np.clip(budget / max(whole, 1e-6), LEAST_ROUNDS, MOST_ROUNDS))
    rounds = Rounds({name: [] for name in rivals})
    for _ in range(count):
        for name, rival in rivals.items():
            rounds.seconds[name].append(_seconds(rival, calls[name]))
    return rounds


def _seconds(rival: Callable[[], object], calls: int) -> float:
    """A call [s]."""
    began = time.perf_counter()
    for _ in range(calls):
        rival()
    if device.resident():
        import taichi as ti

        ti.sync()
    return (time.perf_counter() - began) / calls
