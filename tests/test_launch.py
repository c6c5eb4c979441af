"""Launches that skip Taichi's way do what it does, and refuse what it refuses."""

import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import taichi as ti

from passpmp_ti import device
from passpmp_ti.kernels.launch import kernel

Values = ti.types.ndarray(dtype=ti.f32, ndim=1)
Doubles = ti.types.ndarray(dtype=ti.f64, ndim=1)
Pairs = ti.types.ndarray(dtype=ti.types.vector(2, ti.f32), ndim=1)


@kernel
def scaled(
    power: ti.template(), values: Values, factor: ti.f32, offset: ti.i32, seed: ti.u32, out: Values
):
    for n in range(values.shape[0]):
        result = values[n] * factor + offset + ti.cast(seed, ti.f32)
        for _ in ti.static(range(power - 1)):
            result *= values[n]
        out[n] = result


@kernel
def halved(values: Doubles, out: Doubles):
    for n in range(values.shape[0]):
        out[n] = values[n] / 2


@kernel
def counted(values: Values) -> ti.i32:
    total = 0
    ti.loop_config(serialize=True)
    for n in range(values.shape[0]):
        if values[n] > 0:
            total += 1
    return total


@kernel
def summed(pairs: Pairs) -> ti.i32:
    total = 0.0
    ti.loop_config(serialize=True)
    for n in range(pairs.shape[0]):
        total += pairs[n][0] + pairs[n][1]
    return ti.cast(total, ti.i32)


def values(count=5):
    return np.linspace(-1, 2, count, dtype=np.float32)


@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("count", [1, 5, 1000])
def test_later_launches_are_the_first_one_again(power, count):
    given = values(count)
    outs = [np.empty(count, dtype=np.float32) for _ in range(4)]
    for out in outs[:3]:
        scaled(power, given, 3.0, 2, 7, out)
    scaled.plain(power, given, 3.0, 2, 7, outs[3])
    assert all(out.tobytes() == outs[3].tobytes() for out in outs)
    assert outs[3] == pytest.approx((given * 3 + 9) * given ** (power - 1))


def test_arguments_are_those_of_each_launch():
    for shift in range(4):
        given, out = values(7) + shift, np.empty(7, dtype=np.float32)
        scaled(1, given, 0.5 * shift, -shift, shift, out)
        assert out == pytest.approx(given * 0.5 * shift)


def test_arrays_of_a_device_and_of_the_host_may_take_turns():
    given = values()
    there, back = ti.ndarray(ti.f32, 5), ti.ndarray(ti.f32, 5)
    there.from_numpy(given)
    for _ in range(3):
        out = np.empty(5, dtype=np.float32)
        scaled(1, given, 2.0, 0, 0, out)
        scaled(1, there, 2.0, 0, 0, back)
        assert (back.to_numpy() == out).all()


def test_arrays_of_doubles_are_handed_over_too():
    with device.forced():
        there, back = device.put(values().astype(float) / 3), device.empty((5,), float)
    for _ in range(3):
        given, out = values().astype(float) / 3, np.empty(5)
        halved(given, out)
        halved(there, back)
        assert (out == given / 2).all()
        assert (device.host(back) == out).all()
    # single ones are none of them
    with pytest.raises(ValueError, match="dtype=f64"):
        halved(values(), out)


def test_arrays_of_vectors_are_handed_over_too():
    given = np.arange(12, dtype=np.float32).reshape(6, 2)
    there = ti.ndarray(Pairs.dtype, 6)
    there.from_numpy(given)
    summed(given)
    for pairs in (given, there):
        assert summed(pairs) == given.sum()
    for wrong in (given[:, :1].copy(), given.reshape(3, 4), given[0], given.reshape(2, 3, 2)):
        with pytest.raises(Exception):  # noqa: B017, PT011 - whatever Taichi raises
            summed(wrong)


def test_what_is_kept_of_a_launch_is_never_taken_for_what_is_given():
    out = np.empty(5, dtype=np.float32)
    for n in range(20):
        # a new array as a rule lies where the last one lay, and may have its name, too
        given = values() + n
        scaled(1, given, 1.0, 0, 0, out)
        assert (out == given).all()
        given[:] = n  # in place: the same array, other values
        scaled(1, given, 1.0, 0, 0, out)
        assert (out == n).all()
        with pytest.raises(Exception):  # noqa: B017, PT011 - whatever Taichi raises
            scaled(1, values(), 1.0, 0, "seed", out)
    gone = weakref.ref(given)
    del given
    assert gone() is None


def test_an_array_of_a_device_may_be_given_again_and_again():
    there, back, out = values(), ti.ndarray(ti.f32, 5), np.empty(5, dtype=np.float32)
    given = ti.ndarray(ti.f32, 5)
    given.from_numpy(there)
    for n in range(5):
        scaled(1, given, 2.0, n, 0, back)
        assert (back.to_numpy() == 2 * there + n).all()
        scaled(1, given, 2.0, n, 0, out)
        assert (out == 2 * there + n).all()


def test_threads_do_not_take_each_others_arguments():
    def work(n):
        given, out = np.full(50, n, dtype=np.float32), np.empty(50, dtype=np.float32)
        for _ in range(200):
            scaled(1, given, 2.0, n, 0, out)
            if not (out == 3 * n).all():
                return False
        return True

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(work, range(8)))


def test_what_a_kernel_returns_comes_back():
    assert [counted(values()) for _ in range(3)] == [counted.plain(values())] * 3
    assert counted(-np.ones(3, dtype=np.float32)) == 0


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros(5),  # float64
        np.zeros((5, 1), dtype=np.float32),
        np.zeros(10, dtype=np.float32)[::2],
        [0.0, 1.0],
        None,
    ],
)
def test_what_taichi_refuses_stays_refused(wrong):
    out = np.empty(5, dtype=np.float32)
    for _ in range(2):
        scaled(1, values(), 1.0, 0, 0, out)
    with pytest.raises(Exception):  # noqa: B017, PT011 - whatever Taichi raises
        scaled(1, wrong, 1.0, 0, 0, out)


def test_numbers_of_numpy_count_as_numbers():
    outs = [np.empty(5, dtype=np.float32) for _ in range(3)]
    scaled(1, values(), 1.5, 2, 3, outs[0])
    scaled(1, values(), 1.5, 2, 3, outs[1])
    scaled(1, values(), np.float32(1.5), np.int64(2), np.int32(3), outs[2])
    assert (outs[0] == outs[1]).all()
    assert (outs[0] == outs[2]).all()
