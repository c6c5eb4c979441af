"""Drive a wheelchair through a world of one's own: two lines a cycle are the planner's.

The world is four people, discs that walk straight on at no more than the speed that the planner
was told. Replace `sweep` by a range finder and `executing.at` by a base, and this is a robot.
"""

from __future__ import annotations

import numpy as np

import passpmp_ti as pti

RADIUS = 0.25
PLACES = np.array([[3.0, 1.2], [5.0, -2.0], [7.0, 2.5], [1.5, -4.0]])
VELOCITIES = np.array([[-0.6, 0.0], [0.0, 0.5], [-0.3, -0.7], [0.4, 0.6]])  # all below 0.8 m/s
GOAL = (8.0, 0.0)


def people(time: float) -> np.ndarray:
    """[4, 2] where they are at `time` [s]."""
    return PLACES + VELOCITIES * time


def sweep(state: np.ndarray, time: float) -> pti.Scan:
    """A full turn of 720 beams that reach 10 m."""
    bearings = -np.pi + np.arange(720) * np.pi / 360
    rays = np.stack([np.cos(bearings + state[2]), np.sin(bearings + state[2])], axis=1)
    ranges = np.full(720, np.inf)
    for centre in people(time) - state[:2]:
        ahead, aside = rays @ centre, rays[:, 0] * centre[1] - rays[:, 1] * centre[0]
        hit = (ahead > 0) & (np.abs(aside) < RADIUS)
        ranges[hit] = np.minimum(ranges[hit], ahead[hit] - np.sqrt(RADIUS**2 - aside[hit] ** 2))
    return pti.Scan(ranges, bearings[0], np.pi / 360, 10.0, tuple(state[:3]), time)


def main() -> None:
    pti.init()
    robot = pti.DifferentialDrive(wheel_speed=2.0)
    settings = pti.Settings.for_robot(robot, object_speed=0.8)
    navigator = pti.Navigator(robot, settings, GOAL)
    state, time, nearest = np.zeros(5), 0.0, np.inf
    executing = None
    while not navigator.reached and time < 60.0:
        # answer is what to follow from time + cycle on; until then the robot follows the one before
        answer = navigator.update(sweep(state, time), state)
        if executing is None:
            executing = pti.Trajectory.resting(state, time)
        if round(time / settings.cycle) % 10 == 0:
            record = navigator.record
            print(
                f"t {time:4.1f} s  x {state[0]:5.2f} m  y {state[1]:5.2f} m "
                f" {robot.speed(state):5.2f} m/s  {record.decision:7}"
                f" {record.tree_nodes:5d} nodes  {1e3 * record.timings['total']:4.0f} ms"
            )
        for moment in np.linspace(time, time + settings.cycle, 11):
            there = executing.at(moment)
            gap = np.hypot(*(people(moment) - there[:2]).T).min() - RADIUS - robot.radius
            if not robot.at_rest(there):
                nearest = min(nearest, gap)
        time += settings.cycle
        state = executing.at(time)
        executing = answer
    where = "reached the goal" if navigator.reached else "did not reach the goal"
    print(f"{where} after {time:.1f} s; nearest to anybody while moving: {nearest:.2f} m")


if __name__ == "__main__":
    main()
