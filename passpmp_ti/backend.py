"""Where the kernels run. The only place that initialises Taichi."""

from __future__ import annotations

import contextlib
import io
import logging
import os
from pathlib import Path

from passpmp_ti import door

BACKENDS = ("auto", "cpu", "cuda", "vulkan", "metal")

_running: str | None = None


def init(backend: str = "auto", threads: int | None = None, *, debug: bool = False) -> str:
    """Start Taichi once; a later call that asks for nothing else does nothing.

    Args:
        backend: "cpu", "cuda", "vulkan", "metal", or "auto": CUDA where it works, else the CPU.
        threads: most CPU threads, OpenCV's among them; None: all.
        debug: check every index in the kernels; slow, for tests.

    Returns:
        The name of the backend that runs.

    Raises:
        ValueError: an unknown backend, or one other than what runs already.
        RuntimeError: the backend asked for does not work on this machine.
    """
    global _running
    door.choice("init", "backend", backend, BACKENDS)
    if threads is not None:
        threads = door.whole("init", "threads", threads, least=1)
    if _running is not None:
        if backend not in ("auto", _running):
            raise ValueError(
                f"init.backend = {backend!r}, but Taichi runs on {_running!r} in this process and"
                " arrays made there would die; start a new process"
            )
        return _running

    import taichi as ti

    # taichi.gpu crashes on machines without one: name a backend, and CUDA only beside its driver.
    wanted = backend if backend != "auto" else ("cuda" if _cuda_driver_present() else "cpu")
    options: dict[str, object] = dict(
        log_level=ti.ERROR,
        offline_cache=True,
        offline_cache_file_path=str(cache_folder()),
        fast_math=False,
        debug=debug,
        random_seed=0,
    )
    if threads is not None:
        options["cpu_max_num_threads"] = threads
        # OpenCV's own threads would wait busily on cores that others were promised
        with contextlib.suppress(ImportError):
            import cv2

            cv2.setNumThreads(threads)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            ti.init(arch=getattr(ti, wanted), enable_fallback=False, **options)
    except RuntimeError as cause:
        if backend != "auto":
            raise RuntimeError(
                f"init.backend = {backend!r} does not work on this machine ({cause});"
                " use 'auto' or 'cpu'"
            ) from cause
        wanted = "cpu"
        with contextlib.redirect_stdout(io.StringIO()):
            ti.init(arch=ti.cpu, **options)
    _running = wanted
    logging.getLogger("passpmp_ti").info("kernels run on %s", wanted)
    return wanted


def running() -> str | None:
    """The backend that runs, or None before `init`."""
    return _running


def cache_folder() -> Path:
    """Where compiled kernels are kept between processes."""
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "passpmp_ti" / "kernels"


def _cuda_driver_present() -> bool:
    return Path("/proc/driver/nvidia/version").exists() or Path("/dev/nvidiactl").exists()
