"""Sweeps that were measured on the way, told as scans from one place.

A mirror takes 19 ms for a sweep; meanwhile the robot rolls and turns, and nobody knows exactly when
which beam was measured, or where the robot headed. A scan has one pose. So each beam tells the
least that any beam saw which may have looked along it: what is proven empty shrinks, by what the
robot really moved, and nothing of it is left to `Settings.localisation_error`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hardware.scip_client import ScipClient
from hardware.scip_receiver import Pose
from hardware.scip_settings import ScipSettings
from passpmp_ti import door
from passpmp_ti.scan import Scan

EDGE = 0.3
"""A beam that would tell so much less than it saw [m] looks past an edge: it is lost rather than
met by what it may not have met."""
OWN = 0.3
"""At both ends of a sweep all that is nearer than this is the robot's own body [m]."""
BELIEVED = 1.25
"""Wheels slip: the robot may roll and turn faster than they tell, by this factor."""
SPEED_ERROR = 0.05
"""And by this [m/s]: noise, and what changes within half a sweep."""


def bounds(right: float, left: float, track: float) -> tuple[float, float]:
    """How fast a robot may really roll [m/s] and turn [rad/s] whose wheels tell these speeds.

    Args:
        right: ground speed of the right wheel [m/s].
        left: of the left one [m/s].
        track: distance between them [m].
    """
    rolling = BELIEVED * 0.5 * abs(right + left) + SPEED_ERROR
    return rolling, (BELIEVED * abs(right - left) + SPEED_ERROR) / track


def steadied(scan: Scan, shift: float, turn: float) -> Scan:
    """What a sweep proves for a sensor that stands at the scan's pose.

    A place at distance s along a bearing was looked at from up to `shift` away: at a bearing that
    differs by `turn` and asin(shift / s), to a distance that differs by `shift`. Whatever beam may
    have looked there has its say. A step more, since what lies between two beams is known from
    both.

    Args:
        scan: of a sensor that moved.
        shift: greatest distance of the sensor from the scan's pose in the sweep [m].
        turn: greatest error of a beam's bearing, turning and error of heading together [rad].

    Returns:
        The scan with ranges that are never longer, `range_max` too: who met nothing looked no
        farther than that from where it was. Beams at both ends, past which nobody may have
        looked, are lost, and those that may have looked past an edge: a return there would stand
        where nothing stands. A scan of a whole turn has no ends.

    Raises:
        ValueError: a bound that is negative or no number, or a shift of `range_max` or more.
    """
    door.finite("steadied", "shift", shift, least=0.0, unit="m")
    door.finite("steadied", "turn", turn, least=0.0, unit="rad")
    lost = scan.lost
    nearer = np.where(lost, 0.0, np.maximum(scan.ranges - shift, 0.0))
    away = np.maximum(nearer, shift)
    sideways = np.arcsin(np.divide(shift, away, out=np.ones_like(away), where=away > 0))
    sideways[lost | (shift == 0.0)] = 0.0
    # up, and a step more: every rounding widens
    reach = np.ceil((turn + sideways) / scan.angle_increment).astype(np.int64) + 1
    beside = math.ceil((turn + math.asin(min(shift / OWN, 1.0))) / scan.angle_increment) + 1
    around = 0
    if abs(len(nearer) * scan.angle_increment - math.tau) <= scan.angle_increment:
        # first and last may look along one bearing: counted from one to the other, a step is lost
        reach, beside = reach + 1, beside + 1
        around = min(max(int(reach.max()), beside), len(nearer))
        nearer, reach, lost = (np.pad(each, around, "wrap") for each in (nearer, reach, lost))
    told = nearer.copy()
    for off in range(1, min(int(reach.max()), len(told) - 1) + 1):
        spread = np.where(reach >= off, nearer, np.inf)
        np.minimum(told[off:], spread[:-off], out=told[off:])
        np.minimum(told[:-off], spread[off:], out=told[:-off])
    # Among the beams about a lost one, what it would have told is never nearer than both that are
    # left: who spreads over it spreads over one of them as well.
    told[told < nearer - EDGE] = 0.0
    # Beams that are lost side by side may hide what no neighbour meets: places that only they
    # looked at lie beside them as the edge of the sweep lies beside its ends.
    wide = lost & (np.append(lost[1:], False) | np.append(False, lost[:-1]))
    about = np.convolve(wide, np.ones(2 * beside + 1))[beside : beside + len(told)]
    told[about > 0.5] = 0.0
    if around:
        told = told[around:-around]
    else:
        told[:beside] = told[-beside:] = 0.0
    return replace(scan, ranges=told, range_max=scan.range_max - shift)


def steadied_or_lost(scan: Scan, shift: float, turn: float) -> Scan:
    """`steadied`; a scan that proves nothing where a robot is told to move as none does: that is
    for the executor to judge, and must not end a planner."""
    if shift < scan.range_max and turn < math.pi:
        return steadied(scan, shift, turn)
    return replace(scan, ranges=np.full_like(scan.ranges, math.nan))


class SteadyClient(ScipClient):
    """A client whose scans are steadied by how the robot moved."""

    def __init__(
        self,
        settings: ScipSettings,
        *,
        state_at: Callable[[float], np.ndarray | None],
        pose_at: Callable[[float], Pose],
        track: float,
        arm: float,
        heading_error: float,
    ) -> None:
        """
        Args:
            settings: of the device.
            state_at: [5] the robot's state (x, y, theta, v_r, v_l) at a time; None: nobody knows.
            pose_at: the sensor's pose at a time.
            track: distance between the driven wheels [m].
            arm: of the sensor, about the point between these [m].
            heading_error: bound on the error of a told heading [rad].
        """
        super().__init__(settings, pose_at=pose_at)
        self._state_at, self._track = state_at, track
        self._arm, self._heading_error = arm, heading_error

    def read(self, timeout: float) -> Scan | None:
        scan = super().read(timeout)
        if scan is None:
            return None
        # no beam is measured farther from the pose's moment than this
        half = 0.5 * self.settings.stamp_error
        state = self._state_at(scan.stamp - half)
        if state is None:
            return replace(scan, ranges=np.full_like(scan.ranges, math.nan))
        rolling, turning = bounds(float(state[3]), float(state[4]), self._track)
        turn = half * turning + self._heading_error
        # a heading that is off has the sensor elsewhere too, on the end of its arm
        return steadied_or_lost(scan, half * rolling + turn * self._arm, turn)
