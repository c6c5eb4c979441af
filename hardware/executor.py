"""The executor: hears planner, sensors and the stop button, and drives a base, tick by tick."""

from __future__ import annotations

import contextlib
import math
import select
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from hardware.base import Base, Odometry
from hardware.executor_settings import ExecutorSettings
from hardware.held import Held
from hardware.letterbox import MOST_AT_ONCE, Letterbox
from hardware.messages import (
    MOST_ODOMETRY,
    Ask,
    Beat,
    Message,
    MessageError,
    Offer,
    Reset,
    Stop,
    decode,
)
from hardware.sleep import Sleep, Slept, asleep
from hardware.status import State, Status
from passpmp_ti.robots import DifferentialDrive

ADDRESS = "executor"
"""Name of the socket for planner and sensors, in the executor's directory."""
BUTTON = "stop"
"""Of the emergency stop's own socket."""
LATCH = "stopped"
"""Of the file that is there from an emergency stop to its reset: the next executor stops too."""
RESET_WITHIN = 1.0
"""[s]; who let the button go longer ago was told that it did not help, and may have gone."""


class Tick(NamedTuple):
    """What one tick did."""

    time: float
    state: float
    reason: float
    right: float
    left: float
    """What the base was told [m/s]."""
    error: float
    rests_from: float
    """When what is held ends [s]."""
    taken: float


class Executor:
    """Holds, follows, brakes. One thread; nothing in it waits but for the next tick."""

    def __init__(
        self,
        base: Base,
        robot: DifferentialDrive,
        settings: ExecutorSettings,
        directory: Path,
        *,
        clock: Callable[[], float] = time.monotonic,
        log: Callable[[Tick], None] | None = None,
        slept: Callable[[], Slept] = asleep,
    ) -> None:
        """
        Args:
            base: what is driven.
            robot: as it is planned for.
            settings: how it is driven.
            directory: of the sockets; who may enter it may drive the robot.
            clock: seconds that never go back, the same for all processes.
            log: told of every tick.
            slept: tells for how long the machine has slept.

        Raises:
            ValueError: the base cannot do what is planned for the robot, or the directory's name
                is too long.
        """
        self.held = Held(robot, base.limits, settings, clock())
        self.garbled = 0
        """Messages that could not be read."""
        self.overruns = 0
        """Ticks more than a period late."""
        self._base = base
        self._settings = settings
        self._clock = clock
        self._log = log
        self._sleep = Sleep(slept)
        self._recent: deque[Odometry] = deque(maxlen=MOST_ODOMETRY)
        self._button = Letterbox(directory / BUTTON)
        self._box = Letterbox(directory / ADDRESS)
        self._latch = directory / LATCH
        self._stopping = False
        self._sent = 0
        if self._latch.exists():
            self.held.stop()

    @property
    def rests(self) -> bool:
        """Whether the robot stands, as far as is known, and nothing that is held moves it."""
        return self.held.order[:2] == (0.0, 0.0) and self.held.state not in (
            State.FOLLOWING,
            State.CARRYING_ON,
        )

    def run(self, leave: Callable[[], bool]) -> None:
        """Tick on, until `leave` says so; then take nothing new, come to rest, and return."""
        due = self._clock()
        while True:
            leaving = leave()
            if leaving and self.rests:
                return
            listening = [self._button] if leaving else [self._button, self._box]
            select.select(listening, [], [], max(due - self._clock(), 0.0))
            pressed = self.hear_button()
            if not leaving:
                self.hear(due)
            now = self._clock()
            if now < due and not pressed:
                continue
            self.tick()
            if now < due:
                continue  # one for the button is besides the others: however often it is pressed
            self.overruns += now > due + self._settings.period
            # a tick that was missed is not made up for
            due = max(due + self._settings.period, now)

    def hear_button(self) -> bool:
        """Whether the emergency stop was pressed, or let go, since."""
        heard = False
        for data, sender in self._button.collect():
            message = self._read(data)
            if message is None:
                continue
            if isinstance(message.body, Stop):
                heard |= self.held.state is not State.EMERGENCY
                self.held.stop()
            elif isinstance(message.body, Reset) and self._fresh(message):
                heard |= self.held.reset()
            self._answer(sender, message)
        if heard:
            self._remember()
        return heard

    def hear(self, until: float = math.inf) -> None:
        """Hear planner and sensors, one at least, until the next tick is due: what came with others
        waits for it, or the wheels would wait for the talk.

        Args:
            until: when the next tick is due [s].
        """
        self._look_up()
        for _ in range(MOST_AT_ONCE):
            letters = self._box.collect(1)
            if not letters:
                return
            self._heed(*letters[0])
            if self._clock() >= until:
                return

    def tick(self) -> None:
        """Look at the base, decide, and tell it."""
        self._look_up()
        odometry, now = self._base.odometry(), self._clock()
        if odometry is not None and (not self._recent or odometry is not self._recent[-1]):
            self._recent.append(odometry)
        order = self.held.step(now, odometry)
        if order.stop:
            self._base.stop()
        elif self._stopping:
            self._base.reset()
        self._stopping = order.stop
        self._base.drive(order.right, order.left)
        if self._log is not None:
            held = self.held
            self._log(
                Tick(
                    now, held.state, held.reason, order.right, order.left, held.error,
                    held.last[1], held.taken,
                )
            )  # fmt: skip

    def status(self) -> Status:
        """As it is now."""
        held = self.held
        place, rests_from = held.last
        return Status(
            stamp=self._clock(), state=held.state, reason=held.reason, held=held.held,
            newest=held.newest, rests=(place.x, place.y, place.theta), rests_from=rests_from,
            judged=held.judged, verdict=held.verdict, error=held.error,
            worst_error=held.worst_error, right=held.order.right, left=held.order.left,
            taken=held.taken, refused=held.refused, garbled=self.garbled,
            overruns=self.overruns, odometry=tuple(self._recent),
        )  # fmt: skip

    def close(self) -> None:
        """The base stops."""
        self._base.close()
        self._button.close()
        self._box.close()

    def _look_up(self) -> None:
        """Was the machine asleep? To be asked before anything is taken or followed."""
        if self._sleep.woke():
            self.held.slept(self._clock())

    def _heed(self, data: bytes, sender: str) -> None:
        message = self._read(data)
        if message is None:
            return
        body, now = message.body, self._clock()
        if isinstance(body, Offer):
            name = (message.session, message.sequence)
            self.held.offer(body.trajectory, name, message.sent_at, now)
        elif isinstance(body, Beat):
            self.held.hear(body.source, body.of, now, message.session)
        elif not isinstance(body, Ask):
            return
        self._answer(sender, message)

    def _remember(self) -> None:
        """Whether it was told to stop for good, for the executor after this one. The robot stops
        whether or not that can be written."""
        with contextlib.suppress(OSError):
            if self.held.state is State.EMERGENCY:
                self._latch.touch()
            else:
                self._latch.unlink(missing_ok=True)

    def _fresh(self, message: Message) -> bool:
        return abs(self._clock() - message.sent_at) <= RESET_WITHIN

    def _read(self, data: bytes) -> Message | None:
        try:
            return decode(data)
        except MessageError:
            self.garbled += 1
            return None

    def _answer(self, sender: str, message: Message) -> None:
        if sender:
            self._sent += 1
            told = Message(message.session, self._sent, self._clock(), self.status())
            self._box.post(sender, told.encode())
