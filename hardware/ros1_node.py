"""The planner as a node of ROS 1; `launch/planner.launch` starts it. See docs/ros.md."""

from __future__ import annotations

import sys

from hardware.ros1 import Ros1Port
from hardware.ros_settings import RosSettings


def main() -> int:
    try:
        with Ros1Port("passpmp_planner") as port:
            settings = RosSettings.from_parameters(port.parameters())
            from passpmp_ti import backend

            backend.init(settings.backend, threads=settings.threads)
            from hardware.ros_planner import Planner

            Planner(port, settings).run(port.leaving)
    except (ValueError, RuntimeError) as error:
        print(f"passpmp_planner: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
