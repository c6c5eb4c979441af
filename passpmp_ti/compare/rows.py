"""How the numbers of a summary are put into words: one row of the table each."""

from __future__ import annotations

import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

NOTHING = "–"


@dataclass(frozen=True, slots=True)
class Row:
    """One row."""

    label: str
    form: str
    """How a variant's numbers are told; `{name:form}` stands for an entry of the summary."""
    note: str = ""
    """What it means, in a sentence."""

    @property
    def keys(self) -> tuple[str, ...]:
        """The entries that it tells."""
        return tuple(name for _, name, _, _ in string.Formatter().parse(self.form) if name)

    def told(self, group: Mapping[str, Any]) -> str:
        """A variant's cell; a dash where an entry, or the first and so the whole, is not known."""
        told = ""
        for text, name, form, _ in string.Formatter().parse(self.form):
            told += text
            if name:
                told += _told(group[name], form or "")
        return NOTHING if group[self.keys[0]] is None else told


def percent(share: float, form: str = ".1%") -> str:
    """A share in per cent, with a space as SI asks for."""
    return format(share, form).replace("%", " %")


def _told(value: Any, form: str) -> str:
    """A number by a format as Python knows it; seconds in milliseconds with `ms` at its end."""
    if value is None:
        return NOTHING
    if form.endswith("%"):
        return percent(value, form)
    if form.endswith("ms"):
        return f"{format(1e3 * value, form[:-2])} ms"
    return format(value, form)


ROWS: Sequence[Row] = (
    Row(
        "episodes",
        "{episodes} of {cycles} cycles ({raised} raised)",
        "raised: ended by an error, and left out",
    ),
    Row(
        "episodes with a contact while moving",
        "{contact_episodes}: {contact_share:.1%} ({contact_low:.1%} to {contact_high:.1%})",
        "in brackets: exact 95 % interval (Clopper-Pearson)",
    ),
    Row(
        "contacts while moving",
        "{contacts} ({contacts_beyond_bound} beyond the bound)",
        "beyond the bound: with somebody faster than `object_speed`, in the 3 s before",
    ),
    Row("contacts at rest", "{contacts_at_rest}", "somebody walked into the standing robot"),
    Row(
        "goal reached",
        "{reached}: {reached_share:.1%} ({reached_low:.1%} to {reached_high:.1%})",
        "before the scenario's time was up",
    ),
    Row(
        "time to the goal, median",
        "{time_median:.1f} s ({time_q1:.1f} to {time_q3:.1f})",
        "of those that reached it; in brackets: quartiles",
    ),
    Row(
        "later than the first, median",
        "{later_median:+.1f} s ({later_low:+.1f} to {later_high:+.1f}; {pairs} pairs)",
        "on seeds on which both reached the goal; negative: sooner; in brackets: 95 % interval of"
        " the median",
    ),
    Row("mean speed", "{mean_speed:.2f} m/s", "distance by time, all episodes"),
    Row("share of time moving", "{share_moving:.1%}"),
    Row(
        "p-safe cycles",
        "{p_safe_share:.2%}",
        "the strict model, kept beside the planner, proves that the robot can be at rest before"
        " anything can touch it",
    ),
    Row(
        "p-safe cycles while moving",
        "{p_safe_share_moving:.2%}",
        "the same without cycles at rest, which are p-safe by definition",
    ),
    Row("cycles with a broken premise", "{broken_premises}", "a return where nothing could be"),
    Row(
        "cost of a cycle",
        "{cost_median:.1fms}, 99 %: {cost_p99:.1fms}",
        "wall clock time from scan to trajectory, one thread, all workers busy",
    ),
    Row("cost beside the first", "× {cost_ratio:.2f}", "ratio of the medians"),
)

PROMISES: Sequence[Row] = (
    Row("trajectories judged", "{judged}"),
    Row("contacts promised", "{expected:.3g}"),
    Row("contacts met", "{met}"),
)
"""Rows of a summary's `promises`."""
BIN: Sequence[Row] = (
    Row("promised between", "{low:.2g} and {high:.2g}"),
    Row("mean promise", "{promised:.3g}"),
    Row("trajectories", "{count}"),
    Row("came to a contact", "{met}"),
    Row("share", "{share:.3g} ({share_low:.2g} to {share_high:.2g})"),
)
"""Columns of one of their bins."""
SEED: Sequence[Row] = (
    Row("time to the goal", "{time_to_goal:.1f} s"),
    Row("contacts while moving", "{contacts}"),
)
"""Columns of one episode."""
