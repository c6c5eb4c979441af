"""What a planner's process did, cycle by cycle, as a file that others read while it grows."""

from __future__ import annotations

import os
import pickle
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hardware.chain import Sent
from hardware.scip_receiver import Counters
from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.scan import Scan

LENGTH = struct.Struct("<I")
"""Stands before each cycle: its bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """One cycle, as a judge and a picture need it; times on the monotonic clock [s]."""

    at: float
    """When it ended."""
    record: CycleRecord | None
    """Without the model, the tree and the plan. None: there was nothing to plan from."""
    took: float | None
    """From the scans' arrival to the answer, sent [s]."""
    sent: Sent | None
    goals_reached: int
    """So many of the goals that this planner was given."""
    plan: np.ndarray
    """[n, 2] float32, where what is held leads [m]."""
    seen: np.ndarray
    """[n, 2] float32, some of the returns [m]."""
    worst_error: float
    """Farthest off its path since the executor began, as that measured it [m]."""
    lidars: tuple[Counters, ...]
    scans: tuple[Scan, ...] = ()
    """What was planned on, where the planner was told to keep it."""
    state: np.ndarray | None = None
    """[5] the robot's then, as told, with the scans."""


class CycleWriter:
    """Appends cycles. A process that is killed loses the one that it was about to write."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)

    def add(self, cycle: Cycle) -> None:
        """Write one."""
        data = pickle.dumps(cycle, protocol=pickle.HIGHEST_PROTOCOL)
        os.write(self._file, LENGTH.pack(len(data)) + data)

    def close(self) -> None:
        """Nothing more is written."""
        os.close(self._file)


class CycleReader:
    """Reads what is new. Only files of one's own: pickles can do anything."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._read = 0

    def new(self) -> list[Cycle]:
        """The cycles since the last call, whole ones only."""
        if not self._path.exists():
            return []
        with self._path.open("rb") as file:
            file.seek(self._read)
            data = file.read()
        found, at = [], 0
        while at + LENGTH.size <= len(data):
            (length,) = LENGTH.unpack_from(data, at)
            end = at + LENGTH.size + length
            if end > len(data):
                break
            found.append(pickle.loads(data[at + LENGTH.size : end]))
            at = end
        self._read += at
        return found
