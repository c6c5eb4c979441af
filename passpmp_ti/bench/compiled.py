"""The loops of reference.py compiled by Numba; import it only where Numba is installed."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from passpmp_ti.bench.reference import CAR, STEERING
from passpmp_ti.bench.states import States

F = np.float32
PULL, RATE, XI_MAX = F(CAR.acceleration), F(CAR.xi_rate), F(CAR.xi_max)
V_MAX, V_REVERSE, PER_WAY = F(CAR.v_max), F(CAR.v_reverse), F(0.5 / CAR.wheelbase)
STEER = np.array(STEERING, dtype=np.float32)
HALF, ZERO = F(0.5), F(0.0)

jit: Any = numba.njit(cache=False, fastmath=False, inline="always")
parallel: Any = numba.njit(parallel=True, cache=False, fastmath=False)


@jit
def _blocked(arrival, scale, x, y, t):
    size = arrival.shape[0]
    i = math.floor(x * scale) + size // 2
    j = math.floor(y * scale) + size // 2
    if i < 0 or j < 0 or i >= size or j >= size:
        return True
    return t * F(1000) >= arrival[j, i]


@jit
def _moved(x, y, theta, v, xi, t, speed, steering, step):
    way = (v + speed) * (HALF * step)
    middle = min(max(xi + steering * (HALF * step), -XI_MAX), XI_MAX)
    turn = way * math.tan(middle) * PER_WAY
    return (
        x + way * math.cos(theta + turn),
        y + way * math.sin(theta + turn),
        theta + turn + turn,
        speed,
        min(max(xi + steering * step, -XI_MAX), XI_MAX),
        t + step,
    )


@jit
def _safe(arrival, scale, x0, y0, theta0, v0, xi0, t0, step):
    for k in range(3):
        x, y, theta, v, xi, t = x0, y0, theta0, v0, xi0, t0
        clear = not _blocked(arrival, scale, x, y, t)
        while clear and v != ZERO:
            speed = max(abs(v) - PULL * step, ZERO)
            if v < ZERO:
                speed = -speed
            x, y, theta, v, xi, t = _moved(x, y, theta, v, xi, t, speed, STEER[k], step)
            clear = not _blocked(arrival, scale, x, y, t)
        if clear:
            return True
    return False


@parallel
def _check(arrival, scale, x, y, theta, v, xi, t, step, safe):
    for n in numba.prange(len(x)):
        safe[n] = _safe(arrival, scale, x[n], y[n], theta[n], v[n], xi[n], t[n], step)


@parallel
def _children(arrival, scale, parents, controls, steps, step, ends, safe):
    fan = len(controls)
    for m in numba.prange(len(safe)):
        p, k = m // fan, m % fan
        x, y, theta = parents[p, 0], parents[p, 1], parents[p, 2]
        v, xi, t = parents[p, 3], parents[p, 4], parents[p, 5]
        clear = True
        done = 0
        while clear and done < steps:
            speed = min(max(v + controls[k, 0] * step, -V_REVERSE), V_MAX)
            x, y, theta, v, xi, t = _moved(x, y, theta, v, xi, t, speed, controls[k, 1], step)
            clear = not _blocked(arrival, scale, x, y, t)
            done += 1
        safe[m] = clear and _safe(arrival, scale, x, y, theta, v, xi, t, step)
        ends[m, 0], ends[m, 1], ends[m, 2] = x, y, theta
        ends[m, 3], ends[m, 4], ends[m, 5] = v, xi, t


def set_threads(count: int | None) -> None:
    """Let the loops use `count` threads; None: all."""
    # named at run time: a type checker that sees Numba does not see this
    most = vars(numba.config)["NUMBA_NUM_THREADS"]
    numba.set_num_threads(min(count or most, most))


def passively_safe(arrival: np.ndarray, cell: float, states: States, step: float) -> np.ndarray:
    """`reference.passively_safe`."""
    safe = np.empty(len(states), dtype=np.uint8)
    _check(arrival, F(1 / cell), *states.columns, F(step), safe)
    return safe


def children(
    arrival: np.ndarray, cell: float, parents: np.ndarray, controls: np.ndarray,
    steps: int, step: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """`reference.children`."""
    count = len(parents) * len(controls)
    ends = np.empty((count, 6), dtype=np.float32)
    safe = np.empty(count, dtype=bool)
    _children(arrival, F(1 / cell), parents, controls, steps, F(step), ends, safe)
    return ends, safe
