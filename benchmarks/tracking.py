"""How well the tracker follows, and whether what it predicts comes to be.

python benchmarks/tracking.py accuracy                       # shipped scenarios, ETH, lidar logs
python benchmarks/tracking.py accuracy --log FILE.log.gz     # another CARMEN log
python benchmarks/tracking.py calibration                    # the ETH recording
python benchmarks/tracking.py calibration --mixture          # mixtures, as hybrid mode takes them
python benchmarks/tracking.py calibration --recording FILE --format obsmat --clock 25
"""

from __future__ import annotations

import argparse
import gzip
import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import passpmp_ti as pti
from passpmp_ti.bench.machine import circumstances, told
from passpmp_ti.bench.reliability import BINS, Reliability
from passpmp_ti.bench.watched import Scene, Tally, Whose, promises, sightings_of
from passpmp_ti.sim.data_files import find_data
from passpmp_ti.sim.recordings import FORMATS, Recording, recorded_movers
from passpmp_ti.sim.scenario import Scenario
from passpmp_ti.sim.sources import RecordingSource
from passpmp_ti.sim.world import World
from passpmp_ti.tracking import follow

AHEAD = np.array([0.4, 0.8, 1.6, 2.4])
"""[s]."""
CYCLE = 0.1
"""[s]."""
EVERY = 4
"""Cycles from one forecast that is judged to the next."""
LAYERS = 0.1 * np.arange(1, 31)
"""Times of the forecast that is timed [s]."""
BEAMS, RANGE = 1081, 10.0
"""Of the range finders that other recordings are seen with, as in the scenario eth."""
FEWEST = 10
"""Scans that a log must hold."""
LOGS = "${PASSPMP_DATA}/lidar_carmen/README.md"
BEYOND = 10.5
"""People come from and leave to this far outside of where they were recorded [m]."""


def standing(scenario: Scenario, seed: int) -> tuple[Scene, float]:
    """The robot at a scenario's start, and the time at which its episode begins [s]."""
    world, state, begin = scenario.build(seed)
    scene = Scene(
        world=world,
        lidars=scenario.lidars,
        settings=scenario.settings,
        place=tuple(state[:3].tolist()),
        static_map=scenario.static_map,
    )
    return scene, begin


def watch(scene: Scene, begin: float, seconds: float, seed: int) -> Tally:
    """Follow for a while, and judge every cycle."""
    generator, tally, tracks, whose = np.random.default_rng(seed), Tally(), None, Whose()
    for k in range(round(seconds / CYCLE)):
        stamp = begin + k * CYCLE
        sightings = scene.sightings(stamp, generator)
        started = time.perf_counter()
        tracks = follow(tracks, sightings, stamp, scene.settings)
        tracks.forecast(stamp + LAYERS)
        tally.count(tracks, sightings, time.perf_counter() - started)
        whose.told(tracks, sightings, scene)
        tally.judge(tracks, sightings, scene, whose)
    return tally


def watch_log(path: Path) -> Tally:
    """Follow what a CARMEN log holds; nothing is known of the truth."""
    settings, tally, tracks = pti.Settings(object_speed=2.0, range_noise=0.03), Tally(), None
    last = -math.inf
    with gzip.open(path, "rt") as file:
        for line in file:
            if not line.startswith("FLASER"):
                continue
            words = line.split()
            n = int(words[1])
            x, y, theta = (float(w) for w in words[2 + n : 5 + n])
            stamp = float(words[-1])
            if stamp <= last:
                continue
            last = stamp
            increment = math.pi / (n if n % 2 == 0 else n - 1)
            scan = pti.Scan(
                np.array([float(w) for w in words[2 : 2 + n]]), -math.pi / 2, increment, 40.0,
                (x, y, theta), stamp,
            )  # fmt: skip
            sightings = sightings_of([scan], settings)
            started = time.perf_counter()
            tracks = follow(tracks, sightings, stamp, settings)
            tracks.forecast(stamp + LAYERS)
            tally.count(tracks, sightings, time.perf_counter() - started)
    return tally


def row(name: str, tally: Tally) -> str:
    """A line of the table of accuracy."""
    ms = 1e3 * np.array(tally.seconds)
    cells = [
        name, f"{len(ms):,}", f"{np.mean(tally.tracks):.1f} / {max(tally.tracks)}",
        f"{100 * tally.explained / max(tally.returns, 1):.2f}",
    ]  # fmt: skip
    if tally.movers_seen:
        position, speed = np.concatenate(tally.position), np.concatenate(tally.speed)
        cells += [
            f"{100 * tally.movers_followed / tally.movers_seen:.1f}",
            f"{np.median(position):.3f} / {np.quantile(position, 0.95):.3f}",
            f"{np.median(speed):.2f} / {np.quantile(speed, 0.95):.2f}",
            f"{1000 * tally.switches / tally.movers_followed:.2f}",
        ]
    else:
        cells += ["", "", "", ""]
    return "| " + " | ".join([*cells, f"{np.median(ms):.1f} / {np.quantile(ms, 0.99):.1f}"]) + " |"


def accuracy(options: argparse.Namespace) -> None:
    """Print the table of accuracy."""
    print(
        "| seen | cycles | tracks, mean / most | returns explained [%] | movers followed [%]"
        " | position error, median / 95 % [m] | velocity error, median / 95 % [m/s] | id switches"
        " per 1,000 | cycle, median / 99 % [ms] |"
    )
    print("|---" * 9 + "|")
    for name, seeds, seconds in (
        ("crowded", range(4), 30.0),
        ("corridor_person", range(1), 40.0),
        ("eth", range(0, 20, 4), 40.0),
        ("eth_stream", range(0, 20, 4), 40.0),
    ):
        scenario = pti.load_scenario(name)
        total = Tally()
        for seed in seeds:
            total.add(watch(*standing(scenario, seed), seconds, seed))
        print(row(f"`{name}`", total), flush=True)
    logs = options.log or sorted(find_data(LOGS, Path()).parent.glob("*.log.gz"))
    for path in logs:
        tally, name = watch_log(path), path.name.split(".")[0]
        if len(tally.seconds) < FEWEST:
            print(f"{path}: left out, its stamps hardly ever increase", file=sys.stderr)
        else:
            print(row(f"log {name}", tally), flush=True)


def recorded_scenes(options: argparse.Namespace) -> tuple[list[Scene], list[np.ndarray]]:
    """A robot that stands at several places of a recording, and the recorded tracks."""
    eth = pti.load_scenario("eth")
    if options.recording is None:
        assert isinstance(eth.movers, RecordingSource)
        tracks, world = eth.movers.tracks, standing(eth, 0)[0].world
        settings, static_map = eth.settings, eth.static_map
    else:
        tracks = Recording(
            path=options.recording, format=options.format, clock=options.clock
        ).tracks()
        rows = np.concatenate(tracks)[:, 1:]
        edge = (*(rows.min(axis=0) - BEYOND), *(rows.max(axis=0) + BEYOND))
        movers = recorded_movers(tracks, edge, np.zeros((0, 4)))
        world = World(edge, movers=movers)
        settings = eth.settings.changed(object_speed=movers.top_speed)
        static_map = None
    if options.object_speed:
        settings = settings.changed(object_speed=options.object_speed)
    rows = np.concatenate(tracks)[:, 1:]
    low, high = np.quantile(rows, [0.1, 0.9], axis=0)
    spots = low + (high - low) * np.array([[0.25, 0.25], [0.5, 0.5], [0.75, 0.75]])
    scenes = [
        Scene(
            world=world, lidars=eth.lidars, settings=settings, static_map=static_map,
            place=(float(x), float(y), 0.0),
        )
        for x, y in spots
        if world.clearance(np.array([[x, y]]))[0] > 0.4
    ]  # fmt: skip
    return scenes, tracks


def calibration(options: argparse.Namespace) -> None:
    """Print the reliability of what is predicted about recorded people."""
    scenes, recorded = recorded_scenes(options)
    generator = np.random.default_rng(0)
    first = np.array([t[0, 0] for t in recorded])
    last = np.array([t[-1, 0] for t in recorded])
    begin = float(first.min())
    seconds = min(options.seconds, float(last.max()) - begin)
    asked = []
    for scene in scenes:
        tracks, settings, whose = None, scene.settings, Whose()
        for k in range(round(seconds / CYCLE)):
            stamp = round(begin + k * CYCLE, 6)
            sightings = scene.sightings(stamp, generator)
            tracks = follow(tracks, sightings, stamp, settings)
            whose.told(tracks, sightings, scene)
            if k % EVERY or not len(tracks):
                continue
            mine = whose.all(tracks)
            movers = scene.world.movers
            # extensions beyond the recording are straight: they would flatter
            known = (mine[:, 0] >= 0) & (first[mine] <= stamp).all(axis=1)
            known = known & (stamp + AHEAD[:, None] <= last[mine].min(axis=1))
            forecast = tracks.forecast(stamp + AHEAD)
            asked += promises(
                forecast if options.mixture else forecast.reduced(),
                movers.positions(stamp + AHEAD)[:, mine],
                known,
                movers.radius[mine],
                stamp,
                options.places,
                generator,
            )
    horizon = np.concatenate([a.horizon for a in asked])
    chance = np.concatenate([a.chance for a in asked])
    touched = np.concatenate([a.touched for a in asked])
    tables = {f"{t:g} s": np.isclose(horizon, t) for t in AHEAD}
    tables["all"] = np.ones(len(horizon), dtype=bool)
    print(f"{sum(a.tracks for a in asked):,} track predictions, {len(horizon):,} discs,"
          f" bound {scenes[0].settings.object_speed:.2f} m/s, {len(scenes)} places\n")  # fmt: skip
    bins = [f"{b / BINS:g}-{(b + 1) / BINS:g}" for b in range(BINS)]
    print(f"| ahead | {' | '.join(bins)} | worst |")
    print("|---" * (BINS + 2) + "|")
    for name, which in tables.items():
        r = Reliability.of(chance[which], touched[which])
        cells = [f"{p:.2f} / {m:.2f} ({c:,})" for p, m, c in zip(r.promised, r.met, r.count,
                                                                strict=True)]  # fmt: skip
        print(f"| {name} | {' | '.join(cells)} | {r.worst:.3f} |")


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("accuracy", "calibration"))
    parser.add_argument("--log", type=Path, action="append", help="accuracy: a CARMEN log instead")
    parser.add_argument("--recording", type=Path, help="calibration: people instead of ETH")
    parser.add_argument("--format", choices=FORMATS, default="obsmat")
    parser.add_argument("--clock", type=float, default=25.0, help="frames a second")
    parser.add_argument("--object-speed", type=float, help="the bound; else the fastest step")
    parser.add_argument("--seconds", type=float, default=math.inf, help="of the recording")
    parser.add_argument("--places", type=int, default=4, help="discs a track and horizon")
    parser.add_argument("--mixture", action="store_true", help="calibration: all components")
    options = parser.parse_args(arguments)
    pti.init("cpu", threads=1)
    print(told(circumstances(1)) + "\n")
    {"accuracy": accuracy, "calibration": calibration}[options.what](options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
