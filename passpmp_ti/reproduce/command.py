"""`passpmp reproduce`: options, and what it prints. Heavy imports stand inside the functions."""

from __future__ import annotations

import argparse
import datetime
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from passpmp_ti import door

EXAMPLE = """passpmp reproduce table5 fig8
  passpmp reproduce all --seeds 3 --out out/paper"""
ALL = "all"
NAMES = (
    "table3", "table4", "table5", "table6", "table7", "fig8", "fig9", "fig10", "fig12", "fig13",
    "fig14", "fig15", "fig16", "fig17", "fig19", "fig20", "fig21", "fig22", "guide", "trees",
    "memory", "products", "standing", "cones",
)  # fmt: skip
"""Of what can be run, in the order of the page."""
INTERRUPTED = 130
"""Exit code."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What `reproduce` takes."""
    add = parser.add_argument
    add("names", nargs="+", metavar="item", help=f"{', '.join(NAMES)}, or {ALL}")
    add("--seeds", type=int, default=2, metavar="N", help="episodes of each kind (default: 2)")
    add("--threads", type=int, metavar="N", help="of the kernels (default: all)")
    add(
        "--out",
        default="docs",
        metavar="DIR",
        help="the page reproduction.md, its numbers and figures; sections of items that are not run"
        " now stay (default: docs)",
    )


def run(given: argparse.Namespace) -> int:
    """Run the items, print ours beside the paper's, and make their sections of the page anew."""
    names = chosen(given.names)
    seeds = door.whole("reproduce", "seeds", given.seeds, least=1)
    from passpmp_ti import backend
    from passpmp_ti.bench.machine import circumstances
    from passpmp_ti.reproduce import page
    from passpmp_ti.reproduce.item import Asked
    from passpmp_ti.reproduce.registry import ITEMS

    backend.init(threads=given.threads)
    folder = Path(given.out)
    asked = Asked(seeds=seeds, see=_see)
    by = circumstances(given.threads)  # before files of the checkout change
    interrupted = False
    for name in names:
        began = time.perf_counter()
        try:
            found = ITEMS[name].run(asked)
        except KeyboardInterrupt:
            interrupted = True
            break
        made = {
            "date": datetime.date.today().isoformat(), "seconds": time.perf_counter() - began, **by,
        }  # fmt: skip
        _see("")
        page.write(folder, name, asked, found, made)
        page.assemble(folder)
        print(page.section(name, page.read(folder, name)), end="\n\n")
    print(f"page: {folder / page.PAGE}")
    if interrupted:
        print("passpmp: interrupted; what was run before is in the page", file=sys.stderr)
        return INTERRUPTED
    return 0


def chosen(given: Sequence[str]) -> tuple[str, ...]:
    """Names on the command line as items, each once, in the order of the page.

    Raises:
        ValueError: no such item; the nearest is suggested.
    """
    for name in given:
        door.choice("reproduce", "item", name, (*NAMES, ALL))
    return NAMES if ALL in given else tuple(name for name in NAMES if name in given)


def _see(what: str) -> None:
    """One line on standard error that is written over."""
    if sys.stderr.isatty():
        print(f"\r\033[K{what}", end="", file=sys.stderr, flush=True)
    elif what:
        print(what, file=sys.stderr)
