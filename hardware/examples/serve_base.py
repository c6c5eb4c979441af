"""Serves a base to the executor: put your driver where the simulated one stands.

    python hardware/examples/serve_base.py /run/user/1000/passpmp-base/base

Its robot's file then has `base: {kind: socket, address: /run/user/1000/passpmp-base/base, ...}`.
"""

import select
import sys
from pathlib import Path

import numpy as np

from hardware.base import BaseLimits
from hardware.base_link import BaseServer
from hardware.simulated_base import BaseNature, SimulatedBase

LOOK = 0.002
"""It looks for orders this often [s]."""


def serve(address: Path) -> None:
    """Until Ctrl-C; the base then stops."""
    address.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    # your own: drive(right, left), odometry(), stop(), reset(), close() and limits, as
    # hardware.base.Base has them; no call may wait for the device
    limits = BaseLimits(wheel_speed=1.4, acceleration=1.0, command_timeout=0.25)
    base = SimulatedBase(BaseNature(limits=limits), rng=np.random.default_rng(0))
    server = BaseServer(base, address)
    print(f"serving {address}", flush=True)
    try:
        while True:
            select.select([server], [], [], LOOK)
            server.step()
    except KeyboardInterrupt:
        pass
    finally:
        server.close()


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    serve(Path(sys.argv[1]))
