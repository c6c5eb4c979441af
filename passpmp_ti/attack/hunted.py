"""What movers know of the robot: where it is, what it holds, and where it would coast to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.robots import Robot
from passpmp_ti.sim.contacts import disc_centres
from passpmp_ti.trajectory import Trajectory

LOOK_AHEAD, PACE = 3.0, 0.1
"""How far ahead the robot's ways are told, and how finely [s]."""


@dataclass(frozen=True, kw_only=True)
class Ways:
    """The robot's ways as they are known in one cycle."""

    times: np.ndarray
    """[p] absolute [s]."""
    held: np.ndarray
    """[p, 2] along what the robot holds, to rest [m]."""
    coast: np.ndarray
    """[p, 2] if it went on instead of braking [m]: what it will do if the next plan allows."""


@dataclass(frozen=True, kw_only=True)
class Hunted:
    """The robot at one tick."""

    time: float
    state: np.ndarray
    """[5] the truth."""
    discs: np.ndarray
    """[d, 2] centres of its body's discs [m]."""
    radius: float
    """Of each disc [m]."""
    cover: float
    """Radius of the disc about the reference point that covers the body [m]."""
    speed: float
    """Of the reference point, signed [m/s]."""
    moving: bool
    still_for: float
    """For how long it has been at rest [s]."""
    ways: Ways


def ways_of(
    robot: Robot, now: float, switch: float, executing: Trajectory, answer: Trajectory
) -> Ways:
    """Where the robot goes: what it executes until `switch` [s], the planner's answer from then."""
    times = now + PACE * np.arange(round(LOOK_AHEAD / PACE) + 1)
    states = np.where((times < switch)[:, None], executing.sampled(times), answer.sampled(times))
    turn = float(answer.times[answer.brakes_from])
    last = answer.at(max(turn, now))
    speed = float(robot.speed(last))
    after = np.maximum(times - max(turn, now), 0.0)
    ahead = speed * np.array([np.cos(last[2]), np.sin(last[2])])
    coast = np.where((times <= turn)[:, None], states[:, :2], last[:2] + after[:, None] * ahead)
    return Ways(times=times, held=states[:, :2].copy(), coast=coast)


def hunted_at(
    robot: Robot, time: float, state: np.ndarray, moving: bool, still_for: float, ways: Ways
) -> Hunted:
    """The robot at `time` [s], truly in `state` [5]."""
    return Hunted(
        time=time,
        state=state,
        discs=disc_centres(robot, state[None])[0],
        radius=robot.disc_radius,
        cover=robot.radius,
        speed=float(robot.speed(state)),
        moving=moving,
        still_for=still_for,
        ways=ways,
    )
