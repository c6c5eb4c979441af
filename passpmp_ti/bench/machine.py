"""What a figure was measured on: the machine, its versions, the state of the code."""

from __future__ import annotations

import importlib.util
import os
import platform
import subprocess
import sys
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from passpmp_ti import backend

CODE = Path(__file__).resolve().parents[2]
"""The checkout, or the folder that the package was installed into."""


def machine() -> dict[str, Any]:
    """The machine, in words and numbers, and the versions of what ran on it."""
    return {
        "machine": processor(),
        "cores": cores(),
        "system": f"{platform.system()} {platform.release()}",
        "python": sys.version.split()[0],
        **{name: metadata.version(name) for name in ("taichi", "numpy", "scipy")},
        **({"numba": metadata.version("numba")} if importlib.util.find_spec("numba") else {}),
    }


def circumstances(threads: int | None) -> dict[str, Any]:
    """The machine, the backend that runs, the threads it may use, and the commit."""
    return {
        **machine(),
        "backend": backend.running() or "none",
        "threads": threads or cores(),
        "commit": commit(),
    }


def told(found: Mapping[str, Any]) -> str:
    """`circumstances` in one line."""
    return (
        f"{found['machine']}, {found['cores']} cores, {found['threads']} threads,"
        f" backend {found['backend']}, Python {found['python']}, Taichi {found['taichi']},"
        f" NumPy {found['numpy']}, commit {found['commit']}"
    )


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def processor() -> str:
    """The processor's name, as well as the system tells it."""
    listing = Path("/proc/cpuinfo")
    if listing.is_file():
        for line in listing.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def has_avx512() -> bool:
    """Whether the processor has the vector instructions of the tuned C++."""
    listing = Path("/proc/cpuinfo")
    return listing.is_file() and "avx512f" in listing.read_text(errors="replace").split()


def commit() -> str:
    """Of the code, with a plus where it was changed since; "unknown" outside a checkout."""
    try:
        head = _git("rev-parse", "--short=12", "HEAD")
        return head + ("+" if _git("status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.SubprocessError):
        return "unknown"


def _git(*arguments: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(CODE), *arguments], capture_output=True, text=True, check=True, timeout=10
    )
    return done.stdout.strip()
