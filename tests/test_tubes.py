"""Tubes of tracked movers: nobody who keeps to them is ever where the grid says he cannot be."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import passpmp_ti as pti
from passpmp_ti.grid import tubes as module
from passpmp_ti.grid.window import Window
from passpmp_ti.kernels.arrival import NEVER
from passpmp_ti.tracking.forecast import Forecast

ROBOT = pti.DifferentialDrive()
STAMP = 100.0004
BASE = 100.0


def settings_with(**changes):
    return pti.Settings.for_robot(ROBOT, mode="hybrid", cell=0.1, **changes)


def forecast_of(settings, generator, count=3, parts=2):
    """Movers about the origin, their spread growing and turned anyhow."""
    times = module.layer_times(settings, ROBOT, STAMP)
    ahead = times - STAMP
    weight = generator.uniform(0.2, 1.0, (count, parts))
    weight /= weight.sum(axis=1, keepdims=True)
    velocity = generator.uniform(-1.2, 1.2, (count, parts, 2))
    place = generator.uniform(-3, 3, (count, 1, 2)) + generator.normal(0, 0.02, (count, parts, 2))
    mean = np.zeros((count, parts, len(times), 4))
    mean[..., :2] = place[:, :, None] + velocity[:, :, None] * ahead[:, None]
    mean[..., 2:] = velocity[:, :, None]
    turn = generator.uniform(0, np.pi, (count, parts))
    axes = np.stack([np.cos(turn), -np.sin(turn), np.sin(turn), np.cos(turn)], axis=-1)
    axes = axes.reshape(count, parts, 1, 2, 2)
    spread = 0.02 + np.array([0.15, 0.05]) * ahead[:, None]
    covariance = np.zeros((count, parts, len(times), 4, 4))
    covariance[..., :2, :2] = axes * (spread**2)[..., None, :] @ axes.swapaxes(-1, -2)
    covariance[..., 2, 2] = covariance[..., 3, 3] = 0.1
    covariance = 0.5 * (covariance + covariance.swapaxes(-1, -2))
    forecast = Forecast(
        times=times, weight=weight, mean=mean, covariance=covariance, radius=np.full(count, 0.25)
    )
    tracks = SimpleNamespace(
        last_seen=np.full(count, STAMP),
        last_centre=place[:, 0],
        last_radius=np.full(count, 0.3),
    )
    return tracks, forecast


def grid_of(settings, tracks, forecast, hidden=NEVER):
    window = Window.around(0.0, 0.0, 192, settings.cell)
    tubes = module.tubes_of(tracks, forecast, ROBOT, settings, window, BASE)
    laid = module.Laid(window, BASE, STAMP, ROBOT, settings)
    nothing = np.zeros((192, 192), dtype=np.uint16)
    return window, laid.tubes_over(nothing + np.uint16(hidden), tubes, nothing)


def walks_of(settings, tracks, forecast, generator, count):
    """[count, n, 2] ways of the first mover that keep to its ellipses, its disc and the bound of
    speed; and their times [n]."""
    q = np.sqrt(-2 * np.log(0.9 * (1 - settings.confidence) / len(forecast.times)))
    root = np.linalg.cholesky(forecast.covariance[0, 0, :, :2, :2])
    bearing = generator.uniform(0, 2 * np.pi, (count, 1))
    unit = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    knots = forecast.mean[0, 0, :, :2] + 0.9999 * q * (root @ unit[..., None])[..., 0]
    # half way to the next layer, off to a side as far as the bound of speed lets one be there
    step = np.diff(knots, axis=1)
    apart = np.linalg.norm(step, axis=-1)
    reach = settings.object_speed * np.diff(forecast.times)
    keeps = (apart <= reach).all(axis=1)
    knots, step, apart = knots[keeps], step[keeps], apart[keeps]
    side = np.stack([-step[..., 1], step[..., 0]], axis=-1) / np.maximum(apart, 1e-9)[..., None]
    bulge = 0.5 * np.sqrt(np.maximum(reach**2 - apart**2, 0.0))[..., None] * 0.9999
    middles = 0.5 * (knots[:, :-1] + knots[:, 1:]) + bulge * side * generator.choice([-1, 1])
    way = np.empty((len(knots), knots.shape[1] + middles.shape[1], 2))
    way[:, ::2], way[:, 1::2] = knots, middles
    times = np.empty(way.shape[1])
    times[::2] = forecast.times
    times[1::2] = 0.5 * (forecast.times[:-1] + forecast.times[1:])
    gone = np.linalg.norm(way - tracks.last_centre[0], axis=-1)
    inside = gone <= tracks.last_radius[0] - 0.05 + settings.object_speed * (times - STAMP)
    return way[inside.all(axis=1)], times


def broken_by(settings, seed):
    """How many places a mover touched before the grid said that it could."""
    generator = np.random.default_rng(seed)
    tracks, forecast = forecast_of(settings, generator)
    window, ticks = grid_of(settings, tracks, forecast)
    ways, times = walks_of(settings, tracks, forecast, generator, 400)
    kept = times <= STAMP + settings.horizon + ROBOT.longest_braking
    places = ways[:, kept].reshape(-1, 2)
    when = np.broadcast_to(times[kept], (len(ways), kept.sum())).ravel()
    # a robot that is just touched: its disc's middle lies anywhere about the mover
    bearing = generator.uniform(0, 2 * np.pi, len(places))
    apart = ROBOT.disc_radius + forecast.radius[0]
    points = places + apart * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    cells = np.floor((points - np.array(window.origin)) / window.cell).astype(int)
    inside = ((cells >= 0) & (cells < window.size)).all(axis=1)
    found = ticks[cells[inside, 1], cells[inside, 0]].astype(int)
    assert inside.sum() > 2000
    return int((found > np.ceil((when[inside] - BASE) * 1000)).sum())


@pytest.mark.parametrize("seed", range(4))
def test_nobody_who_keeps_to_his_tube_is_met_outside_it(seed):
    assert broken_by(settings_with(), seed) == 0


@pytest.mark.parametrize(
    ("name", "without"),
    [
        ("away_from_tube", lambda robot, settings, cell: settings.clearance(robot) - 0.03),
        ("strayed", lambda settings, half: 0.0),
    ],
)
def test_every_margin_is_needed(monkeypatch, name, without):
    monkeypatch.setattr(module, name, without)
    assert sum(broken_by(settings_with(), seed) for seed in range(8)) > 0


def test_a_tube_is_never_wider_than_the_bound_of_speed():
    settings = settings_with()
    generator = np.random.default_rng(3)
    tracks, forecast = forecast_of(settings, generator, count=1)
    wide = Forecast(
        times=forecast.times, weight=forecast.weight, mean=forecast.mean,
        covariance=forecast.covariance * 100, radius=forecast.radius,
    )  # fmt: skip
    window, ticks = grid_of(settings, tracks, wide)
    j, i = np.indices(ticks.shape)
    x, y = ((k + 0.5) * settings.cell + o for k, o in zip((i, j), window.origin, strict=True))
    gap = np.hypot(x - tracks.last_centre[0, 0], y - tracks.last_centre[0, 1])
    gap -= module.away_from_tube(ROBOT, settings, settings.cell) + 0.3
    # and where he was seen is known no better than the track says
    allowed = 0.9 * (1 - settings.confidence) / len(forecast.times)
    spread = np.linalg.eigvalsh(wide.covariance[:, :, 0, :2, :2])[..., -1].max()
    gap -= np.sqrt(-2 * np.log(allowed) * spread)
    half = 0.5 * (forecast.times[1] - forecast.times[0])
    end = int((STAMP + module.last_braking_ends(settings, ROBOT) - BASE) * 1000)
    reached = ticks < end
    assert reached.any()
    # a layer is lost half of it early, and its border by the cell
    early = 2 * half + settings.cell / settings.object_speed
    assert (ticks[reached] / 1000 >= gap[reached] / settings.object_speed - early).all()


def test_less_confidence_gives_away_less_room():
    generator = np.random.default_rng(5)
    tracks, forecast = forecast_of(settings_with(), generator)
    sure = grid_of(settings_with(confidence=0.999), tracks, forecast)[1]
    unsure = grid_of(settings_with(confidence=0.8), tracks, forecast)[1]
    assert (sure <= unsure).all()
    assert (sure < unsure).any()


def test_nothing_is_promised_after_the_last_layer():
    settings = settings_with()
    tracks, forecast = forecast_of(settings, np.random.default_rng(6))
    _, ticks = grid_of(settings, tracks, forecast)
    end = module.last_braking_ends(settings, ROBOT)
    assert ticks.max() <= np.ceil((STAMP + end - BASE) * 1000)
    assert forecast.times[-1] >= STAMP + end


def test_hidden_movers_keep_their_arrival_times_where_no_tube_is():
    settings = settings_with()
    tracks, forecast = forecast_of(settings, np.random.default_rng(7))
    free = grid_of(settings, tracks, forecast)[1]
    capped = grid_of(settings, tracks, forecast, hidden=500)[1]
    assert (capped == np.minimum(free, 500)).all()


def test_slower_hidden_movers_are_asked_about_in_proportion():
    settings = settings_with().changed(
        mode="probabilistic", emergence=0.1, allowed_risk=0.04, hidden_speeds=(0.25, 0.5, 1)
    )
    # one in ten, of whom two thirds are at least half as fast as the bound: more than is allowed
    assert module.asked_speed(settings) == 0.5
    window = Window.around(0.0, 0.0, 192, settings.cell)
    hidden = np.arange(192 * 192, dtype=np.int64).reshape(192, 192).clip(0, NEVER)
    laid = module.Laid(window, BASE, STAMP, ROBOT, settings)
    ticks = laid.slowed(hidden.astype(np.uint16), np.zeros((0, 2))).astype(int)
    end = int((STAMP + module.last_braking_ends(settings, ROBOT) - BASE) * 1000)
    later = np.where(hidden == 0, 0, 2 * (hidden - 1) + 1)
    # beyond the horizon only what the bound itself proves
    assert (ticks <= np.maximum(np.minimum(later, end), hidden)).all()
    assert (ticks >= np.minimum(later - 2, end)).all()
    certain = settings.changed(emergence=1.0, hidden_speeds=(1.0,))
    laid = module.Laid(window, BASE, STAMP, ROBOT, certain)
    same = laid.slowed(hidden.astype(np.uint16), np.zeros((0, 2)))
    assert (same == hidden).all()


def test_what_is_proven_of_anybody_stays_proven():
    settings = settings_with()
    tracks, forecast = forecast_of(settings, np.random.default_rng(8))
    window = Window.around(0.0, 0.0, 192, settings.cell)
    tubes = module.tubes_of(tracks, forecast, ROBOT, settings, window, BASE)
    hidden = np.full((192, 192), NEVER, dtype=np.uint16)
    strict = np.random.default_rng(9).integers(0, 9000, (192, 192)).astype(np.uint16)
    laid = module.Laid(window, BASE, STAMP, ROBOT, settings)
    alone = laid.tubes_over(hidden, tubes, np.zeros_like(hidden))
    assert (laid.tubes_over(hidden, tubes, strict) == np.maximum(alone, strict)).all()
