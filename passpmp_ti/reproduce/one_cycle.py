"""Figs. 8 and 9: one planning cycle, and the iterations of its swarm."""

from __future__ import annotations

import numpy as np

from passpmp_ti.compare.axes import Axis
from passpmp_ti.compare.svg import Drawing
from passpmp_ti.planner.plan import trajectory_to
from passpmp_ti.planner.swarm import Swarm, best_leaf
from passpmp_ti.planner.tree import Tree
from passpmp_ti.reproduce import paper
from passpmp_ti.reproduce.cycle import Ground
from passpmp_ti.reproduce.figure import curves, document, strip
from passpmp_ti.reproduce.item import Asked, Claim, Found, Numbers, percent, table
from passpmp_ti.reproduce.runs import Run
from passpmp_ti.reproduce.scene import Scene
from passpmp_ti.settings import Settings
from passpmp_ti.sim.world import Bounds
from passpmp_ti.viz.branches import branches_of
from passpmp_ti.viz.region import braking_ics

AFTER = 6.0
"""The cycle that is shown, after the start of `simple` [s]."""
NODES = 240
"""Of the tree in the pictures: as many as the paper's largest (Table VI), and a small file."""
MARGIN = 1.3
"""Side of a picture by that of the tree."""
REGION_STATES = 8_000
SMALL_SWARM = 15
"""Fig. 13: with so many particles the paper finds the optimum now and then."""
ITERATIONS = (1, 2, 5, 10, 20, 40, 60)
SHOWN = (1, 5, 20, 60)


def _cycle(asked: Asked, changes: dict) -> tuple[Run, Ground, Settings]:
    """The cycle of `simple` that is shown."""
    run = asked.runs.drive("simple", duration=min(AFTER + 0.7, asked.longest))
    settings = run.scenario.settings.changed(**changes)
    goal = run.scenario.goals[0]
    ground = Ground.of(run.nearest(AFTER), run.scenario.robot, settings, goal)
    return run, ground, settings


def _panel(
    run: Run, ground: Ground, tree: Tree, leaves: tuple[int, ...], best: int, title: str, full: bool
) -> Drawing:
    """The tree in its scene; `full`: with the region and what is not safe."""
    branches = branches_of(tree)
    ways = branches.rejected if full and len(branches.rejected) else branches.safe
    state = run.nearest(AFTER).state
    bounds = _around(np.concatenate([ways.reshape(-1, 2), state[None, :2]]))
    scene = Scene(bounds, title, 620.0 if full else 300.0)
    if full:
        speed = float(ground.robot.speed(ground.root))
        scene.region(
            braking_ics(
                ground.model, bounds, float(ground.root[2]), speed, ground.start, REGION_STATES
            )
        )
    scene.world(run.world)
    scene.movers(run.world, ground.model.stamp)
    if full:
        scene.lines(_thinned(branches.rejected, 3), "unsafe")
    scene.lines(_thinned(branches.safe, 3), "safe")
    scene.lines(_thinned(branches.braking, 3), "braking")
    scene.lines(_thinned(branches.through(tree, leaves), 4), "particle")
    scene.robot(run.scenario.robot, state)
    scene.line(trajectory_to(tree, best).states[:, :2], "choice")
    for goal in run.scenario.goals:
        scene.goal(goal)
    return scene.drawing()


def _thinned(lines: np.ndarray, points: int) -> np.ndarray:
    """[n, points, 2] of lines [n, m, 2], their ends among them."""
    return lines[:, np.round(np.linspace(0, lines.shape[1] - 1, points)).astype(int)]


def _around(points: np.ndarray) -> Bounds:
    """A square about some places [n, 2], with a margin [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * MARGIN * float((high - low).max())
    return (
        float(middle[0]) - half, float(middle[1]) - half,
        float(middle[0]) + half, float(middle[1]) + half,
    )  # fmt: skip


def run_cycle(asked: Asked) -> Found:
    """Fig. 8."""
    asked.see("fig8: one cycle of simple")
    run, ground, settings = _cycle(asked, {"capacity": NODES, "particles": paper.PARTICLES})
    tree = ground.grow(settings)
    leaf, leaves, cost = Swarm(ground.robot, settings).choose(tree, np.random.default_rng(0))
    _, least = best_leaf(tree, ground.robot, settings)
    ways = sorted({node for end in leaves for node in tree.lineage(end)})
    states = np.array([ground.robot.within_limits(s) for s in tree.states])
    safe = ground.model.passively_safe(states, tree.times)
    numbers: Numbers = {
        "nodes": tree.count, "leaves": len(tree.leaves), "plans": len(leaves),
        "states": len(ways), "safe": int(safe[ways].sum()), "cost": cost, "least": least,
        "object_speed": settings.object_speed,
    }  # fmt: skip
    shown = _panel(run, ground, tree, leaves, leaf, f"simple, {AFTER:g} s after the start", True)
    return Found(
        numbers=numbers,
        claims=(
            Claim(
                says="all particles are p-safe",
                ours=f"{numbers['safe']} of {numbers['states']} nodes on the particles' ways, asked"
                " again one by one",
                holds=numbers["safe"] == numbers["states"],
            ),
            Claim(
                says="the green trajectory is the optimum",
                ours=f"{cost:.4g}, and {least:.4g} is the least of all {numbers['leaves']} leaves",
                holds=bool(cost <= least * (1 + 1e-6)),
            ),
        ),
        figures={
            "Grey: braking ICS of the heading and speed that the plan begins with; blue: p-safe"
            " primitives; cyan: primitives that are not; magenta: braking trajectories; red: the"
            " particles' ways; green: the chosen trajectory to rest; red disc: the car; cross: the"
            " goal": document(shown)
        },
    )


def tell_cycle(numbers: Numbers) -> str:
    """Fig. 8 as markdown."""
    return (
        f"A tree of {numbers['nodes']} nodes and {numbers['leaves']} plans, of which the 100"
        f" particles end in {numbers['plans']} different ones. Objects of at most"
        f" {numbers['object_speed']:g} m/s. The grey region is that of one heading and one speed; a"
        " plan may lead into it, slower."
    )


def run_iterations(asked: Asked) -> Found:
    """Fig. 9."""
    run, ground, base = _cycle(asked, {"sub_swarms": 1, "optimizer": "pso"})
    tree = ground.grow(base)
    _, least = best_leaf(tree, ground.robot, base)
    counts = (SMALL_SWARM, paper.PARTICLES)
    excess: dict[str, list[list[float]]] = {}
    panels = []
    searches = min(asked.searches, 20)
    for particles in counts:
        row = []
        for iterations in ITERATIONS:
            asked.see(f"fig9: {particles} particles, {iterations} iterations")
            settings = base.changed(particles=particles, iterations=iterations)
            swarm = Swarm(ground.robot, settings)
            found = [swarm.choose(tree, np.random.default_rng(k)) for k in range(searches)]
            row.append([cost / least - 1 for _, _, cost in found])
            if particles == SMALL_SWARM and iterations in SHOWN:
                leaf, leaves, cost = found[0]
                title = (
                    f"iteration {iterations}: {100 * (cost / least - 1):.2f} % above the optimum"
                )
                panels.append(_panel(run, ground, tree, leaves, leaf, title, False))
        excess[str(particles)] = row
    means = {p: [100 * float(np.mean(r)) for r in rows] for p, rows in excess.items()}
    hits = {p: [float(np.mean(np.array(r) <= 1e-6)) for r in rows] for p, rows in excess.items()}
    drawing = curves(
        "Cost of the best particle above the optimum",
        {
            f"{p} particles": list(zip(map(float, ITERATIONS), row, strict=True))
            for p, row in means.items()
        },
        Axis(low=1.0, high=100.0, label="iterations", log=True),
        Axis(low=0.0, high=1.1 * max(1e-3, *(v for r in means.values() for v in r)),
             label="above the optimum [%]"),
    )  # fmt: skip
    never = all((np.diff(np.array(rows), axis=0) <= 1e-9).all() for rows in excess.values())
    return Found(
        numbers={"nodes": tree.count, "leaves": len(tree.leaves), "iterations": list(ITERATIONS),
                 "excess": means, "hits": hits, "searches": searches},
        claims=(
            Claim(
                says="the global best gets better over the iterations, to the optimum",
                ours=f"it {'never gets' if never else 'gets'} worse; after 60 iterations"
                f" {percent(hits[str(paper.PARTICLES)][-1])} of the searches of 100 particles hold"
                " the optimum",
                holds=never and hits[str(paper.PARTICLES)][-1] == 1.0,
            ),
        ),
        figures={
            f"{SMALL_SWARM} particles: their ways in red, the best in green":
                strip("Iterations of the swarm", panels, 4),
            "How far the best particle is above the optimum, mean of the searches":
                document(drawing),
        },
    )  # fmt: skip


def tell_iterations(numbers: Numbers) -> str:
    """Fig. 9 as markdown."""
    rows = []
    for particles, row in numbers["excess"].items():
        rows.append([f"{particles} particles, above the optimum [%]", *(f"{v:.2g}" for v in row)])
        hits = numbers["hits"][particles]
        rows.append([f"{particles} particles, optimum found", *(percent(h) for h in hits)])
    return "\n\n".join(
        [
            table(["iterations", *(str(n) for n in numbers["iterations"])], rows),
            f"The cycle of Fig. 8 with the default tree, {numbers['nodes']} nodes and"
            f" {numbers['leaves']} plans, one swarm; {numbers['searches']} searches each. A search"
            " is the same from its beginning however long it goes on, so these are snapshots of"
            " one.",
        ]
    )
