"""What a drive of a robot came to, and how it goes meanwhile, in numbers and in words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hardware.status import Status


@dataclass(frozen=True, slots=True)
class Look:
    """How it goes."""

    time: float
    """Since the drive began [s]."""
    record: Any
    """The navigator's last."""
    away: float
    """From the goal, by what is known [m]."""
    speed: float
    """[m/s]."""
    status: Status | None
    """The executor's."""
    silent: tuple[str, ...]
    """Range finders that are not heard, and why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """What a drive came to."""

    name: str
    reached: bool
    interrupted: bool
    """By Ctrl-C."""
    why: str
    """Why it ended."""
    seconds: float
    cycle: float
    rounds: int
    """Cycles."""
    idle: int
    """Those without a scan or a known pose, or while the robot braked."""
    sent: int
    """Trajectories."""
    refused: int
    """Of those that the executor judged."""
    took: np.ndarray
    """From a scan's arrival to the planner's answer, sent, each [s]."""
    decisions: dict[str, int]
    worst_error: float
    """Farthest off its path, as the executor measured it [m]."""
    lost: dict[str, int]
    """Links lost, of each range finder."""

    def summary(self) -> dict[str, Any]:
        """In numbers, SI units."""
        told: dict[str, Any] = {
            key: getattr(self, key)
            for key in (
                "name", "reached", "interrupted", "why", "seconds", "cycle", "rounds", "idle",
                "sent", "refused", "decisions", "lost",
            )
        }  # fmt: skip
        told["worst_error"] = None if math.isnan(self.worst_error) else self.worst_error
        for key, share in (("median", 0.5), ("p99", 0.99)):
            told[f"took_{key}"] = float(np.quantile(self.took, share)) if len(self.took) else None
        return told


def line(look: Look) -> str:
    """One line of progress, and one for each range finder that is silent."""
    state = "silent" if look.status is None else look.status.state.name.lower()
    told = (
        f"t {look.time:6.1f} s   to goal {look.away:6.1f} m   speed {look.speed:6.2f} m/s  "
        f" {look.record.decision:<8} {state:<12} {look.record.reason}"
    )
    return "\n".join([told.rstrip(), *look.silent])


def report(told: dict[str, Any]) -> str:
    """A drive's summary as text."""
    took = [told[f"took_{share}"] for share in ("median", "p99")]
    decisions = ", ".join(f"{name} {n}" for name, n in sorted(told["decisions"].items())) or "none"
    error = told["worst_error"]
    lost = ", ".join(f"{name} {n}" for name, n in told["lost"].items())
    return (
        f"\n{told['name']}: {told['why']}, after {told['seconds']:.1f} s\n"
        f"cycles of {told['cycle']:g} s: {told['rounds']}, {told['idle']} of them without a scan or"
        f" a known pose; decisions: {decisions}\n"
        "scan's arrival to new trajectory: "
        + (
            "none"
            if None in took
            else f"median {1e3 * took[0]:.1f} ms, 99 % {1e3 * took[1]:.1f} ms"
        )
        + f"\ntrajectories: {told['sent']} sent, {told['refused']} refused; off its path by"
        f" {'?' if error is None else f'{1e3 * error:.0f}'} mm at the most\n"
        f"links lost: {lost}"
    )
