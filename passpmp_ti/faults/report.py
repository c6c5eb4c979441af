"""A campaign as a page of Markdown."""

from __future__ import annotations

from passpmp_ti.faults.campaign import Found
from passpmp_ti.faults.premises import Noticed
from passpmp_ti.faults.tally import Tallies, Tally, total

FAULT_COLUMNS = (
    ("times", "times"),
    ("while moving", "while_moving"),
    ("faulty cycles", "faulty_cycles"),
    ("contacts moving", "contacts_moving"),
    ("at rest", "contacts_at_rest"),
    ("exceptions", "exceptions"),
    ("held unsafe", "held_unclear"),
    ("unverified", "unverified"),
    ("breaks", "breaks"),
    ("silent", "unrecorded"),
    ("premises", "premises"),
    ("unproven brakes", "unproven_brakes"),
    ("rested", "rested"),
    ("went on", "went_on"),
    ("m", "distance"),
    ("s moving", "time_moving"),
)
PREMISE_COLUMNS = (
    ("trials", "trials"),
    ("shown in free space", "broken"),
    ("noticed in that cycle", "in_time"),
    ("late", "late"),
    ("missed", "missed"),
    ("only within the margin", "shallow"),
    ("braked", "braked"),
    ("of these deferred", "deferred"),
    ("unanswered", "unanswered"),
    ("false alarms", "false_alarms"),
    ("exceptions", "exceptions"),
    ("contacts moving", "contacts_moving"),
    ("cycles", "cycles"),
    ("m", "distance"),
    ("s moving", "time_moving"),
)


def markdown(found: Found) -> str:
    """The tables of a campaign; what must be zero is named under each."""
    lines = [f"{found.jobs} of {found.of} jobs done, {found.failures} failures.", ""]
    for robot, tallies in sorted(found.faults.items()):
        lines += [f"## Faults, {robot}", "", *_faults(tallies), ""]
        lines += [
            "Must be 0: contacts moving, exceptions, held unsafe, unverified, silent.",
            "",
        ]
    for robot, kinds in sorted(found.premises.items()):
        lines += [f"## Broken premises, {robot}", "", *_premises(kinds), ""]
        lines += ["Must be 0: late, missed, unanswered, false alarms, exceptions.", ""]
    return "\n".join(lines)


def _faults(tallies: Tallies) -> list[str]:
    rows = [*sorted(tallies.items()), ("all", total(tallies))]
    return _table("fault", FAULT_COLUMNS, rows)


def _premises(kinds: dict[str, Noticed]) -> list[str]:
    return _table("premise", PREMISE_COLUMNS, sorted(kinds.items()))


def _table(
    first: str,
    columns: tuple[tuple[str, str], ...],
    rows: list[tuple[str, Tally]] | list[tuple[str, Noticed]],
) -> list[str]:
    lines = [
        "| " + " | ".join([first, *(heading for heading, _ in columns)]) + " |",
        "|" + "---|" * (len(columns) + 1),
    ]
    for name, counts in rows:
        values = [getattr(counts, key) for _, key in columns]
        cells = [f"{v:.0f}" if isinstance(v, float) else str(v) for v in values]
        lines.append("| " + " | ".join([name, *cells]) + " |")
    return lines
