"""Which planner drives a scenario, by name; one of them is told the scenario's future."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from passpmp_ti.planner.baselines.known import KnownWorld
from passpmp_ti.planner.baselines.names import baseline
from passpmp_ti.planner.baselines.viability import Viability
from passpmp_ti.sim.movers import NoMovers, PathMovers
from passpmp_ti.sim.patrol import PatrolMovers
from passpmp_ti.sim.scenario import Scenario
from passpmp_ti.sim.sources import NobodyMoves, ScriptSource


def planner_for(name: str, scenario: Scenario, seed: int = 0) -> Callable[..., Any]:
    """What `simulate` takes as its planner.

    Args:
        name: see `passpmp_ti.planner.baselines.names`.
        scenario: that it will drive.
        seed: of the episode; it chooses the movers, whose future `viability` is told.

    Raises:
        ValueError: no such planner, or one that needs a known future in a scenario without one.
    """
    planner = baseline(name)
    if planner is Viability:
        return partial(planner, world=known_world(scenario, seed))
    return planner


def known_world(scenario: Scenario, seed: int = 0) -> KnownWorld:
    """Everything that will ever be in a scenario, if its movers stop one day or repeat themselves.

    Raises:
        ValueError: they do neither.
    """
    world, _, start_time = scenario.build(seed)
    movers = world.movers
    period, freezes_at = None, None
    if isinstance(movers, PatrolMovers):
        period = movers.period
    elif isinstance(scenario.movers, (ScriptSource, NobodyMoves)):
        ends = [float(path[-1, 0]) for path in getattr(movers, "paths", ())]
        freezes_at = max([start_time, *ends])
    else:
        raise ValueError(
            f"scenario {scenario.name!r}: the future of its movers is not known for ever, and"
            " viability needs that; take movers of type scripted (they stop at last) or patrol"
        )
    assert isinstance(movers, (NoMovers, PathMovers, PatrolMovers))
    return KnownWorld(
        bounds=scenario.bounds, clearance=world.clearance, movers=movers, period=period,
        freezes_at=freezes_at,
    )  # fmt: skip
