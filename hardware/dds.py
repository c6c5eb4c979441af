"""ROS 2's wire without ROS 2: its topics over Cyclone DDS behind a `Port`. The extra `[ros2]`.

Names, types and CDR are ROS 2's, so its nodes on the same domain hear and are heard. Not told: the
graph (`ros2 node list` does not know these nodes), since rmw tells that on a topic of its own.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, get_type_hints

import numpy as np

from hardware.ros_messages import Tree
from hardware.ros_port import ODOMETRY, SCAN, TRANSFORMS
from passpmp_ti import door

if TYPE_CHECKING:
    from cyclonedds.qos import Qos

LOOPBACK = """<CycloneDDS><Domain>
<General><AllowMulticast>false</AllowMulticast>
<Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>100</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
"""Nothing leaves the machine, and nothing comes from outside."""
NAMES = {"/move_base_simple/goal": "goal_pose"}
"""Topics that ROS 2 calls differently."""
AT_ONCE = 32
"""Messages of a topic that are taken in one go."""
NAP = 100
"""[ms] after which a thread that waits looks whether it is over."""
MOST_DOMAIN = 232


class DdsPort:
    """A participant on a domain of ROS 2. One thread hears all topics."""

    def __init__(self, *, domain: int | None = None, loopback: bool = True) -> None:
        """
        Args:
            domain: of ROS 2; None: `ROS_DOMAIN_ID`, or 0.
            loopback: nothing but this machine; False: as `CYCLONEDDS_URI` says, or all interfaces.

        Raises:
            ValueError: cyclonedds is not installed, or there is no such domain.
        """
        if importlib.util.find_spec("cyclonedds") is None:
            raise ValueError(
                "ROS 2's wire needs cyclonedds, which is not installed;"
                " pip install 'passpmp_ti[ros2]'"
            )
        from cyclonedds.core import WaitSet
        from cyclonedds.domain import Domain, DomainParticipant

        if domain is None:
            domain = _whole(os.environ.get("ROS_DOMAIN_ID", "0"))
        door.whole("DdsPort", "domain", domain, least=0, most=MOST_DOMAIN)
        self._domain = Domain(domain, LOOPBACK) if loopback else None
        self._participant = DomainParticipant(domain)
        self._waits = WaitSet(self._participant)
        self._readers: list[tuple[Any, Callable[[Any], None]]] = []
        self._entities: list[Any] = []
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def __enter__(self) -> DdsPort:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def publisher(
        self, topic: str, kind: str, *, latched: bool = False
    ) -> Callable[[Tree], None]:
        from cyclonedds.pub import DataWriter

        from hardware.dds_types import KINDS

        made = KINDS[kind]
        writer = DataWriter(self._participant, self._topic(topic, kind), qos=_qos(kind, latched))
        self._entities.append(writer)

        def publish(tree: Tree) -> None:
            writer.write(filled(made(), tree))

        return publish

    def subscribe(
        self, topic: str, kind: str, hear: Callable[[Any], None], *, latched: bool = False
    ) -> None:
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState
        from cyclonedds.sub import DataReader

        reader = DataReader(
            self._participant, self._topic(topic, kind), qos=_qos(kind, latched, hears=True)
        )
        any_new = ViewState.Any | InstanceState.Any | SampleState.NotRead
        with self._lock:
            self._readers.append((reader, hear))
            condition = ReadCondition(reader, any_new)
            self._entities.append(condition)
            self._waits.attach(condition)

    def close(self) -> None:
        """Hear and say nothing more."""
        self._closed.set()
        self._thread.join()

    def _topic(self, topic: str, kind: str) -> Any:
        from cyclonedds.topic import Topic

        from hardware.dds_types import KINDS

        name = NAMES.get(topic, topic).lstrip("/")
        of: Any = KINDS[kind]
        made: Any = Topic(self._participant, f"rt/{name}", of)
        self._entities.append(made)
        return made

    def _listen(self) -> None:
        from cyclonedds.internal import InvalidSample
        from cyclonedds.util import duration

        while not self._closed.is_set():
            self._waits.wait(duration(milliseconds=NAP))
            with self._lock:
                readers = list(self._readers)
            for reader, hear in readers:
                for sample in _taken(reader):
                    if isinstance(sample, InvalidSample):
                        continue
                    try:
                        hear(sample)
                    except Exception as error:  # one message must not make the node deaf
                        print(f"a message was not understood: {error!r}", file=sys.stderr)


def _taken(reader: Any) -> list[Any]:
    """What came. Bytes that are no message of the topic's type raise whatever they like; that must
    not make the node deaf, and what came together with them is lost with them."""
    try:
        return list(reader.take(N=AT_ONCE))
    except Exception as error:
        print(f"bytes that are no message: {error!r}", file=sys.stderr)
        return []


def filled(message: Any, tree: Tree) -> Any:
    """The message, with the tree's fields put into it."""
    for name, value in tree.items():
        if isinstance(value, dict):
            filled(getattr(message, name), value)
        elif isinstance(value, np.ndarray):
            setattr(message, name, value.tolist())
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            hint = get_type_hints(type(message), include_extras=True)[name]
            of = hint.__metadata__[0].subtype
            setattr(message, name, [filled(of(), one) for one in value])
        else:
            setattr(message, name, value)
    return message


def _qos(kind: str, latched: bool, *, hears: bool = False) -> Qos:
    """As ROS 2's nodes expect: sensors may lose, commands may not. Who hears odometry asks for no
    more than sensors give, so that it hears either."""
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.util import duration

    loses = kind == SCAN or (hears and kind in (ODOMETRY, TRANSFORMS) and not latched)
    reliability = (
        Policy.Reliability.BestEffort
        if loses
        else Policy.Reliability.Reliable(duration(milliseconds=100))
    )
    durability = Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile
    depth = 100 if kind == TRANSFORMS else 1 if latched else 5
    return Qos(reliability, durability, Policy.History.KeepLast(depth))


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(
            f"ROS_DOMAIN_ID must be a whole number, 0 to {MOST_DOMAIN}; got {text!r}"
        ) from None
