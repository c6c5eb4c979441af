"""Episodes one after the other, until enough has been seen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from passpmp_ti.sim.episode import simulate
from passpmp_ti.sim.scenario import Scenario


class EnoughError(Exception):
    """Ends an episode from within, raised by what watches it."""


def drive(scenario: Scenario, seed: int, enough: Callable[[], bool], **watched: Any) -> int:
    """Drive from `seed` on, seed after seed, until `enough`; returns the last seed."""
    while not enough():
        try:
            simulate(scenario, seed=seed, **watched)
        except EnoughError:
            break
        seed += 1
    return seed
