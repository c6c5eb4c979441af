"""Looks at a range finder: what it is, how well it is heard, which codes it sends.

    python -m hardware.scip_look 192.168.0.10

Point it at open space, at your hand, at black cloth, and see which numbers come for each: they are
what `Codes` has to say. An emulated one to try it with:

    python -m hardware.scip_look --emulate
"""

from __future__ import annotations

import argparse
import contextlib
import math
import sys
import time

import numpy as np

from hardware.scip import PORT
from hardware.scip_client import ScipClient
from hardware.scip_device import Device
from hardware.scip_emulator import Emulator
from hardware.scip_session import Session
from hardware.scip_settings import ScipSettings
from hardware.scip_sweep import FIRST_CODE
from passpmp_ti.scan import Scan


def room(begin: float) -> np.ndarray:
    """A round room of 4 m with a door that swings, and somebody's hand at the last beams."""
    ranges = np.full(1081, 4.0)
    opening = round(270 + 200 * math.sin(begin))
    ranges[opening : opening + 80] = np.inf
    ranges[-20:] = 0.01
    return ranges


def told(scan: Scan | None, client: ScipClient, rate: float) -> str:
    """One line for people."""
    counters = client.counters
    if scan is None:
        return f"nothing comes: {client.trouble or 'not opened yet'}"
    returns, lost = int(scan.returned.sum()), int(scan.lost.sum())
    nearest = scan.ranges[scan.returned].min() if returns else math.inf
    return (
        f"{rate:5.1f} scans/s; {returns} returns, the nearest at {nearest:.3f} m, {lost} lost;"
        f" codes: {codes(client.session)}; missed {counters.missed}, bad sums {counters.bad_sums},"
        f" late {counters.late}, unsure {counters.unsure}, links lost {counters.lost}"
    )


def codes(session: Session | None) -> str:
    """Which numbers of the newest sweep are no distances, and how often each came."""
    if session is None or session.sweep is None or session.parameters is None:
        return "none"
    numbers = session.sweep.distances
    found = numbers[(numbers < session.parameters.nearest) | (numbers >= FIRST_CODE)]
    each = zip(*np.unique(found, return_counts=True), strict=True)
    return ", ".join(f"{number} x {code}" for code, number in each) or "none"


def look(client: ScipClient, seconds: float) -> bool:
    """Print a line a second; returns whether any scan came."""
    known = False
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        number, newest = 0, None
        began = time.monotonic()
        while (left := began + 1.0 - time.monotonic()) > 0:
            scan = client.read(left)
            if scan is not None:
                number, newest = number + 1, scan
        session = client.session
        if newest is not None and session is not None and not known:
            print(session.version, session.parameters, session.state, sep="\n")
            known = True
        print(told(newest, client, number / (time.monotonic() - began)), flush=True)
    return client.counters.scans > 0


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Look at a range finder that speaks SCIP 2.",
        epilog="example: python -m hardware.scip_look 192.168.0.10 --seconds 10",
    )
    parser.add_argument("host", nargs="?", help="its address in numbers")
    parser.add_argument("--port", type=int, default=PORT)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--range-max", type=float, default=10.0, help="[m]")
    parser.add_argument("--emulate", action="store_true", help="look at an emulated one instead")
    given = parser.parse_args()
    if (given.host is None) != given.emulate:
        parser.error("give the address of a range finder, or --emulate")
    with contextlib.ExitStack() as stack:
        host, port = given.host, given.port
        if given.emulate:
            emulator = stack.enter_context(Emulator(lambda now: Device(room, now)))
            host, port = emulator.address
        settings = ScipSettings(host=host, port=port, range_max=given.range_max)
        return 0 if look(stack.enter_context(ScipClient(settings)), given.seconds) else 1


if __name__ == "__main__":
    sys.exit(main())
