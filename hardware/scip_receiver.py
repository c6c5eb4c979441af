"""Turns a device's sweeps into scans whose stamps can be relied on."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hardware.scip_clock import MILLISECOND, DeviceClock
from hardware.scip_commands import Measure
from hardware.scip_settings import ScipSettings
from hardware.scip_sweep import Parameters, Sweep, ranges_of
from passpmp_ti.scan import Scan

UNEVEN = 0.01
"""Relative error of a device's speed of turning: a UST was seen to turn 0.2 % slower than told."""

Pose = tuple[float, float, float]


@dataclass(slots=True)
class Counters:
    """What happened since the client was made."""

    connections: int = 0
    """Links over which sweeps came."""
    lost: int = 0
    """Links that were lost or given up, attempts to connect included."""
    sweeps: int = 0
    """Whole sweeps that came."""
    scans: int = 0
    """Those handed out."""
    bad_sums: int = 0
    garbled: int = 0
    """Replies that could not be read, but for their check sums."""
    strays: int = 0
    """Replies that nothing had asked for."""
    missed: int = 0
    """Sweeps that never came, by the time stamps of those that did."""
    repeated: int = 0
    """Sweeps that are no newer than the one before; not handed out."""
    frozen: int = 0
    """Sweeps that tell the same distances as those before; not handed out."""
    unstable: int = 0
    """Sweeps that the device itself called so; it sends none."""
    unsure: int = 0
    """Sweeps that could not be promised their stamp error, or of which it is not known from where;
    not handed out."""
    late: int = 0
    """Scans that were handed out, but had come late."""
    passed: int = 0
    """Scans that a newer one came after before they were read."""


class Receiver:
    """Takes sweep after sweep of one connection.

    A scan's stamp is the latest moment at which its last beam can have been measured. No beam was
    measured earlier than `ScipSettings.stamp_error` before it: sweeps of which that is not proven
    are not handed out.
    """

    def __init__(
        self,
        settings: ScipSettings,
        parameters: Parameters,
        command: Measure,
        clock: DeviceClock,
        counters: Counters,
        pose_at: Callable[[float], Pose] | None,
    ) -> None:
        """
        Args:
            settings: of the device.
            parameters: of the device.
            command: that is answered with these sweeps.
            clock: of the device; is told when sweeps came.
            counters: are counted on.
            pose_at: the sensor's pose in the world at a time, NaN where it is not known: such
                scans are not handed out; None: (0, 0, 0).
        """
        self.doubts = False
        """Whether a sweep could not be promised its stamp error, since `clocks_compared`."""
        self.newest_at = -math.inf
        """When a sweep that was newer than all before came [s]."""
        self._settings = settings
        self._parameters = parameters
        self._command = command
        self._clock = clock
        self._counters = counters
        self._pose_at = pose_at
        self._last: int | None = None  # stamp of the newest sweep [ms], turns counted
        self._stamp = -math.inf  # of the newest scan [s]
        self._seen = np.empty(0, dtype=np.int64)  # the newest distances
        self._same_in_row = 0

    def clocks_compared(self) -> None:
        """The device was asked for its clock, so what went by meanwhile was not missed."""
        self.doubts = False
        self._last = None

    def take(self, sweep: Sweep, at: float) -> Scan | None:
        """The scan of a sweep, or None where it must not be used.

        Args:
            sweep: whole.
            at: when it was there [s].

        Raises:
            ClockJumped: its stamp cannot be.
        """
        counters, command, parameters = self._counters, self._command, self._parameters
        counters.sweeps += 1
        first, last = parameters.after(command.start), parameters.after(command.end)
        self._clock.arrived(sweep.stamp, last * (1 - UNEVEN), at)
        stamp = self._clock.turned(sweep.stamp)
        if self._last is not None:
            if stamp <= self._last:
                counters.repeated += 1
                return None
            period = parameters.period * (command.skip + 1)
            counters.missed += max(0, round((stamp - self._last) * MILLISECOND / period) - 1)
        self._last = stamp
        self.newest_at = at
        if self._is_frozen(sweep):
            counters.frozen += 1
            return None
        begin, end = self._clock.instants(
            sweep.stamp, first * (1 - UNEVEN), last * (1 + UNEVEN), at
        )
        if end - begin > self._settings.stamp_error or end <= self._stamp:
            counters.unsure += 1
            self.doubts = True
            return None
        scan = self._scan(sweep, begin, end)
        if scan is None:
            counters.unsure += 1
            return None
        self._stamp = end
        counters.scans += 1
        counters.late += int(at - end > self._settings.late)
        return scan

    def _is_frozen(self, sweep: Sweep) -> bool:
        same = np.array_equal(sweep.distances, self._seen)
        self._same_in_row = self._same_in_row + 1 if same else 0
        self._seen = sweep.distances
        most = self._settings.frozen_after
        return most > 0 and self._same_in_row >= most

    def _scan(self, sweep: Sweep, begin: float, end: float) -> Scan | None:
        """None where it is not known from where."""
        settings, command, parameters = self._settings, self._command, self._parameters
        ranges = ranges_of(sweep.distances, parameters, settings.codes, settings.range_max)
        # a value stands for the middle of the steps that share it
        middle = 0.5 * (command.cluster - 1)
        low = parameters.angle(command.start + middle)
        high = parameters.angle(command.end - middle)
        if settings.upside_down:
            ranges, low = ranges[::-1], -high
        # halfway through the sweep it is off by the least
        pose = (0.0, 0.0, 0.0) if self._pose_at is None else self._pose_at(0.5 * (begin + end))
        if not all(map(math.isfinite, pose)):
            return None
        return Scan(
            ranges,
            angle_min=low,
            angle_increment=parameters.angle(command.cluster) - parameters.angle(0),
            range_max=settings.range_max,
            pose=pose,
            stamp=end,
        )
