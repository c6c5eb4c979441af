"""One cycle as a picture: the world, what the model says of it, the tree and the choice."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from passpmp_ti.planner.record import CycleRecord
from passpmp_ti.robots import Robot
from passpmp_ti.viz import palette, panel
from passpmp_ti.viz.actors import draw_body, draw_outline, draw_world, shade_unseen
from passpmp_ti.viz.branches import Branches, branches_of
from passpmp_ti.viz.canvas import Canvas
from passpmp_ti.viz.panel import Entry, Reading
from passpmp_ti.viz.plot import Bounds, Plot
from passpmp_ti.viz.region import Region, braking_ics

if TYPE_CHECKING:
    from passpmp_ti.sim.world import World

MAGNIFY, LEAST_CLOSE_UP = 2.5, 150
"""How much larger the close-up is, and its least side [px]."""
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
    tree = moment.record.tree
    branches = None if tree is None else branches_of(tree)
    canvas.clear()
    region = _region(moment, canvas.bounds, region_states)
    _paint(moment, canvas, region, branches)
    (x, y, w, h), below = canvas.layout.panel, canvas.layout.panel_below
    foot = panel.draw(
        canvas.page,
        (x, y, w, h),
        below,
        "This cycle",
        _readings(moment),
        moment.record.lost_scan or moment.record.reason,
        _legend(moment, region),
    )
    side = min(w, y + h - foot - panel.CLOSE_UP_HEAD)
    if side >= LEAST_CLOSE_UP:
        half = 0.5 * side / (MAGNIFY * canvas.scale)
        near = Plot(_bounds_near(moment, half), (side, side))
        _paint(moment, near, _region(moment, near.bounds, region_states // 4), branches)
        panel.draw_close_up(canvas.page, x, foot, near.sheet, f"Close-up, {2 * half:.0f} m wide")
    return canvas.image()


def _paint(moment: Moment, plot: Plot, region: Region | None, branches: Branches | None) -> None:
    """Everything that has a place in the world, the nearest to the eye last."""
    if region is not None:
        plot.region(~region.safe, region.origin, region.cell, palette.ICS)
    if moment.record.model is not None:
        shade_unseen(moment.record.model, plot)
    draw_world(moment.world, moment.time, plot)
    plot.line(moment.trail, palette.EXECUTED, 3)
    draw_body(moment.robot, moment.state, plot)
    if branches is not None and moment.record.tree is not None:
        plot.lines(branches.rejected, palette.UNSAFE, 1)
        plot.lines(branches.safe, palette.SAFE, 1)
        plot.lines(branches.braking, palette.BRAKING, 2)
        leaves = moment.record.particle_leaves
        plot.lines(branches.through(moment.record.tree, leaves), palette.PARTICLE, 1)
    _draw_choice(moment, plot)
    draw_outline(moment.robot, moment.state, plot)
    for goal in moment.goals:
        plot.dot(np.asarray(goal), 5, palette.GOAL)
    plot.star(np.asarray(moment.record.goal), 11, palette.GOAL)


def _bounds_near(moment: Moment, half: float) -> Bounds:
    """A square about the robot, the faster it goes the further ahead [m]."""
    x, y, theta = (float(v) for v in moment.state[:3])
    ahead = 0.7 * half * float(moment.robot.speed(moment.state)) / moment.robot.top_speed
    x, y = x + ahead * math.cos(theta), y + ahead * math.sin(theta)
    return (x - half, y - half, x + half, y + half)


def _draw_choice(moment: Moment, plot: Plot) -> None:
    chosen = moment.record.chosen
    if chosen is None:
        return
    start = chosen.states[0, :2]
    if np.hypot(*(start - moment.state[:2])) > 0.5 * moment.robot.radius:
        # where the plan begins, one cycle from now: the grey disc of Fig. 10
        plot.disc(start, moment.robot.radius, palette.MUTED, width=1)
    plot.line(chosen.states[:, :2], palette.CHOICE, 4)


def _region(moment: Moment, bounds: Bounds, count: int) -> Region | None:
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
    return braking_ics(model, bounds, float(root[2]), speed, time, count)


def _readings(moment: Moment) -> list[Reading]:
    record = moment.record
    away = math.hypot(record.goal[0] - moment.state[0], record.goal[1] - moment.state[1])
    nodes = str(record.tree_nodes)
    return [
        Reading("time", f"{moment.time:.1f} s"),
        Reading("speed", f"{float(moment.robot.speed(moment.state)):.2f} m/s"),
        Reading("to the goal", f"{away:.1f} m"),
        Reading(
            "decision",
            DECISIONS.get(record.decision, record.decision),
            alarm=record.decision == "brake",
        ),
        Reading("tree nodes", nodes),
        Reading("cycle took", f"{1e3 * record.timings.get('total', 0.0):.0f} ms"),
        Reading("contacts while moving", str(moment.contacts_moving), moment.contacts_moving > 0),
        Reading("contacts at rest", str(moment.contacts_at_rest)),
    ]


def _legend(moment: Moment, region: Region | None) -> list[Entry]:
    """What the colours mean; a robot at rest is p-safe by definition, so it has no region."""
    if region is not None:
        label = f"braking ICS at {region.speed:.1f} m/s"
    elif moment.record.model is not None and moment.robot.at_rest(moment.state):
        label = "braking ICS (none at rest)"
    else:
        label = "braking ICS (not drawn)"
    return [Entry(e.sign, e.colour, label) if e.colour == palette.ICS else e for e in ENTRIES]
