"""Messages as the bytes that ROS 1 and ROS 2's wire carry, as a fuzzer breaks them.

Whatever a middleware raises over bytes is its own affair: it raises that in its own thread, before
anybody hears. What it makes of broken bytes is heard.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from io import BytesIO
from typing import Any

from hardware import dds, ros1
from hardware.findings import broken
from hardware.fuzzed_listeners import TOPICS, Planners
from hardware.fuzzed_messages import RIGHT
from hardware.ros_messages import Tree

FRESH = 200
"""Right messages are told anew after so many: stamps grow old."""


class Refused(Exception):
    """The middleware itself does not take the bytes for a message."""


class Wire:
    """Bytes to messages, and these to who listens."""

    refusal: type[Exception] = Refused

    def __init__(
        self,
        draw: random.Random,
        write: Callable[[str, Tree], bytes],
        read: Callable[[str, bytes], Any],
    ) -> None:
        """
        Args:
            draw: decides when a cycle is planned.
            write: the bytes of a message of a kind.
            read: the message of a kind that bytes are.
        """
        self._write, self._read = write, read
        self._listener = Planners(draw)
        self._topics = list(TOPICS)
        self._made = 0

    def made(self, draw: random.Random) -> tuple[str, bytes]:
        if self._made % FRESH == 0:
            now = time.time()
            self._right = {
                topic: self._write(kind, RIGHT[kind](now)) for topic, kind in TOPICS.items()
            }
        self._made += 1
        topic = draw.choice(self._topics)
        return topic, broken([self._right[topic]], draw)

    def eat(self, data: tuple[str, bytes]) -> None:
        topic, told = data
        try:
            message = self._read(TOPICS[topic], told)
        except Exception as why:
            raise Refused(str(why)) from why
        self._listener.eat((topic, message))

    def close(self) -> None:
        self._listener.close()


def ros1_wire(draw: random.Random) -> Wire:
    """ROS 1's, by rospy's own classes."""

    def write(kind: str, tree: Tree) -> bytes:
        buffer = BytesIO()
        ros1.filled(ros1.message_class(kind)(), tree).serialize(buffer)
        return buffer.getvalue()

    def read(kind: str, told: bytes) -> Any:
        message: Any = ros1.message_class(kind)()
        return message.deserialize(told)

    return Wire(draw, write, read)


def dds_wire(draw: random.Random) -> Wire:
    """ROS 2's, by Cyclone DDS."""
    from hardware.dds_types import KINDS

    def write(kind: str, tree: Tree) -> bytes:
        made: Any = KINDS[kind]
        return bytes(dds.filled(made(), tree).serialize())

    def read(kind: str, told: bytes) -> Any:
        made: Any = KINDS[kind]
        return made.deserialize(told)

    return Wire(draw, write, read)
