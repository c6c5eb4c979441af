"""One drive through the crowd, and what is told of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from passpmp_ti.benchmark.campaign import Trial
from passpmp_ti.benchmark.crowd_movers import CrowdMovers
from passpmp_ti.benchmark.crowd_world import crowd
from passpmp_ti.compare.job import Result, rehearse_once, told_of
from passpmp_ti.planner.baselines.names import baseline
from passpmp_ti.settings import MODES
from passpmp_ti.sim.episode import CycleInfo, Episode, simulate
from passpmp_ti.sim.scenario import Scenario


def scenario_of(trial: Trial, labels: str, walled: bool) -> Scenario:
    """The world of a trial: `world` counts walkers, `variant` names a mode or a planner."""
    mode = trial.variant if trial.variant in MODES else "conservative"
    return crowd(trial.world, trial.trial, labels=labels, walled=walled, mode=mode)


def planner_of(trial: Trial) -> Callable[..., Any] | None:
    """What drives a trial, for `simulate`; None: the navigator, in the mode of that name."""
    return None if trial.variant in MODES else baseline(trial.variant)


def drive(trial: Trial, labels: str = "sensor", walled: bool = False) -> Result:
    """Drive one trial, in a worker; the world as `crowd` makes it."""
    return told_of(trial.key, lambda: _drive(trial, scenario_of(trial, labels, walled)))


def noticed(info: CycleInfo) -> None:
    """Let those who wait notice the robot; to be called from `simulate`'s `on_cycle`.

    They act on where the robot is as the cycle begins, after its scan: nothing that the scan shows
    changes afterwards.
    """
    movers = info.world.movers
    assert isinstance(movers, CrowdMovers)
    movers.notice(info.time, info.state[:2])


def _drive(trial: Trial, scenario: Scenario) -> dict[str, Any]:
    planner = planner_of(trial)
    if planner is None:
        rehearse_once(scenario.robot, scenario.settings)
    episode = simulate(scenario, seed=trial.trial, on_cycle=noticed, planner=planner)
    if episode.interrupted:
        raise KeyboardInterrupt  # half a trial is none
    return {
        "outcome": outcome_of(episode),
        "timings": {"cycles_us": [round(1e6 * s) for s in episode.update_times[1:]]},
    }


def outcome_of(episode: Episode) -> dict[str, Any]:
    """One trial in numbers, SI units."""
    summary, movers = episode.summary(), episode.world.movers
    assert isinstance(movers, CrowdMovers)
    return {
        name: summary[name]
        for name in (
            "reached_goal", "time_to_goal", "duration", "collisions_moving", "collisions_at_rest",
            "collisions_fixed", "collisions_moving_beyond_bound", "distance_driven",
            "share_moving", "nearest_approach_moving", "cycles", "broken_premises", "lost_scans",
        )
    } | {
        "stepped_out": sum(time is not None for time in movers.stepped),
        "touched_for": sum(contact.end - contact.start for contact in episode.contacts),
        "place": [float(x) for x in episode.states[-1][:2]],
    }  # fmt: skip
