"""The emergency stop's own way to the executor.

python -m hardware.stop_button DIRECTORY            # stop
python -m hardware.stop_button DIRECTORY --reset    # let it drive again, once it stands
"""

from __future__ import annotations

import argparse
import contextlib
import os
import select
import sys
import time
from pathlib import Path

from hardware.executor import BUTTON, LATCH
from hardware.executor_process import busy
from hardware.letterbox import Letterbox
from hardware.messages import Message, MessageError, Reset, Stop, decode
from hardware.status import State, Status

PATIENCE = 1.0
"""[s] to wait for the executor to say that it heard."""
AGAIN = 0.05
"""[s] after which it is told once more."""


class StopButton:
    """Presses and lets go; hears whether that was understood."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._to, self._latch = directory / BUTTON, directory / LATCH
        self._session = time.monotonic_ns()
        self._box = Letterbox(directory / f"button-{os.getpid()}-{self._session:x}")
        self._sent = 0

    def __enter__(self) -> StopButton:
        return self

    def __exit__(self, *_: object) -> None:
        self._box.close()

    def press(self) -> bool:
        """Stop for good. Whether the executor says that it does; where none does, the next one that
        works here finds that it was pressed."""
        state = self._say(Stop())
        if state is not State.EMERGENCY:
            with contextlib.suppress(OSError):
                self._latch.touch()
        return state is State.EMERGENCY

    def release(self) -> bool:
        """Let it drive again. Whether the executor says that it may; not while it moves. Where
        none works, nothing drives, and the next one finds that it was let go."""
        state = self._say(Reset())
        if state is None and not busy(self._directory):
            self._latch.unlink(missing_ok=True)
            return True
        return state is not None and state is not State.EMERGENCY

    def _say(self, body: Stop | Reset) -> State | None:
        began = time.monotonic()
        until, state, arrived = began + PATIENCE, None, False
        while state is None and time.monotonic() < until:
            # a box that is full, or not there yet, loses what is sent. Two resets could let go
            # what somebody pressed between them.
            if not arrived or isinstance(body, Stop):
                self._sent += 1
                message = Message(self._session, self._sent, time.monotonic(), body)
                arrived = self._box.post(self._to, message.encode())
            select.select([self._box], [], [], AGAIN)
            for data, _ in self._box.collect():
                try:
                    heard = decode(data)
                except MessageError:
                    continue
                if not isinstance(heard.body, Status) or heard.session != self._session:
                    continue
                if heard.body.stamp >= began:  # not what was answered to an earlier one
                    state = heard.body.state
        return state


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Stop a robot for good, or let it drive again.",
        epilog="example: python -m hardware.stop_button /run/passpmp",
    )
    parser.add_argument("directory", type=Path, help="of the executor's sockets")
    parser.add_argument("--reset", action="store_true", help="let it drive again")
    given = parser.parse_args()
    if not given.directory.is_dir():
        print(
            f"stop_button DIRECTORY = {given.directory}: no such folder; give that of the"
            " executor's sockets, as passpmp doctor names it",
            file=sys.stderr,
        )
        return 2
    with StopButton(given.directory) as button:
        done = button.release() if given.reset else button.press()
    print(("drives again" if given.reset else "stops") if done else "the executor did not obey")
    return 0 if done else 1


if __name__ == "__main__":
    sys.exit(main())
