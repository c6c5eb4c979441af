"""Certificates: what is emitted verifies, what is tampered with does not, and the verifier agrees
with attackers, with the planner, and with itself."""

import copy
import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from oracle import attack, cases, exact, gridless, hidden

from passpmp_ti import CarLike, DifferentialDrive, Navigator, Settings, StaticMap
from passpmp_ti.certificate.content import robot_of
from passpmp_ti.certificate.writer import CertificateWriter
from passpmp_ti.cli import main
from passpmp_verify.document import CertificateError, digest, pack, read, unpack, write
from passpmp_verify.gridless import RESOLUTION
from passpmp_verify.reader import certificate_of, robot_from
from passpmp_verify.verify import model_of, verify, verify_file

CHAIR = DifferentialDrive(wheel_speed=2.0)
CAR = CarLike()
ROOM = exact.world_of(
    [
        exact.box(2.6, 1.2, 1.0, 0.8, 0.3),
        exact.box(1.2, -1.6, 2.4, 0.5),
        exact.box(-2.0, 0.0, 0.5, 4.0),
    ],
    [(4.2, -0.4, 0.3)],
)
YARD = exact.world_of([exact.box(25, 9, 8, 5, 0.2), exact.box(18, -10, 30, 3)])


def drive(folder, robot, settings, world, goal, cycles, *, range_max, blank=1, static_map=None):
    """Drive and certify; in all but every `blank`-th cycle the beams are lost. Returns
    [(file, decision)]."""
    navigator = Navigator(robot, settings, goal, static_map)
    writer = CertificateWriter(folder)
    state, stamp, written = np.zeros(5), 7.0, []
    for k in range(cycles):
        before = navigator.held
        scan = exact.sweep(
            world, tuple(state[:3]), 360, 2 * np.pi, range_max, stamp, labelled=static_map is None
        )
        if k % blank:
            scan = replace(scan, ranges=np.full(360, np.nan))
        after = navigator.update(scan, state)
        path = writer.see(scan, state, navigator)
        written.append((path, navigator.record.decision))
        stamp += settings.cycle
        state = (after if before is None else before).at(stamp)
    return written


@pytest.fixture(scope="module")
def chair(tmp_path_factory):
    settings = Settings.for_robot(CHAIR, object_speed=1.0, particles=20)
    return drive(
        tmp_path_factory.mktemp("chair"), CHAIR, settings, ROOM, (4.0, 0.3), 30, range_max=6.0
    )


@pytest.fixture(scope="module")
def car(tmp_path_factory):
    settings = Settings.for_robot(CAR, object_speed=5.0, cell=0.4, particles=20)
    return drive(
        tmp_path_factory.mktemp("car"), CAR, settings, YARD, (60.0, 0.0), 30, range_max=50.0
    )


@pytest.fixture(scope="module")
def forgetful(tmp_path_factory):
    """Two of three scans hold nothing: what is held rests on older ones."""
    settings = Settings.for_robot(CHAIR, object_speed=1.0, particles=20)
    return drive(
        tmp_path_factory.mktemp("forgetful"), CHAIR, settings, ROOM, (4.0, 0.3), 16,
        range_max=6.0, blank=3,
    )  # fmt: skip


def moving_document(written):
    """The document of the cycle in the middle of a drive."""
    return read(written[len(written) // 2][0])


def verdict_of(document):
    """What the verifier says of a document whose digest is made anew."""
    return verify(certificate_of(document))


def path_of(document):
    path = document["trajectory"]
    return unpack("times", path["times"], "float64", (None,)), unpack(
        "states", path["states"], "float64", (None, 5)
    )


def with_path(document, times, states, brakes_from=None):
    changed = copy.deepcopy(document)
    path = changed["trajectory"]
    path["times"], path["states"] = pack(times), pack(states)
    if brakes_from is not None:
        path["brakes_from"] = brakes_from
    return changed


# what is emitted -------------------------------------------------------------------------------


@pytest.mark.parametrize("who", ["chair", "car", "forgetful"])
def test_every_certificate_of_a_drive_verifies(who, request):
    written = request.getfixturevalue(who)
    verdicts = [verify_file(path) for path, _ in written]
    assert [v.reason for v in verdicts if not v.safe] == []
    assert sum(decision == "new" for _, decision in written) > 3
    moving = [v for v in verdicts if v.proof.least is not None]
    assert len(moving) > len(written) // 2
    assert all(v.proof.least.margin > 0 for v in moving)
    assert not any(v.contradictions for v in verdicts)


def test_a_path_that_rests_on_memory_fails_without_the_older_scan(forgetful):
    documents = [read(path) for path, _ in forgetful]
    resting_on_memory = [d for d in documents if len(d["moments"]) > 1]
    assert len(resting_on_memory) >= 5
    document = copy.deepcopy(resting_on_memory[-1])
    assert verdict_of(document).safe
    document["moments"] = document["moments"][:1]
    assert not verdict_of(document).safe


def test_walls_that_only_a_map_declares_are_in_the_certificate(tmp_path):
    walls = [[-3, -0.9, 6, -0.9], [-3, 0.9, 6, 0.9], [6, -0.9, 6, 0.9], [-3, -0.9, -3, 0.9]]
    boxes = [exact.box(1.5, 1.0, 9.2, 0.2), exact.box(1.5, -1.0, 9.2, 0.2)]
    world = exact.world_of([*boxes, exact.box(6.1, 0, 0.2, 2.2), exact.box(-3.1, 0, 0.2, 2.2)])
    settings = Settings.for_robot(CHAIR, object_speed=1.0, particles=20)
    written = drive(
        tmp_path, CHAIR, settings, world, (3.0, 0.0), 10, range_max=6.0,
        static_map=StaticMap.from_segments(np.array(walls)),
    )  # fmt: skip
    document = read(written[-1][0])
    verdict = verdict_of(document)
    assert verdict.safe
    assert verdict.proof.least is not None
    # without the map the walls may move
    assert not verdict_of({**document, "static_map": None}).safe


def test_the_verifier_runs_without_the_planner(chair):
    code = (
        "import sys\n"
        "for name in ('taichi', 'passpmp_ti', 'scipy', 'cv2'): sys.modules[name] = None\n"
        "from passpmp_verify.__main__ import main\n"
        "code = main(sys.argv[1:])\n"
        "others = {m.partition('.')[0] for m in sys.modules if sys.modules[m] is not None}\n"
        "assert 'numpy' in others and not others & {'taichi', 'passpmp_ti', 'scipy', 'cv2'}\n"
        "sys.exit(code)\n"
    )
    files = [str(path) for path, _ in chair[10:12]]
    done = subprocess.run(
        [sys.executable, "-c", code, *files], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("safe from t = ") == 2


# tampering ---------------------------------------------------------------------------------------


def leaves(node, path=()):
    if isinstance(node, dict):
        for key, value in node.items():
            yield from leaves(value, (*path, key))
    elif isinstance(node, list):
        for k, value in enumerate(node):
            yield from leaves(value, (*path, k))
    else:
        yield path, node


def changed_at(document, path, value):
    changed = copy.deepcopy(document)
    node = changed
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    return changed


def test_every_changed_field_breaks_the_digest(forgetful):
    document = moving_document(forgetful)
    assert document["sha256"] == digest(document)
    seen = 0
    for path, value in leaves(document):
        if path in (("format",), ("version",)):
            continue
        if isinstance(value, bool) or value is None:
            other = not value
        elif isinstance(value, str):
            other = value[:-1] + ("A" if value[-1:] != "A" else "B")
        else:
            other = value + 1
        tampered = changed_at(document, path, other)
        assert tampered["sha256"] != digest(tampered), path
        seen += 1
    assert seen > 60


def test_a_changed_file_is_not_safe(chair, tmp_path):
    document = moving_document(chair)
    document["assumptions"]["object_speed"] = 0.5
    (tmp_path / "c.json").write_text(json.dumps(document))
    verdict = verify_file(tmp_path / "c.json")
    assert not verdict.safe
    assert "digest" in verdict.reason


def shifted(document, dx, dy):
    times, states = path_of(document)
    return with_path(document, times, states + np.array([dx, dy, 0, 0, 0]))


def without_tail(document):
    times, states = path_of(document)
    cut = int(np.argmax(np.abs(states[:, 3:5]).max(axis=1))) + 2
    return with_path(document, times[:cut], states[:cut], cut - 1)


def hurried(document):
    times, states = path_of(document)
    return with_path(document, times[0] + 0.5 * (times - times[0]), states)


def bent(document):
    times, states = path_of(document)
    away = np.linspace(0, 0.5, len(states))
    bent = states.copy()
    bent[:, 1] += away
    return with_path(document, times, bent)


def speeding_up_at_the_end(document):
    times, states = path_of(document)
    return with_path(document, times, states, 0)


def with_ranges(document, change):
    changed = copy.deepcopy(document)
    for moment in changed["moments"]:
        for scan in moment["scans"]:
            ranges = unpack("ranges", scan["ranges"], "float64", (None,))
            scan["ranges"] = pack(change(ranges))
    return changed


def edited(document, *path, value):
    return changed_at(document, path, value)


TAMPERINGS = {
    "moved into a wall": (lambda d: shifted(d, 0.0, -0.8), "must be free"),
    "moved out of what was seen": (lambda d: shifted(d, 50.0, 0.0), "nothing is proven"),
    "without its tail": (without_tail, "does not end at rest"),
    "twice as fast": (hurried, "follow from its speed"),
    "bent": (bent, "its place does not follow"),
    "a tail that speeds up": (speeding_up_at_the_end, "its braking tail speeds up"),
    "shorter ranges": (lambda d: with_ranges(d, lambda r: 0.3 * r), "must be free"),
    "lost beams": (lambda d: with_ranges(d, lambda r: r * np.nan), "must be free"),
    "faster objects": (
        lambda d: edited(d, "assumptions", "object_speed", value=9.0), "must be free",
    ),
    "narrower objects": (
        lambda d: edited(d, "assumptions", "object_width", value=0.01), "must be free",
    ),
    "an older scan": (
        lambda d: edited(d, "moments", 0, "scans", 0, "stamp", value=1.0), "must be free",
    ),
    "a scan from elsewhere": (
        lambda d: edited(d, "moments", 0, "scans", 0, "pose", value=[30.0, 0.0, 0.0]),
        "must be free",
    ),
    "noise": (lambda d: edited(d, "assumptions", "range_noise", value=1.0), "must be free"),
    "a worse place": (
        lambda d: edited(d, "assumptions", "localisation_error", value=0.7), "must be free",
    ),
    "a robot off its path": (
        lambda d: edited(d, "assumptions", "tracking_error", value=1.4), "must be free",
    ),
    "a late scan": (lambda d: edited(d, "assumptions", "stamp_error", value=5.0), "must be free"),
    "a wider robot": (
        lambda d: edited(d, "robot", "discs", 0, value=[0.0, 1.5]), "must be free",
    ),
    "a weaker robot": (
        lambda d: edited(d, "robot", "acceleration", value=0.2), "cannot change its speed",
    ),
    "a slower robot": (
        lambda d: edited(d, "robot", "wheel_speed", value=0.1), "beyond the robot's limits",
    ),
    "a wider track": (lambda d: edited(d, "robot", "track", value=5.0), "heading"),
}  # fmt: skip


@pytest.mark.parametrize("what", TAMPERINGS)
def test_physics_tells_a_tampered_certificate_whose_digest_was_made_anew(what, chair):
    tamper, told = TAMPERINGS[what]
    document = moving_document(chair)
    if what == "a wider track":
        document = turning_document(chair)
    if what == "a tail that speeds up":
        document = read(chair[0][0])  # from rest
    assert verdict_of(document).safe
    verdict = verdict_of(tamper(document))
    assert not verdict.safe
    assert told in verdict.reason


def turning_document(written):
    documents = [read(path) for path, _ in written]
    return max(documents, key=lambda d: np.ptp(path_of(d)[1][:, 2]))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("assumptions", "range_noise"), -1.0),
        (("assumptions", "object_speed"), -1.0),
        (("assumptions", "tracking_error"), -5.0),
        (("assumptions", "object_width"), "wide"),
        (("assumptions", "blind_speed"), 50.0),
        (("robot", "discs"), []),
        (("robot", "discs", 0), [0.0, -0.4]),
        (("robot", "track"), 0.0),
        (("robot", "kind"), "tank"),
        (("moments",), []),
        (("moments", 0, "clear_radius"), -1.0),
        (("moments", 0, "scans", 0, "angle_increment"), 1.0),
        (("trajectory", "brakes_from"), 10_000),
        (("trajectory", "times", "shape"), [3]),
        (("trajectory", "times", "data"), "nonsense"),
    ],
)
def test_numbers_that_cannot_be_are_refused(path, value, chair):
    with pytest.raises(CertificateError):
        certificate_of(changed_at(moving_document(chair), path, value))


def test_a_path_moved_towards_an_obstacle_fails_where_and_when_it_comes_too_near(chair):
    document = moving_document(chair)
    times, states = path_of(document)
    # sideways, up to where the long box south of the way begins to matter
    for aside in np.arange(0.0, 1.5, 0.05):
        verdict = verdict_of(shifted(document, 0.0, -aside))
        if not verdict.safe:
            break
    assert aside > 0
    place = verdict.proof.failed
    assert f"t = {place.time:.3f} s" in verdict.reason
    assert f"({place.x:.3f}, {place.y:.3f})" in verdict.reason
    at = [np.interp(place.time, times, states[:, k]) for k in (0, 1)]
    assert np.hypot(place.x - at[0], place.y - (at[1] - aside)) < 1e-3
    assert place.room < place.need
    assert place.need >= CHAIR.disc_radius


def test_a_scan_that_a_later_one_contradicts_is_not_relied_on(forgetful):
    document = next(d for d in map(read, (p for p, _ in forgetful[8:])) if len(d["moments"]) == 2)
    assert verdict_of(document).safe
    # the newest scan, which lost all beams, meets somebody in the middle of what was seen empty
    newest = document["moments"][0]["scans"][0]
    ranges = np.full(360, np.nan)
    ranges[180:184] = 0.6
    newest["ranges"] = pack(ranges)
    verdict = verdict_of(document)
    assert not verdict.safe
    assert len(verdict.contradictions) == 1
    assert "not relied on" in verdict.told()


def test_a_safe_path_is_free_at_any_moment_between_its_samples_too(forgetful):
    certificate = certificate_of(read(forgetful[10][0]))
    assert verify(certificate).safe
    moment = np.arange(certificate.begin, certificate.times[-1], 2.5e-4)
    columns = [np.interp(moment, certificate.times, column) for column in certificate.states.T]
    moves = (columns[3] != 0) | (columns[4] != 0)
    moment, x, y = moment[moves], columns[0][moves], columns[1][moves]
    room = np.full(len(moment), -np.inf)
    for seen in certificate.moments:
        model = model_of(seen, certificate.robot, certificate.assumptions, None)
        room = np.maximum(room, model.room(np.stack([x, y], axis=1), moment))
    assert len(moment) > 500
    assert room.min() > CHAIR.disc_radius


@pytest.mark.parametrize("robot", [CAR, CHAIR], ids=["car", "chair"])
def test_no_motion_within_the_limits_leaves_the_line_by_more_than_is_added(robot):
    generator = np.random.default_rng(5)
    declared = robot_from(robot_of(robot))
    (low_a, high_a), (low_b, high_b) = declared.limits
    worst = 0.0
    for _ in range(200):
        start = np.zeros(5)
        start[3:] = generator.uniform(low_a, high_a), generator.uniform(low_b, high_b)
        inputs = np.array(declared.rates) * generator.choice([-1.0, 0.0, 1.0], 2)
        dt, offset = generator.uniform(0.01, 0.1), generator.uniform(-2, 2)
        path = [start]
        for _ in range(20):
            path.append(exact.rk4(robot, path[-1], inputs, dt / 20, dt / 20))
        path = np.array(path)
        ends = path[[0, -1]]
        within = (np.abs(ends[1, 3:]) <= [high_a, high_b]).all() and ends[1, 3] >= low_a
        if not within:
            continue
        x = path[:, 0] + offset * np.cos(path[:, 2])
        y = path[:, 1] + offset * np.sin(path[:, 2])
        share = np.linspace(0, 1, 21)
        off = np.hypot(x - x[0] - share * (x[-1] - x[0]), y - y[0] - share * (y[-1] - y[0])).max()
        added = float(declared.wobble(ends, np.array([dt]), offset)[0])
        assert off <= added
        worst = max(worst, off / added)
    assert worst > 0.3, "a bound that nothing comes near is no bound but a guess"


# the command ---------------------------------------------------------------------------------


def test_the_command_tells_safe_from_unsafe_and_from_what_is_none(chair, tmp_path, capsys):
    good = str(chair[15][0])
    assert main(["verify", good]) == 0
    assert "safe from t = " in capsys.readouterr().out
    write(tmp_path / "bad.json", without_tail(read(chair[15][0])))
    assert main(["verify", good, str(tmp_path / "bad.json")]) == 1
    assert "NOT safe" in capsys.readouterr().out
    (tmp_path / "none.json").write_text("{")
    assert main(["verify", str(tmp_path / "none.json"), good, str(tmp_path / "nowhere")]) == 2
    told = capsys.readouterr()
    assert told.err.count("error") == 2
    assert "Traceback" not in told.err
    assert "safe from t = " in told.out


def test_help_of_verify_shows_an_example(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["verify", "--help"])
    assert ended.value.code == 0
    assert "passpmp verify" in capsys.readouterr().out.partition("example")[2]


def test_a_run_leaves_certificates(tmp_path, capsys):
    scenario = tmp_path / "short.yaml"
    scenario.write_text(
        "description: a short drive in the open\nrobot: {type: differential}\n"
        "settings: {object_speed: 1.0}\nlidars: [{range_max: 8, beams: 360}]\n"
        "world: {bounds: [-5, -5, 5, 5]}\nstart: [0, 0, 0]\ngoals: [[1, 0]]\nduration: 1\n"
    )
    folder = tmp_path / "out"
    arguments = ["run", str(scenario), "--certificates", str(folder), "--certify-every", "3"]
    assert main(arguments) == 0
    assert str(folder) in capsys.readouterr().out
    files = sorted(str(path) for path in folder.iterdir())
    assert len(files) == 4
    assert main(["verify", *files]) == 0


# the model ---------------------------------------------------------------------------------------


def test_what_the_planner_calls_free_is_free_and_nobody_reaches_what_the_verifier_calls_free():
    grid = exact_free = 0
    for seed in range(24):
        generator = np.random.default_rng([77, seed])
        case = cases.random_case(generator)
        settings = case.settings
        states, times = cases.random_states(case, 300, generator)
        points, radius = states[:, :2], case.robot.disc_radius
        need = radius + settings.tracking_error + 2 * settings.localisation_error
        claimed = ~case.model().occupied(points, times)
        free = gridless.gridless(case).free(points, need, times)
        assert free[claimed].all(), f"seed {seed}"
        true = case.true_states(states, generator)[free, :2]
        attackers = hidden.hidden_discs(case, 200, generator)
        touched = attack.reaches(true, case.age(times[free]), attackers, radius, case.blockers)
        touched |= exact.box_distance(true, case.world) < radius
        assert not touched.any(), f"seed {seed}"
        grid, exact_free = grid + int(claimed.sum()), exact_free + int(free.sum())
    assert exact_free > 3000
    assert grid > 0.8 * exact_free


def test_distances_are_those_to_the_nearest_place_that_is_not_proven():
    turn = np.linspace(0, 2 * np.pi, 3000, endpoint=False)
    rim = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    asked = 0
    for seed in range(12):
        generator = np.random.default_rng([78, seed])
        case = cases.random_case(generator)
        model = gridless.gridless(case)
        points = cases.random_states(case, 30, generator)[0][:, :2]
        to_unseen = model.margins(points)[0]

        def proven(places, model=model):
            return np.any([view.proves(places) for view in model.views], axis=0)

        inside = proven(points)
        assert (to_unseen[~inside] == 0).all()
        for point, distance in zip(points[inside], to_unseen[inside], strict=True):
            assert proven(point + distance * rim).all()
            # as far as distances may fall short, and what 3000 bearings may miss
            beyond = (distance + RESOLUTION) * 1.01 + 0.02
            assert not proven(point + beyond * rim).all()
            asked += 1
    assert asked > 150
