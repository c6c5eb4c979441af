"""Messages in files: ROS 1 bags and ROS 2's MCAP, written and read. The extra `[bags]` (rosbags)
does it."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hardware.ros_messages import Tree

SUFFIXES = (".bag", ".mcap")
TF_MESSAGE = "geometry_msgs/TransformStamped[] transforms\n"


class Recorded(NamedTuple):
    """A message of a recording."""

    topic: str
    kind: str
    """"package/Name"."""
    time: float
    """When it was recorded, wall clock [s]."""
    message: Any


def check_installed() -> None:
    """
    Raises:
        ValueError: rosbags is not installed.
    """
    if importlib.util.find_spec("rosbags") is None:
        raise ValueError(
            "recordings need rosbags, which is not installed; pip install 'passpmp_ti[bags]'"
        )


class BagWriter:
    """Writes a recording: a ROS 1 bag (.bag), or one MCAP file as ROS 2 writes them (.mcap)."""

    def __init__(self, path: str | Path) -> None:
        """
        Args:
            path: the file; its folder is made where there is none.

        Raises:
            ValueError: another suffix, a file that exists, or rosbags is not installed.
        """
        check_installed()
        self.path = Path(path)
        if self.path.suffix not in SUFFIXES:
            raise ValueError(
                f"BagWriter.path must end with {' or '.join(SUFFIXES)}; got {str(path)!r}"
            )
        if self.path.exists():
            raise ValueError(f"BagWriter.path = {path} exists already; take another name")
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores

        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._writer: Any
        self._folder = self.path.with_suffix(".part")
        if self.path.suffix == ".bag":
            self._types = _types(Stores.ROS1_NOETIC)
            self._writer = rosbag1.Writer(self.path)
        else:
            self._types = _types(Stores.ROS2_HUMBLE)
            # one that was cut short
            shutil.rmtree(self._folder, ignore_errors=True)
            self._writer = rosbag2.Writer(
                self._folder, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP
            )
        self._connections: dict[str, Any] = {}
        self._writer.open()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def write(self, topic: str, kind: str, tree: Tree, time: float) -> None:
        """Write a message; `time` is wall clock [s]."""
        full = kind.replace("/", "/msg/")
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, full, typestore=self._types
            )
        message = made(self._types, full, tree)
        serialise = (
            self._types.serialize_ros1 if self.path.suffix == ".bag" else self._types.serialize_cdr
        )
        self._writer.write(
            self._connections[topic], round(time * 1e9), bytes(serialise(message, full))
        )

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()
        if self.path.suffix == ".mcap" and self._folder.exists():
            # a folder with one file and a description; the file describes itself
            (found,) = self._folder.glob("*.mcap")
            found.rename(self.path)
            shutil.rmtree(self._folder)


def messages(path: str | Path, kinds: Iterable[str]) -> Iterator[Recorded]:
    """Messages of some kinds, in the order in which they were recorded.

    Args:
        path: a ROS 1 bag, an MCAP file, or the folder of a ROS 2 recording.
        kinds: "package/Name" each.

    Raises:
        ValueError: there is no such recording, or it cannot be read.
    """
    check_installed()
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores

    path, wanted = Path(path), set(kinds)
    if not path.exists():
        raise ValueError(f"{path}: no such recording; give a .bag, an .mcap or a folder with one")
    try:
        # what a recording does not define is as ROS 2 has it
        with AnyReader([path], default_typestore=_types(Stores.ROS2_HUMBLE)) as reader:
            chosen = [c for c in reader.connections if _short(c.msgtype) in wanted]
            if not chosen:
                return
            for connection, time, data in reader.messages(connections=chosen):
                message = reader.deserialize(data, connection.msgtype)
                yield Recorded(connection.topic, _short(connection.msgtype), time * 1e-9, message)
    except Exception as cause:
        # rosbags trusts a file's own numbers: a broken one has it raise anything
        raise ValueError(
            f"{path}: not a recording that can be read: {str(cause) or type(cause).__name__}"
        ) from cause


def _types(store: Any) -> Any:
    """A store of types, with tf's beside them."""
    from rosbags.typesys import get_types_from_msg, get_typestore

    types = get_typestore(store)
    if "tf2_msgs/msg/TFMessage" not in types.types:
        types.register(get_types_from_msg(TF_MESSAGE, "tf2_msgs/msg/TFMessage"))
    return types


def made(types: Any, name: str, tree: Tree) -> Any:
    """A message of a store's type, from a tree."""
    from rosbags.interfaces import Nodetype

    values = {}
    for field, (node, of) in types.fielddefs[name][1]:
        given = tree.get(field)
        if node is Nodetype.NAME:
            values[field] = made(types, of, given or {})
        elif node is Nodetype.BASE:
            values[field] = given if given is not None else ("" if of[0] == "string" else 0)
        elif of[0][0] is Nodetype.NAME:
            values[field] = [made(types, of[0][1], one) for one in given or ()]
        else:
            values[field] = np.asarray([] if given is None else given, dtype=of[0][1][0])
    return types.types[name](**values)


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/")
