"""Margins of the arrival map are needed: rounding, layers, and what a map is taken to know.

Constants that are frozen into kernels are replaced in a process of their own (oracle/exposure.py);
the claim there is the map's own, cell by cell, so that no margin of the motion hides it.
"""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracle import attack, cases, exact, exposure, hidden

from passpmp_ti import DifferentialDrive, FutureModel, Settings, StaticMap

NEVER = 65535
ROBOT = DifferentialDrive(discs=((0.0, 0.1),))
OPEN = exact.world_of([], [(1.2, 0.4, 0.3), (-0.7, 1.3, 0.25)])


def worst_without(scene, constant):
    """How deep [m] attackers get into a scene's map once a constant is 0."""
    done = subprocess.run(
        [sys.executable, exposure.__file__, scene, f"{constant}=0"],
        capture_output=True, text=True, check=True, cwd=Path(__file__).parents[1],
    )  # fmt: skip
    return float(done.stdout.split()[-1])


# scenes in which rounding decides: two scans of one place, or of two, each of which would vouch
# for the border of the other
@pytest.mark.parametrize(
    ("constant", "scene"),
    [("SLACK", (True, 720, 0.2, 17)), ("BEARING_SLACK", (False, 720, 0.2, 8))],
)
def test_single_precision(constant, scene):
    twins, beams, cell, seed = scene
    assert exposure.worst_of([seed], twins, beams, cell) < 0
    named = ",".join(map(str, ("twins" if twins else "apart", beams, cell, seed)))
    assert worst_without(named, constant) > 0.01


def test_a_layer_speaks_of_its_end():
    # what the layer before its own would say: a layer judged when it begins
    settings = Settings(cell=0.05, object_speed=2.0, object_width=0.4, layer_length=0.2)
    scan = exact.sweep(OPEN, (0.0, 0.0, 0.0), 720, 2 * np.pi, 2.5, 5.0)
    case = cases.Case(ROBOT, settings, OPEN, [scan], (0.0, 0.0, 0.0))
    model = case.model()
    movers = hidden.hidden_discs(case, 300, np.random.default_rng(0))
    j, i = np.indices(model.shape).reshape(2, -1)
    centres = np.array(model.origin) + (np.stack([i, j], axis=1) + 0.5) * model.cell

    def reached(layer, claim):
        """Cells that the claim calls free, reached before the layer ends."""
        free = ~claim.ravel()
        ages = np.full(free.sum(), (layer + 1) * 0.2 - 1e-6)
        return attack.reaches(centres[free], ages, movers, ROBOT.disc_radius, case.blockers).any()

    assert not any(reached(layer, model.layer(layer)) for layer in range(1, 4))
    assert all(reached(layer, model.layer(layer - 1)) for layer in range(1, 4))


def test_whole_milliseconds(monkeypatch):
    # 0.2 m in a millisecond: half of one off is seen
    settings = Settings(cell=0.02, object_speed=200.0, object_width=0.4, window=256)
    scan = exact.sweep(OPEN, (0.0, 0.0, 0.0), 2880, 2 * np.pi, 2.5, 5.0004)
    case = cases.Case(ROBOT, settings, OPEN, [scan], (0.0, 0.0, 0.0))
    model = case.model()
    movers = hidden.hidden_discs(case, 300, np.random.default_rng(0))
    generator = np.random.default_rng(1)
    places = generator.uniform(-1.5, 1.5, (4000, 2))
    times = 5.0004 + generator.uniform(0, 0.008, 4000)

    def reached(model):
        free = ~model.occupied(places, times)
        return attack.reaches(
            places[free], case.age(times[free]), movers, ROBOT.disc_radius, case.blockers
        ).sum()

    assert reached(model) == 0
    # arrivals rounded up and times down instead
    monkeypatch.setattr(
        FutureModel, "ticks_of",
        lambda self, times: np.floor(np.asarray(times) * 1000 - self.base_ticks).astype(np.int32),
    )  # fmt: skip
    later = np.where((model.ticks > 0) & (model.ticks < NEVER - 1), model.ticks + 1, model.ticks)
    assert reached(replace(model, ticks=later.astype(np.uint16))) > 0


def test_a_map_may_not_take_a_door_for_wall(monkeypatch):
    # a door of 0.5 m in a mapped wall, seen at a slant by beams that all miss it
    walls = [exact.box(1.7, 5.5, 0.2, 3.0), exact.box(1.7, -0.25, 0.2, 7.5)]
    world, pose = exact.world_of(walls), (0.0, 0.0, np.pi / 150)
    settings = Settings(cell=0.05, object_speed=1.0, object_width=0.45, map_tolerance=0.1)
    scan = exact.sweep(world, pose, 150, 2 * np.pi, 9.0, 5.0, labelled=False)
    known = StaticMap.from_segments(world.edges.reshape(-1, 4), 0.05)
    case = cases.Case(ROBOT, settings, world, [scan], pose, known)
    generator = np.random.default_rng(0)
    behind = np.array([1.85, 3.4]) + generator.random((400, 2)) * [0.75, 1.5]
    movers = hidden.attackers_of(
        case, *hidden.keep_possible(case, behind, np.full(len(behind), 0.225))
    )
    places = np.array([0.9, 3.5]) + generator.random((300, 2)) * [0.6, 1.0]
    ages = generator.uniform(0, 1.2, 300)

    def reached():
        free = ~case.model().occupied(places, 5.0 + ages)
        return attack.reaches(places[free], ages[free], movers, ROBOT.disc_radius, world).sum()

    assert reached() == 0
    with pytest.raises(ValueError, match="a door as wide as an object"):
        replace(case, settings=settings.changed(map_tolerance=0.3)).model()
    # what that refusal keeps out: a map taken for 0.3 m thicker than it is knows no door
    dilated = StaticMap.dilated
    monkeypatch.setattr(StaticMap, "dilated", lambda self, tolerance: dilated(self, 0.3))
    assert reached() > 0
