"""A robot that hears cmd_vel and tells odometry, as the executor's base, in a process of its own.

The robot's driver has a watchdog; this process has one too, for drivers that have none, and the
emergency stop comes in here, where no kernel holds Python's lock.
"""

from __future__ import annotations

import math
import select
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from hardware.base import BaseLimits, Odometry, twist_of
from hardware.base_link import BaseServer
from hardware.executor_process import check_private
from hardware.priority import put_forward
from hardware.ros_clock import RosClock
from hardware.ros_frames import Frames, compose
from hardware.ros_messages import Pose, Tree, Untrusted, motion_of, stop_of, transforms_of, twist
from hardware.ros_port import BOOL, ODOMETRY, TRANSFORMS, TWIST, Port
from hardware.ros_settings import RosSettings
from hardware.stop_button import StopButton

LOOK = 0.002
"""It looks for commands this often [s]."""
REPEAT = 0.05
"""Rest is told again after this [s]: a message may be lost, and a robot that rolls is none that
was told once."""
AGAIN = 0.2
"""After this an executor is asked again that did not obey [s]."""
PRIORITY = 8
"""Of SCHED_FIFO, where it is granted: just below the executor's."""
LINGER = 10.0
"""It ends when nobody drives it any more, or after this [s]."""
SOCKET = "base"
"""Name of its socket in the executor's directory."""


class RosBase:
    """A `Base` that says cmd_vel. Odometry comes from another thread than all else."""

    def __init__(
        self,
        limits: BaseLimits,
        say: Callable[[Tree], None],
        say_stop: Callable[[Tree], None],
        *,
        times: RosClock,
        child: str,
        place: Callable[[str, Pose], Pose] = lambda frame, pose: pose,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """
        Args:
            limits: of the robot.
            say: publishes cmd_vel, a geometry_msgs/Twist.
            say_stop: publishes whether the executor's stop is on, a latched std_msgs/Bool.
            times: for the odometry's stamps.
            child: the odometry's child frame; what moves another frame is not believed.
            place: puts a pose in the odometry's frame into the one that is planned in.
            clock: seconds that never go back.
        """
        self._limits = limits
        self._say, self._say_stop = say, say_stop
        self._times, self._child, self._clock = times, child, clock
        self._place = place
        self._told: Odometry | None = None
        self._told_at = -math.inf
        self._said_at = -math.inf
        self._stopped = False
        self._pressed = False
        self.refused: Counter[str] = Counter()
        """Odometry that was not believed, by reason."""
        say_stop({"data": False})

    @property
    def limits(self) -> BaseLimits:
        return self._limits

    def drive(self, right: float, left: float) -> None:
        if not (math.isfinite(right) and math.isfinite(left)):
            return
        self._told_at = self._clock()
        if self._stopped or self._pressed:
            self.watch()
            return
        most = self._limits.wheel_speed
        right, left = (max(-most, min(most, v)) for v in (right, left))
        self._tell(right, left)

    @property
    def driven(self) -> bool:
        """Whether somebody drives it now."""
        return self._clock() - self._told_at <= self._limits.command_timeout

    def odometry(self) -> Odometry | None:
        return self._told

    def stop(self) -> None:
        if not self._stopped:
            self._stopped = True
            self._say_stop({"data": True})
        self._tell(0.0, 0.0)

    def reset(self) -> None:
        self._told_at = -math.inf  # rest, until it is told to drive again
        if self._stopped:
            self._stopped = False
            self._say_stop({"data": False})

    def close(self) -> None:
        self.stop()

    def press(self, *, pressed: bool) -> None:
        """Obey nobody while a button that is not the executor's is pressed."""
        self._pressed = pressed
        self.watch()

    def watch(self) -> None:
        """Tell the robot to rest whenever nobody may drive it; to be called often."""
        now = self._clock()
        if (not self.driven or self._stopped or self._pressed) and now - self._said_at >= REPEAT:
            self._tell(0.0, 0.0)

    def hear(self, message: Any) -> None:
        """Take in a nav_msgs/Odometry; what is not to be believed is as if it had not come."""
        try:
            motion = motion_of(message)
            if motion.child.lstrip("/") != self._child:
                raise Untrusted(f"odometry of a frame that is not {self._child}")
            stamp = self._times.ours(motion.stamp)
            pose = self._place(motion.frame, motion.pose)
        except Untrusted as why:
            self.refused[str(why)] += 1
            return
        if self._told is not None and stamp <= self._told.stamp:
            return
        self._told = replace(motion, pose=pose).odometry(stamp, self._limits.track)

    def _tell(self, right: float, left: float) -> None:
        self._said_at = self._clock()
        self._say(twist(*twist_of(right, left, self._limits.track)))


class ButtonKeeper:
    """Sees that the executor obeys the emergency stop's topic, however long that takes.

    True stops. False lets go, if it was this that stopped: one that lay about before must not undo
    what somebody pressed elsewhere.
    """

    def __init__(self, directory: Path, press: Callable[[bool], None]) -> None:
        """
        Args:
            directory: of the executor's sockets.
            press: presses the base's own button, or lets it go; at once.
        """
        self._directory, self._press = directory, press
        self._wanted: bool | None = None
        self._news = threading.Condition()
        self._done: bool | None = None  # what the executor obeyed last
        self._closed = False
        self._thread = threading.Thread(target=self._keep, daemon=True)
        self._thread.start()

    def hear(self, message: Any) -> None:
        """Take in a std_msgs/Bool."""
        pressed = stop_of(message)
        with self._news:
            if not pressed and self._wanted is None:
                return
            if pressed:
                self._press(True)
            self._wanted = pressed
            self._news.notify()

    def close(self) -> None:
        """It hears no more."""
        with self._news:
            self._closed = True
            self._news.notify()
        self._thread.join()

    def _keep(self) -> None:
        while self._due():
            wanted = self._wanted
            with StopButton(self._directory) as button:
                obeyed = button.press() if wanted else button.release()
            with self._news:
                if obeyed and wanted is self._wanted:
                    self._done = wanted
                    if not wanted:
                        self._press(False)
                elif not self._closed:
                    # no executor is there, or the robot still rolls
                    self._news.wait(AGAIN)

    def _due(self) -> bool:
        """Wait for something to be done; False: it is over."""
        with self._news:
            self._news.wait_for(lambda: self._closed or self._wanted is not self._done)
            return not self._closed


def placer(frames: Frames, planned: str) -> Callable[[str, Pose], Pose]:
    """What puts a pose in the odometry's frame into the one that is planned in, as tf joins them.

    Args:
        frames: as tf tells of them.
        planned: name of that frame; empty: the odometry's own.
    """

    def place(frame: str, pose: Pose) -> Pose:
        origin = frames.pose(planned or frame, frame)
        if origin is None:
            raise Untrusted(f"tf does not join the odometry's frame with {planned}")
        return compose(origin, pose)

    return place


def serve(port: Port, settings: RosSettings, leave: Callable[[], bool]) -> None:
    """Be the base of an executor in `settings.directory`, until `leave` says so.

    Raises:
        ValueError: others may enter that directory.
    """
    directory = settings.directory
    directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    check_private(directory)
    times = RosClock(oldest=settings.oldest, skew=settings.skew)
    frames = Frames()
    base = RosBase(
        settings.limits, port.publisher("cmd_vel", TWIST),
        port.publisher("stop", BOOL, latched=True), times=times, child=settings.base_frame,
        place=placer(frames, settings.frame),
    )  # fmt: skip
    server = BaseServer(base, directory / SOCKET)
    keeper = ButtonKeeper(directory, lambda pressed: base.press(pressed=pressed))
    try:
        if settings.frame:
            for topic in ("/tf", "/tf_static"):
                port.subscribe(
                    topic, TRANSFORMS, lambda heard: frames.hear(transforms_of(heard)),
                    latched=topic == "/tf_static",
                )  # fmt: skip
        port.subscribe("odom", ODOMETRY, base.hear)
        port.subscribe("emergency_stop", BOOL, keeper.hear, latched=True)
        put_forward("the base", PRIORITY)
        until = None
        while until is None or (base.driven and time.monotonic() < until):
            if until is None and leave():
                # whoever ends all at once leaves the executor time to come to rest
                until = time.monotonic() + LINGER
            select.select([server], [], [], LOOK)
            server.step()
            base.watch()
            times.look()
    finally:
        keeper.close()
        server.close()
