"""Algorithm 2: what a tree holds, and what stops it."""

import numpy as np
import pytest
from oracle import exact

from passpmp_ti import CarLike, DifferentialDrive, FutureModel, Settings
from passpmp_ti.grid.body import to_states
from passpmp_ti.kernels.tree import FIRST
from passpmp_ti.planner.guide import Guide
from passpmp_ti.planner.tree import ROOT, TreeGrower, follow

CHAIR, CAR = DifferentialDrive(), CarLike()
CHAIR_SETTINGS = Settings.for_robot(
    CHAIR, object_speed=0.5, cell=0.1, capacity=3000, primitives=(0.4, 0.6)
)
CAR_SETTINGS = Settings.for_robot(CAR, object_speed=3.0, cell=0.5, capacity=3000)
CLUTTER = exact.world_of(
    [exact.box(3.0, 1.5, 1.0, 1.0, 0.4), exact.box(2.0, -2.4, 2.0, 0.6, 0.1)], [(4.5, -0.4, 0.3)]
)


def grown(robot, settings, world, state=(0.0, 0, 0, 0, 0), scale=1.0, proof=None):
    """A tree about the origin from `state`, a cycle after the scan."""
    boxes, discs = world.boxes * scale, world.discs * scale
    scan = exact.sweep(exact.World(boxes, discs), (0.0, 0, 0), 720, 2 * np.pi, 8.0 * scale, 3.0)
    model = FutureModel.from_scan(scan, robot, settings)
    guide = Guide(
        robot, settings, (0.0, 0.0), [(6.0 * scale, 0.0)], model.window.anchor,
        model.window.inner_radius, None,
    ).field(model, (6.0 * scale, 0.0), np.zeros(2))  # fmt: skip
    root, start = np.array(state, dtype=float), 3.0 + settings.cycle
    if proof is None:
        proof = int(model.proving_brakes(root[None], np.array([start]))[0])
    return TreeGrower(robot, settings).grow(model, guide, root, start, proof)


TREES = {
    "chair": lambda: grown(CHAIR, CHAIR_SETTINGS, CLUTTER, (0.0, 0, 0, 0.6, 0.6)),
    "car": lambda: grown(CAR, CAR_SETTINGS, CLUTTER, (0.0, 0, 0, 6.0, 0.0), 8.0),
}


@pytest.fixture(scope="module", params=TREES)
def tree(request):
    """A tree of each robot among things that stand and one that may move."""
    return TREES[request.param]()


def test_parents_come_before_children_and_siblings_side_by_side(tree):
    assert tree.count > 100
    assert tree.parent[ROOT] == -1
    assert (tree.parent[1:] < np.arange(1, tree.count)).all()
    assert (tree.parent[1:] >= 0).all()
    # parents never fall back: the children of one node are one run
    assert (np.diff(tree.parent[1:]) >= 0).all()


def test_every_node_is_passively_safe(tree):
    assert tree.model.passively_safe(tree.states, tree.times).all()


def test_times_are_absolute_and_grow_by_the_primitives(tree):
    assert tree.times[ROOT] == pytest.approx(3.0 + tree.model.settings.cycle)
    grown_nodes = ~tree.braking
    took = tree.times[1:] - tree.times[tree.parent[1:]]
    allowed = [tree.model.settings.cycle, *tree.model.settings.primitives]
    for t in took[grown_nodes[1:]]:
        assert min(abs(t - a) for a in allowed) < 1e-9


def test_every_primitive_is_free_all_the_way(tree):
    step, robot = tree.model.settings.time_step, tree.model.robot
    states = tree.states
    for node in range(1, tree.count):
        parent = tree.parent[node]
        if robot.at_rest(states[parent]) and robot.at_rest(states[node]):
            continue
        path = to_states(
            follow(tree.model, tree.pose[parent], tree.controls_to(node)[-1:]),
            tree.model.window.anchor,
        )
        assert path[0] == pytest.approx(states[parent], abs=1e-5)
        assert path[-1] == pytest.approx(states[node], abs=1e-5)
        times = tree.times[parent] + step * np.arange(len(path))
        assert not tree.model.touched(path, times).any()


def test_what_brakes_ends_at_rest_and_is_a_leaf(tree):
    braked = np.flatnonzero(tree.braking)
    assert tree.model.robot.at_rest(tree.states[braked]).all()
    assert not np.isin(braked, tree.parent).any()
    assert np.isin(braked, tree.leaves).all()


def test_each_control_of_a_node_is_either_a_child_or_rejected(tree):
    assert tree.stopped_by == "depth"
    tried = (~tree.braking & (tree.link[:, FIRST] >= 0)).sum() * len(tree.model.robot.controls)
    children = (~tree.braking).sum() - 1
    assert len(tree.rejected) == tried - children > 0


def test_a_node_without_a_safe_child_gets_the_braking_that_proved_it():
    # a robot that can only speed up: near a wall nothing but braking is left
    hasty = DifferentialDrive()
    object.__setattr__(hasty, "controls", (hasty.controls[0],))
    wall = exact.world_of([exact.box(3.5, 0.0, 1.0, 8.0)])
    settings = CHAIR_SETTINGS.changed(object_speed=0.0, cell=0.05, primitives=(0.4, 0.6, 1.0, 1.0))
    tree = grown(hasty, settings, wall, (0.0, 0.0, 0.0, 1.0, 1.0))
    (last,) = np.flatnonzero(tree.braking)
    assert last == tree.count - 1 >= 2
    assert tree.parent[last] == last - 1
    assert not hasty.at_rest(tree.states[last - 1])
    assert hasty.at_rest(tree.states[last])
    assert tree.stopped_by == "unsafe"


def test_the_same_bytes_on_two_runs():
    for make in TREES.values():
        a, b = make(), make()
        assert a.pose.tobytes() == b.pose.tobytes()
        assert a.link.tobytes() == b.link.tobytes()
        assert a.cost.tobytes() == b.cost.tobytes()


OPEN = exact.world_of()


@pytest.mark.parametrize(("robot", "controls"), [(CHAIR, 10), (CAR, 9)], ids=["chair", "car"])
def test_in_the_open_every_node_has_a_child_for_each_control(robot, controls):
    base = CHAIR_SETTINGS if robot is CHAIR else CAR_SETTINGS
    settings = base.changed(object_speed=0.0, primitives=(0.2,))
    tree = grown(robot, settings, OPEN, scale=1.0 if robot is CHAIR else 8.0)
    assert tree.count == 1 + controls + controls**2
    assert (tree.depth, tree.stopped_by) == (2, "depth")
    assert len(tree.leaves) == controls**2
    assert not tree.braking.any()


def test_capacity_stops_it_and_it_says_so():
    tree = grown(CHAIR, CHAIR_SETTINGS.changed(object_speed=0.0, capacity=57), OPEN)
    assert tree.count <= 57
    assert tree.count > 47
    assert tree.stopped_by == "capacity"
    assert tree.model.passively_safe(tree.states, tree.times).all()
    tiny = grown(CHAIR, CHAIR_SETTINGS.changed(object_speed=0.0, capacity=1), OPEN)
    assert (tiny.count, tiny.stopped_by) == (1, "capacity")


def test_a_spent_time_budget_stops_it_and_it_says_so():
    tree = grown(CHAIR, CHAIR_SETTINGS.changed(exploration_time=0.0), OPEN)
    assert (tree.count, tree.stopped_by) == (1, "time")


def test_a_root_that_nothing_can_follow_is_left_alone():
    # fast towards a wall a step away: no child, no proof
    wall = exact.world_of([exact.box(1.2, 0.0, 1.0, 8.0)])
    tree = grown(CHAIR, CHAIR_SETTINGS, wall, (0.0, 0, 0, 4.0, 4.0))
    assert (tree.count, tree.stopped_by) == (1, "unsafe")


def test_a_node_at_rest_may_wait():
    tree = grown(CHAIR, CHAIR_SETTINGS, CLUTTER)
    waiting = CHAIR.at_rest(tree.states) & (tree.parent >= 0)
    assert (waiting & (np.hypot(*tree.states[:, :2].T) < 1e-6)).any()
