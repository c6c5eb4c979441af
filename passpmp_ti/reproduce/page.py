"""The page: put together from what each item left in the folder, so that one can be run again."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from passpmp_ti.bench.machine import told as machine_told
from passpmp_ti.reproduce.item import Asked, Found, table
from passpmp_ti.reproduce.registry import GROUPS, ITEMS
from passpmp_ti.reproduce.runs import PATIENCE

PAGE, NUMBERS, IMAGES = "reproduction.md", "reproduction", "images/reproduction"
"""In the folder: the page, one JSON file an item, the figures."""
COMMAND = "passpmp reproduce"

HEAD = f"""# The paper, run again

Made by `{COMMAND} all`; do not edit. One item is run again, and its section made anew, by
`{COMMAND} table5`. Every figure of ours on this page was measured by that command; the paper's are
from Bouraine & Azouaoui, Robotica, 2020, by the number of the table.

**How to read it.** The paper gives no coordinates for its scenes, so they are ours: same sizes,
numbers and limits, other places. Trends and orders can be compared, digits cannot. *Holds* tells
whether what the paper says was found here; where it was not, the section says why. Speeds, contacts
and distances are the simulator's truth, not the planner's belief. A contact counts as *moving* if
the robot moved at any moment of it. Seeds draw the movers, or where the robot starts. Where nobody
moves, a robot that stood for {PATIENCE:g} s is taken to stay, and the drive ends. Running times are
of a machine that others used too. Other planners in all scenarios, viability among them:
[baselines.md](baselines.md); what each step does: [how-it-works.md](how-it-works.md).
"""
SLIPS_HEAD = """Where the printed text slips, and what is done here instead, is listed in
[how-it-works.md](how-it-works.md#where-this-differs-from-the-paper). Four of the slips can be
seen in a short run; *holds: no* here is the point."""
THEIRS = "What the paper could not have claimed"


def write(folder: Path, name: str, asked: Asked, found: Found, made: dict[str, Any]) -> None:
    """Leave what one item came to: its numbers and figures, in place of those before.

    Args:
        folder: where the page lies.
        name: of the item.
        asked: how much was run.
        found: what came of it.
        made: when, by what and for how long, ready for JSON.
    """
    numbers, images = folder / NUMBERS, folder / IMAGES
    numbers.mkdir(parents=True, exist_ok=True)
    images.mkdir(parents=True, exist_ok=True)
    before = read(folder, name)
    for file in (before or {"figures": {}})["figures"].values():
        (images / file).unlink(missing_ok=True)
    figures = {}
    for n, (caption, svg) in enumerate(found.figures.items()):
        file = f"{name}.svg" if n == 0 else f"{name}-{n + 1}.svg"
        (images / file).write_text(svg, encoding="utf-8")
        figures[caption] = file
    told = {
        "item": name, "seeds": asked.seeds, "searches": asked.searches, **made,
        "claims": [asdict(claim) for claim in found.claims], "figures": figures,
        "numbers": found.numbers,
    }  # fmt: skip
    path = numbers / f"{name}.json"
    # a run that is stopped while it writes must not leave half a file behind
    part = path.with_suffix(".part")
    part.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    os.replace(part, path)


def assemble(folder: Path) -> str:
    """The page of what lies in the folder, as markdown; also written there."""
    known = {name: read(folder, name) for name in ITEMS}
    parts = [HEAD, *_overview(known)]
    for title, group in GROUPS.items():
        parts.append(f"# {title}")
        if title == THEIRS:
            parts.append(SLIPS_HEAD)
        for name in group:
            parts.append(section(name, known[name]))
    text = "\n\n".join(part.strip("\n") for part in parts) + "\n"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / PAGE).write_text(text, encoding="utf-8")
    return text


def section(name: str, told: dict[str, Any] | None) -> str:
    """One item; `told`: what its file says, None: there is none."""
    item = ITEMS[name]
    parts = [f'<a id="{name}"></a>\n\n## {item.title}', f"*The paper:* {item.paper}"]
    if told is None:
        return "\n\n".join([*parts, f"Not run yet: `{COMMAND} {name}`."])
    try:
        parts.append(item.tell(told["numbers"]))
    except LookupError:  # a file of a version that measured something else
        return "\n\n".join([*parts, f"Run by another version: `{COMMAND} {name}` runs it again."])
    for caption, file in told["figures"].items():
        parts += [f"![{item.title}]({IMAGES}/{file})", f"*{caption}.*"]
    claims = [[c["says"], c["ours"], c["holds"]] for c in told["claims"]]
    parts.append(table(["said", "found here", "holds"], claims))
    parts.append(
        f"`{COMMAND} {name} --seeds {told['seeds']}`, {told['seconds']:.0f} s on {told['date']};"
        f" {machine_told(told)}."
    )
    return "\n\n".join(parts)


def _overview(known: dict[str, dict[str, Any] | None]) -> Iterator[str]:
    """All claims in one table, but for the slips: they are there to fail."""
    rows = [
        [f"[{name}](#{name})", claim["says"], claim["ours"], claim["holds"]]
        for title, group in GROUPS.items()
        if title != THEIRS
        for name in group
        for claim in (known[name] or {"claims": []})["claims"]
    ]
    if rows:
        yield "# At a glance"
        yield table(["", "said", "found here", "holds"], rows)


def read(folder: Path, name: str) -> dict[str, Any] | None:
    """What an item left in the folder; None: nothing."""
    path = folder / NUMBERS / f"{name}.json"
    if not path.is_file():
        return None
    told: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return told
