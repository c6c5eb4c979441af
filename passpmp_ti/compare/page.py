"""The page of a comparison: one HTML file that needs nothing but the videos beside it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

from passpmp_ti.compare import charts, table
from passpmp_ti.compare.rows import BIN, ROWS, SEED
from passpmp_ti.compare.style import STYLE
from passpmp_ti.compare.summary import Group

READING = (
    "All variants drive the same seeds: the same movers, range errors and random numbers. Speeds"
    " and contacts are the truth's, not the planner's belief. A contact counts as moving if the"
    " robot moved at any moment of it.",
    "Shares have exact two-sided 95 % intervals (Clopper-Pearson), medians of differences those of"
    " their order statistics. They speak of worlds drawn as here, no others.",
    "Risk met is counterfactual: of a chosen trajectory it is asked whether following it to rest"
    " would have touched a mover of the true world while the robot moved. Nobody in the scenarios"
    " reacts to the robot, so that is an exact answer. Trajectories of one episode overlap: their"
    " intervals, which take them as independent, are too narrow. Those on which the robot stands"
    " still are left out.",
    "A cycle's cost is wall clock time in one thread while all workers are busy, without the first"
    " cycle of each episode, which may compile kernels. Variants drive different ways, so it is not"
    " the cost of the same scene.",
)


def html(told: Mapping[str, Any], videos: Mapping[str, str]) -> str:
    """The page.

    Args:
        told: see `report.document`.
        videos: by scenario, a file beside the page.
    """
    variants = told["variants"]
    heading = " · ".join(variants)
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(heading)}</title><style>{STYLE}</style></head><body>",
        f"<header><h1>{escape(heading)}</h1>",
        f"<p class='muted'>{escape(', '.join(told['scenarios']))}: the same worlds, driven by each."
        f" {told['episodes_done']} of {told['episodes_wanted']} episodes, {escape(told['date'])}."
        "</p></header><main>",
    ]
    raised = sum(
        group["raised"]
        for scenario in told["scenarios"].values()
        for group in scenario["variants"].values()
    )
    if raised:
        parts.append(
            f"<p class='alarm'>{raised} episodes ended by an error and are left out; see"
            " <code>episodes.jsonl</code>.</p>"
        )
    for name, scenario in told["scenarios"].items():
        parts += _section(name, scenario, videos.get(name))
    parts.append("<section><h2>How to read it</h2>")
    parts += [f"<p>{escape(words)}</p>" for words in READING]
    parts += [
        _definitions((row.label, row.note) for row in ROWS if row.note),
        "</section></main><footer>",
        f"<p>{escape(table.origin(told))}</p><pre>{escape(told['command'])}</pre>",
        "<p><a href='summary.json'>summary.json</a> · <a href='summary.md'>summary.md</a> ·"
        " <a href='episodes.jsonl'>episodes.jsonl</a></p>",
        "</footer></body></html>\n",
    ]
    return "\n".join(parts)


def _section(name: str, scenario: Mapping[str, Any], video: str | None) -> list[str]:
    groups: Mapping[str, Group] = scenario["variants"]
    parts = [
        f"<section><h2>{escape(name)}</h2><p class='muted'>{escape(scenario['description'])};"
        f" objects of at most {scenario['object_speed']:.3g} m/s; ends after"
        f" {scenario['duration']:g} s.</p>"
    ]
    parts += [f"<p class='finding'>{escape(sentence)}</p>" for sentence in scenario["findings"]]
    rows = [[row.label, *own] for row, own in table.cells(groups)]
    parts += [_table(["", *groups], rows), "<div class='charts'>"]
    for title, chart in (
        ("Contacts while moving", charts.contacts_chart(groups)),
        ("Cost of a cycle", charts.cost_chart(groups)),
        ("Time to the goal", charts.arrival_chart(groups, scenario["duration"])),
        ("Risk promised, risk met", charts.reliability_chart(groups)),
    ):
        parts.append(f"<figure><figcaption>{title}</figcaption>{chart}</figure>")
    parts.append("</div>")
    if video:
        file = escape(video, quote=True)
        parts.append(
            "<figure><figcaption>One seed in all of them, twice as fast as it happened</figcaption>"
            f"<video controls loop muted preload='metadata' src='{file}'></video></figure>"
        )
    parts += [
        "<details><summary>Risk promised and met, bin by bin</summary>",
        _table(
            ["", *(row.label for row in BIN)],
            [
                [name, *(row.told(b) for row in BIN)]
                for name, group in groups.items()
                for b in group["promises"]["bins"]
            ],
        ),
        "</details><details><summary>Every seed</summary>",
        _table(["seed", *groups], _by_seed(groups)),
        "</details></section>",
    ]
    return parts


def _by_seed(groups: Mapping[str, Group]) -> list[list[str]]:
    """A row a seed: time to the goal, and contacts where there are any."""
    seeds = sorted({seed for group in groups.values() for seed in group["seeds"]}, key=int)
    time, contacts = SEED
    rows = []
    for seed in seeds:
        row = [seed]
        for group in groups.values():
            one = group["seeds"].get(seed)
            words = "" if one is None else time.told(one)
            if one is not None and one["contacts"]:
                words += f", {contacts.told(one)} contacts"
            row.append(words)
        rows.append(row)
    return rows


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """The first column names the rows."""
    told = "".join(f"<th>{escape(words)}</th>" for words in head)
    body = []
    for first, *others in rows:
        own = "".join(f"<td>{escape(words)}</td>" for words in others)
        body.append(f"<tr><th>{escape(first)}</th>{own}</tr>")
    return (
        f"<div class='wide'><table><thead><tr>{told}</tr></thead>"
        f"<tbody>{''.join(body)}</tbody></table></div>"
    )


def _definitions(entries: Iterable[tuple[str, str]]) -> str:
    told = "".join(f"<dt>{escape(a)}</dt><dd>{escape(b)}</dd>" for a, b in entries)
    return f"<dl>{told}</dl>"
