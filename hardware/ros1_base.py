"""The executor's base as a node of ROS 1: cmd_vel out, odometry and emergency stop in."""

from __future__ import annotations

import sys

from hardware.ros1 import Ros1Port
from hardware.ros_base import serve
from hardware.ros_settings import RosSettings


def main() -> int:
    try:
        with Ros1Port("passpmp_base") as port:
            serve(port, RosSettings.from_parameters(port.parameters()), port.leaving)
    except ValueError as error:
        print(f"passpmp_base: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
