"""Memory that goes from cycle to cycle: fresh pages are slow to come by."""

from __future__ import annotations

import threading
import weakref

import numpy as np

from passpmp_ti import device

SPARE = 4
"""Blocks that are kept for whoever asks next."""


class Reused:
    """Hands out single-precision arrays, and takes back their memory when nobody holds them any
    more."""

    def __init__(self) -> None:
        self._free: list[np.ndarray] = []
        self._lock = threading.Lock()

    def floats(self, count: int) -> device.Array:
        """[count] float32, not set."""
        if device.resident():
            return device.empty((count,), np.float32)
        with self._lock:
            fits = [n for n, block in enumerate(self._free) if len(block) >= count]
            block = self._free.pop(fits[0]) if fits else np.empty(count + count // 4, np.float32)
        array = block[:count]
        weakref.finalize(array, self._take_back, block).atexit = False
        return array

    def _take_back(self, block: np.ndarray) -> None:
        with self._lock:
            self._free = sorted([*self._free, block], key=len)[-SPARE:]
