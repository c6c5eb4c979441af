"""Plan one cycle on a scan made by hand: something 8 m away all round, somebody nearer."""

from __future__ import annotations

import numpy as np

import passpmp_ti as pti

pti.init()
robot = pti.DifferentialDrive()
settings = pti.Settings.for_robot(robot, object_speed=1.0, capacity=12_000)
bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
ranges = np.where(np.abs(bearings - 2.0) < 0.08, 4.0, 8.0)  # metres; all may move
scan = pti.Scan(ranges, bearings[0], np.pi / 360, range_max=10.0, pose=(0, 0, 0), stamp=0.0)
navigator = pti.Navigator(robot, settings, goal=(4.0, 0.0))
plan = navigator.update(scan, np.zeros(5))  # at rest at the origin: (x, y, theta, v_r, v_l)

tree = navigator.record.tree
safe = navigator.model.passively_safe(tree.states, tree.times)
away = np.hypot(*(plan.states[-1, :2] - navigator.goal))
print(
    f"{tree.count} nodes, {safe.sum()} of them p-safe, {len(tree.rejected)} primitives rejected;"
    f" the plan takes {plan.duration:.2f} s to rest and ends {away:.2f} m from the goal"
)
