"""Moments of a forecast and the Gaussians there: the kernels against whole arrays in NumPy."""

import contextlib
import hashlib
import os
import pickle
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from oracle import moments as reference
from oracle.forecasts import Forecast, any_mover, forecast_of

import passpmp_ti as pti
from passpmp_ti import device
from passpmp_ti.grid.chances import chances_of
from passpmp_ti.grid.moments import moments_of
from passpmp_ti.grid.reach import Reach

HOME = Path(__file__).resolve().parents[1]
ROBOT = pti.DifferentialDrive()
SETTINGS = pti.Settings.for_robot(ROBOT)
STAMP = 100.0
TIMES = STAMP + 0.1 * np.arange(16)
ANCHOR = (-3.0, 2.0)
POSITION = (0.4, -0.2)
KINDS = ["any", "sharp", "wide", "steep", "crossing", "bent", "waving", "light", "round", "far"]
KINDS += ["one", "none"]


def mixtures(kind: str, seed: int) -> Forecast:
    """Objects of two components each about the robot, of every kind that is told apart."""
    rng = np.random.default_rng(seed)
    count = {"one": 1, "none": 0}.get(kind, 7)
    spread = {"sharp": 1e-2, "steep": 3e-2, "wide": 6.0, "waving": 6.0}.get(kind, 1.0)
    speed = {"steep": 6.0, "crossing": 2.0}.get(kind, 0.8)
    if not count:
        return Forecast(TIMES, *map(np.zeros, ((0, 2), (0, 2, 16, 4), (0, 2, 16, 4, 4), (0,))))
    movers = []
    for _ in range(2 * count):
        velocity = rng.normal(0, speed, 2)
        where = rng.uniform(-2.0, 2.0, 2) + (50.0 if kind == "far" else 0.0)
        # they all meet at the robot, half way
        where = where if kind != "crossing" else np.array(POSITION) - 0.75 * velocity
        movers.append(any_mover(rng, where, velocity))
    made = forecast_of(movers, TIMES)
    mean = made.mean.reshape(count, 2, 16, 4).copy()
    covariance = made.covariance.reshape(count, 2, 16, 4, 4) * spread**2
    weight = rng.uniform(0.1, 1.0, (count, 2))
    if kind == "bent":
        # no constant velocity makes this of them: they turn, and their covariances shrink
        mean[..., :2] += 0.2 * np.sin(9 * np.arange(16))[:, None]
        covariance *= (1.0 - 0.06 * np.arange(16))[:, None, None]
    if kind == "waving":
        # to and fro, by less than what is cut into parts for
        mean[..., ::2, 0] += 0.2
    if kind == "light":
        weight[::2, 1] = 1e-8
    if kind == "round":
        covariance[..., :2, 2:] = covariance[..., 2:, :2] = 0.0
        covariance[..., :2, :2] = covariance[..., :1, :1] * np.eye(2)
    weight /= weight.sum(axis=1, keepdims=True)
    return Forecast(TIMES, weight, mean, covariance, rng.uniform(0.2, 0.6, count))


def asked(kind: str, seed: int, speed: float = 0.7) -> tuple:
    """What `moments_of` is asked."""
    forecast = mixtures(kind, seed)
    reach = Reach.of(ROBOT, POSITION, STAMP, speed, 0.0, STAMP + SETTINGS.horizon)
    return forecast, forecast.radius + 0.5, reach, ANCHOR


def fields(moments) -> dict[str, np.ndarray]:
    """Of `Moments`, by name."""
    return {name: np.asarray(getattr(moments, name)) for name in moments.__dataclass_fields__}


def digest(moments) -> str:
    """Of every byte."""
    whole = hashlib.sha256()
    for name, values in fields(moments).items():
        whole.update(f"{name} {values.shape}".encode() + np.ascontiguousarray(values).tobytes())
    return whole.hexdigest()


@pytest.mark.parametrize("kind", KINDS)
def test_kernels_work_out_what_whole_arrays_do(kind):
    for seed in range(6):
        given = asked(kind, seed, speed=0.2 * seed)
        made, wanted = fields(moments_of(*given)), fields(reference.moments_of(*given))
        for name, values in made.items():
            assert values.shape == wanted[name].shape, name
            if name in ("wanted", "starts", "sides", "times"):
                assert (values == wanted[name]).all(), name
                continue
            # the sine of an angle is known to 1e-8 where its cosine is 1 but for rounding
            np.testing.assert_allclose(values, wanted[name], rtol=1e-6, atol=1e-7, err_msg=name)


def test_the_kinds_are_what_they_are_called():
    made = {kind: moments_of(*asked(kind, 0)) for kind in KINDS}
    parts = {kind: len(moments.times) for kind, moments in made.items()}
    assert parts["none"] == parts["far"] == 2
    assert parts["wide"] < parts["waving"] <= len(TIMES) < parts["steep"]
    assert not made["far"].wanted.any()
    assert (made["far"].near[:, 2] == -1).all()
    assert 0 < made["any"].wanted.mean() < 1
    assert made["light"].left_out > 0
    # what is sharp is blurred, and what is wide is not
    for kind, blurred in (("sharp", True), ("steep", True), ("wide", False)):
        radius = asked(kind, 0)[1].repeat(2)
        assert (made[kind].radius > np.tile(radius, parts[kind])).any() == blurred


def test_arrays_of_a_device_make_the_same_bytes():
    for kind in KINDS:
        given = asked(kind, 3)
        here = digest(moments_of(*given))
        with device.forced():
            assert digest(moments_of(*given)) == here


ALONE = """
import pickle, sys
import passpmp_ti
from passpmp_ti.grid.moments import moments_of
passpmp_ti.init("cpu", threads=1)
given = pickle.load(sys.stdin.buffer)
sys.stdout.buffer.write(pickle.dumps([moments_of(*one) for one in given]))
"""


def test_one_thread_makes_the_same_bytes():
    given = [asked(kind, 1) for kind in KINDS]
    path = os.pathsep.join(p for p in (str(HOME), os.environ.get("PYTHONPATH")) if p)
    done = subprocess.run(
        [sys.executable, "-c", ALONE],
        input=pickle.dumps([(SimpleNamespace(**vars(one[0])), *one[1:]) for one in given]),
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, timeout=300, check=True,
    )  # fmt: skip
    alone = pickle.loads(done.stdout)
    assert [digest(made) for made in alone] == [digest(moments_of(*one)) for one in given]


def test_a_forecast_of_nobody_makes_chances():
    forecast, *_ = asked("none", 0)
    for apart in (False, True):
        with device.forced() if apart else contextlib.nullcontext():
            made = chances_of(forecast, ROBOT, SETTINGS, POSITION, STAMP, 100_000, ANCHOR)
            assert device.host(made.tally)[0] == 0
