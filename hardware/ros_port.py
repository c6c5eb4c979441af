"""What a node needs of its middleware, whichever that is: ROS 1, or ROS 2's wire."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from hardware.ros_messages import Tree

BOOL = "std_msgs/Bool"
DIAGNOSTICS = "diagnostic_msgs/DiagnosticArray"
GRID = "nav_msgs/OccupancyGrid"
MARKERS = "visualization_msgs/MarkerArray"
ODOMETRY = "nav_msgs/Odometry"
PATH = "nav_msgs/Path"
POSE = "geometry_msgs/PoseStamped"
SCAN = "sensor_msgs/LaserScan"
TRANSFORMS = "tf2_msgs/TFMessage"
TWIST = "geometry_msgs/Twist"


class Port(Protocol):
    """Publishes and hears messages. Callbacks come from threads of the middleware."""

    def publisher(
        self, topic: str, kind: str, *, latched: bool = False
    ) -> Callable[[Tree], None]:
        """What publishes a message on a topic.

        Args:
            topic: its name.
            kind: of its messages, "package/Name".
            latched: who comes later still gets the last one.
        """

    def subscribe(
        self, topic: str, kind: str, hear: Callable[[Any], None], *, latched: bool = False
    ) -> None:
        """Have `hear` called with each message of a topic; arguments as for `publisher`."""
