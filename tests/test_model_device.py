"""A model whose arrays stay where the kernels run is the model that a CPU makes."""

import math

import numpy as np
import pytest
from oracle import exact
from oracle.cases import random_case
from oracle.worlds import random_scans

from passpmp_ti import DifferentialDrive, FutureModel, Navigator, Settings, device
from passpmp_ti.grid import memory


def arrays(model):
    """All that kernels read of a model, as bytes."""
    kept = (model.ticks, model.spans, model.seen_cells, model.marks, model.counts)
    return [device.host(array).tobytes() for array in kept]


def chain(case, later):
    """Three models, each with the memory of the one before."""
    models = [case.model()]
    for scans, position in later:
        models.append(
            FutureModel.from_scan(
                scans, case.robot, case.settings, models[-1], case.static_map, position=position
            )
        )
    return models


@pytest.mark.parametrize("seed", range(12))
def test_models_on_a_device_equal_those_of_the_host_byte_for_byte(seed):
    generator = np.random.default_rng(seed)
    case = random_case(generator)
    later = []
    for k in range(2):
        x, y, theta = case.position
        position = (x + 0.11 * (k + 1), y - 0.07 * (k + 1), theta + 0.1 * k)
        # the world moves on with the robot at times: premises break
        stamp = case.scans[0].stamp + 0.1 * (k + 1)
        seen_from = case.position if seed % 2 else position
        scans = random_scans(
            generator, case.world, seen_from, case.settings, 1.0, case.robot, stamp, beams=360
        )
        later.append((scans, position))
    on_host = chain(case, later)
    with device.forced():
        on_device = chain(case, later)
        assert not isinstance(on_device[-1].ticks, np.ndarray)
        assert not isinstance(on_device[-1].marks, np.ndarray)
    for ours, theirs in zip(on_device, on_host, strict=True):
        assert arrays(ours) == arrays(theirs)
        assert ours.broken_premises.tobytes() == theirs.broken_premises.tobytes()
        for name in ("seen", "sources", "standing_sources", "static", "movable"):
            assert (getattr(ours, name) == getattr(theirs, name)).all()
        assert (ours.layer(2) == theirs.layer(2)).all()


def test_intruders_cap_memory_on_a_device_as_on_the_host():
    case = random_case(np.random.default_rng(3))
    model = case.model()
    broken = np.array([case.position[:2]]) + 0.8
    with device.forced():
        capped = memory.without_intruders(case.model(), broken, 100, 0.4, case.settings)
    expected = memory.without_intruders(model, broken, 100, 0.4, case.settings)
    assert device.host(capped).tobytes() == expected.tobytes()
    assert (expected < model.ticks).any()


def test_a_cycle_on_a_device_brings_no_map_to_the_host(monkeypatch):
    robot = DifferentialDrive()
    settings = Settings.for_robot(robot, object_speed=0.5, cell=0.1, capacity=200, particles=20)
    world = exact.world_of([exact.box(2.0, 1.5, 0.5, 0.5)], [(1.5, -1.5, 0.3)])
    brought = []

    def host(array, plainly=device.host):
        if not isinstance(array, np.ndarray):
            brought.append(array.shape)
        return plainly(array)

    with device.forced():
        navigator, state = Navigator(robot, settings, (5.0, 0.0)), np.zeros(5)
        for k in range(4):
            if k == 2:
                monkeypatch.setattr(device, "host", host)
            pose = tuple(float(v) for v in state[:3])
            scan = exact.sweep(world, pose, 360, 2 * np.pi, 6.0, 0.1 * k, labelled=True)
            plan = navigator.update(scan, state)
            assert not navigator.record.fault
            state = plan.at(0.1 * (k + 1))
    assert navigator.record.tree_nodes > 100
    assert navigator.model.shape == (128, 128)
    # flags of returns, samples of a plan, leaves of particles
    assert max(math.prod(shape) for shape in brought) <= 1000
