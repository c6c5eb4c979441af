"""The planners that can drive a scenario, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from passpmp_ti import door
from passpmp_ti.planner.baselines.dynamic_window import DynamicWindow
from passpmp_ti.planner.baselines.input_space import InputSpaceSampling
from passpmp_ti.planner.baselines.mppi import Mppi
from passpmp_ti.planner.baselines.passpmp import Passpmp
from passpmp_ti.planner.baselines.viability import Viability
from passpmp_ti.planner.navigator import Navigator

BASELINES: dict[str, Callable[..., Any]] = {
    "passpmp": Passpmp,
    "iss": InputSpaceSampling,
    "dwa": DynamicWindow,
    "mppi": Mppi,
    "viability": Viability,
}
NAVIGATOR = "passpmp-pso"


def baseline(name: str) -> Callable[..., Any]:
    """What makes the planner of that name; it is called like `Navigator`.

    Raises:
        ValueError: there is no such planner; all are listed.
    """
    known = {NAVIGATOR: Navigator, **BASELINES}
    return known[door.choice("baseline", "name", name, known)]
