"""The nodes of ROS 2: planner, base and twin over Cyclone DDS.

    python -m hardware.dds_node twin --config twin.yaml
    python -m hardware.dds_node base --config launch/twin.yaml
    python -m hardware.dds_node planner --config launch/twin.yaml

They stay on this machine unless --network is given.
"""

from __future__ import annotations

import argparse
import signal
import sys
from types import FrameType
from typing import Any

from hardware.dds import DdsPort
from hardware.ros_settings import RosSettings, read_parameters
from passpmp_ti import door

NODES = ("planner", "base", "twin")


def run(node: str, values: dict[str, Any], *, loopback: bool) -> None:
    """Be a node until SIGTERM or SIGINT.

    Raises:
        ValueError: settings that make no sense.
        RuntimeError: the executor did not start, or ended.
    """
    asked: list[int] = []

    def leave(number: int, frame: FrameType | None) -> None:
        asked.append(number)

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, leave)

    def leaving() -> bool:
        return bool(asked)

    with DdsPort(loopback=loopback) as port:
        if node == "twin":
            from hardware.ros_twin import RosTwin, RosTwinSettings
            from passpmp_ti import backend

            backend.init("cpu", threads=1)
            RosTwin(port, RosTwinSettings.from_parameters(values)).run(leaving)
            return
        settings = RosSettings.from_parameters(values)
        if node == "base":
            from hardware.ros_base import serve

            serve(port, settings, leaving)
            return
        from hardware.ros_planner import Planner
        from passpmp_ti import backend

        backend.init(settings.backend, threads=settings.threads)
        Planner(port, settings).run(leaving)


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Be a node of ROS 2 over Cyclone DDS.",
        epilog="example: python -m hardware.dds_node planner --config launch/wheelchair.yaml",
    )
    parser.add_argument("node", choices=NODES)
    parser.add_argument("--config", metavar="FILE", help="what is set, as YAML (docs/ros.md)")
    parser.add_argument("--network", action="store_true", help="on all interfaces, not loopback")
    given = parser.parse_args()
    try:
        values = read_parameters(given.config) if given.config else {}
        run(door.choice("dds_node", "node", given.node, NODES), values, loopback=not given.network)
    except (ValueError, RuntimeError, OSError) as error:
        print(f"passpmp {given.node}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
