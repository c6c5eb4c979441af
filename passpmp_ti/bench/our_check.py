"""The one place where the benchmarks call the check kernel with a map of their own making."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from passpmp_ti import device
from passpmp_ti.grid.body import Body
from passpmp_ti.grid.spans import spans_of
from passpmp_ti.kernels.check import check_states
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings


def our_check(
    arrival_ticks: np.ndarray,
    corner: tuple[int, int],
    robot: Robot,
    settings: Settings,
    poses: np.ndarray,
    ticks: np.ndarray,
) -> tuple[Callable[[], object], Callable[[], np.ndarray]]:
    """The call to be timed, and what it found.

    Args:
        arrival_ticks: [J, I] uint16 [ms].
        corner: (i0, j0), cell [0, 0] counted from the origin of the poses.
        robot: that brakes.
        settings: cell, time step and object speed of the check.
        poses: [n, 7] float32.
        ticks: [n] int32.

    Returns:
        The call, which a GPU may still be at when it returns; and the one that brings [n] bool,
        safe.
    """
    body = Body.of(robot, settings)
    size = len(arrival_ticks)
    arrival, counts = device.put(arrival_ticks), device.put(body.placed(corner, size))
    arguments = [
        arrival, spans_of(arrival, counts, size), device.put(body.numbers), counts,
        device.put(body.braking), device.put(np.ascontiguousarray(poses)), device.put(ticks),
        device.empty((len(poses),), np.int32),
    ]  # fmt: skip

    def call() -> None:
        check_states(body.kind, *arguments)

    return call, lambda: device.host(arguments[-1]) > 0
