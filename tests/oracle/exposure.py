"""How near attackers come to what the arrival map promises, cell by cell.

The map's claim is stronger than a robot needs: until a cell's tick, nobody is within the clearance
of any point of the cell. So every cell is attacked at all of its points and up to its last tick,
and no margin of the robot's motion hides one of the map.

As a program, `python exposure.py twins,720,0.2,17 NAME=value` replaces constants that are frozen
into kernels when they are compiled, and prints the worst of each seed's scene [m].
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

NEVER = 65535


def deepest(model, attackers, clearance):
    """How far any attacker gets into the clearance of any cell before its tick [m]; < 0: not."""
    j, i = np.nonzero(model.ticks > 1)
    low = np.array(model.origin) + np.stack([i, j], axis=1) * model.cell
    ticks = model.ticks[j, i].astype(float)
    # free up to the tick before; what is never touched is not asked of later than a minute
    free_for = np.where(ticks == NEVER, 60e3, ticks - 1) / 1000 + model.base - model.stamp
    worst = -np.inf
    for centre, radius, speed in zip(*attackers, strict=True):
        gap = np.maximum(np.maximum(low - centre, centre - low - model.cell), 0)
        inside = speed * free_for - (np.hypot(gap[:, 0], gap[:, 1]) - radius - clearance)
        worst = max(worst, float(inside.max()))
    return worst


def worst_of(seeds, twins, beams, cell):
    """The deepest [m] of scenes with two scans of one place (twins) or of two places."""
    from oracle import cases, exact, hidden, worlds
    from passpmp_ti import DifferentialDrive, Settings

    robot = DifferentialDrive(discs=((0.0, 0.05),))
    settings = Settings(cell=cell, object_width=0.4, object_speed=1.0, time_step=0.002)
    worst = -np.inf
    for seed in seeds:
        generator = np.random.default_rng(seed)
        pose = (*generator.uniform(-3, 3, 2), generator.uniform(-3, 3))
        world = worlds.random_world(generator, pose, robot, settings, 0.6)
        world = exact.world_of([], world.discs)
        other = pose if twins else (pose[0] + 0.3, pose[1] + 0.1, pose[2] + 1.0)
        scans = [exact.sweep(world, p, beams, 2 * np.pi, 15 * cell, 5.0) for p in (pose, other)]
        case = cases.Case(robot, settings, world, scans, pose)
        attackers = hidden.hidden_discs(case, 1000, generator)
        worst = max(worst, deepest(case.model(), attackers, settings.clearance(robot)))
    return worst


def _without(changes):
    import passpmp_ti.grid.model  # noqa: F401 (its kernels are not compiled yet)

    for name, value in changes.items():
        holders = [
            module
            for key, module in sys.modules.items()
            if key.startswith("passpmp_ti") and hasattr(module, name)
        ]
        assert holders, f"no module holds {name}"
        for module in holders:
            setattr(module, name, float(value))


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))
    twins, beams, cell, *seeds = sys.argv[1].split(",")
    _without(dict(change.split("=") for change in sys.argv[2:]))
    for seed in seeds:
        print(f"{seed} {worst_of([int(seed)], twins == 'twins', int(beams), float(cell)):.6f}")
