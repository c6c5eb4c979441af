"""A GPU's safe sets are the CPU's, up to states within the margin for single precision.

Wherever a GPU is found, it is asked in a process of its own, and the CPU judges. The CPU in a
process of its own is asked as well, once as it is and once with arrays that the host cannot read in
place: that tries what this test is made of, and a GPU's ways without one.
"""

import functools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from oracle import on_backend
from oracle.on_backend import APART, MARGIN, model_of, robot_of

from passpmp_ti import CarLike, Trajectory, probe
from passpmp_ti.bench.scenes import car_scene, wheelchair_scene
from passpmp_ti.planner.plan import still_clear

ASKED = os.environ.get("PASSPMP_GPU", "cuda")
"""Which GPU backend; Vulkan and Metal only where they are named."""
STATES = 20_000
HOME = Path(on_backend.__file__).resolve().parents[2]
SCENES = {
    f"{robot} {name}": (robot, make, name)
    for robot, make in (("car", car_scene), ("wheelchair", wheelchair_scene))
    for name in ("crowded", "ring")
}


@pytest.fixture(scope="module", params=["cpu", APART, ASKED])
def arch(request):
    if request.param not in ("cpu", APART):
        if not probe.has_driver(request.param):
            pytest.skip(f"no GPU: no driver for {request.param} on this machine")
        reason = probe.trouble(request.param, again=True)
        if reason:
            pytest.skip(f"no GPU that works: {request.param}: {reason}")
    return request.param


@pytest.fixture(scope="module")
def every_input():
    return {name: given(robot, make(scene)) for name, (robot, make, scene) in SCENES.items()}


@pytest.fixture(scope="module", params=SCENES)
def scene(request):
    return request.param


@pytest.fixture(scope="module")
def inputs(every_input, scene):
    return every_input[scene]


def given(robot, scene):
    """What a backend is asked about a scene."""
    scan = scene.scan()
    states, times = drawn(scene)
    return {
        "robot": np.array(robot),
        # slow enough that a robot at rest has somewhere to go
        "object_speed": np.array(0.15 * scene.settings.object_speed),
        "ranges": scan.ranges,
        "moving": scan.moving,
        "angle_min": np.array(scan.angle_min),
        "angle_increment": np.array(scan.angle_increment),
        "range_max": np.array(scan.range_max),
        "goal": np.array([0.3 * scene.range_max, 0.1 * scene.range_max]),
        "states": states,
        "times": times,
    }


def drawn(scene):
    """States of a robot anywhere, at any speed, soon."""
    rng = np.random.default_rng(5)
    states = np.zeros((STATES, 5))
    states[:, :2] = rng.uniform(-0.6, 0.6, (STATES, 2)) * scene.range_max
    states[:, 2] = rng.uniform(-np.pi, np.pi, STATES)
    most = scene.robot.top_speed
    states[:, 3] = rng.uniform(0, most, STATES)
    if isinstance(scene.robot, CarLike):
        states[:, 4] = rng.uniform(-scene.robot.xi_max, scene.robot.xi_max, STATES)
    else:
        states[:, 4] = np.clip(states[:, 3] + rng.uniform(-0.2, 0.2, STATES) * most, 0, most)
    states = np.array([scene.robot.within_limits(s) for s in states])
    return states, rng.uniform(0.0, 2.0, STATES)


@pytest.fixture(scope="module")
def answers_of(every_input, tmp_path_factory):
    """backend -> answers: each is asked once, in whatever order tests come to ask."""
    return functools.cache(lambda arch: asked(arch, every_input, tmp_path_factory.mktemp(arch)))


def asked(arch, every_input, folder):
    """What a backend makes of all inputs, in one process."""
    for name, inputs in every_input.items():
        np.savez(folder / f"{name}.in.npz", **inputs)
    path = os.pathsep.join(p for p in (str(HOME), os.environ.get("PYTHONPATH")) if p)
    done = subprocess.run(
        [sys.executable, on_backend.__file__, arch, folder],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    answers = {}
    for name in every_input:
        with np.load(folder / f"{name}.out.npz") as saved:
            answers[name] = dict(saved)
    return answers


@pytest.fixture(scope="module")
def found(arch, answers_of, scene):
    return answers_of(arch)[scene]


@pytest.fixture(scope="module")
def bounds(inputs):
    """(a model of a margin more, a model of a margin less) on the CPU."""
    return model_of(inputs, MARGIN), model_of(inputs, -MARGIN)


def test_arrival_times_lie_between_those_of_a_margin_more_and_less(found, bounds):
    strict, lax = bounds
    assert (strict.ticks <= found["ticks"]).all()
    assert (found["ticks"] <= lax.ticks).all()


def test_no_state_is_called_safe_that_is_not_but_for_the_margin(found, bounds, inputs):
    lax = bounds[1].passively_safe(inputs["states"], inputs["times"])
    assert not (found["safe"] & ~lax).any()


def test_no_state_is_called_unsafe_that_is_safe_with_a_margin_more(found, bounds, inputs):
    strict = bounds[0].passively_safe(inputs["states"], inputs["times"])
    assert not (strict & ~found["safe"]).any()
    assert 0.02 < strict.mean() < 0.98


def test_every_node_of_its_tree_is_passively_safe(found, bounds, inputs):
    assert len(found["tree_times"]) > 10
    states = np.array([robot_of(inputs).within_limits(s) for s in found["tree_states"]])
    assert np.allclose(states, found["tree_states"], atol=1e-4)
    assert bounds[1].passively_safe(states, found["tree_times"]).all()


def test_its_plan_is_free_and_ends_at_rest(found, bounds, inputs):
    assert found["decision"][1] == ""
    plan = Trajectory(found["plan_times"], found["plan_states"], 0)
    assert len(plan.times) > 2
    assert still_clear(bounds[1], plan)
    assert robot_of(inputs).at_rest(plan.states[-1])


def test_the_cpu_gives_the_same_bytes_in_every_process(arch, found, inputs):
    if arch not in ("cpu", APART):
        pytest.skip("a GPU may round otherwise")
    here = on_backend.carried_out(inputs)
    for name, value in found.items():
        assert np.asarray(here[name]).tobytes() == value.tobytes(), name
