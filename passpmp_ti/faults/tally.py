"""What became of the faults, counted kind by kind."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from typing import Any

NO_FAULT = "no fault yet"


@dataclass
class Tally:
    """Counts of one kind of fault; what happens after a burst counts for it until the next."""

    times: int = 0
    """Bursts."""
    while_moving: int = 0
    """Bursts that began while the robot moved."""
    faulty_cycles: int = 0
    cycles: int = 0
    """Faulty ones and those after them, until the next burst."""
    contacts_moving: int = 0
    contacts_at_rest: int = 0
    exceptions: int = 0
    """Raised by `update`."""
    endless: int = 0
    """Answers that do not end at rest."""
    breaks: int = 0
    """Answers that did not begin where the robot was, and were not taken."""
    unverified: int = 0
    """New plans that the model which made them does not find free."""
    held_unclear: int = 0
    """Cycles in which what was held was judged unsafe, without a broken premise."""
    premises: int = 0
    """Cycles that reported a broken premise, though none was broken."""
    unproven_brakes: int = 0
    """Brakings that no control proved: the best of what was left, off the plan."""
    caught: int = 0
    """Errors inside the planner that the record tells of."""
    unrecorded: int = 0
    """Faulty cycles of which the record told nothing, though nothing could be planned."""
    rested: int = 0
    """Bursts after which the robot came to rest on what it held."""
    went_on: int = 0
    """Bursts that it drove through without stopping."""
    distance: float = 0.0
    """[m]"""
    time_moving: float = 0.0
    """[s]"""

    def add(self, other: Tally) -> None:
        """Count another one's counts too."""
        for entry in fields(self):
            setattr(self, entry.name, getattr(self, entry.name) + getattr(other, entry.name))

    @property
    def failures(self) -> int:
        """Everything that must not happen."""
        return (
            self.contacts_moving + self.exceptions + self.endless
            + self.unverified + self.held_unclear + self.unrecorded
        )  # fmt: skip


Tallies = dict[str, Tally]


def merged(parts: Iterable[Tallies]) -> Tallies:
    """Several tallies as one."""
    whole: Tallies = {}
    for part in parts:
        for kind, tally in part.items():
            whole.setdefault(kind, Tally()).add(tally)
    return whole


def total(tallies: Tallies) -> Tally:
    """All kinds together."""
    whole = Tally()
    for tally in tallies.values():
        whole.add(tally)
    return whole


def as_document(tallies: Tallies) -> dict[str, Any]:
    """For JSON."""
    return {kind: asdict(tally) for kind, tally in tallies.items()}
