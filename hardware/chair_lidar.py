"""A range finder on a chair in MuJoCo: rays cast slice by slice, as a mirror turns."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from hardware.chair_model import (
    FLOOR_GROUP,
    LIDAR_HEIGHT,
    PEOPLE_GROUP,
    WALL_GROUP,
    WHEEL_RADIUS,
)
from hardware.mujoco_chair import MujocoChair
from hardware.scip_sweep import UST_10LX, Parameters
from passpmp_ti import door

LIDAR_NOISE = 0.01
"""Standard deviation of a range, cut at three of them [m]."""
SLICES = 18
"""Of a sweep; the chair and all people stand still for each, 1.04 ms of a UST-10LX's 18.75."""


class ChairLidar:
    """What an emulated device is shown: call it with the time at which a sweep begins.

    Walls, people and the floor are seen, the chair's own body is not. It sits on the chair's body
    and leans with it.
    """

    def __init__(
        self,
        chair: MujocoChair,
        mount: tuple[float, float, float],
        rng: np.random.Generator,
        *,
        noise: float = LIDAR_NOISE,
        parameters: Parameters = UST_10LX,
    ) -> None:
        """
        Args:
            chair: on which it sits.
            mount: (x, y, theta) on it [m, m, rad].
            rng: draws the errors.
            noise: standard deviation of a range; cut at three of them [m].
            parameters: of the device.
        """
        self._noise = door.finite("ChairLidar", "noise", noise, least=0.0, unit="m")
        self._chair, self._rng, self._parameters = chair, rng, parameters
        self._data = mujoco.MjData(chair.model)
        self._body = chair.model.body("chair").id
        steps = np.arange(parameters.first, parameters.last + 1)
        bearings = mount[2] + (steps - parameters.front) * (2 * math.pi / parameters.steps_per_turn)
        self._rays = np.stack([np.cos(bearings), np.sin(bearings), np.zeros(len(steps))], axis=1)
        self._mount = np.array([mount[0], mount[1], LIDAR_HEIGHT - WHEEL_RADIUS])
        self._parts = np.array_split(np.arange(len(steps)), SLICES)
        middles = [0.5 * (steps[part[0]] + steps[part[-1]]) for part in self._parts]
        self._after = np.array([parameters.after(middle) for middle in middles])
        self._seen = np.zeros(6, dtype=np.uint8)
        self._seen[[FLOOR_GROUP, WALL_GROUP, PEOPLE_GROUP]] = 1

    def __call__(self, begin: float) -> np.ndarray:
        """[steps] ranges [m]; `inf`: nothing; `nan`, all of them: the chair does not move on."""
        times = begin + self._after
        poses = self._chair.poses(times)
        count = len(self._rays)
        if poses is None:
            return np.full(count, np.nan)
        ranges = np.empty(count)
        for part, when, qpos in zip(self._parts, times, poses, strict=True):
            ranges[part] = self._cast(self._rays[part], float(when), qpos)
        far = self._parameters.farthest / 1000.0
        # a cutoff does not clip: what is beyond it may come back all the same
        hit = (ranges >= 0) & (ranges <= far)
        errors = np.clip(self._rng.normal(0.0, self._noise, count), -3 * self._noise, None)
        errors = np.minimum(errors, 3 * self._noise)
        # nothing is nearer than 0, and 0 would be a lost beam
        return np.where(hit, np.maximum(ranges + errors, 0.0) + 1e-9, np.inf)

    def _cast(self, rays: np.ndarray, when: float, qpos: np.ndarray) -> np.ndarray:
        model, data = self._chair.model, self._data
        data.qpos[:] = qpos
        self._chair.place_people(data, when)
        mujoco.mj_kinematics(model, data)
        turned = data.xmat[self._body].reshape(3, 3)
        place = data.xpos[self._body] + turned @ self._mount
        count = len(rays)
        met, distance = np.empty(count, dtype=np.int32), np.empty(count)
        mujoco.mj_multiRay(
            model, data, place, (rays @ turned.T).ravel(), self._seen, True, self._body, met,
            distance, None, count, self._parameters.farthest / 1000.0,
        )  # fmt: skip
        return distance
