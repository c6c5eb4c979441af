"""What one backend makes of saved inputs: `python on_backend.py BACKEND FOLDER`.

Each NAME.in.npz there is answered by a NAME.out.npz. A process has one backend, so each is asked in
a process of its own; imported, it is the same computation on the backend that runs already.
"""

import contextlib
import sys
from pathlib import Path

import numpy as np

import passpmp_ti as pti
from passpmp_ti import device
from passpmp_ti.planner.guide import Guide
from passpmp_ti.planner.tree import TreeGrower

MARGIN = 1e-3
"""What the clearance holds for single precision [m], see `settings.integration_margin`."""
TRACKING = 0.01
"""[m] so that the clearance can be a margin less as well as more."""
CYCLES = 3
APART = "apart"
"""The CPU, but with arrays that the host cannot read in place."""


def robot_of(inputs):
    return pti.CarLike() if str(inputs["robot"]) == "car" else pti.DifferentialDrive()


def settings_of(inputs, more=0.0):
    """Settings with `more` clearance [m]."""
    robot = robot_of(inputs)
    return pti.Settings.for_robot(
        robot, object_speed=float(inputs["object_speed"]), capacity=2000, particles=20,
        iterations=20, tracking_error=TRACKING + more,
    )  # fmt: skip


def scan_of(inputs, k=0):
    """The scan of cycle k; the world stands still."""
    return pti.Scan(
        inputs["ranges"], angle_min=float(inputs["angle_min"]),
        angle_increment=float(inputs["angle_increment"]), range_max=float(inputs["range_max"]),
        pose=(0.0, 0.0, 0.0), stamp=k * settings_of(inputs).cycle, moving=inputs["moving"],
    )  # fmt: skip


def model_of(inputs, more=0.0):
    return pti.FutureModel.from_scan(scan_of(inputs), robot_of(inputs), settings_of(inputs, more))


def carried_out(inputs):
    """Everything that is compared: arrays by name."""
    robot, settings = robot_of(inputs), settings_of(inputs)
    model = model_of(inputs)
    goal = tuple(float(v) for v in inputs["goal"])
    rest = np.zeros(5)
    guide = Guide(
        robot, settings, (0.0, 0.0), [goal], model.window.anchor, model.window.inner_radius, None
    ).field(model, goal, rest[:2])
    tree = TreeGrower(robot, settings).grow(model, guide, rest, settings.cycle, -1).on_host()
    navigator = pti.Navigator(robot, settings, goal)
    held = [navigator.update(scan_of(inputs, k), rest) for k in range(CYCLES)]
    return {
        "safe": model.passively_safe(inputs["states"], inputs["times"]),
        "ticks": device.host(model.ticks),
        "tree_states": tree.states,
        "tree_times": tree.times,
        "tree_parent": tree.parent,
        "plan_times": held[0].times,
        "plan_states": held[0].states,
        "decision": np.array([navigator.record.decision, navigator.record.fault]),
    }


if __name__ == "__main__":
    arch, folder = sys.argv[1], Path(sys.argv[2])
    pti.init("cpu" if arch == APART else arch)
    with device.forced() if arch == APART else contextlib.nullcontext():
        for file in sorted(folder.glob("*.in.npz")):
            with np.load(file) as saved:
                answer = carried_out(dict(saved))
            np.savez(folder / file.name.replace(".in.", ".out."), **answer)
