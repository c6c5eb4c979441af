"""What the fields of ROS messages mean here, and ours as their fields. No ROS, no clock, no socket.

ROS 1, ROS 2's wire and bags all carry the same messages, so each meaning stands once. What comes in
is anything with a message's attributes; what goes out is a *tree*: a message as nested dicts, named
as ROS 2 names them, which every middleware fills into its own types. Stamps are wall clock here;
`ros_clock.py` says what they are on ours.

Sources: the definitions of sensor_msgs, nav_msgs, geometry_msgs and visualization_msgs; REP 103
(units), 105 (frames), 117 (ranges that are no distances).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import wraps
from operator import index
from typing import Any, ParamSpec, TypeVar

import numpy as np

from hardware.base import FARTHEST, Odometry, twist_of, wheels_of
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.scan import Scan
from passpmp_ti.trajectory import Trajectory

Tree = dict[str, Any]
"""A message: its fields by name; messages within it are trees, lists of them lists."""
Pose = tuple[float, float, float]
"""(x, y, theta) [m, m, rad]."""
P = ParamSpec("P")
T = TypeVar("T")

TOO_NEAR = 1e-3
"""The range that stands for "something is nearer than can be measured" [m]."""
UPRIGHT = 0.02
"""A range finder may lean by this [rad]: its beams then reach 2 mm less far at 10 m."""
LEVEL = 0.2
"""A robot may lean by this on its way [rad]."""
MOST_BEAMS = 16_384
"""Of a scan; what is made of one must not take longer than a cycle."""
MOST_LETTERS = 256
"""Of a frame's name."""
FREE, OCCUPIED = 0, 100
"""Values of an OccupancyGrid's cell."""


class Untrusted(ValueError):
    """A message that is not to be believed, and why: the world is unseen then."""


def _or_untrusted(read: Callable[P, T]) -> Callable[P, T]:
    """A reader that raises `Untrusted` and nothing else, whatever a message holds: recordings bring
    their own definitions, in which a field may be anything, or missing."""

    @wraps(read)
    def reading(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return read(*args, **kwargs)
        except Untrusted:
            raise
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as why:
            raise Untrusted("a message without the fields of its kind") from why

    return reading


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sweep:
    """A LaserScan in our meanings; who heard it knows when and where that was."""

    frame: str
    stamp: float
    """As it came, wall clock [s]."""
    ranges: np.ndarray
    """[n] float64 [m], as `Scan.ranges`."""
    angle_min: float
    angle_increment: float
    """> 0 [rad]."""
    range_max: float
    """[m]."""
    lasts: float
    """From the first beam to the last, as the message tells; 0 where it does not [s]."""

    def at(self, pose: Pose, stamp: float) -> Scan:
        """The scan, of a sensor at a pose in the world, with a stamp of our clock."""
        return Scan(
            self.ranges, self.angle_min, self.angle_increment, self.range_max, pose=pose,
            stamp=stamp,
        )  # fmt: skip


@_or_untrusted
def sweep_of(message: Any, *, range_max: float, beyond_is_free: bool = False) -> Sweep:
    """Read a sensor_msgs/LaserScan.

    | the message has | here |
    |---|---|
    | a number from `range_min` to its `range_max` | that distance |
    | +inf | nothing within the lesser of both `range_max` |
    | -inf | `TOO_NEAR`: something stands here, and no space before it is vouched for |
    | NaN, less than `range_min` | lost: its bearing is unseen |
    | a number above its `range_max` | lost, since the definition says "discard" |

    float32 moves a range of 10 m by up to 0.5 um: the model's millimetre for rounding holds that.

    Args:
        message: with the attributes of a LaserScan, of whatever middleware.
        range_max: how far +inf is taken for empty space [m], however far the message says.
        beyond_is_free: a number above the message's own `range_max` is no distance but a driver's
            way to say +inf. Only for drivers known to do so.

    Raises:
        Untrusted: its bearings or ranges make no sense.
    """
    with np.errstate(invalid="ignore"):  # a NaN that signals, once it is cast
        ranges = np.array(message.ranges, dtype=np.float64)
    low, step = float(message.angle_min), float(message.angle_increment)
    near, far = float(message.range_min), float(message.range_max)
    n = len(ranges)
    if ranges.ndim != 1 or n > MOST_BEAMS:
        raise Untrusted(f"a scan of more than {MOST_BEAMS} beams, or none")
    if n < 2 or not all(map(math.isfinite, (low, step, near))) or step == 0.0 or not far > TOO_NEAR:
        raise Untrusted("a scan without beams, bearings or range")
    last = low + (n - 1) * step
    # float32 sums angles up; more than a beam off, and nobody knows which beam looks where
    if not abs(last - float(message.angle_max)) <= abs(step):
        raise Untrusted("a scan whose beams do not fill its angles")
    if (n - 1) * abs(step) > 2 * math.pi:
        raise Untrusted("a scan of more than a turn")
    with np.errstate(invalid="ignore"):
        given = ranges.copy()
        ranges[(given < near) | (given <= 0.0)] = np.nan
        ranges[given > far] = math.inf if beyond_is_free else math.nan
        ranges[given == math.inf] = math.inf
        ranges[given == -math.inf] = TOO_NEAR
    if step < 0.0:
        low, step, ranges = last, -step, ranges[::-1]
    lasts = (n - 1) * abs(float(message.time_increment))
    return Sweep(
        frame=frame_of(message), stamp=seconds(message.header.stamp), ranges=ranges,
        angle_min=low, angle_increment=step, range_max=min(range_max, far),
        lasts=lasts if math.isfinite(lasts) else math.inf,
    )  # fmt: skip


def laser_scan(
    scan: Scan, stamp: float, frame: str, *, range_min: float = 0.02, lasts: float = 0.0
) -> Tree:
    """A scan as sensor_msgs/LaserScan.

    Args:
        scan: to be told.
        stamp: of its first beam, wall clock [s].
        frame: of the sensor.
        range_min: nearer returns become -inf [m].
        lasts: from the first beam to the last [s].
    """
    n = len(scan.ranges)
    ranges = scan.ranges.astype(np.float32)
    ranges[scan.lost] = np.nan
    ranges[scan.ranges >= scan.range_max] = np.inf
    with np.errstate(invalid="ignore"):
        ranges[(scan.ranges > 0) & (scan.ranges < range_min)] = -np.inf
    return {
        "header": header(stamp, frame),
        "angle_min": scan.angle_min,
        "angle_max": scan.angle_min + (n - 1) * scan.angle_increment,
        "angle_increment": scan.angle_increment,
        "time_increment": lasts / (n - 1),
        "scan_time": 0.0,
        "range_min": range_min,
        "range_max": scan.range_max,
        "ranges": ranges,
        "intensities": np.zeros(0, dtype=np.float32),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A nav_msgs/Odometry in our meanings."""

    frame: str
    child: str
    """Frame that moves, and in which its twist is told."""
    stamp: float
    """As it came, wall clock [s]."""
    pose: Pose
    speed: float
    """[m/s]."""
    turn_rate: float
    """[rad/s]."""

    def odometry(self, stamp: float, track: float) -> Odometry:
        """For an executor: a stamp of our clock, the distance between the driven wheels [m]."""
        return Odometry(stamp, *self.pose, *wheels_of(self.speed, self.turn_rate, track))


@_or_untrusted
def motion_of(message: Any) -> Motion:
    """Read a nav_msgs/Odometry. Numbers that are none stay so: the executor has a rule for them.

    Raises:
        Untrusted: the robot leans by more than `LEVEL`, or its orientation is none.
    """
    twist = message.twist.twist
    return Motion(
        frame=frame_of(message), child=_name(message.child_frame_id),
        stamp=seconds(message.header.stamp),
        pose=planar(message.pose.pose.position, message.pose.pose.orientation, LEVEL),
        speed=float(twist.linear.x), turn_rate=float(twist.angular.z),
    )  # fmt: skip


def odometry_message(
    odometry: Odometry, stamp: float, frame: str, child: str, track: float
) -> Tree:
    """Odometry as nav_msgs/Odometry; `stamp` is wall clock [s], `track` between the wheels [m]."""
    covariance = np.zeros(36)
    speed, turn_rate = twist_of(odometry.right, odometry.left, track)
    return {
        "header": header(stamp, frame),
        "child_frame_id": child,
        "pose": {"pose": pose_tree((odometry.x, odometry.y, odometry.theta)),
                 "covariance": covariance},
        "twist": {"twist": twist(speed, turn_rate), "covariance": covariance},
    }  # fmt: skip


def twist(speed: float, turn_rate: float) -> Tree:
    """geometry_msgs/Twist of a speed [m/s] and a turn rate [rad/s]."""
    return {
        "linear": {"x": speed, "y": 0.0, "z": 0.0},
        "angular": {"x": 0.0, "y": 0.0, "z": turn_rate},
    }


@_or_untrusted
def wheels_from(message: Any, track: float) -> tuple[float, float]:
    """(right, left) ground speeds [m/s] that a geometry_msgs/Twist asks for.

    Raises:
        Untrusted: it is none.
    """
    return wheels_of(float(message.linear.x), float(message.angular.z), track)


def stop_of(message: Any) -> bool:
    """Whether a std_msgs/Bool tells to stop. Only a plain False does not: what is none at all may
    have been meant to."""
    return getattr(message, "data", True) is not False


@_or_untrusted
def stamp_of(message: Any) -> float:
    """When a message with a header says it is of, wall clock [s].

    Raises:
        Untrusted: it does not say.
    """
    return seconds(message.header.stamp)


@_or_untrusted
def frame_of(message: Any) -> str:
    """The frame that a message's header names.

    Raises:
        Untrusted: it names none, or by more than `MOST_LETTERS`.
    """
    return _name(message.header.frame_id)


@_or_untrusted
def place_of(message: Any) -> tuple[str, float, float]:
    """(frame, x, y) of a geometry_msgs/PoseStamped.

    Raises:
        Untrusted: numbers that are none, or beyond `FARTHEST`.
    """
    x, y = float(message.pose.position.x), float(message.pose.position.y)
    if not (abs(x) <= FARTHEST and abs(y) <= FARTHEST):
        raise Untrusted(f"a goal at ({x:g}, {y:g})")
    return frame_of(message), x, y


def pose_stamped(pose: Pose, stamp: float, frame: str) -> Tree:
    """geometry_msgs/PoseStamped."""
    return {"header": header(stamp, frame), "pose": pose_tree(pose)}


def transforms_of(message: Any) -> list[tuple[str, str, Pose]]:
    """[(parent, child, pose of the child in the parent)] of a tf2_msgs/TFMessage; what leans by
    more than `UPRIGHT` is not in the plane and left out, as is what is no transform: whoever needs
    it will miss it."""
    found = []
    try:
        told = list(message.transforms)
    except (AttributeError, TypeError):
        return []
    for one in told:
        try:
            found.append(_link_of(one))
        except Untrusted:
            continue
    return found


@_or_untrusted
def _link_of(message: Any) -> tuple[str, str, Pose]:
    pose = planar(message.transform.translation, message.transform.rotation, UPRIGHT)
    return frame_of(message), _name(message.child_frame_id), pose


def transforms(links: Iterable[tuple[str, str, Pose]], stamp: float) -> Tree:
    """tf2_msgs/TFMessage of (parent, child, pose of the child in the parent)."""
    told = []
    for parent, child, pose in links:
        place = pose_tree(pose)
        told.append(
            {
                "header": header(stamp, parent),
                "child_frame_id": child,
                "transform": {"translation": place["position"], "rotation": place["orientation"]},
            }
        )
    return {"transforms": told}


def path(trajectory: Trajectory, stamps: Sequence[float], stamp: float, frame: str) -> Tree:
    """nav_msgs/Path of a trajectory; `stamps` are its states' times on the wall clock [s]."""
    poses = [
        pose_stamped((float(s[0]), float(s[1]), float(s[2])), when, frame)
        for s, when in zip(trajectory.states, stamps, strict=True)
    ]
    return {"header": header(stamp, frame), "poses": poses}


def occupancy_grid(
    occupied: np.ndarray, origin: tuple[float, float], cell: float, stamp: float, frame: str
) -> Tree:
    """nav_msgs/OccupancyGrid.

    Args:
        occupied: [J, I] bool, rows upwards.
        origin: outer corner of cell [0, 0] [m].
        cell: its side [m].
        stamp: wall clock [s].
        frame: of the origin.
    """
    rows, columns = occupied.shape
    return {
        "header": header(stamp, frame),
        "info": {
            "map_load_time": time_tree(stamp), "resolution": cell, "width": columns,
            "height": rows, "origin": pose_tree((origin[0], origin[1], 0.0)),
        },
        "data": np.where(occupied, OCCUPIED, FREE).astype(np.int8).ravel(),
    }  # fmt: skip


def map_message(known: StaticMap, stamp: float, frame: str) -> Tree:
    """What stays as nav_msgs/OccupancyGrid; `stamp` is wall clock [s]."""
    tree = occupancy_grid(known.occupied, known.origin[:2], known.resolution, stamp, frame)
    tree["info"]["origin"] = pose_tree(known.origin)
    return tree


@_or_untrusted
def static_map_of(message: Any) -> tuple[str, StaticMap]:
    """(frame, map) of a nav_msgs/OccupancyGrid. Only cells that are surely occupied are taken for
    what stays: what is unknown, or likely, may be anything.

    Raises:
        Untrusted: it is no map of the plane.
    """
    info = message.info
    x, y, yaw = planar(info.origin.position, info.origin.orientation, UPRIGHT)
    data = np.asarray(message.data)
    width, height = index(info.width), index(info.height)
    if not len(data) or len(data) != width * height:
        raise Untrusted(f"a map of {width} times {height} cells with {len(data)} values")
    # no cast before this: a number that wraps round to it, or a text, is not surely occupied
    occupied = data.reshape(height, width) == OCCUPIED
    # the shortest number that is this float32: 0.05 and not 0.0500000007, or a ring of cells that
    # lie just as far from a wall as is tolerated would be lost; 1000 cells shift by 1 um
    with np.errstate(over="ignore"):
        resolution = float(str(np.float32(info.resolution)))
    try:
        return frame_of(message), StaticMap(occupied, resolution, (x, y, yaw))
    except ValueError as why:
        raise Untrusted(f"a map that is none: {why}") from why


def header(stamp: float, frame: str) -> Tree:
    """std_msgs/Header."""
    return {"stamp": time_tree(stamp), "frame_id": frame}


def pose_tree(pose: Pose) -> Tree:
    """geometry_msgs/Pose in the plane."""
    x, y, theta = (float(v) for v in pose)
    return {
        "position": {"x": x, "y": y, "z": 0.0},
        "orientation": {
            "x": 0.0, "y": 0.0, "z": math.sin(0.5 * theta), "w": math.cos(0.5 * theta)
        },
    }  # fmt: skip


def time_tree(stamp: float) -> Tree:
    """A time as ROS has it; `stamp` in seconds."""
    nanoseconds = round(stamp * 1e9)
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}


def seconds(time: Any) -> float:
    """A time of any middleware [s]."""
    if hasattr(time, "nanosec"):
        return float(time.sec + 1e-9 * time.nanosec)
    return float(time.secs + 1e-9 * time.nsecs)


def _name(frame: object) -> str:
    if not isinstance(frame, str) or len(frame) > MOST_LETTERS:
        raise Untrusted(f"a frame whose name is none, or of more than {MOST_LETTERS} letters")
    return frame


def planar(position: Any, orientation: Any, lean: float) -> Pose:
    """(x, y, theta) of a pose whose z axis is upright within `lean` [rad].

    Raises:
        Untrusted: it is not, the orientation is no quaternion, or the place is beyond `FARTHEST`.
    """
    place = float(position.x), float(position.y)
    if any(FARTHEST < abs(p) < math.inf for p in place):
        raise Untrusted(f"a place farther away than {FARTHEST:g} m")
    x, y, z, w = (float(getattr(orientation, name)) for name in "xyzw")
    norm = x * x + y * y + z * z + w * w
    if not abs(norm - 1.0) < 0.02:
        raise Untrusted("an orientation that is no unit quaternion")
    if 1.0 - 2.0 * (x * x + y * y) / norm < math.cos(lean):
        raise Untrusted(f"an orientation that leans by more than {lean:g} rad")
    theta = math.atan2(2 * (w * z + x * y), norm - 2 * (y * y + z * z))
    return *place, theta
