"""Roads: nodes that move alike share their ways, and the tree is the one that looks would grow."""

import numpy as np
import pytest
from oracle import cases
from test_spans import SAYS_NOTHING, model_with, random_ticks
from test_tree import CAR, CAR_SETTINGS, CHAIR, CHAIR_SETTINGS, CLUTTER, grown

import passpmp_ti.planner.roads as roads_module
import passpmp_ti.planner.tree as tree_module
from passpmp_ti import CarLike, DifferentialDrive, Settings, device
from passpmp_ti.grid.body import to_poses
from passpmp_ti.kernels.tree import CONTROL, PARENT, PROOF
from passpmp_ti.planner.guide import Guide, GuideField
from passpmp_ti.planner.roads import Roads
from passpmp_ti.planner.tree import TreeGrower, follow

LONG_CAR = CarLike(discs=((-1.0, 0.9), (1.0, 0.9), (3.0, 0.9)))
LONG_CHAIR = DifferentialDrive(discs=((-0.3, 0.4), (0.5, 0.4)))


@pytest.fixture
def always(monkeypatch):
    """Roads are laid for every level, however few its nodes are."""
    monkeypatch.setattr(roads_module, "WORTH", 1)
    monkeypatch.setattr(roads_module, "FEWEST", 1)
    monkeypatch.setattr(roads_module, "ROWS", 1 << 22)


def never(monkeypatch):
    monkeypatch.setattr(roads_module, "FEWEST", 1 << 30)


def open_model(robot, settings):
    return model_with(np.full((256, 256), 65535, dtype=np.uint16), robot, settings)


def random_states(robot, n, generator):
    states = np.zeros((n, 5))
    states[:, 2] = generator.uniform(-np.pi, np.pi, n)
    if isinstance(robot, CarLike):
        states[:, 3] = generator.uniform(-robot.v_reverse, robot.v_max, n)
        states[:, 4] = generator.uniform(-robot.xi_max, robot.xi_max, n)
    else:
        states[:, 3:] = generator.uniform(-robot.wheel_speed, robot.wheel_speed, (n, 2))
    states[0, 3:] = 0.0
    return states


@pytest.mark.parametrize("robot", [CAR, CHAIR], ids=["car", "chair"])
def test_samples_are_those_of_the_integrator_to_a_tenth_of_a_millimetre(robot, always):
    settings = Settings.for_robot(robot)
    model, generator = open_model(robot, settings), np.random.default_rng(0)
    body, steps = model.body, 20
    alike = random_states(robot, 40, generator)
    # nodes of one gait need not be equal to the last bit
    nodes = np.concatenate((alike, alike * (1, 1, 1, 1 + 1e-7, 1 - 1e-7), alike))
    poses = to_poses(nodes, (0.0, 0.0))
    roads = Roads(robot, len(poses))
    assert roads.lay(model, poses, 0, len(poses), steps, len(poses))
    assert 40 <= roads.number <= 60
    most = 0.0
    for n in range(len(poses)):
        poses[n, :2] = 70.0, 70.0  # 100 m away
        gait = roads.gait[n]
        for u in range(len(body.controls)):
            road = gait * len(body.controls) + u
            path = follow(model, poses[n], [(body.controls[u], steps)])
            most = max(most, apart(roads, road, steps, poses[n], path))
            ending = roads.links[road, 4]
            for b in range(len(body.braking)):
                brake = roads.number * len(body.controls) + ending * len(body.braking) + b
                path_on = follow(model, path[-1], [(body.braking[b], -1)])
                moving = roads.links[brake, 1]
                # sums of f32 may take a step more, at almost no speed
                assert abs(moving - (len(path_on) - 1)) <= 1
                most = max(
                    most, apart(roads, brake, min(moving, len(path_on) - 1), path[-1], path_on)
                )
    assert most < 1e-4


def apart(roads, road, steps, start, path):
    """Greatest distance of a road from a path [m]."""
    begin = roads.links[road, 0]
    x, y = roads.rows[begin : begin + steps + 1, :2].astype(float).T
    c, s = start[2:4].astype(float)
    places = np.stack((start[0] + c * x - s * y, start[1] + s * x + c * y), axis=1)
    return np.hypot(*(places - path[: steps + 1, :2]).T).max()


def straight_guide(goal=(60.0, 0.0)):
    frame = np.zeros(11, dtype=np.float32)
    frame[3:6] = *goal, 1.0
    ahead = np.zeros((2, 2, 2), dtype=np.float32)
    return GuideField(ahead[0], ahead, frame, (0.0, 0.0))


def named(tree):
    """{controls from the root on: node}."""
    names = [()]
    for node in range(1, tree.count):
        what = (int(tree.link[node, CONTROL]), bool(tree.braking[node]))
        names.append((*names[tree.link[node, PARENT]], what))
    return {name: node for node, name in enumerate(names)}


def border(model, tree, parent, control, steps):
    """Whether the answer on a child changes within a fifth of a millimetre."""
    answers = set()
    for dx, dy in np.random.default_rng(0).uniform(-2e-4, 2e-4, (200, 2)):
        pose = tree.pose[parent].copy()
        pose[:2] += dx, dy
        path = follow(model, pose, [(model.body.controls[control], steps)])
        states = np.concatenate((path[:, :2], path[:, 4:]), axis=1).astype(float)
        states[:, :2] += model.window.anchor
        times = tree.times[parent] + model.settings.time_step * np.arange(len(path))
        clear = not model.touched(states, times).any()
        answers.add((clear, int(model.proving_brakes(states[-1:], times[-1:])[0])))
    return len(answers) > 1


def same_but_at_borders(model, a, b):
    """How many nodes two trees share that differ nowhere but where a rounding decides."""
    in_a, in_b = named(a), named(b)
    for name in set(in_a) ^ set(in_b):
        tree, names, others = (a, in_a, in_b) if name in in_a else (b, in_b, in_a)
        if name[:-1] not in others:
            continue
        node = names[name]
        if name[-1][1]:
            # it brakes where the other tree has a child: that one is compared
            continue
        parent, control, steps = tree.link[node, :3]
        assert border(model, tree, parent, control, steps)
    shared = sorted(set(in_a) & set(in_b))
    at_a, at_b = (np.array([names[name] for name in shared]) for names in (in_a, in_b))
    assert (a.link[at_a, 2:4] == b.link[at_b, 2:4]).all()
    np.testing.assert_allclose(a.pose[at_a], b.pose[at_b], atol=2e-4)
    np.testing.assert_allclose(a.cost[at_a, :2], b.cost[at_b, :2], rtol=1e-4, atol=1e-4)
    # without roads, costs along a braking are those of a few long steps
    assert np.abs(a.cost[at_a, 3] - b.cost[at_b, 3]).mean() < 0.05
    assert np.abs(a.cost[at_a, 4] - b.cost[at_b, 4]).mean() < 2 * model.settings.time_step
    for node in at_a[a.link[at_a, PROOF] != b.link[at_b, PROOF]]:
        assert border(model, a, *a.link[node, :3])
    return len(shared)


def both_ways(model, guide, state, monkeypatch):
    """(tree along roads, tree by integration and all looks)."""
    start = model.stamp + model.settings.cycle
    # room for all nodes, so that none moves another one out, and for all roads
    settings = model.settings.changed(capacity=12000, primitives=model.settings.primitives[:2])
    along = TreeGrower(model.robot, settings).grow(model, guide, state, start, -1)
    object.__setattr__(model, "spans", np.full_like(model.spans, SAYS_NOTHING))
    never(monkeypatch)
    stepwise = TreeGrower(model.robot, settings).grow(model, guide, state, start, -1)
    return along, stepwise


@pytest.mark.parametrize("seed", range(12))
def test_a_tree_along_roads_is_the_tree_by_integration(seed, always, monkeypatch):
    generator = np.random.default_rng(seed)
    case = cases.random_case(generator)
    model = case.model()
    states, times = cases.random_states(case, 200, generator)
    safe = np.flatnonzero(model.passively_safe(states, times))
    for state in states[safe[:1]]:
        along, stepwise = both_ways(model, straight_guide(), state, monkeypatch)
        assert same_but_at_borders(model, along, stepwise) > 0.99 * stepwise.count


@pytest.mark.parametrize("robot", [CAR, LONG_CAR, CHAIR, LONG_CHAIR])
@pytest.mark.parametrize("seed", range(3))
def test_so_it_is_in_worlds_that_nothing_made(robot, seed, always, monkeypatch):
    settings = Settings.for_robot(robot, object_speed=3.0)
    generator = np.random.default_rng(seed)
    ticks = np.maximum(random_ticks(256, generator), 900)
    for _ in range(60):
        j, i = generator.integers(0, 250, 2)
        ticks[j : j + 4, i : i + 4] = generator.choice([0, 700])
    ticks[120:136, 120:136] = 65535
    model = model_with(ticks, robot, settings)
    state = np.array([0.0, 0.0, generator.uniform(-3, 3), 0.5, 0.0])
    along, stepwise = both_ways(model, straight_guide(), state, monkeypatch)
    assert along.count > 50
    assert same_but_at_borders(model, along, stepwise) > 0.99 * stepwise.count


def bytes_of(tree):
    tree = tree.on_host()
    return [a.tobytes() for a in (tree.pose, tree.link, tree.cost)]


MAKES = {
    "chair": lambda: grown(CHAIR, CHAIR_SETTINGS, CLUTTER, (0.0, 0, 0, 0.6, 0.6), proof=0),
    "car": lambda: grown(CAR, CAR_SETTINGS, CLUTTER, (0.0, 0, 0, 6.0, 0.0), 8.0, proof=0),
}


MAKES["a car that finds no room"] = lambda: grown(
    CAR, CAR_SETTINGS.changed(capacity=700), CLUTTER, (0.0, 0, 0, 6.0, 0.0), 8.0, proof=0
)


@pytest.mark.parametrize("make", MAKES.values(), ids=MAKES)
def test_neither_chunks_nor_the_run_change_a_byte(make, monkeypatch):
    first = bytes_of(make())
    assert bytes_of(make()) == first
    monkeypatch.setattr(tree_module, "CHUNK", 100)
    monkeypatch.setattr(tree_module, "LEAST", 3)
    assert bytes_of(make()) == first


@pytest.mark.parametrize("make", MAKES.values(), ids=MAKES)
def test_arrays_apart_from_the_host_give_the_same_tree(make, monkeypatch):
    # a guide that is looked up is found otherwise there
    monkeypatch.setattr(Guide, "field", lambda *a: straight_guide())
    monkeypatch.setattr(roads_module, "DEVICE_WORTH", roads_module.WORTH)
    first = bytes_of(make())
    with device.forced():
        assert bytes_of(make()) == first
    # where roads are not laid, a device integrates as the host does
    never(monkeypatch)
    first = bytes_of(make())
    with device.forced():
        assert bytes_of(make()) == first


def test_levels_of_few_gaits_are_grown_along_roads(monkeypatch):
    laid = []
    lay = Roads.lay
    monkeypatch.setattr(Roads, "lay", lambda *a: laid.append(lay(*a)) or laid[-1])
    MAKES["car"]()
    assert not laid[0]
    assert laid[-1]


@pytest.mark.parametrize(("limit", "value"), [("GAITS", 16), ("ROWS", 300)])
def test_where_roads_find_no_room_the_tree_is_integrated(limit, value, always, monkeypatch):
    monkeypatch.setattr(roads_module, limit, value)
    short = MAKES["car"]()
    never(monkeypatch)
    assert same_but_at_borders(short.model, short, MAKES["car"]()) > 0.99 * short.count


def test_rest_is_like_nothing_but_rest():
    settings = Settings.for_robot(CAR)
    poses = np.zeros((3, 7), dtype=np.float32)
    poses[:, 2] = 1.0
    poses[:, 5] = 0.0, 1e-7, -1e-7
    poses = np.repeat(poses, 10, axis=0)
    poses = np.concatenate((poses, poses))
    roads = Roads(CAR, len(poses))
    assert roads.lay(open_model(CAR, settings), poses, 0, len(poses), 5, len(poses))
    assert roads.number == 3
    assert len(set(roads.gait[[0, 10, 20]])) == 3
