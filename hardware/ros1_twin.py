"""A chair that is none, as a node of ROS 1: range finders, odometry and tf out, cmd_vel in."""

from __future__ import annotations

import sys

from hardware.ros1 import Ros1Port
from passpmp_ti import backend


def main() -> int:
    try:
        with Ros1Port("passpmp_twin") as port:
            backend.init("cpu", threads=1)
            from hardware.ros_twin import RosTwin, RosTwinSettings

            settings = RosTwinSettings.from_parameters(port.parameters())
            RosTwin(port, settings).run(port.leaving)
    except ValueError as error:
        print(f"passpmp_twin: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
