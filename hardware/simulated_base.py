"""A base that is none: wheels with a lag, slip, noise, and a watchdog of their own."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hardware.base import BaseLimits, Odometry, twist_of
from passpmp_ti import door

STEP = 2e-3
"""[s]; it moves in steps of this."""
LONGEST_NAP = 2.0
"""[s]; what is at rest and was told nothing for longer has not moved since."""
FAULTS = ("silent", "nan", "frozen", "jump", "deaf")


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseNature:
    """How a simulated base differs from one that obeys at once."""

    limits: BaseLimits = field(default_factory=BaseLimits)
    lag: float = 0.05
    """Time constant of the wheels' first-order answer [s]."""
    slip: float = 0.0
    """Greatest share by which a wheel's way over ground differs from its turning, either way."""
    slip_time: float = 0.1
    """Time for which a slip lasts [s]."""
    pose_noise: float = 0.0
    """Standard deviation of x and of y as they are told [m]."""
    heading_noise: float = 0.0
    """Of the heading [rad]."""
    speed_noise: float = 0.0
    """Of the wheels' speeds [m/s]."""
    period: float = 0.01
    """Time from one odometry to the next [s]."""

    def __post_init__(self) -> None:
        name = "BaseNature"
        for positive in ("lag", "slip_time", "period"):
            door.finite(name, positive, getattr(self, positive), least=STEP, unit="s")
        door.finite(name, "slip", self.slip, least=0.0, most=0.9)
        for least_0 in ("pose_noise", "heading_noise", "speed_noise"):
            door.finite(name, least_0, getattr(self, least_0), least=0.0)


class SimulatedBase:
    """A `Base` of plain kinematics. It moves whenever it is called, up to the clock's time."""

    def __init__(
        self,
        nature: BaseNature | None = None,
        *,
        rng: np.random.Generator,
        pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
        clock: Callable[[], float] = time.monotonic,
        log: Callable[[Odometry], None] | None = None,
    ) -> None:
        """
        Args:
            nature: how it answers.
            rng: decides noise and slip.
            pose: where it stands at first (x, y, theta) [m, m, rad].
            clock: seconds that never go back.
            log: told the truth whenever odometry is due.
        """
        self.nature = BaseNature() if nature is None else nature
        self._rng = rng
        self._clock = clock
        self._log = log
        self._now = clock()
        self._pose = list(pose)
        self._wheels = [0.0, 0.0]
        self._wanted = (0.0, 0.0)
        self._told_at = -math.inf
        self._stopped = False
        self._fault = ""
        self._slip = (1.0, 1.0)
        self._slip_until = -math.inf
        self._told: Odometry | None = None
        self._due = self._now
        self.refused = 0
        """Commands with a number that is none."""

    @property
    def limits(self) -> BaseLimits:
        return self.nature.limits

    @property
    def truth(self) -> Odometry:
        """Where it is and how fast it goes, without noise and faults."""
        self.advance()
        return self._truth()

    def drive(self, right: float, left: float) -> None:
        self.advance()
        if not (math.isfinite(right) and math.isfinite(left)):
            self.refused += 1
            return
        most = self.limits.wheel_speed
        if self._fault == "deaf":
            self._told_at = self._now
            return
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

    def inject(self, fault: str) -> None:
        """From now on: "silent": no odometry comes; "nan": its numbers are none; "frozen": it
        shows the same place with new stamps; "jump": its place is 1 m off; "deaf": its wheels
        go on as they were told last, until it is told to stop; "": none of these."""
        if fault:
            door.choice("SimulatedBase", "fault", fault, FAULTS)
        self.advance()
        self._fault = fault

    def advance(self) -> None:
        """Move up to now."""
        now = self._clock()
        still = self._wheels == [0.0, 0.0] and (self._stopped or self._silent(self._now))
        if still and now - self._now > LONGEST_NAP:
            self._now = self._due = now - LONGEST_NAP
        while self._now + STEP <= now:
            self._move()
            self._now += STEP
            if self._now >= self._due:
                self._measure()
                self._due += self.nature.period

    def _silent(self, now: float) -> bool:
        return now - self._told_at > self.limits.command_timeout

    def _move(self) -> None:
        n = self.nature
        braking = self._stopped or self._silent(self._now)
        if self._now >= self._slip_until and n.slip > 0.0:
            right, left = self._rng.uniform(1 - n.slip, 1 + n.slip, 2).tolist()
            self._slip = (right, left)
            self._slip_until = self._now + n.slip_time
        most = n.limits.acceleration * STEP
        for i in (0, 1):
            wanted = 0.0 if braking else self._wanted[i]
            # who brakes by himself does it by brakes, not by a speed loop
            change = wanted - self._wheels[i]
            change *= 1.0 if braking else STEP / n.lag
            self._wheels[i] += max(-most, min(most, change))
        speed, turn = twist_of(
            self._wheels[0] * self._slip[0], self._wheels[1] * self._slip[1], n.limits.track
        )
        middle = self._pose[2] + 0.5 * turn * STEP
        self._pose[0] += speed * math.cos(middle) * STEP
        self._pose[1] += speed * math.sin(middle) * STEP
        self._pose[2] += turn * STEP

    def _truth(self) -> Odometry:
        return Odometry(self._now, *self._pose, *self._wheels)

    def _measure(self) -> None:
        truth, n = self._truth(), self.nature
        if self._log is not None:
            self._log(truth)
        if self._fault == "silent":
            return
        if self._fault == "nan":
            self._told = truth._replace(x=math.nan, right=math.nan)
            return
        if self._fault == "frozen" and self._told is not None:
            self._told = self._told._replace(stamp=self._now)
            return
        scales = (n.pose_noise, n.pose_noise, n.heading_noise, n.speed_noise, n.speed_noise)
        noise = self._rng.normal(0.0, 1.0, 5) * scales
        noisy = [value + float(e) for value, e in zip(truth[1:], noise, strict=True)]
        if self._fault == "jump":
            noisy[0] += 1.0
        self._told = Odometry(self._now, *noisy)


def build(
    *, seed: int = 0, pose: tuple[float, float, float] = (0.0, 0.0, 0.0), **nature: Any
) -> SimulatedBase:
    """A base from plain numbers, as a configuration has them.

    Args:
        seed: of noise and slip.
        pose: where it stands at first.
        nature: fields of `BaseNature`; `limits` as a mapping of fields of `BaseLimits`.

    Raises:
        ValueError: a number out of its range.
    """
    if "limits" in nature:
        nature["limits"] = BaseLimits(**nature["limits"])
    rng = np.random.default_rng(seed)
    return SimulatedBase(BaseNature(**nature), rng=rng, pose=pose)
