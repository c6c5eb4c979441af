"""ROS 1 by Debian's own packages: rospy's messages and topics behind a `Port`."""

from __future__ import annotations

import importlib.util
import os
import signal
import sys
from collections.abc import Callable
from importlib.machinery import PathFinder
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

import numpy as np

from hardware.ros_messages import Tree

DEBIAN = Path("/usr/lib/python3/dist-packages")
"""Where Debian's packages are; a virtual environment does not look there."""
NEEDED = (
    "python3-rospy python3-roslaunch python3-rosmaster python3-sensor-msgs python3-nav-msgs"
    " python3-geometry-msgs python3-visualization-msgs python3-diagnostic-msgs python3-tf2-ros"
    " python3-rosbag python3-rostopic"
)
"""Debian's packages for all that is done here."""


def there(name: str) -> bool:
    """Whether `load` would find a module. Nothing is loaded, and no path changed."""
    return bool(importlib.util.find_spec(name) or PathFinder.find_spec(name, [str(DEBIAN)]))


def load(name: str = "rospy") -> ModuleType:
    """A module of ROS 1, from wherever it is.

    Debian's folder is appended last, so that what the environment has itself wins.

    Raises:
        ValueError: it is nowhere.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        pass
    if DEBIAN.is_dir() and str(DEBIAN) not in sys.path:
        sys.path.append(str(DEBIAN))
        importlib.invalidate_caches()
    try:
        return importlib.import_module(name)
    except ImportError as cause:
        raise ValueError(
            f"ROS 1 is not installed ({cause}); on Debian: apt-get install"
            f" --no-install-recommends {NEEDED}"
        ) from cause


def message_class(kind: str) -> type:
    """The class of a kind of message, "package/Name".

    Raises:
        ValueError: its package is not installed.
    """
    package, name = kind.split("/")
    found: type = getattr(load(f"{package}.msg"), name)
    return found


def filled(message: Any, tree: Tree) -> Any:
    """The message, with the tree's fields put into it."""
    types = dict(zip(message.__slots__, message._slot_types, strict=True))
    for name, value in tree.items():
        kind = types[name]
        if kind in ("time", "duration"):
            old = getattr(message, name)
            setattr(message, name, type(old)(value["sec"], value["nanosec"]))
        elif isinstance(value, dict):
            filled(getattr(message, name), value)
        elif isinstance(value, np.ndarray):
            setattr(message, name, value.tolist())
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            one = message_class(kind[: kind.index("[")])
            setattr(message, name, [filled(one(), part) for part in value])
        else:
            setattr(message, name, value)
    return message


class Ros1Port:
    """A node of ROS 1, on this machine alone unless ROS_IP or ROS_HOSTNAME says where else it is.

    Signals are the node's own: rospy would end it in the middle of a cycle.
    """

    def __init__(self, name: str) -> None:
        """
        Args:
            name: of the node, unless it is started under another.

        Raises:
            ValueError: ROS 1 is not installed.
        """
        if not {"ROS_IP", "ROS_HOSTNAME"} & set(os.environ):
            # else its sockets would listen on every interface
            os.environ["ROS_IP"] = "127.0.0.1"
        self._rospy = load("rospy")
        self._asked: list[int] = []
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._leave)
        self._rospy.init_node(name, disable_signals=True)

    def __enter__(self) -> Ros1Port:
        return self

    def __exit__(self, *_: object) -> None:
        self._rospy.signal_shutdown("the node ends")

    def leaving(self) -> bool:
        """Whether the node was asked to end."""
        return bool(self._asked) or self._rospy.is_shutdown()

    def parameters(self) -> dict[str, Any]:
        """The node's private parameters."""
        given = self._rospy.get_param("~", {})
        return dict(given) if isinstance(given, dict) else {}

    def publisher(
        self, topic: str, kind: str, *, latched: bool = False
    ) -> Callable[[Tree], None]:
        message = message_class(kind)
        to = self._rospy.Publisher(topic, message, queue_size=2, latch=latched, tcp_nodelay=True)

        def publish(tree: Tree) -> None:
            try:
                to.publish(filled(message(), tree))
            except self._rospy.ROSException:
                # the node is asked to end; who waits for this sees that it does
                self._asked.append(0)

        return publish

    def subscribe(
        self, topic: str, kind: str, hear: Callable[[Any], None], *, latched: bool = False
    ) -> None:
        # a latched topic has several publishers' last words, and none may be lost
        self._rospy.Subscriber(
            topic, message_class(kind), hear, queue_size=20 if latched else 2, tcp_nodelay=True
        )

    def _leave(self, number: int, frame: FrameType | None) -> None:
        self._asked.append(number)
