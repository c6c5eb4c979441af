"""The page of what was driven on the twin, from the folders of its campaigns.

    python -m hardware.twin_page --experiments out/twin --faults out/twin-faults \\
        --page docs/twin-results.md
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from hardware.chair_model import ChairNature
from hardware.twin_experiments import EXPERIMENTS, LATE, TRIES
from hardware.twin_faults import CYCLE, kinds
from hardware.twin_settings import executor_of
from passpmp_ti.compare.job import Result
from passpmp_ti.compare.ledger import EPISODES, Ledger

FILMS = "twin"
"""The folder of the videos, beside the page."""
PERIOD = ChairNature().period
HEAD = """# What was driven on the twin

Made by `python -m hardware.twin_page`; do not edit. How the twin is made, and what the numbers
rest on: [twin.md](twin.md). All of it is real time, through the whole chain: range finders' rays,
SCIP over TCP, client, planner, executor, wheels; twin, planner and executor are processes of
their own.
"""
EXPERIMENTS_HEAD = """## The paper's four experiments

`python -m hardware.twin_experiments --runs N --out FOLDER`. Each seed draws a chair, where it
begins, and all noise. Contacts are the truth's: *moving* if the chair moved at any moment of it.
*Stood*: the longest time at rest on the way, least and greatest of the drives. In
`corridor_person` the way is blocked until the person leaves; `dead_end` has no way to its goal,
and is over when its time is, before the chair backs out of it: there the column tells how many
stood at rest then.
"""
LATENCIES_HEAD = """### Times in the chain

From the scan's stamp to its arrival, and from its arrival on: medians of the drives' medians, and
the greatest of their 99th percentiles. The wheels have a trajectory when it begins, a cycle after
the scan's stamp. *Twin late*: the worst of any moment of any drive.
"""
FAULTS_HEAD = """## Faults in the chain

`python -m hardware.twin_faults --runs N --out FOLDER`. The chair drives to and fro in the
corridor. At a random moment while it moves faster than 0.25 m/s one thing breaks. *Allowed* is
the end of what was held when the fault could be known, and `rest_late`; or, where it brakes off
its path, the detection time, the braking time from the speed it had, and `rest_late`. *Failed*:
late at rest, or moved while the fault lasted, or did not drive again once it was mended.
*Touched*: contacts while it moved. *Noticed after*: from then on nothing new is taken, or it
brakes.
"""
DISTURBED = (
    f"A drive in which the twin itself was late by more than {1e3 * LATE:.0f} ms at any moment is"
    f" disturbed: it is driven again, up to {TRIES} drives in all, and the last one counts."
    " Contacts of those before are counted as well."
)


def experiments(found: Iterable[Result]) -> str:
    """Both tables of the experiments, as markdown."""
    known = list(found)
    drives, times = [], []
    for e in EXPERIMENTS:
        these = [f for f in known if f["scenario"] == e.scenario and f["variant"] == e.variant]
        if these:
            name = f"Fig. {e.figure}, `{e.scenario}`, {e.cycle:g} s"
            drives.append([name, f"{e.object_speed:g}", *_drives(these)])
            times.append([name, *_times(these)])
    again = sum(len(f["disturbed"]) for f in known)
    rest = sum(not f["quiet"] for f in known)
    touched = sum(d["collisions_moving"] for f in known for d in f["disturbed"])
    return "\n\n".join([
        EXPERIMENTS_HEAD.strip(),
        _table(
            ["experiment, cycle", "objects [m/s]", "drives", "goal reached", "time to it [s]",
             "contacts moving, at rest", "nearest wall, mover [m]", "stood [s]",
             "off its path [mm]", "stops off what is held"],
            drives,
        ),
        LATENCIES_HEAD.strip(),
        _table(
            ["experiment, cycle", "stamp to arrival [ms]", "to new trajectory [ms]",
             "to executor [ms]", "to wheels [ms]", "sent; not taken", "cycles without a scan",
             "twin late [ms]"],
            times,
        ),
        f"{DISTURBED} That happened {again} times, with {touched} contacts while moving; {rest} of"
        f" the {len(known)} drives were disturbed to the last.",
    ])  # fmt: skip


def faults(found: Iterable[Result]) -> str:
    """The table of the faults, as markdown."""
    known = list(found)
    noticed = {kind.name: kind.detection for kind in kinds(executor_of(CYCLE), PERIOD)}
    rows = []
    for name in dict.fromkeys(f["kind"] for f in known):
        these = [f for f in known if f["kind"] == name]
        # one that never rested has no time of rest
        rested = [f for f in these if math.isfinite(f["took"])]
        took, back = [f["took"] for f in rested], [f["back"] for f in rested]
        rows.append([
            name, f"{noticed[name]:.2f}", str(len(these)),
            str(sum(bool(f["failure"]) for f in these)),
            str(sum(f["touched"] for f in these)),
            f"{np.median(took):.2f}, {max(took):.2f}" if rested else "-",
            f"{min(f['allowed'] - f['took'] for f in rested):.2f}" if rested else "-",
            f"{np.median(back):.2f}, {max(back):.2f}" if rested else "-",
        ])  # fmt: skip
    again = sum(len(f["disturbed"]) for f in known)
    failed = sum(bool(d["failure"]) for f in known for d in f["disturbed"])
    touched = sum(d["touched"] for f in known for d in f["disturbed"])
    return "\n\n".join([
        FAULTS_HEAD.strip(),
        _table(
            ["fault", "noticed after [s]", "runs", "failed", "touched",
             "to rest: median, longest [s]", "least to spare [s]",
             "drives again after: median, longest [s]"],
            rows,
        ),
        f"{again} runs in which the twin was late by more than {1e3 * LATE:.0f} ms were run again:"
        f" {failed} of those failed, with {touched} contacts while moving.",
        "\n".join(f"- {f['kind']} {f['seed']}: {f['failure']}" for f in known if f["failure"]),
    ])  # fmt: skip


def _drives(these: Sequence[Result]) -> list[str]:
    reached = sum(f["reached_goal"] for f in these)
    rest = sum(f["rests_at_last"] for f in these)
    times = [f["time_to_goal"] for f in these if f["reached_goal"]]
    stops: dict[str, int] = {}
    for found in these:
        for reason, count in found["stops"].items():
            stops[reason] = stops.get(reason, 0) + count
    goal = f"{reached} (at rest {rest})" if these[0]["scenario"] == "dead_end" else str(reached)
    walls = [f["nearest_fixed_moving"] for f in these if f["nearest_fixed_moving"] is not None]
    movers = [
        f["nearest_approach_moving"] for f in these if f["nearest_approach_moving"] is not None
    ]
    return [
        str(len(these)), goal,
        f"{np.median(times):.1f} ({min(times):.1f} to {max(times):.1f})" if times else "-",
        f"{sum(f['collisions_moving'] for f in these)},"
        f" {sum(f['collisions_at_rest'] for f in these)}",
        ", ".join(f"{min(near):.2f}" if near else "-" for near in (walls, movers)),
        f"{min(f['longest_stand'] for f in these):.1f} to"
        f" {max(f['longest_stand'] for f in these):.1f}",
        f"{1e3 * max(f['worst_error'] for f in these):.0f}",
        ", ".join(f"{name.replace('_', ' ')} {n}" for name, n in stops.items()) or "none",
    ]  # fmt: skip


def _times(these: Sequence[Result]) -> list[str]:
    def both(key: str) -> str:
        known = [f for f in these if f[f"{key}_median"] is not None]
        if not known:
            return "-"
        median = np.median([f[f"{key}_median"] for f in known])
        return f"{1e3 * median:.1f}, {1e3 * max(f[f'{key}_p99'] for f in known):.1f}"

    return [
        both("scan_age"), both("to_trajectory"), both("to_executor"), both("to_wheels"),
        f"{sum(f['sent'] for f in these)}; {sum(f['refused'] for f in these)}",
        f"{sum(f['idle'] for f in these)}",
        f"{1e3 * max(f['twin_latest'] for f in these):.0f}",
    ]  # fmt: skip


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def page(
    driven: Mapping[str, Iterable[Result]], machines: Iterable[str], films: Iterable[str] = ()
) -> str:
    """The page.

    Args:
        driven: results of "experiments" and of "faults", where there are any.
        machines: what it was driven on, and at which commits.
        films: videos, from where the page lies.
    """
    parts = [HEAD, f"Driven on {'; '.join(sorted(set(machines)))}."]
    links = ", ".join(f"[{Path(film).stem}]({film})" for film in films)
    if links:
        parts.append(f"Videos, twice as fast as it happened: {links}.")
    if "experiments" in driven:
        parts.append(experiments(driven["experiments"]))
    if "faults" in driven:
        parts.append(faults(driven["faults"]))
    return "\n\n".join(part.strip() for part in parts) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Write the page of what was driven on the twin.",
        epilog="example: python -m hardware.twin_page --experiments out/twin --page twin.md",
    )
    parser.add_argument("--experiments", type=Path, metavar="FOLDER")
    parser.add_argument("--faults", type=Path, metavar="FOLDER")
    parser.add_argument("--page", type=Path, required=True, metavar="FILE")
    given = parser.parse_args()
    driven: dict[str, list[Result]] = {}
    for name in ("experiments", "faults"):
        folder = getattr(given, name)
        if folder is None:
            continue
        if not (folder / EPISODES).exists():
            print(f"--{name} {folder} holds nothing that was driven", file=sys.stderr)
            return 2
        driven[name] = list(Ledger(folder, {}).results.values())
    beside = given.page.parent / FILMS
    films = [f"{FILMS}/{film.name}" for film in sorted(beside.glob("*.mp4"))]
    circumstances = [f["timings"] for found in driven.values() for f in found]
    loads = [told["load"] for told in circumstances if "load" in told]
    machines = [f"{told['machine']}, commit {told['commit']}" for told in circumstances]
    if loads:
        machines = [f"{m}, beside a load of {min(loads):.0f} to {max(loads):.0f}" for m in machines]
    given.page.write_text(page(driven, machines, films), encoding="utf-8")
    print(f"written to {given.page}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
