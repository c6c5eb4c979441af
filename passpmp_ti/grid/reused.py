"""Memory that goes from cycle to cycle: fresh pages are slow to come by."""

from __future__ import annotations

import queue
import weakref

import numpy as np

from passpmp_ti import device

SPARE = 4
"""Blocks that are kept for whoever asks next."""


class Reused:
    """Hands out single-precision arrays, and takes back their memory when nobody holds them any
    more. A slice of such an array does not keep it: do not take one."""

    def __init__(self) -> None:
        # collectors run anywhere, in `floats` too: only what is re-entrant may be touched there
        self._back: queue.SimpleQueue[np.ndarray] = queue.SimpleQueue()

    def floats(self, count: int) -> device.Array:
        """[count] float32, not set."""
        if device.resident():
            return device.empty((count,), np.float32)
        block = None
        for spare in self._taken()[:SPARE]:
            if block is None and len(spare) >= count:
                block = spare
            else:
                self._back.put(spare)
        if block is None:
            block = np.empty(count + count // 4, np.float32)
        array = block[:count]
        weakref.finalize(array, self._back.put, block).atexit = False
        return array

    def _taken(self) -> list[np.ndarray]:
        """All blocks that came back, the smallest first."""
        blocks = []
        try:
            while True:
                blocks.append(self._back.get_nowait())
        except queue.Empty:
            return sorted(blocks, key=len)
