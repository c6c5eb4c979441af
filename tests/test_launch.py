"""Launches past Taichi's checks do what its own do."""

import numpy as np
import pytest
import taichi as ti

from passpmp_ti import device
from passpmp_ti.launch import Launch


@ti.kernel
def scaled(
    twice: ti.template(),
    values: ti.types.ndarray(dtype=ti.f32, ndim=1),
    offset: ti.i32,
    out: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    for n in range(values.shape[0]):
        out[n] = values[n] + offset
        if ti.static(twice):
            out[n] *= 2.0


def of(launch, values, offset, twice=False):
    out = device.empty(values.shape, np.float32)
    launch(twice, device.put(values), offset, out)
    return list(device.host(out))


def test_every_launch_has_the_arguments_that_it_is_given():
    launch = Launch(scaled, 1)
    for n in (3, 5, 2):
        values = np.arange(n, dtype=np.float32)
        assert of(launch, values, 0) == list(values)
        assert of(launch, values, -4) == list(values - 4)
        assert of(launch, values, 1, True) == list(2 * values + 2)
    assert len(launch._compiled) == 2
    assert all(launch._compiled.values())


def test_arrays_apart_from_the_host_go_taichis_way():
    launch = Launch(scaled, 1)
    with device.forced():
        assert of(launch, np.ones(3, dtype=np.float32), 1) == [2, 2, 2]
    assert not launch._compiled


def test_what_taichi_refuses_is_refused():
    launch = Launch(scaled, 1)
    values = np.ones(4, dtype=np.float32)
    assert of(launch, values, 1) == [2, 2, 2, 2]
    with pytest.raises(ValueError, match="contiguous"):
        launch(False, np.ones(8, dtype=np.float32)[::2], 1, values)
    with pytest.raises(Exception, match=r"argument|type|dtype"):
        launch(False, np.ones(4), 1, values)
    with pytest.raises(Exception, match=r"argument|type|dim"):
        launch(False, np.ones((2, 2), dtype=np.float32), 1, values)


def test_a_taichi_that_is_not_known_launches_itself():
    called = []
    launch = Launch(lambda *a: called.append(a), 1)
    for _ in range(2):
        launch(False, np.ones(1, dtype=np.float32), 1)
    assert len(called) == 2
