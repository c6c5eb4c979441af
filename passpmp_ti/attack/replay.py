"""A written episode carried out again, to the last bit, and drawn."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from passpmp_ti import door
from passpmp_ti.attack.attempt import outcome, run
from passpmp_ti.attack.case import Case
from passpmp_ti.sim.episode import CycleInfo


def read_case(path: Path) -> tuple[Case, dict[str, Any]]:
    """The case that a file names, and what became of it then.

    Raises:
        ValueError: no file of an episode.
    """
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        case = Case(**told["case"])
    except (OSError, json.JSONDecodeError, KeyError, TypeError) as cause:
        raise ValueError(f"{path}: not an episode written by `passpmp attack`: {cause}") from cause
    return case, told


def replay(
    path: Path, out: Path | None, on_cycle: Callable[[CycleInfo], None] | None = None
) -> tuple[dict[str, Any], bool]:
    """Carry out an episode again.

    Args:
        path: written by a campaign.
        out: where video, snapshots, summary and arrays go; None: nothing is drawn.
        on_cycle: called once a cycle.

    Returns:
        What became of it now, and whether every place at every moment was the same.

    Raises:
        ValueError: no file of an episode.
    """
    case, before = read_case(path)
    now = outcome(run(case, on_cycle)) if out is None else _drawn(case, out, on_cycle)
    return now, now["digest"] == before.get("digest")


def _drawn(case: Case, out: Path, on_cycle: Callable[[CycleInfo], None] | None) -> dict[str, Any]:
    from passpmp_ti.viz.outcome import Outcome

    detail = f"{case.robot} · seed {case.seed}"
    if case.cheat_speed != 1.0:
        detail += f" · movers at {door.finite('Case', 'cheat_speed', case.cheat_speed):g} x"
    with Outcome(out, f"attack: {case.kind}", detail) as drawn:

        def see(info: CycleInfo) -> None:
            drawn.see(info)
            if on_cycle is not None:
                on_cycle(info)

        attempt = run(case, see)
        drawn.finish(attempt.episode())
    return outcome(attempt)
