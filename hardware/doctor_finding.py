"""What a check of a machine or a robot found."""

from __future__ import annotations

from dataclasses import dataclass

OK, WARN, FAIL = "ok", "warn", "FAIL"
"""All is well; it works, and something is missing or slow; it does not work."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One line."""

    what: str
    """What was looked at."""
    level: str
    """`OK`, `WARN` or `FAIL`."""
    told: str
    """What was seen."""
    remedy: str = ""
    """What to do about it; empty where nothing is to be done."""

    def line(self) -> str:
        """For people."""
        told = f"{self.level:<4}  {self.what:<18} {self.told}"
        return f"{told}; {self.remedy}" if self.remedy else told


def graded(what: str, value: float, told: str, remedy: str, *, warn: float, fail: float) -> Finding:
    """A finding by a number that should be small.

    Args:
        what: was looked at.
        value: the number.
        told: how it is told.
        remedy: what to do where it is too large.
        warn: above this.
        fail: above this.
    """
    level = FAIL if value > fail else WARN if value > warn else OK
    return Finding(what, level, told, "" if level == OK else remedy)
