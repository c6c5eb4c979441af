"""Runs that are kept, one JSON file each, so that a long study goes on where it was stopped."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any


def kept(
    folder: Path, name: str, asked: Mapping[str, Any], run: Callable[[], Mapping[str, Any]]
) -> dict[str, Any]:
    """What a run came to: read where it was run before, else run and written.

    Args:
        folder: where the files lie; made if it is not there.
        name: of the file, without its ending.
        asked: what was run, ready for JSON; a file that answers something else is run anew.
        run: does it; its answer is ready for JSON.

    Returns:
        {**asked, **what the run came to}.
    """
    path = folder / f"{name}.json"
    wanted = json.loads(json.dumps(dict(asked)))
    if path.exists():
        found = json.loads(path.read_text())
        if {key: found.get(key) for key in wanted} == wanted:
            return found
    row = {**wanted, **run()}
    folder.mkdir(parents=True, exist_ok=True)
    # a run that is stopped while it writes must not leave half a file behind
    part = path.with_suffix(".part")
    part.write_text(json.dumps(row, indent=1) + "\n")
    os.replace(part, path)
    return json.loads(path.read_text())
