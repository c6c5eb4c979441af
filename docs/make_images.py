"""Draw the pictures of these pages anew: `python docs/make_images.py [name ...]`.

Everything shown is what the program computed. The picture of recorded people needs the ETH data
(see docs/add-a-scenario.md); it is left as it is where the data is absent.
"""

from __future__ import annotations

import struct
import sys
import zlib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

import passpmp_ti as pti
from passpmp_ti.sim.episode import CycleInfo, simulate
from passpmp_ti.sim.lidar import Lidar
from passpmp_ti.sim.movers import PathMovers
from passpmp_ti.sim.scenario import load_scenario
from passpmp_ti.sim.world import World
from passpmp_ti.viz import palette, panel, text
from passpmp_ti.viz.actors import draw_robot, draw_world, shade_unseen
from passpmp_ti.viz.canvas import Canvas
from passpmp_ti.viz.outcome import moment_of
from passpmp_ti.viz.panel import Entry, Reading
from passpmp_ti.viz.region import braking_ics
from passpmp_ti.viz.scene import draw_cycle

FOLDER = Path(__file__).parent / "images"
LATEST = 2.0
"""Where the colours of the arrival map end [s]."""


def main(names: list[str]) -> None:
    pti.init()
    FOLDER.mkdir(exist_ok=True)
    for name in names or PICTURES:
        image = PICTURES[name]()
        if image is None:
            continue
        path = FOLDER / f"{name}.png"
        path.write_bytes(palette_png(image))
        print(f"{path}: {image.shape[1]} x {image.shape[0]}, {path.stat().st_size / 1000:.0f} kB")


def cycle() -> np.ndarray:
    """One planning cycle of `crowded`, objects of at most 5 m/s."""
    scenario = load_scenario("crowded").changed(object_speed=5.0)
    return _cycle_after(scenario, 5.0, 0, (1280, 980))


def eth() -> np.ndarray | None:
    """The wheelchair among recorded people, on its way; None without the recording."""
    try:
        scenario = load_scenario("eth")
    except (ValueError, OSError) as problem:
        print(f"eth: left as it is; {problem}")
        return None
    return _cycle_after(scenario, 6.5, 0, (1500, 1000))


def _cycle_after(scenario, seconds: float, seed: int, size: tuple[int, int]) -> np.ndarray:
    """The cycle nearest after `seconds` of a drive."""
    trail: list[np.ndarray] = []
    found: list[np.ndarray] = []

    def see(info: CycleInfo) -> None:
        trail.append(info.state[:2].copy())
        if info.time - start < seconds - 1e-6 or found:
            return
        canvas = Canvas(scenario.bounds, size)
        speed = info.navigator.settings.object_speed
        canvas.title(scenario.name, f"seed {seed} · objects ≤ {speed:.3g} m/s")
        found.append(draw_cycle(moment_of(info, np.array(trail)), canvas, region_states=60_000))

    start = scenario.build(seed)[2]
    simulate(replace(scenario, duration=seconds + 1.0), seed=seed, on_cycle=see)
    return found[0]


def arrival() -> np.ndarray:
    """The arrival times that one scan leaves, with what it saw and what emits."""
    robot = pti.DifferentialDrive()
    settings = pti.Settings.for_robot(robot, object_speed=1.5)
    bounds = (-3.5, -3.0, 6.5, 4.0)
    walls = np.array([[-8, -2.2, 7, -2.2], [-8, 3.2, 2.4, 3.2], [3.6, 3.2, 7, 3.2]], dtype=float)
    box = np.array([[3.2, -0.9], [4.2, -0.9], [4.2, 0.1], [3.2, 0.1]])
    somebody = PathMovers([np.array([[0.0, 1.4, 1.7]])], np.array([0.25]))
    world = World(bounds, (box,), walls, somebody)
    lidar = Lidar(range_max=6.0, beams=1440, labels="sensor")
    state = np.zeros(5)
    model = pti.FutureModel.from_scan(lidar.scan(world, state, 0.0), robot, settings)

    canvas = Canvas(bounds, (1180, 900))
    canvas.title("Arrival times of one scan", "objects ≤ 1.5 m/s, range 6 m")
    _paint_arrival(canvas, model)
    draw_robot(robot, state, canvas)

    entries = [
        Entry(panel.HATCH, palette.UNSEEN, "not seen"),
        Entry(panel.AREA, palette.ICS, "seen, but no room for the robot"),
        Entry(panel.AREA, palette.STATIC, "a return that stays"),
        Entry(panel.AREA, palette.MOVER, "a return that may move"),
        Entry(panel.AREA, palette.ROBOT, "source: may let things out"),
        Entry(panel.DISC, palette.ROBOT, "robot"),
    ]
    readings = [
        Reading("cell", f"{model.cell:g} m"),
        Reading("clearance", f"{settings.clearance(robot):.3f} m"),
        Reading("seen cells", str(int(model.seen.sum()))),
        Reading("source cells", str(int(model.sources.sum()))),
    ]
    place, below = canvas.layout.panel, canvas.layout.panel_below
    panel.draw(canvas.page, place, below, "This scan", readings, "", entries)
    image = canvas.image()
    _colour_bar(image, (place[0], place[1] + place[3] - 60, place[2] - 8))
    return image


def cones() -> np.ndarray:
    """Arrival times as the crow flies, and round what stays, side by side."""
    scenario = load_scenario(Path(__file__).parent / "geodesic" / "corner.yaml")
    state = np.array([2.5, -0.3, 0.0, 0.0, 0.0])
    world, _, start = scenario.build(0)
    scans = [lidar.scan(world, state, start) for lidar in scenario.lidars]
    pages = []
    for kind, note in (("straight", "as the crow flies"), ("geodesic", "round what stays")):
        model = pti.FutureModel.from_scan(
            scans, scenario.robot, scenario.settings.changed(cones=kind), position=tuple(state[:3])
        )
        canvas = Canvas((-1.8, -3.7, 8.6, 3.7), (1180, 640))
        canvas.title(f'cones="{kind}"', f"{note}; objects ≤ 1 m/s, bright: 2 s and later")
        _paint_arrival(canvas, model)
        draw_robot(scenario.robot, state, canvas)
        x, _, w, _ = canvas.layout.plot
        pages.append(canvas.image()[:, : x + w + 20])
    return np.concatenate(pages, axis=1)


def region() -> np.ndarray:
    """The braking-ICS region of one scan for two speeds, side by side."""
    scenario = load_scenario("simple")
    world, state, start = scenario.build(0)
    settings = scenario.settings
    scan = scenario.lidars[0].scan(world, state, start)
    model = pti.FutureModel.from_scan(scan, scenario.robot, settings)
    bounds = (0.0, 0.0, 120.0, 180.0)
    time = start + settings.cycle
    pages = []
    for speed in (5.0, 15.0):
        canvas = Canvas(bounds, (900, 900))
        found = braking_ics(model, bounds, 0.0, speed, time, 60_000)
        canvas.region(~found.safe, found.origin, found.cell, palette.ICS)
        shade_unseen(model, canvas)
        draw_world(world, start, canvas)
        draw_robot(scenario.robot, state, canvas)
        share = 100 * found.share(found.seen)
        canvas.title(f"{speed:g} m/s", f"heading along x: {share:.0f} % of the seen is p-safe")
        x, _, w, _ = canvas.layout.plot
        pages.append(canvas.image()[:, : x + w + 20])
    return np.concatenate(pages, axis=1)


def _paint_arrival(canvas: Canvas, model: pti.FutureModel) -> None:
    """Colour every place by when the robot could first be touched there; mark what was seen."""
    j, i = _cells_of_pixels(canvas, model)
    ticks = model.ticks[j, i].astype(float)
    shade = np.clip(ticks / (1000 * LATEST), 0, 1) * 255
    canvas.sheet[:] = _colours(shade.astype(np.uint8))
    canvas.sheet[ticks == 0] = palette.ICS
    shade_unseen(model, canvas)
    for marked, colour in (
        (model.static, palette.STATIC),
        (model.movable, palette.MOVER),
        (model.sources, palette.ROBOT),
    ):
        canvas.sheet[marked[j, i]] = colour


def _cells_of_pixels(canvas: Canvas, model: pti.FutureModel) -> tuple[np.ndarray, np.ndarray]:
    """([h, w], [h, w]) row and column of the model's cell under each pixel."""
    height, width = canvas.sheet.shape[:2]
    x = canvas.bounds[0] + (np.arange(width) + 0.5) / canvas.scale
    y = canvas.bounds[3] - (np.arange(height) + 0.5) / canvas.scale
    i = np.clip(np.floor((x - model.origin[0]) / model.cell), 0, model.shape[1] - 1)
    j = np.clip(np.floor((y - model.origin[1]) / model.cell), 0, model.shape[0] - 1)
    return tuple(np.meshgrid(j.astype(int), i.astype(int), indexing="ij"))


def _colours(values: np.ndarray) -> np.ndarray:
    """[h, w, 3] (red, green, blue) of [h, w] uint8: dark is soon, bright is late."""
    steps = values // 16 * 16 + 8  # sixteen colours: a step is LATEST / 16
    return cv2.applyColorMap(steps, cv2.COLORMAP_VIRIDIS)[:, :, ::-1]


def _colour_bar(image: np.ndarray, place: tuple[int, int, int]) -> None:
    x, y, width = place
    bar = np.broadcast_to(np.linspace(0, 255, width).astype(np.uint8), (18, width))
    text.draw(
        image, "earliest touch after the scan", (x, y - 8), palette.INK, 14, weight=text.HEADING
    )
    image[y : y + 18, x : x + width] = _colours(np.ascontiguousarray(bar))
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        label = f"{'≥ ' if share == 1 else ''}{share * LATEST:g} s"
        at = (x + width * share, y + 36)
        text.draw(image, label, at, palette.MUTED, 13, align=share)


def palette_png(image: np.ndarray, colours: int = 256) -> bytes:
    """A PNG of [H, W, 3] uint8 with a palette of its commonest colours and all of the program's."""
    packed = image.astype(np.uint32) @ np.array([65536, 256, 1], dtype=np.uint32)
    values, back, counts = np.unique(packed, return_inverse=True, return_counts=True)
    named = np.array([c for c in vars(palette).values() if isinstance(c, tuple)], dtype=np.uint32)
    named = np.unique(named @ np.array([65536, 256, 1], dtype=np.uint32))
    common = values[np.argsort(-counts, kind="stable")]
    kept = np.concatenate([named, common[~np.isin(common, named)]])[:colours]
    split = np.stack([kept >> 16, kept >> 8 & 255, kept & 255], axis=1).astype(np.int32)
    every = np.stack([values >> 16, values >> 8 & 255, values & 255], axis=1).astype(np.int32)
    nearest = np.concatenate(
        [
            ((part[:, None] - split) ** 2).sum(axis=2).argmin(axis=1)
            for part in np.array_split(every, max(1, len(every) // 4096))
        ]
    )
    indices = nearest[back.reshape(-1)].reshape(image.shape[:2]).astype(np.uint8)
    rows = np.concatenate([np.zeros((len(indices), 1), np.uint8), indices], axis=1)
    header = struct.pack(">IIBBBBB", image.shape[1], image.shape[0], 8, 3, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"PLTE", split.astype(np.uint8).tobytes()))
    data = ((b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in (*chunks, *data)
    )


PICTURES = {"cycle": cycle, "arrival": arrival, "cones": cones, "region": region, "eth": eth}


if __name__ == "__main__":
    main(sys.argv[1:])
