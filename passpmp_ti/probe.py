"""Whether a backend works here, asked in a process of its own.

A driver without its device, or one that is broken, can end the process that asks, or keep it for
ever. `python -m passpmp_ti.probe cuda` is the process that may be lost.
"""

from __future__ import annotations

import contextlib
import json
import os
import platform
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path
from typing import Any

from passpmp_ti import kernel_cache

LIMIT = 30.0
"""[s] A probe that takes longer is taken for one that hangs."""
FORGET = 3600.0
"""[s] What did not work is tried again then: the device may only have been busy."""
WORKS = "passpmp_ti.probe: works"
"""What a probe says that went well."""
NUMBERS = 1000
"""How many sums a probe adds up."""
FILES = {
    "cuda": (
        "/proc/driver/nvidia/version",
        "/dev/nvidiactl",
        "/dev/nvhost-gpu",
        "/dev/dxg",
        "C:/Windows/System32/nvcuda.dll",
    ),
    "vulkan": ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "C:/Windows/System32/vulkan-1.dll"),
    "metal": ("/System/Library/Frameworks/Metal.framework",),
}
"""What lies where the driver of a backend is installed."""


def has_driver(backend: str) -> bool:
    """Whether a driver of the backend seems to be installed."""
    return any(Path(file).exists() for file in FILES[backend])


def trouble(backend: str, *, again: bool = False) -> str:
    """Why a backend does not work here; empty where it does.

    What was found is kept beside the kernels, for this driver and this version of Taichi: for good
    where the backend works, for `FORGET` where it does not.

    Args:
        backend: "cuda", "vulkan" or "metal".
        again: do not believe that it does not work, try it.
    """
    key = _circumstances(backend)
    known = _known().get(backend)
    if known and known.get("key") == key:
        found = str(known["trouble"])
        fresh = abs(time.time() - float(known["when"])) < FORGET
        if not found or (fresh and not again):
            return found
    found = _ask(command(backend))
    _keep(backend, {"key": key, "trouble": found, "when": time.time()})
    return found


def command(backend: str) -> list[str]:
    """How the process is started that may be lost."""
    return [sys.executable, "-m", "passpmp_ti.probe", backend]


def _ask(asked: list[str]) -> str:
    """What the process said that may be lost; empty where all is well."""
    home = str(Path(__file__).resolve().parents[1])
    path = os.pathsep.join(p for p in (home, os.environ.get("PYTHONPATH")) if p)
    try:
        done = subprocess.run(
            asked, capture_output=True, text=True, errors="replace", timeout=LIMIT,
            stdin=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": path}, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"it did not answer within {LIMIT:g} s"
    except OSError as error:
        return f"it could not be tried: {error}"
    if done.returncode < 0:
        return f"its driver ends the process (signal {-done.returncode})"
    if done.returncode:
        said = done.stderr.strip().splitlines()
        return said[-1][:300] if said else f"it ended with {done.returncode}"
    return "" if WORKS in done.stdout else "it does not compute what it should"


def _circumstances(backend: str) -> str:
    """What a verdict depends on, as far as it can be told without touching the device."""
    told = [metadata.version("taichi"), platform.machine(), platform.version()]
    told.append(os.environ.get("CUDA_VISIBLE_DEVICES", ""))
    for name in FILES[backend]:
        file = Path(name)
        try:
            # what lies in /proc and /dev is as old as the machine's last start
            told.append(file.read_text() if name.startswith("/proc") else str(_age(file)))
        except OSError:
            continue
    return "\n".join(told)


def _age(file: Path) -> int:
    return 0 if str(file).startswith("/dev") else file.stat().st_mtime_ns


def _notes() -> Path:
    return kernel_cache.folder().parent / "backends.json"


def _known() -> dict[str, Any]:
    try:
        known = json.loads(_notes().read_text())
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def _keep(backend: str, verdict: dict[str, Any]) -> None:
    """Write it down where that is possible; whole or not at all, since others may read."""
    notes = _notes()
    own = notes.with_name(f"{notes.name}.{os.getpid()}")
    try:
        notes.parent.mkdir(parents=True, exist_ok=True)
        own.write_text(json.dumps({**_known(), backend: verdict}, indent=2))
        own.replace(notes)
    except OSError:
        with contextlib.suppress(OSError):
            own.unlink()


def main(backend: str) -> int:
    """Start the backend, let it compute and look at what it found: the process that may be lost."""
    import numpy as np
    import taichi as ti

    ti.init(
        arch=getattr(ti, backend), enable_fallback=False, log_level=ti.ERROR, offline_cache=False,
        offline_cache_file_path=str(kernel_cache.NOWHERE),
    )  # fmt: skip
    from passpmp_ti.kernels.probe import add_up

    whole = np.arange(NUMBERS, dtype=np.int32)
    real = np.arange(NUMBERS, dtype=np.float32) - 500
    there = [ti.ndarray(kind, (NUMBERS,)) for kind in (ti.i32, ti.f32, ti.f32)]
    there[0].from_numpy(whole)
    there[1].from_numpy(real)
    add_up(*there)
    if not np.array_equal(there[2].to_numpy(), real * 0.5 + (whole & 255)):
        print("it adds up wrongly", file=sys.stderr)
        return 1
    print(WORKS)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
