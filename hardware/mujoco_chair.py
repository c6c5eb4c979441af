"""A wheelchair in MuJoCo: a `Base` with mass, motors that take time, and wheels that slip."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np

from hardware.base import BaseLimits, Odometry, wheels_of
from hardware.chair_model import AWAY, TALL, TIME_STEP, WHEEL_RADIUS, ChairNature, mjcf
from passpmp_ti.sim.world import World

REMEMBERED = 0.5
"""For how long it is known where the chair was [s]; a range finder asks a sweep back."""
SETTLING = 0.5
"""It stands on its wheels for this long before anybody looks [s]."""
LONGEST_NAP = 2.0
"""[s] of physics that are made up for; what is older is left out."""


class Pose(NamedTuple):
    """The chair's body at one instant."""

    stamp: float
    """[s]."""
    qpos: np.ndarray
    """MuJoCo's coordinates."""


class SpeedLoop:
    """PID of one wheel: torque from the speed that it should have and the one that it has."""

    def __init__(self, gains: tuple[float, float, float], torque: float) -> None:
        """
        Args:
            gains: as `ChairNature.gains`.
            torque: greatest [N m].
        """
        self._gains, self._torque = gains, torque
        self._sum, self._last = 0.0, 0.0

    def step(self, wanted: float, speed: float, load: float) -> float:
        """The torque until the next step [N m].

        Args:
            wanted: [m/s].
            speed: [m/s].
            load: torque that is known to be needed [N m].
        """
        p, i, d = self._gains
        off = wanted - speed
        torque = load + p * off + i * self._sum + d * (off - self._last) / TIME_STEP
        self._last = off
        if abs(torque) < self._torque:
            # a motor at its limit winds nothing up
            self._sum += off * TIME_STEP
        if wanted == 0.0 and abs(speed) < 0.01:
            self._sum *= 0.98
        return max(-self._torque, min(self._torque, torque))


class MujocoChair:
    """A `Base` with physics. It moves whenever it is called, up to the clock's time.

    What it tells of its place is the truth and bounded noise: it stands for a localisation with
    that error. What it tells of its wheels is how they turn, which is not how it moves: they slip,
    and are not as large as it believes.
    """

    def __init__(
        self,
        world: World,
        nature: ChairNature | None = None,
        *,
        rng: np.random.Generator,
        pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
        begin: float = 0.0,
        clock: Callable[[], float] = time.monotonic,
        log: Callable[[Odometry], None] | None = None,
    ) -> None:
        """
        Args:
            world: what stands and who walks.
            nature: of the chair.
            rng: decides noise and slip.
            pose: where it stands at first (x, y, theta) [m, m, rad].
            begin: the world's time is this much ahead of the clock's [s].
            clock: seconds that never go back.
            log: told the truth whenever odometry is due; its wheels' speeds are those over ground.
        """
        self.nature = ChairNature() if nature is None else nature
        self.world = world
        self.begin = begin
        self.model = mujoco.MjModel.from_xml_string(mjcf(world, self.nature))
        self._data = mujoco.MjData(self.model)
        self._rng, self._clock, self._log = rng, clock, log
        self._chair = self.model.body("chair").id
        self._wheels = [self.model.joint(name).dofadr[0] for name in ("right", "left")]
        self._tyres = [self.model.geom(name).id for name in ("right", "left")]
        self._slip_until = -math.inf
        n = self.nature
        self._loops = [SpeedLoop(n.gains, n.torque) for _ in (0, 1)]
        self._setpoint = [0.0, 0.0]
        self._wanted = (0.0, 0.0)
        self._told_at = -math.inf
        self._stopped = False
        self._told: Odometry | None = None
        self.refused = 0
        """Commands with a number that is none."""
        self.silent = False
        """Whether it tells nothing new of where it is, as if its encoders' cable was pulled."""
        self._moved = threading.Condition()
        self._past: deque[Pose] = deque(maxlen=round(REMEMBERED / TIME_STEP))
        x, y, theta = pose
        self._data.qpos[:7] = [
            x, y, WHEEL_RADIUS, math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)
        ]  # fmt: skip
        for _ in range(round(SETTLING / TIME_STEP)):
            mujoco.mj_step(self.model, self._data)
        self._now = self._due = clock()
        self._past.append(Pose(self._now, self._data.qpos.copy()))

    @property
    def limits(self) -> BaseLimits:
        return self.nature.limits

    @property
    def truth(self) -> Odometry:
        """Where it is, and the speeds over ground of the points at which its wheels stand."""
        self.advance()
        return self._truth()

    @property
    def tilt(self) -> float:
        """How far it leans, in any direction [rad]."""
        return math.acos(max(-1.0, min(1.0, float(self._data.xmat[self._chair][8]))))

    def drive(self, right: float, left: float) -> None:
        self.advance()
        if not (math.isfinite(right) and math.isfinite(left)):
            self.refused += 1
            return
        most = self.limits.wheel_speed
        self._wanted = (max(-most, min(most, right)), max(-most, min(most, left)))
        self._told_at = self._now

    def odometry(self) -> Odometry | None:
        self.advance()
        return self._told

    def stop(self) -> None:
        self.advance()
        self._stopped = True

    def reset(self) -> None:
        self.advance()
        self._stopped = False
        self._wanted = (0.0, 0.0)

    def close(self) -> None:
        self.stop()

    def advance(self) -> None:
        """Move up to now."""
        now = self._clock()
        if now - self._now > LONGEST_NAP:
            self._now = self._due = now - LONGEST_NAP
        while self._now + TIME_STEP <= now:
            self._step()
            self._now += TIME_STEP
            with self._moved:
                self._past.append(Pose(self._now, self._data.qpos.copy()))
                self._moved.notify_all()
            if self._now >= self._due:
                self._measure()
                self._due += self.nature.period

    def poses(self, times: np.ndarray, patience: float = 1.0) -> list[np.ndarray] | None:
        """Where the chair was at times [n] [s], increasing: MuJoCo's coordinates for each.

        Waits until the last of them is past: a range finder that reads early would see a chair that
        is not yet where it will be. To be called from another thread than the chair's own.

        Args:
            times: of the last `REMEMBERED` seconds.
            patience: longest wait [s].

        Returns:
            None where the chair does not move on.
        """
        with self._moved:
            there = self._moved.wait_for(lambda: self._past[-1].stamp >= times[-1], patience)
            past = list(self._past)
        if not there:
            return None
        stamps = np.array([pose.stamp for pose in past])
        return [past[n].qpos for n in np.searchsorted(stamps, times).clip(0, len(past) - 1)]

    def place_people(self, data: mujoco.MjData, time: float) -> None:
        """Put the movers where they are at a time of the clock [s]."""
        when = time + self.begin
        movers = self.world.movers
        if len(movers.radius):
            data.mocap_pos[:, :2] = movers.at(when)
            data.mocap_pos[:, 2] = np.where(movers.present(when), TALL, AWAY)

    def _step(self) -> None:
        n, data = self.nature, self._data
        if self._now >= self._slip_until and n.slippery > 0.0:
            for tyre in self._tyres:
                grip = n.friction * (1.0 - n.slippery * self._rng.random())
                self.model.geom_friction[tyre, 0] = grip
            self._slip_until = self._now + n.slip_time
        braking = self._stopped or self._now - self._told_at > n.limits.command_timeout
        most = n.limits.acceleration * TIME_STEP
        for i in (0, 1):
            wanted = 0.0 if braking else self._wanted[i]
            change = max(-most, min(most, wanted - self._setpoint[i]))
            self._setpoint[i] += change
            speed = float(data.qvel[self._wheels[i]]) * WHEEL_RADIUS
            # half the chair on each wheel, as its electronics believe
            load = 0.5 * n.mass * WHEEL_RADIUS * change / TIME_STEP
            data.ctrl[i] = self._loops[i].step(self._setpoint[i], speed, load)
        mujoco.mj_step(self.model, data)

    def _truth(self) -> Odometry:
        x, y, _, w, qx, qy, qz = (float(v) for v in self._data.qpos[:7])
        theta = math.atan2(2 * (w * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
        vx, vy = (float(v) for v in self._data.qvel[:2])
        # sideways motion counts too: nothing that moves is called at rest
        along = vx * math.cos(theta) + vy * math.sin(theta)
        speed = math.copysign(math.hypot(vx, vy), along)
        right, left = wheels_of(speed, float(self._data.qvel[5]), self.limits.track)
        return Odometry(self._now, x, y, theta, right, left)

    def _measure(self) -> None:
        truth, n = self._truth(), self.nature
        if self._log is not None:
            self._log(truth)
        turning = [float(self._data.qvel[wheel]) * WHEEL_RADIUS for wheel in self._wheels]
        scales = (n.pose_noise, n.pose_noise, n.heading_noise, n.speed_noise, n.speed_noise)
        noise = np.clip(self._rng.normal(0.0, 1.0, 5), -3.0, 3.0) * scales
        if self.silent:
            return
        values = (truth.x, truth.y, truth.theta, *turning)
        told = [value + float(e) for value, e in zip(values, noise, strict=True)]
        self._told = Odometry(self._now, *told)
