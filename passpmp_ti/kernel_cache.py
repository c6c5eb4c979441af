"""Where compiled kernels are kept between processes: the user's cache folder.

Taichi writes what it compiled as a process ends, under a lock: a file that nobody else may have
made. Processes that start together each compile, and the first to end writes. Beyond 100 MiB (one
robot's kernels take about 2) it throws a quarter away, the longest unused first; another version of
Taichi throws all away.
"""

from __future__ import annotations

import contextlib
import logging
import os
import tempfile
import time
from pathlib import Path

LOCK = "ticache.lock"
STALE = 60.0
"""[s] A lock is held for milliseconds: one that is older was left by a process that was killed."""

NOWHERE = Path(__file__).parent
"""Taichi's folder where nothing is kept. It makes its folder as the process ends even then, and
crashes where it cannot: so one that is there. Nothing is written to it."""


def folder() -> Path:
    """Where compiled kernels are kept."""
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "passpmp_ti" / "kernels"


def prepared() -> Path | None:
    """The folder, made and in order; None, and a warning, where nothing can be written there."""
    kept = folder()
    try:
        kept.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=kept):
            pass
    except OSError as error:
        logging.getLogger("passpmp_ti").warning(
            "compiled kernels cannot be kept in %s (%s): every start takes as long as the first;"
            " let XDG_CACHE_HOME name a folder that can be written",
            kept,
            error.strerror or error,
        )
        return None
    tidy(kept)
    return kept


def tidy(kept: Path) -> None:
    """Remove what a killed process left behind, with which nothing would be read or written ever
    again: its lock, and files that it had only begun."""
    latest = time.time() - STALE
    for left in (kept / LOCK, *(f for f in kept.glob("*.tic") if not _size(f))):
        # another process may be as tidy
        with contextlib.suppress(OSError):
            if left.stat().st_mtime < latest:
                left.unlink()


def _size(file: Path) -> int:
    """[bytes]; as if it held something where it is gone."""
    try:
        return file.stat().st_size
    except OSError:
        return 1
