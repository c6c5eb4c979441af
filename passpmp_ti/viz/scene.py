"""One cycle as a picture: the world, what the model says of it, the tree and the choice."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.robots import Robot
from passpmp_ti.viz import palette, panel
from passpmp_ti.viz.canvas import Canvas
from passpmp_ti.viz.panel import Entry, Reading
from passpmp_ti.viz.region import Region, braking_ics

if TYPE_CHECKING:
    from passpmp_ti.sim.world import World

TAIL, TAIL_POINTS = 1.2, 9
"""Length of the trail of a moving object [s]."""
LEAST_ROBOT = 5.0
"""The robot is drawn at least this large [px]."""
DECISIONS = {"new": "new plan", "held": "plan held", "brake": "braking", "arrived": "arrived"}

ENTRIES = (
    Entry(panel.HATCH, palette.UNSEEN, "not seen"),
    Entry(panel.AREA, palette.ICS, "braking ICS"),
    Entry(panel.AREA, palette.STATIC, "stays"),
    Entry(panel.DISC, palette.MOVER, "moves"),
    Entry(panel.LINE, palette.TRAIL, "where it came from", 3),
    Entry(panel.LINE, palette.UNSAFE, "primitive, not p-safe", 1),
    Entry(panel.LINE, palette.SAFE, "primitive, p-safe", 1),
    Entry(panel.LINE, palette.BRAKING, "braking trajectory", 2),
    Entry(panel.LINE, palette.PARTICLE, "particle", 1),
    Entry(panel.LINE, palette.CHOICE, "chosen trajectory", 4),
    Entry(panel.LINE, palette.EXECUTED, "executed path", 3),
    Entry(panel.DISC, palette.ROBOT, "robot"),
    Entry(panel.STAR, palette.GOAL, "goal"),
)


@dataclass(frozen=True, kw_only=True)
class Moment:
    """What a picture shows."""

    time: float
    """[s]."""
    world: World
    record: CycleRecord
    robot: Robot
    state: np.ndarray
    """[5] the robot's state at `time`."""
    goals: tuple[tuple[float, float], ...] = ()
    """All goals [m]; the one driven to is the record's."""
    trail: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    """[n, 2] where the robot has been [m]."""
    contacts_moving: int = 0
    """Contacts so far while the robot moved."""
    contacts_at_rest: int = 0
    """Contacts so far while it stood."""


def draw_cycle(moment: Moment, canvas: Canvas, *, region_states: int = 20_000) -> np.ndarray:
    """Draw one planning cycle in the language of Figs. 8, 10 and 12.

    Args:
        moment: what to show.
        canvas: laid out for the world's bounds; its title stays, its plot is drawn anew.
        region_states: about how many states the braking-ICS region is made of; 0: without it.

    Returns:
        [H, W, 3] uint8 (red, green, blue).
    """
    canvas.clear()
    region = _region(moment, canvas, region_states)
    if region is not None:
        canvas.region(~region.safe, region.origin, region.cell, palette.ICS)
    model = moment.record.model
    if model is not None:
        outside = ~canvas.sampled(model.seen, model.origin, model.cell)
        canvas.shade(outside)
    draw_world(moment.world, moment.time, canvas)
    _draw_tree(moment.record, canvas)
    canvas.line(moment.trail, palette.EXECUTED, 3)
    _draw_choice(moment, canvas)
    for goal in moment.goals:
        canvas.dot(np.asarray(goal), 5, palette.GOAL)
    canvas.star(np.asarray(moment.record.goal), 11, palette.GOAL)
    draw_robot(moment.robot, moment.state, canvas)
    place, below = canvas.layout.panel, canvas.layout.panel_below
    panel.draw(canvas.page, place, below, _readings(moment), _note(moment), _legend(region))
    return canvas.image()


def draw_world(world: World, time: float, canvas: Canvas) -> None:
    """The things that stay, and those that move at `time` [s] with where they came from."""
    for polygon in world.polygons:
        canvas.fill(polygon, palette.STATIC)
    canvas.lines([s.reshape(2, 2) for s in world.segments], palette.STATIC, 2)
    movers = world.movers
    present = movers.present(time)
    if not np.any(present):
        return
    tails = np.stack([movers.at(time - TAIL * s) for s in np.linspace(1, 0, TAIL_POINTS)], axis=1)
    canvas.lines(list(tails[present]), palette.TRAIL, 3)
    for centre, radius in zip(movers.at(time)[present], movers.radius[present], strict=True):
        canvas.disc(centre, float(radius), palette.MOVER)


def draw_robot(robot: Robot, state: np.ndarray, canvas: Canvas) -> None:
    """The robot's body with a mark towards its front."""
    x, y, theta = (float(v) for v in state[:3])
    ahead = np.array([math.cos(theta), math.sin(theta)])
    least = LEAST_ROBOT / canvas.layout.scale
    here = np.array([x, y])
    for offset, radius in robot.discs:
        canvas.disc(here + offset * ahead, max(radius, least) + 1.5 / canvas.layout.scale,
                    palette.FLOOR)
    for offset, radius in robot.discs:
        canvas.disc(here + offset * ahead, max(radius, least), palette.ROBOT)
    length = max(robot.radius, least)
    aside = np.array([-ahead[1], ahead[0]])
    nose = np.stack([0.75 * ahead, -0.45 * ahead + 0.45 * aside, -0.2 * ahead,
                     -0.45 * ahead - 0.45 * aside])
    canvas.fill(here + length * nose, palette.FLOOR)


def _draw_tree(record: CycleRecord, canvas: Canvas) -> None:
    tree = record.tree
    if tree is not None:
        canvas.lines(tree.rejected, palette.UNSAFE, 1)
        nodes = [n for n in range(tree.count) if tree.parent[n] >= 0]
        canvas.lines([tree.primitive(n) for n in nodes if not tree.braking[n]], palette.SAFE, 1)
        canvas.lines([tree.primitive(n) for n in nodes if tree.braking[n]], palette.BRAKING, 2)
    canvas.lines(record.particles, palette.PARTICLE, 1)


def _draw_choice(moment: Moment, canvas: Canvas) -> None:
    chosen = moment.record.chosen
    if chosen is None:
        return
    start = chosen.states[0, :2]
    if np.hypot(*(start - moment.state[:2])) > 0.5 * moment.robot.radius:
        # where the plan begins, one cycle from now: the grey disc of Fig. 10
        canvas.disc(start, moment.robot.radius, palette.MUTED, width=1)
    canvas.line(chosen.states[:, :2], palette.CHOICE, 4)


def _region(moment: Moment, canvas: Canvas, count: int) -> Region | None:
    """The region for the state in which the plan begins; at rest: for the plan's top speed."""
    model, chosen = moment.record.model, moment.record.chosen
    if model is None or count <= 0:
        return None
    root = moment.state if chosen is None else chosen.states[0]
    time = model.stamp if chosen is None else max(chosen.start, model.stamp)
    speed = float(moment.robot.speed(root))
    if abs(speed) < 1e-3 and chosen is not None:
        speeds = moment.robot.speed(chosen.states)
        speed = float(speeds[np.argmax(np.abs(speeds))])
    if abs(speed) < 1e-3:
        return None
    return braking_ics(model, canvas.bounds, float(root[2]), speed, time, count)


def _readings(moment: Moment) -> list[Reading]:
    record = moment.record
    away = math.hypot(record.goal[0] - moment.state[0], record.goal[1] - moment.state[1])
    nodes = str(record.tree_nodes)
    return [
        Reading("time", f"{moment.time:.1f} s"),
        Reading("speed", f"{float(moment.robot.speed(moment.state)):.2f} m/s"),
        Reading("to the goal", f"{away:.1f} m"),
        Reading("decision", DECISIONS.get(record.decision, record.decision),
                alarm=record.decision == "brake"),
        Reading("tree nodes", nodes),
        Reading("cycle took", f"{1e3 * record.timings.get('total', 0.0):.0f} ms"),
        Reading("contacts while moving", str(moment.contacts_moving), moment.contacts_moving > 0),
        Reading("contacts at rest", str(moment.contacts_at_rest)),
    ]


def _note(moment: Moment) -> str:
    return moment.record.lost_scan or moment.record.reason


def _legend(region: Region | None) -> list[Entry]:
    if region is None:
        return [e for e in ENTRIES if e.colour != palette.ICS]
    label = f"braking ICS at {region.speed:.1f} m/s"
    return [
        Entry(e.sign, e.colour, label) if e.colour == palette.ICS else e for e in ENTRIES
    ]
