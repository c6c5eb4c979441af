"""Where the robot is on what it follows, and where it will be a cycle later."""

from __future__ import annotations

import math

import numpy as np

from passpmp_ti.grid.body import to_poses, to_states
from passpmp_ti.grid.model import FutureModel
from passpmp_ti.planner.coast import UNCHANGED
from passpmp_ti.planner.tree import follow
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

POSE_SLACK = 1e-3
"""[m] beyond the declared errors at which a robot is no longer where its plan has it."""
TURN_SLACK = 0.02
"""The same for its heading [rad]."""
LONGEST_ROAD = 5.0
"""[s] for which it is remembered what was followed before the last answer."""


def allowed_gap(robot: Robot, settings: Settings) -> tuple[float, float]:
    """How far a robot may be from its plan, in place [m] and heading [rad], if nothing is wrong.

    No error of heading is declared: a robot that keeps within d of its plan is given d over its
    radius.
    """
    # between samples the true way leaves the straight one
    bend = robot.top_acceleration * settings.time_step**2 / 8
    apart = settings.tracking_error + settings.localisation_error + bend + POSE_SLACK
    return apart, TURN_SLACK + apart / robot.radius


def gap(held: Trajectory, state: np.ndarray, time: float) -> tuple[float, float]:
    """Distance [m] and angle [rad] between a state [5] and where `held` is at `time` [s]."""
    there = held.at(time)
    turn = math.remainder(float(state[2] - there[2]), 2 * math.pi)
    return math.hypot(state[0] - there[0], state[1] - there[1]), abs(turn)


def moments_on(
    held: Trajectory, state: np.ndarray, allowed: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Times [n] [s] at which `held` passes a state [5] within what is allowed; how far off [m].

    At most one between two samples, the nearest.
    """
    if len(held.times) == 1:
        apart, turn = gap(held, state, held.start)
        fits = apart <= allowed[0] and turn <= allowed[1]
        return (np.array([held.start]), np.array([apart])) if fits else (np.zeros(0), np.zeros(0))
    first, change = held.states[:-1], np.diff(held.states, axis=0)
    length2 = (change[:, :2] ** 2).sum(axis=1)
    along = ((state[:2] - first[:, :2]) * change[:, :2]).sum(axis=1)
    share = np.clip(along / np.where(length2 > 0, length2, 1.0), 0.0, 1.0)
    near = first + share[:, None] * change
    apart = np.hypot(*(near[:, :2] - state[:2]).T)
    turn = np.abs(np.mod(near[:, 2] - state[2] + math.pi, 2 * math.pi) - math.pi)
    fits = (apart <= allowed[0]) & (turn <= allowed[1])
    times = held.times[:-1] + share * np.diff(held.times)
    return times[fits], apart[fits]


def only_fits_now(
    held: Trajectory, state: np.ndarray, time: float, allowed: tuple[float, float], spare: float
) -> bool:
    """Whether the robot is where `held` has it at `time`, and at no time off by more than `spare`.

    If so the clock is right to within `spare` [s]: no other reading fits the place.
    """
    apart, turn = gap(held, state, time)
    if apart > allowed[0] or turn > allowed[1]:
        return False
    wide = (2 * allowed[0], 2 * allowed[1])
    apart, turn = gap(held, state, held.end)
    if apart <= wide[0] and turn <= wide[1]:
        return False  # there it stays: it may be any time
    times, _ = moments_on(held, state, wide)
    return bool((np.abs(times - time) <= spare).all())


def carried_on(
    model: FutureModel,
    road: Trajectory,
    state: np.ndarray,
    stamp: float,
    allowed: tuple[float, float],
    since: float,
) -> tuple[np.ndarray, Trajectory | None]:
    """Where a robot that is off its plan will be a cycle later, and the rest of its way from there.

    Until an answer comes the robot goes on as it does. Its wheels know nothing of a pose that
    jumped or of a clock that did: they do what it follows. So that motion is laid at the measured
    state, and the measured speeds change by what the planned ones change. From which moment of it:
    if the robot is on it, at its speed, where it was to be between the last scan and this one, then
    from there (it was the clock that jumped), else from `stamp`. Where even the speed does not fit,
    it keeps its measured speed and steering.

    Args:
        model: whose robot moves.
        road: what it follows.
        state: [5] as measured at `stamp`.
        stamp: t_k [s].
        allowed: `allowed_gap`.
        since: stamp of the last scan that was used [s].

    Returns:
        The state [5] at stamp + cycle; the rest of its motion from there on, ending at rest. None
        for that where it is not known that what was verified still goes on: the robot may have left
        its way by itself, or its speed does not fit.
    """
    robot, cycle = model.robot, model.settings.cycle
    times, apart = moments_on(road, state, allowed)
    late = (times >= since) & (times < stamp)
    times, apart = times[late], apart[late]
    spare = robot.deceleration * cycle
    now = robot.within_limits(state)
    for moment in [*times[np.argsort(apart, kind="stable")], stamp]:
        begin = road.at(moment)
        if abs(float(robot.speed(begin) - robot.speed(now))) <= spare:
            laid = _laid(road, float(moment), now, stamp)
            after = laid.at(stamp + cycle)
            after[3:] += now[3:] - begin[3:]
            # neither the planned way nor its own can be longer than this
            ways = float(abs(robot.speed(begin)) + abs(robot.speed(now))) + 2 * spare
            slip = allowed[0] + ways * max(stamp - since, cycle)
            goes_on = moment < stamp or gap(road, state, stamp)[0] > slip
            rest = _rest_of(laid, stamp + cycle) if goes_on else None
            return robot.within_limits(after), rest
    pose = to_poses(now[None], model.window.anchor)[0]
    steps = model.settings.steps_of(cycle)
    coasted = follow(model, pose, [(UNCHANGED, steps)])[-1:]
    return to_states(coasted, model.window.anchor)[0], None


def stitched(road: Trajectory, after: Trajectory) -> Trajectory:
    """What is followed before an answer begins, then the answer: late scans speak of both."""
    if after.start <= road.start:
        return after
    recent = (road.times < after.start - 1e-9) & (road.times > after.start - LONGEST_ROAD)
    edge = max(road.start, after.start - LONGEST_ROAD)
    times = np.concatenate([[edge], road.times[recent & (road.times > edge)]])
    return Trajectory(
        np.concatenate([times, after.times]),
        np.concatenate([road.sampled(times), after.states]),
        len(times) + after.brakes_from,
    )


def _laid(road: Trajectory, moment: float, state: np.ndarray, stamp: float) -> Trajectory:
    """The road from `moment` on, moved and turned to begin at `state` at `stamp`."""
    later = road.times > moment + 1e-9
    times = np.concatenate([[moment], road.times[later]])
    begin, states = road.at(moment), road.sampled(times)
    turn = float(state[2] - begin[2])
    c, s = math.cos(turn), math.sin(turn)
    dx, dy = states[:, 0] - begin[0], states[:, 1] - begin[1]
    laid = states.copy()
    laid[:, 0] = state[0] + c * dx - s * dy
    laid[:, 1] = state[1] + s * dx + c * dy
    laid[:, 2] += turn
    return Trajectory(times - moment + stamp, laid, max(road.brakes_from - int((~later).sum()), 0))


def _rest_of(road: Trajectory, start: float) -> Trajectory:
    """The road from `start` on."""
    later = road.times > start + 1e-9
    return Trajectory(
        np.concatenate([[start], road.times[later]]),
        np.concatenate([road.at(start)[None], road.states[later]]),
        max(road.brakes_from - int((~later).sum()) + 1, 0) if later.any() else 0,
    )
