"""Where to run so as to meet somebody whose way is known: pure functions over arrays."""

from __future__ import annotations

import numpy as np


def shortfall(
    places: np.ndarray, speed: np.ndarray, reach: np.ndarray, way: np.ndarray, ahead: np.ndarray
) -> np.ndarray:
    """[m, p] how far short of the robot each disc would fall at each point of its way [m].

    Args:
        places: [m, 2] [m].
        speed: [m] [m/s].
        reach: [m] distance of centres at which they touch [m].
        way: [p, 2] where the robot will be [m].
        ahead: [p] how long until then [s], >= 0.
    """
    apart = places[:, None] - way[None]
    distance = np.sqrt((apart * apart).sum(axis=2))
    return distance - reach[:, None] - speed[:, None] * ahead[None]


def meeting(missing: np.ndarray) -> np.ndarray:
    """[m] index of the first point that each can reach in time; the nearest miss where none."""
    reached = missing <= 0
    return np.where(reached.any(axis=1), reached.argmax(axis=1), missing.argmin(axis=1))


def towards(places: np.ndarray, aims: np.ndarray, speed: np.ndarray, tick: float) -> np.ndarray:
    """[m, 2] velocities from places to aims [m, 2] that do not overshoot in a tick [m/s]."""
    gap = aims - places
    distance = np.sqrt((gap * gap).sum(axis=1))
    pace = np.minimum(speed, distance / tick)
    return gap * (pace / np.maximum(distance, 1e-12))[:, None]


def around(
    velocity: np.ndarray, places: np.ndarray, body: np.ndarray, keep: np.ndarray
) -> np.ndarray:
    """[m, 2] velocities that go round a disc at `body` [2] instead of into it [m/s].

    Args:
        velocity: [m, 2] where each wants to go [m/s].
        places: [m, 2] [m].
        body: [2] its centre [m].
        keep: [m] nearer than this nobody walks towards it [m].
    """
    gap = places - body
    apart = np.maximum(np.sqrt((gap * gap).sum(axis=1)), 1e-9)
    outward = gap / apart[:, None]
    inward = (velocity * outward).sum(axis=1) < 0
    side = np.stack([-outward[:, 1], outward[:, 0]], axis=1)
    sign = np.where((velocity * side).sum(axis=1) >= 0, 1.0, -1.0)
    pace = np.sqrt((velocity * velocity).sum(axis=1))
    turned = (0.98 * sign[:, None] * side + 0.199 * outward) * pace[:, None]
    return np.where(((apart < keep) & inward)[:, None], turned, velocity)
