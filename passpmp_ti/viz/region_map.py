"""The braking-ICS region at a scenario's start: picture and p-safe shares (Table V)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from passpmp_ti.grid.model import FutureModel
from passpmp_ti.sim.scenario import Scenario
from passpmp_ti.sim.world import World
from passpmp_ti.viz import palette, panel
from passpmp_ti.viz.actors import draw_robot, draw_world, shade_unseen
from passpmp_ti.viz.canvas import Canvas
from passpmp_ti.viz.panel import Entry, Reading
from passpmp_ti.viz.region import Region, braking_ics

STATES = 160_000
LEGEND = (
    Entry(panel.AREA, palette.FLOOR, "p-safe"),
    Entry(panel.AREA, palette.ICS, "braking ICS"),
    Entry(panel.HATCH, palette.UNSEEN, "not seen"),
    Entry(panel.AREA, palette.STATIC, "stays"),
    Entry(panel.DISC, palette.MOVER, "moves"),
    Entry(panel.LINE, palette.TRAIL, "where it came from", 3),
    Entry(panel.DISC, palette.ROBOT, "robot"),
    Entry(panel.STAR, palette.GOAL, "goal"),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class RegionMap:
    """What one scan from a scenario's start leaves safe for one heading and speed."""

    scenario: Scenario
    world: World
    state: np.ndarray
    """[5] the robot at rest at its start."""
    model: FutureModel
    region: Region
    time: float
    """At which the states are checked, t_k + cycle [s]."""
    share_of_view: float
    """P-safe share of all states in the view."""
    share_in_range: float
    """P-safe share of the states within the range of the scan (Table V)."""
    share_of_seen: float
    """P-safe share of the states at places that the scan has seen."""


def region_map(
    scenario: Scenario,
    speed: float,
    heading: float | None = None,
    *,
    seed: int = 0,
    after: float = 0.0,
) -> RegionMap:
    """Scan once from the start and check the states all over the view.

    Args:
        scenario: where.
        speed: of the states [m/s].
        heading: of the states [rad]; None: the robot's at its start.
        seed: of the movers.
        after: time of the scan, from the episode's start [s].

    Raises:
        ValueError: a speed beyond the robot's limits.
    """
    world, state, start = scenario.build(seed)
    stamp = start + after
    errors = np.random.default_rng([seed, 1])
    scans = [lidar.scan(world, state, stamp, errors) for lidar in scenario.lidars]
    settings = scenario.settings
    x, y, theta = (float(v) for v in state[:3])
    model = FutureModel.from_scan(
        scans, scenario.robot, settings, None, scenario.static_map, position=(x, y, theta)
    )
    time = stamp + settings.cycle
    region = braking_ics(
        model, scenario.bounds, theta if heading is None else heading, speed, time, STATES
    )
    apart = np.linalg.norm(region.places() - state[:2], axis=-1)
    in_range = apart <= max(lidar.range_max for lidar in scenario.lidars)
    return RegionMap(
        scenario=scenario,
        world=world,
        state=state,
        model=model,
        region=region,
        time=time,
        share_of_view=region.share(),
        share_in_range=region.share(in_range),
        share_of_seen=region.share(region.seen),
    )


def draw_region_map(found: RegionMap) -> np.ndarray:
    """[H, W, 3] uint8 picture of a map (red, green, blue)."""
    scenario, region = found.scenario, found.region
    canvas = Canvas(scenario.bounds)
    settings = scenario.settings
    canvas.title(
        scenario.name,
        f"braking ICS · objects ≤ {settings.object_speed:g} m/s · cycle {settings.cycle:g} s",
    )
    canvas.region(~region.safe, region.origin, region.cell, palette.ICS)
    shade_unseen(found.model, canvas)
    draw_world(found.world, found.model.stamp, canvas)
    for goal in scenario.goals:
        canvas.star(np.asarray(goal), 11, palette.GOAL)
    draw_robot(scenario.robot, found.state, canvas)
    readings = [
        Reading("speed", f"{region.speed:g} m/s"),
        Reading("heading", f"{np.degrees(region.heading):.0f} deg"),
        Reading("time after the scan", f"{found.time - found.model.stamp:g} s"),
        Reading("p-safe, of the view", f"{100 * found.share_of_view:.1f} %"),
        Reading("p-safe, in range", f"{100 * found.share_in_range:.1f} %"),
        Reading("p-safe, of the seen", f"{100 * found.share_of_seen:.1f} %"),
    ]
    place, below = canvas.layout.panel, canvas.layout.panel_below
    panel.draw(canvas.page, place, below, "These states", readings, "", LEGEND)
    return canvas.image()
