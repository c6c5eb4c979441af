"""From a document to a certificate; what cannot be is refused."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from passpmp_verify.certificate import Assumptions, Cells, Certificate, Moment, Sweep
from passpmp_verify.document import CertificateError, unpack
from passpmp_verify.robot import Car, Differential, Robot

MOST_DISCS = 64
CAR_FIELDS: tuple[str, ...] = (
    "v_max",
    "v_reverse",
    "acceleration",
    "xi_max",
    "xi_rate",
    "wheelbase",
)
DIFFERENTIAL_FIELDS: tuple[str, ...] = ("wheel_speed", "acceleration", "track")


def certificate_of(document: Mapping[str, Any]) -> Certificate:
    """The certificate of a document.

    Raises:
        CertificateError: which field is missing or cannot be.
    """
    said = _mapping(document, "assumptions")
    blind = said.get("blind_speed")
    assumptions = Assumptions(
        object_speed=_number(said, "object_speed", least=0),
        object_width=_number(said, "object_width", above=0),
        object_radius=_number(said, "object_radius", least=0),
        blind_speed=None if blind is None else _number(said, "blind_speed", least=0),
        range_noise=_number(said, "range_noise", least=0),
        localisation_error=_number(said, "localisation_error", least=0),
        tracking_error=_number(said, "tracking_error", least=0),
        stamp_error=_number(said, "stamp_error", least=0),
        map_tolerance=_number(said, "map_tolerance", least=0),
    )
    if assumptions.blind_speed is not None and assumptions.blind_speed > assumptions.object_speed:
        raise CertificateError("blind_speed must not be above object_speed, which bounds all")
    moments = tuple(_moment(m) for m in _list(document, "moments"))
    if not moments:
        raise CertificateError("moments: none; nothing is proven without a scan")
    stamps = [m.stamp for m in moments]
    if any(later >= earlier for earlier, later in pairwise(stamps)):
        raise CertificateError("moments must be newest first, each of another instant")
    static_map = None if document.get("static_map") is None else _map(document, assumptions)
    path = _mapping(document, "trajectory")
    times = _finite(path, "times", (None,))
    states = _finite(path, "states", (None, 5))
    brakes_from = path.get("brakes_from")
    if len(times) != len(states) or not len(times):
        raise CertificateError(f"trajectory: {len(times)} times for {len(states)} states")
    if type(brakes_from) is not int or not 0 <= brakes_from < len(times):
        raise CertificateError(f"trajectory.brakes_from = {brakes_from!r} is none of its states")
    return Certificate(
        robot_from(_mapping(document, "robot")), assumptions, moments, static_map, times, states,
        brakes_from,
    )  # fmt: skip


def robot_from(said: Mapping[str, Any]) -> Robot:
    """The robot that declares this of itself.

    Raises:
        CertificateError: which number is missing or cannot be.
    """
    discs = said.get("discs")
    if not isinstance(discs, list) or not 0 < len(discs) <= MOST_DISCS:
        raise CertificateError("robot.discs must be a list of (offset, radius)")
    body = np.array(
        [_numbers(disc, f"robot.discs[{k}]", 2) for k, disc in enumerate(discs)], dtype=np.float64
    )
    if (body[:, 1] <= 0).any():
        raise CertificateError("robot.discs: a radius must be > 0")
    kind = said.get("kind")
    if kind == "car":
        numbers = {
            f: _number(said, f, **({"least": 0} if f == "v_reverse" else {"above": 0}))
            for f in CAR_FIELDS
        }
        if numbers["xi_max"] >= 0.5 * math.pi:
            raise CertificateError("robot.xi_max must be less than a right angle")
        return Car(body, **numbers)
    if kind == "differential":
        return Differential(body, **{f: _number(said, f, above=0) for f in DIFFERENTIAL_FIELDS})
    raise CertificateError(f"robot.kind must be car or differential; it is {kind!r}")


def _moment(said: Any) -> Moment:
    if not isinstance(said, Mapping):
        raise CertificateError("moments: not a list of objects")
    scans = tuple(_scan(s) for s in _list(said, "scans"))
    if not scans:
        raise CertificateError("moments: one without a scan")
    if any(abs(s.stamp - scans[0].stamp) > 1e-6 for s in scans):
        raise CertificateError("moments: scans of different instants in one")
    x, y, theta = _numbers(said.get("position"), "position", 3)
    on_map = said.get("on_map")
    if not isinstance(on_map, bool):
        raise CertificateError(f"on_map must be true or false; it is {on_map!r}")
    return Moment(scans, (x, y, theta), _number(said, "clear_radius", least=0), on_map)


def _scan(said: Any) -> Sweep:
    if not isinstance(said, Mapping):
        raise CertificateError("scans: not a list of objects")
    ranges = unpack("ranges", said.get("ranges"), "float64", (None,))
    n = len(ranges)
    if n < 2:
        raise CertificateError(f"ranges: {n} beams; at least two make a wedge")
    moving = None
    if said.get("moving") is not None:
        moving = unpack("moving", said["moving"], "bool", (n,))
    increment = _number(said, "angle_increment", above=0)
    if (n - 1) * increment > 2 * math.pi + 1e-6:
        raise CertificateError(f"{n} beams of {increment:g} rad span more than a full turn")
    x, y, theta = _numbers(said.get("pose"), "pose", 3)
    return Sweep(
        ranges, _number(said, "angle_min"), increment, _number(said, "range_max", above=0),
        (x, y, theta), _number(said, "stamp"), moving,
    )  # fmt: skip


def _map(document: Mapping[str, Any], assumptions: Assumptions) -> Cells:
    said = _mapping(document, "static_map")
    if assumptions.map_tolerance >= 0.5 * assumptions.object_width:
        raise CertificateError(
            "map_tolerance must be less than half of object_width: a door as wide as an object"
            " must not be taken for wall"
        )
    x, y, yaw = _numbers(said.get("origin"), "static_map.origin", 3)
    occupied = unpack("static_map.occupied", said.get("occupied"), "bool", (None, None))
    if not occupied.size:
        raise CertificateError("static_map.occupied holds no cell")
    return Cells(occupied, _number(said, "resolution", above=0), (x, y, yaw))


def _mapping(said: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    value = said.get(name)
    if not isinstance(value, Mapping):
        raise CertificateError(f"{name} is missing")
    return value


def _list(said: Mapping[str, Any], name: str) -> list[Any]:
    value = said.get(name)
    if not isinstance(value, list):
        raise CertificateError(f"{name} is missing")
    return value


def _number(
    said: Mapping[str, Any], name: str, *, least: float = -math.inf, above: float = -math.inf
) -> float:
    (value,) = _numbers([said.get(name)], name, 1)
    if value < least or value <= above:
        rule = f">= {least:g}" if least > -math.inf else f"> {above:g}"
        raise CertificateError(f"{name} = {value!r} must be {rule}")
    return value


def _numbers(value: Any, name: str, count: int) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != count:
        raise CertificateError(f"{name} must be {count} numbers; it is {value!r}")
    for one in value:
        if isinstance(one, bool) or not isinstance(one, (int, float)) or not math.isfinite(one):
            raise CertificateError(f"{name} must be finite; it is {one!r}")
    return tuple(float(one) for one in value)


def _finite(said: Mapping[str, Any], name: str, shape: tuple[int | None, ...]) -> np.ndarray:
    array = unpack(name, said.get(name), "float64", shape)
    if not np.isfinite(array).all():
        raise CertificateError(f"{name} holds a number that is not finite")
    return array
