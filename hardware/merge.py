"""Scans of several range finders that turn at their own pace, joined into scans of one instant.

The planner takes several scans of one instant, stamped alike. Free-running range finders have none.
Of each the newest scan is taken if all of these lie within `apart` of each other, and all are
given the newest one's stamp. So a scan may be older than its stamp by `apart` more than before,
which the planner's `Settings.stamp_error` has to hold. Half the longest period always finds a
partner for two. Poses stay those at which each was measured.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from hardware.scip_client import ScipClient, wait
from hardware.scip_settings import ScipSettings
from passpmp_ti import door
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings


class Pairing:
    """Takes scans stream by stream and gives those of one instant; each scan is used once."""

    def __init__(self, streams: int, *, apart: float) -> None:
        """
        Args:
            streams: how many range finders there are.
            apart: greatest difference of stamps within what is given [s].
        """
        door.whole("Pairing", "streams", streams, least=1)
        self._waiting: list[Scan | None] = [None] * streams
        self.apart = door.finite("Pairing", "apart", apart, least=0.0, unit="s")
        self.alone = 0
        """Scans that found no partner."""

    def add(self, stream: int, scan: Scan) -> tuple[Scan, ...] | None:
        """What the scan completes: one scan of each stream, in their order; or None.

        Args:
            stream: which range finder it is of, from 0.
            scan: newer than those of this stream before.
        """
        door.whole("Pairing.add", "stream", stream, least=0, most=len(self._waiting) - 1)
        self.alone += self._waiting[stream] is not None
        self._waiting[stream] = scan
        together = [s for s in self._waiting if s is not None]
        newest = max(s.stamp for s in together)
        if len(together) < len(self._waiting) or any(
            newest - s.stamp > self.apart for s in together
        ):
            return None
        self._waiting = [None] * len(self._waiting)
        return tuple(replace(s, stamp=newest) for s in together)


def read_together(
    clients: Sequence[ScipClient],
    pairing: Pairing,
    timeout: float,
    clock: Callable[[], float] = time.monotonic,
) -> tuple[Scan, ...] | None:
    """Scans of one instant, one of each client; None where none came within `timeout` [s].

    Args:
        clients: one for each stream of the pairing, on one clock.
        pairing: keeps what waits for a partner.
        timeout: [s].
        clock: tells when the time is over.
    """
    until = clock() + timeout
    while True:
        for stream, client in enumerate(clients):
            scan = client.read(0.0)
            found = None if scan is None else pairing.add(stream, scan)
            if found is not None:
                return found
        left = until - clock()
        if left <= 0:
            return None
        wait(clients, left)


def needed_stamp_error(scanners: Sequence[ScipSettings], apart: float = 0.0) -> float:
    """What the planner's `Settings.stamp_error` must be at least [s].

    Args:
        scanners: every range finder.
        apart: of their `Pairing`; 0 for a single one.
    """
    return max(s.stamp_error for s in scanners) + apart


def check_stamp_error(
    settings: Settings, scanners: Sequence[ScipSettings], apart: float = 0.0
) -> None:
    """Refuse settings of a planner that promise more than its range finders do.

    Raises:
        ValueError: `stamp_error` is too small, or somebody could cross the seam between what was
            measured first and what was measured last, whole, while nobody looked.
    """
    needed = needed_stamp_error(scanners, apart)
    if settings.stamp_error < needed - 1e-9:
        raise ValueError(
            f"Settings.stamp_error must be >= {needed:g} s, which is how old a beam may be that"
            f" these range finders tell, {apart:g} s of it by their pairing; got"
            f" {settings.stamp_error:g}"
        )
    if settings.object_speed * needed >= settings.object_width:
        raise ValueError(
            f"Settings.object_speed = {settings.object_speed:g} m/s: in {needed:g} s, from the"
            f" first beam to the last, an object could move by its own width of"
            f" {settings.object_width:g} m and be met by none; it must stay below"
            f" {settings.object_width / needed:g} m/s, or the range finders be synchronised"
        )
