"""Arrays where the kernels run: NumPy's memory on the CPU, the device's own on a GPU.

Kernels take either. On the CPU a NumPy array costs no copy, so host and device are one; elsewhere
only `host` and `put` copy, and what stays between them never leaves the device.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from passpmp_ti import backend

Array: TypeAlias = Any
"""np.ndarray on the CPU, ti.ndarray where arrays are resident on a device."""

_forced = False


def resident() -> bool:
    """Whether arrays live on a device that the host cannot read in place."""
    return _forced or backend.running() not in (None, "cpu")


@contextlib.contextmanager
def forced() -> Iterator[None]:
    """Keep arrays apart from the host even on the CPU: how a GPU's paths are tested without one."""
    global _forced
    before, _forced = _forced, True
    try:
        yield
    finally:
        _forced = before


UNKNOWN_MEMORY = 8 * 2**30
"""What is assumed where nothing tells."""
SHARE = 512
"""Indices of a parallel loop that Taichi hands to one thread of a CPU at a time."""


def share() -> int:
    """How many indices of a parallel loop one thread is handed at a time.

    On a CPU a loop over fewer indices runs on one thread. Kernels that have few but large pieces
    of work loop over `share` times as many indices and work at the multiples.
    """
    return 1 if resident() else SHARE


def empty(shape: tuple[int, ...], dtype: Any, lanes: int = 0) -> Array:
    """An array whose values are not set; of vectors of `lanes` numbers, if any."""
    if not resident():
        return np.empty((*shape, lanes) if lanes else shape, dtype=dtype)
    import taichi as ti

    kind = _taichi_type(dtype)
    return ti.ndarray(ti.types.vector(lanes, kind) if lanes else kind, shape)


def full(shape: tuple[int, ...], value: int, dtype: Any) -> Array:
    """An array that holds `value` everywhere."""
    array = empty(shape, dtype)
    array.fill(value)
    return array


def put(values: np.ndarray) -> Array:
    """`values` where the kernels read them; on the CPU the very same array."""
    if not resident() or not isinstance(values, np.ndarray):
        return values
    array = empty(values.shape, values.dtype)
    array.from_numpy(np.ascontiguousarray(values))
    return array


def host(array: Array) -> np.ndarray:
    """`array` where NumPy reads it; on the CPU the very same array."""
    return array if isinstance(array, np.ndarray) else array.to_numpy()


def memory() -> int:
    """Bytes of memory where arrays live: the machine's, or the GPU's."""
    if backend.running() == "cuda":
        driver = ctypes.CDLL("libcuda.so.1")
        total, gpu = ctypes.c_size_t(), ctypes.c_int()
        if not driver.cuDeviceGet(ctypes.byref(gpu), 0) and not driver.cuDeviceTotalMem_v2(
            ctypes.byref(total), gpu
        ):
            return total.value
    if hasattr(os, "sysconf"):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return UNKNOWN_MEMORY


def _taichi_type(dtype: Any) -> Any:
    import taichi as ti

    return {
        "uint8": ti.u8,
        "uint16": ti.u16,
        "int32": ti.i32,
        "uint32": ti.u32,
        "float32": ti.f32,
        "float64": ti.f64,
    }[np.dtype(dtype).name]
