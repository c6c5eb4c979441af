"""Where the kernels run. The only place that initialises Taichi."""

from __future__ import annotations

import contextlib
import io
import logging
import os
from pathlib import Path

from passpmp_ti import door, kernel_cache, probe

BACKENDS = ("auto", "cpu", "cuda", "vulkan", "metal")

SINGLE = ("vulkan", "metal")
"""Backends on which kernels in double precision cannot be relied on."""

_running: str | None = None
_log = logging.getLogger("passpmp_ti")


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

    wanted = backend if backend != "auto" else _chosen()
    if backend not in ("auto", "cpu"):
        # asked in another process: what does not work may end the one that tries it
        reason = probe.trouble(backend, again=True)
        if reason:
            raise _refusal(backend, reason)
    kept = kernel_cache.prepared()
    options: dict[str, object] = dict(
        log_level=ti.ERROR,
        offline_cache=kept is not None,
        offline_cache_file_path=str(kept or kernel_cache.NOWHERE),
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
    before = _own_threads()
    try:
        _start(wanted, options)
    except RuntimeError as cause:
        if backend != "auto" or wanted == "cpu":
            raise _refusal(backend, str(cause)) from cause
        _log.warning("%s worked in a trial and does not now (%s)", wanted, cause)
        wanted = "cpu"
        _start(wanted, options)
    if wanted == "cpu":
        _give_each_a_core(sorted(_own_threads() - before), threads)
    if not debug:
        _shorten_first_compilation()
    _running = wanted
    _log.info("kernels run on %s", wanted)
    return wanted


def has_doubles() -> bool:
    """Whether kernels may work in double precision on the backend that runs."""
    return _running not in SINGLE


def _chosen() -> str:
    """CUDA where it works, else the CPU; `taichi.gpu` would crash where there is no GPU."""
    if not probe.has_driver("cuda"):
        return "cpu"
    reason = probe.trouble("cuda")
    if not reason:
        return "cuda"
    _log.warning("there is a driver for CUDA, but it does not work here: %s", reason)
    return "cpu"


def _refusal(backend: str, reason: str) -> RuntimeError:
    return RuntimeError(
        f"init.backend = {backend!r} does not work on this machine ({reason}); use 'auto' or"
        f" 'cpu', or see whether `{' '.join(probe.command(backend))}` works after a change of the"
        " driver"
    )


def _start(arch: str, options: dict[str, object]) -> None:
    import taichi as ti

    # Taichi greets on standard output, which belongs to the program
    with contextlib.redirect_stdout(io.StringIO()):
        ti.init(arch=getattr(ti, arch), enable_fallback=False, **options)


def _own_threads() -> set[int]:
    """Numbers of this process's threads, where the system lists them."""
    listing = Path("/proc/self/task")
    return {int(entry.name) for entry in listing.iterdir()} if listing.is_dir() else set()


def _give_each_a_core(started: list[int], threads: int | None) -> None:
    """Let each of the kernels' threads run on a core of its own, where they have all cores.

    Linux wakes a thread on the core of the one that wakes it: a kernel that is launched by a thread
    that was busy until then has its workers wait for each other on one core, for milliseconds.

    Args:
        started: threads that Taichi has started, oldest first; the workers are the last of them.
        threads: as `init` was asked.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    workers = started[-len(cores) :]
    if len(cores) < 2 or len(workers) < len(cores) or (threads or len(cores)) != len(cores):
        return
    for thread, core in zip(workers, cores, strict=True):
        with contextlib.suppress(OSError):  # it may have ended, or the system forbid it
            os.sched_setaffinity(thread, {core})


def _shorten_first_compilation() -> None:
    """Let Taichi not wrap the source lines that it keeps for its error messages.

    It prepares a message for every expression that it reads, and wrapping them takes a quarter of
    a first cycle even where every kernel is in the cache. The lines stay, in full length.
    """
    from taichi.lang.ast import ast_transformer_utils

    if hasattr(ast_transformer_utils, "TextWrapper"):
        ast_transformer_utils.TextWrapper = _Unwrapped


class _Unwrapped:
    """Takes the place of `textwrap.TextWrapper`: a text is one line."""

    def __init__(self, width: int) -> None:
        """As `TextWrapper`; the width bounds nothing."""

    def wrap(self, text: str) -> list[str]:
        """[the text]; [] where there is none."""
        return [text] if text.strip() else []


def running() -> str | None:
    """The backend that runs, or None before `init`."""
    return _running
