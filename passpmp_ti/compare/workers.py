"""Where jobs are done: in processes of this machine, or on a Dask cluster, by the same function."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from typing import Any, Protocol, TypeVar


class LostWorkerError(RuntimeError):
    """A worker died of something that no job can tell of; the others may have too."""

    def __init__(self, cause: object) -> None:
        """`cause`: what is known."""
        super().__init__(
            f"a worker died ({cause}); if memory ran out, take fewer --workers. What is finished is"
            " written, and the same command goes on"
        )


J = TypeVar("J")
R = TypeVar("R")

LOCAL = "local"
"""As a scheduler: a Dask cluster that is started on this machine."""
WITHOUT_DASK = (
    "compare.scheduler needs dask.distributed, which is not installed:"
    " `pip install 'passpmp_ti[cluster]'`, or leave --scheduler out to use this machine's cores"
)


class Workers(Protocol):
    """Does jobs, several at once."""

    def each(self, function: Callable[[J], R], jobs: Sequence[J]) -> Generator[R, None, None]:
        """What `function` makes of every job, as it comes. Closing it, or Ctrl-C, drops what is
        under way."""


class Here:
    """This process, one job after the other."""

    def each(self, function: Callable[[J], R], jobs: Sequence[J]) -> Generator[R, None, None]:
        yield from map(function, jobs)


class Processes:
    """Processes of this machine, each with one thread."""

    def __init__(self, count: int) -> None:
        """`count`: processes at once."""
        self._count = count

    def each(self, function: Callable[[J], R], jobs: Sequence[J]) -> Generator[R, None, None]:
        # kernels do not survive a fork
        context = multiprocessing.get_context("spawn")
        before = set(multiprocessing.active_children())
        pool = ProcessPoolExecutor(self._count, mp_context=context, initializer=_begin)
        waiting: set[Future[R]] = set()
        try:
            left = iter(jobs)
            while True:
                while len(waiting) < self._count and (job := next(left, None)) is not None:
                    waiting.add(pool.submit(function, job))
                if not waiting:
                    break
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for one in done:
                    yield one.result()
            pool.shutdown()
        except BrokenExecutor as cause:
            raise LostWorkerError(cause) from cause
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in set(multiprocessing.active_children()) - before:
                child.terminate()
            raise


class Cluster:
    """A Dask cluster; the package and the data must be where its workers find them."""

    def __init__(self, address: str, count: int) -> None:
        """Connect.

        Args:
            address: of a scheduler, or `LOCAL`.
            count: workers of a local one.

        Raises:
            ValueError: Dask is not installed, or nobody answers at the address.
        """
        try:
            import distributed
        except ImportError:
            raise ValueError(WITHOUT_DASK) from None
        self._cluster: Any = None
        if address == LOCAL:
            # kernels share buffers: one thread a process
            self._cluster = distributed.LocalCluster(
                n_workers=count, threads_per_worker=1, dashboard_address=None
            )
        try:
            self._client = distributed.Client(self._cluster or address, timeout="10s")
        except (OSError, ValueError) as cause:
            raise ValueError(
                f"compare.scheduler = {address!r}: no Dask scheduler answers there ({cause});"
                " start one with `dask scheduler` and give the address that it prints"
            ) from cause

    def each(self, function: Callable[[J], R], jobs: Sequence[J]) -> Generator[R, None, None]:
        from distributed import KilledWorker, as_completed

        # not pure: a job that was done before is not to be answered from somebody's memory
        futures = self._client.map(function, jobs, pure=False)
        try:
            for future in as_completed(futures):
                yield future.result()
                future.release()
        except KilledWorker as cause:
            raise LostWorkerError(cause) from cause
        finally:
            self._client.cancel(futures)

    def close(self) -> None:
        """Let go of the cluster; a local one ends."""
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()


@contextlib.contextmanager
def opened(scheduler: str | None, count: int) -> Iterator[Workers]:
    """Workers, let go of at the end.

    Args:
        scheduler: address of a Dask scheduler, or `LOCAL`; None: plain processes.
        count: processes of this machine; one works in this process itself.

    Raises:
        ValueError: see `Cluster`.
    """
    if scheduler is None:
        yield Here() if count == 1 else Processes(count)
        return
    cluster = Cluster(scheduler, count)
    try:
        yield cluster
    finally:
        cluster.close()


def _begin() -> None:
    """A worker leaves Ctrl-C to its parent, has one thread for all it computes, and ends with its
    parent, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["OMP_NUM_THREADS"] = "1"
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
