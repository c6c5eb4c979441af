"""Whether a robot can move as a trajectory says, and where its discs then are."""

from __future__ import annotations

import numpy as np

from passpmp_verify.robot import HEADING_ROUNDING, POSITION_ROUNDING, SPEED_ROUNDING, Robot

SHORTEST = 0.999e-3
"""[s] between samples: rounding that is allowed at every sample must not add up to a motion."""


def faults(
    robot: Robot, times: np.ndarray, states: np.ndarray, brakes_from: int
) -> list[tuple[float, str]]:
    """What a trajectory cannot do or lacks: (time [s], what), the first of each kind.

    Between two samples speeds and steering are taken to change at one pace. Headings and
    positions must then agree with the equations of motion to within single precision, the
    integration rule's own error and, for a car, a steering angle that meets its limit.
    """
    found: list[tuple[float, str]] = []
    dt = np.diff(times)
    if (dt < SHORTEST).any():
        early = times[1:][dt < SHORTEST]
        return [(float(early[0]), f"a sample is no {SHORTEST * 1000:g} ms after the one before")]

    def note(bad: np.ndarray, at: np.ndarray, what: str) -> None:
        if bad.any():
            found.append((float(at[np.argmax(bad)]), what))

    own = states[:, 3:5]
    low, high = np.array(robot.limits).T
    beyond = np.any((own < low - SPEED_ROUNDING) | (own > high + SPEED_ROUNDING), axis=1)
    note(beyond, times, "the state is beyond the robot's limits")
    change = np.abs(np.diff(own, axis=0))
    jumps = np.any(change > np.array(robot.rates) * dt[:, None] + SPEED_ROUNDING, axis=1)
    note(jumps, times[:-1], "the robot cannot change its speed or steering so fast")

    rate = robot.turn_rate(states)
    turn = np.diff(states[:, 2])
    # the mean of the ends, and Simpson's rule for what lies between them
    middle = 0.5 * (states[1:] + states[:-1])
    mean = (rate[1:] + rate[:-1] + 4 * robot.turn_rate(middle)) / 6
    doubt = HEADING_ROUNDING + robot.heading_doubt(states, dt)
    doubt += robot.turn_acceleration(states, dt) * SPEED_ROUNDING
    off = np.abs(turn - mean * dt)
    note(off > doubt, times[:-1], "its heading does not follow from its speeds")

    speed = robot.speed(states)
    way = 0.5 * (speed[1:] + speed[:-1]) * dt
    heading = states[:-1, 2] + 0.5 * turn
    step = np.stack([way * np.cos(heading), way * np.sin(heading)], axis=1)
    off = np.hypot(*(np.diff(states[:, :2], axis=0) - step).T)
    allowed = POSITION_ROUNDING + np.abs(way) * turn**2 / 12 + np.abs(way) * doubt
    allowed += robot.rates[0] * np.abs(turn) * dt**2 / 12
    note(off > allowed, times[:-1], "its place does not follow from its speed and heading")

    tail = np.abs(robot.braking_inputs(states[brakes_from:]))
    faster = np.any(np.diff(tail, axis=0) > SPEED_ROUNDING, axis=1)
    note(faster, times[brakes_from:], "its braking tail speeds up")
    if not robot.at_rest(states[-1:])[0]:
        found.append((float(times[-1]), "it does not end at rest"))
    return sorted(found)


class Spans:
    """Ways of disc centres, each along a straight line at constant pace. All [n]."""

    def __init__(
        self,
        start: np.ndarray,
        end: np.ndarray,
        since: np.ndarray,
        until: np.ndarray,
        need: np.ndarray,
        disc: np.ndarray,
    ) -> None:
        self.start, self.end = start, end
        """[n, 2] [m]"""
        self.since, self.until = since, until
        """absolute [s]"""
        self.need = need
        """radius that must be free about the line [m]"""
        self.disc = disc
        """which disc of the body"""

    def __len__(self) -> int:
        return len(self.since)

    @property
    def middle(self) -> np.ndarray:
        """[n, 2] [m]"""
        return 0.5 * (self.start + self.end)

    @property
    def time(self) -> np.ndarray:
        """[n] in the middle [s]"""
        return 0.5 * (self.since + self.until)

    @property
    def pace(self) -> np.ndarray:
        """[n] [m/s]"""
        return np.hypot(*(self.end - self.start).T) / (self.until - self.since)

    def take(self, index: np.ndarray) -> Spans:
        """Some of them."""
        return Spans(
            self.start[index], self.end[index], self.since[index], self.until[index],
            self.need[index], self.disc[index],
        )  # fmt: skip

    def halves(self) -> Spans:
        """Each cut in its middle."""
        p, t = self.middle, self.time
        return joined(
            [
                Spans(self.start, p, self.since, t, self.need, self.disc),
                Spans(p, self.end, t, self.until, self.need, self.disc),
            ]
        )


def joined(parts: list[Spans]) -> Spans:
    """All spans of several."""
    return Spans(
        np.concatenate([p.start for p in parts]).reshape(-1, 2),
        np.concatenate([p.end for p in parts]).reshape(-1, 2),
        *(
            np.concatenate([getattr(p, name) for p in parts])
            for name in ("since", "until", "need", "disc")
        ),
    )


def spans_of(
    robot: Robot, times: np.ndarray, states: np.ndarray, begin: float, margin: float
) -> Spans:
    """Where the discs of the body are from `begin` [s] on, while the robot moves.

    A robot at rest asks for nothing. Samples are connected by straight lines; `need` holds the
    disc's radius, `margin` [m], and how far the true way may be from the line.
    """
    dt = np.diff(times)
    rest = robot.at_rest(states)
    stands = rest[1:] & rest[:-1] & ~np.diff(states[:, :3], axis=0).any(axis=1)
    moves = np.flatnonzero(~stands & (times[1:] > begin + 1e-9))
    parts = []
    for k, (offset, radius) in enumerate(robot.discs):
        x = states[:, 0] + offset * np.cos(states[:, 2])
        y = states[:, 1] + offset * np.sin(states[:, 2])
        p = np.stack([x, y], axis=1)
        need = radius + margin + robot.wobble(states, dt, float(offset))[moves]
        since = np.maximum(times[moves], begin)
        share = ((since - times[moves]) / dt[moves])[:, None]
        start = p[moves] + share * (p[moves + 1] - p[moves])
        disc = np.full(len(moves), k)
        parts.append(Spans(start, p[moves + 1], since, times[moves + 1], need, disc))
    return joined(parts)
