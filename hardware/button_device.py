"""A button on this machine, any key of which stops the robot for good.

    python -m hardware.button_device '{"directory": "/run/passpmp", "device": "/dev/input/..."}'

A process of its own: neither planner nor kernels hold it up. It outlives a planner that dies, for
as long as the executor carries on to rest. A device that is gone stops the robot too: a button that
was pulled out can stop nobody.
"""

from __future__ import annotations

import json
import os
import select
import struct
import sys
from pathlib import Path

from hardware.executor_process import busy
from hardware.stop_button import StopButton

EVENT = struct.Struct("@llHHi")
"""An input event of Linux: seconds, microseconds, type, code, value."""
KEY, DOWN = 1, 1
LOOK = 0.2
"""[s] between two looks at whether anybody needs the button still."""
READY = b"ready\n"


def pressed(data: bytes) -> bool:
    """Whether any key went down in some events; a piece that is no event counts as one."""
    whole = len(data) // EVENT.size * EVENT.size
    events = EVENT.iter_unpack(data[:whole])
    return whole < len(data) or any(
        kind == KEY and value == DOWN for _, _, kind, _, value in events
    )


def run(directory: Path, device: Path, parent: int) -> None:
    """Watch the device until whoever started this process is gone, and the executor is.

    Raises:
        OSError: it cannot be read at all.
    """
    source = os.open(device, os.O_RDONLY | os.O_NONBLOCK)
    os.write(sys.stdout.fileno(), READY)
    with StopButton(directory) as button:
        while os.getppid() == parent or busy(directory):
            if not select.select([source], [], [], LOOK)[0]:
                continue
            try:
                data = os.read(source, 64 * EVENT.size)
            except OSError:
                data = b""
            if not data:  # gone
                button.press()
                return
            if pressed(data):
                button.press()


def main() -> int:
    if len(sys.argv) not in (2, 3):
        print("example: python -m hardware.button_device CONFIGURATION", file=sys.stderr)
        return 2
    given = json.loads(sys.argv[1])
    parent = int(sys.argv[2]) if len(sys.argv) == 3 else os.getppid()
    try:
        run(Path(given["directory"]), Path(given["device"]), parent)
    except OSError as cause:
        print(f"the stop button: {cause}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
