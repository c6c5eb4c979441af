"""The `passpmp` command: parsing and printing; what it does lives elsewhere."""

from __future__ import annotations

import argparse
import contextlib
import io
import math
import os
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hardware import doctor
from hardware import drive as driving
from passpmp_ti import door
from passpmp_ti.bench import command
from passpmp_ti.benchmark import command as benchmarking
from passpmp_ti.compare import command as comparing
from passpmp_ti.reproduce import command as reproducing

if TYPE_CHECKING:
    from passpmp_ti.sim.scenario import Scenario

FAILED, BAD_INPUT, INTERRUPTED = 1, 2, 130
"""Exit codes."""
CERTIFIED = ("passpmp-pso", "passpmp")
"""Planners whose cycles can be certified."""

# Heavy imports stand inside the subcommands: `passpmp --help` answers at once.


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    given = _parser().parse_args(arguments)
    given.command = shlex.join(["passpmp", *(sys.argv[1:] if arguments is None else arguments)])
    os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
    try:
        return int(given.action(given))
    except (ValueError, OSError) as error:
        print(f"passpmp: error: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("passpmp: interrupted", file=sys.stderr)
        return INTERRUPTED


def _run(given: argparse.Namespace) -> int:
    from passpmp_ti.viz.report import Progress, summary_table

    scenario = _scenario(given)
    seeds = given.seeds or [given.seed]
    if given.certificates and given.planner not in CERTIFIED:
        raise ValueError(
            f"--certificates: {given.planner} proves nothing; leave it out, or take --planner"
            f" {CERTIFIED[0]}"
        )
    if given.certificates and scenario.settings.tracks:
        raise ValueError(
            f"--certificates are of what is proven strictly, and {scenario.settings.mode} mode is a"
            " matter of chance; leave them out, or take --set mode=conservative"
        )
    for folder in filter(None, (given.out, given.certificates)):
        Path(folder).mkdir(parents=True, exist_ok=True)
    summaries: list[Mapping[str, Any]] = []
    interrupted = False
    for seed in seeds:
        progress = Progress()
        out, certificates = (
            None if not folder else Path(folder) / (f"seed-{seed}" if len(seeds) > 1 else "")
            for folder in (given.out, given.certificates)
        )
        watchers: list[Callable[[Any], None]] = [progress.see]
        if certificates is not None:
            watchers.append(_certifying(certificates, given.certify_every))
        try:
            video = not given.no_video
            summaries.append(_drive(scenario, seed, watchers, out, video, given.planner))
        except KeyboardInterrupt:
            interrupted = True
        finally:
            progress.end()
        if interrupted or summaries[-1]["interrupted"]:
            interrupted = True
            break
    if summaries:
        print(f"\n{scenario.name}: {scenario.description}")
        print(summary_table(summaries))
    if interrupted:
        whole = sum(not s["interrupted"] for s in summaries)
        print(
            f"passpmp: interrupted; {whole} of {len(seeds)} runs ended by themselves",
            file=sys.stderr,
        )
    if given.out:
        print(f"\nwritten to {given.out}")
    if given.certificates:
        print(f"certificates: {given.certificates}")
    return INTERRUPTED if interrupted else 0


def _drive(
    scenario: Scenario,
    seed: int,
    watchers: Sequence[Callable[[Any], None]],
    out: Path | None,
    video: bool,
    planner: str,
) -> Mapping[str, Any]:
    """One episode, watched; what was seen is written even if it is cut short."""
    from passpmp_ti.sim.episode import simulate
    from passpmp_ti.sim.planners import planner_for

    _start()
    made = planner_for(planner, scenario, seed)
    if out is None:
        return simulate(scenario, seed=seed, on_cycle=_all(*watchers), planner=made).summary()
    from passpmp_ti.viz.outcome import Outcome

    settings = scenario.settings
    detail = f"seed {seed} · objects ≤ {settings.object_speed:.3g} m/s · cycle {settings.cycle:g} s"
    with Outcome(out, scenario.name, detail, video=video) as outcome:
        watch = _all(*watchers, outcome.see)
        episode = simulate(scenario, seed=seed, on_cycle=watch, planner=made)
        return outcome.finish(episode)


def _all(*watchers: Callable[[Any], None]) -> Callable[[Any], None]:
    def see(info: Any) -> None:
        for watcher in watchers:
            watcher(info)

    return see


def _certifying(folder: Path, every: int) -> Callable[[Any], None]:
    from passpmp_ti.certificate.writer import CertificateWriter

    writer = CertificateWriter(folder, every=every)

    def see(info: Any) -> None:
        writer.see(info.scans, info.state, info.navigator)

    return see


def _verify(given: argparse.Namespace) -> int:
    from passpmp_verify.__main__ import check

    return check(given.files)


def _map(given: argparse.Namespace) -> int:
    scenario = _scenario(given)
    from passpmp_ti.viz.outcome import write_png
    from passpmp_ti.viz.region_map import draw_region_map, region_map
    from passpmp_ti.viz.report import map_report

    _start()
    heading = None if given.heading is None else math.radians(given.heading)
    found = region_map(scenario, given.speed, heading, seed=given.seed, after=given.time)
    path = Path(given.out)
    if not path.suffix:
        path = path.with_suffix(".png")
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png(path, draw_region_map(found))
    print(map_report(found))
    print(f"picture: {path}")
    return 0


def _bench(given: argparse.Namespace) -> int:
    def scenario_of(name: str) -> Scenario:
        given.scenario = name
        return _scenario(given)

    return command.run(given, scenario_of)


def _compare(given: argparse.Namespace) -> int:
    return comparing.run(given, _settings(given))


def _attack(given: argparse.Namespace) -> int:
    if given.replay:
        return _replay(given)
    from passpmp_ti.attack.campaign import (
        EPISODES,
        Campaign,
        carry_out_all,
        default_kinds,
        failed,
        read_results,
    )
    from passpmp_ti.attack.case import KINDS, ROBOTS
    from passpmp_ti.attack.progress import CampaignProgress
    from passpmp_ti.attack.report import markdown, write_report

    robots = ROBOTS if given.robot == "both" else (given.robot,)
    kinds = tuple(given.kinds.split(",")) if given.kinds else default_kinds()
    for kind in kinds:
        door.choice("attack", "kinds", kind, KINDS)
    workers = door.whole("attack", "workers", given.workers or os.cpu_count() or 1, least=1)
    campaign = Campaign(
        robots=robots,
        kinds=kinds,
        episodes=given.episodes if given.episodes or given.cycles else 2 * len(kinds),
        cycles=given.cycles,
        seed=given.seed,
        duration=given.duration,
        cheat_speed=given.cheat_speed,
        changes=dict(_assignment(text) for text in given.set or ()),
    )
    folder = Path(given.out)
    if (folder / EPISODES).exists() and not given.resume:
        raise ValueError(f"{folder} holds a campaign; go on with --resume, or choose another --out")
    progress = CampaignProgress(campaign, read_results(folder))
    interrupted = False
    try:
        carry_out_all(campaign, folder, workers, progress.see)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        progress.end()
    results = read_results(folder)
    told = write_report(results, folder, "Attacks on the guarantee")
    print(markdown(told, "Attacks on the guarantee"))
    print(f"written to {folder}")
    if interrupted:
        print("passpmp: interrupted; the same command with --resume goes on", file=sys.stderr)
        return INTERRUPTED
    return FAILED if any(failed(r) for r in results) else 0


def _replay(given: argparse.Namespace) -> int:
    from passpmp_ti.attack.replay import replay
    from passpmp_ti.viz.report import table

    _start(threads=1)
    out = Path(given.out) / Path(given.replay).stem
    now, same = replay(Path(given.replay), None if given.no_video else out)
    print(table([(key, str(value)) for key, value in now.items()], left=2))
    print("the same to the last bit" if same else "NOT the same as was written")
    if not given.no_video:
        print(f"written to {out}")
    return 0 if same else FAILED


def _faults(given: argparse.Namespace) -> int:
    from passpmp_ti.faults.campaign import ROBOTS, run_faults
    from passpmp_ti.faults.report import markdown

    robots = ROBOTS if given.robot == "both" else (given.robot,)

    def progress(done: int, of: int, standing: str) -> None:
        print(f"\r{done} of {of} drives, {standing}  ", end="", file=sys.stderr, flush=True)

    found = run_faults(
        robots,
        given.times,
        premises=given.premises,
        workers=given.workers or os.cpu_count() or 1,
        seed=given.seed,
        out=given.out,
        progress=progress,
    )
    print(file=sys.stderr)
    print(markdown(found))
    if given.out:
        print(f"written to {given.out}")
    if found.jobs < found.of:
        return INTERRUPTED
    return FAILED if found.failures else 0


def _scenarios(_: argparse.Namespace) -> int:
    import yaml

    from passpmp_ti.sim.scenario import SHIPPED, shipped
    from passpmp_ti.viz.report import table

    # only the one line: a scenario may need data that is not here
    files = [(name, yaml.safe_load((SHIPPED / f"{name}.yaml").read_text())) for name in shipped()]
    print(table([(name, str(file["description"])) for name, file in files], left=2))
    return 0


def _start(threads: int | None = None) -> None:
    """Start the kernels; Taichi greets on standard output, which belongs to the results."""
    from passpmp_ti import backend

    with contextlib.redirect_stdout(io.StringIO()):
        backend.init(threads=threads)


def _scenario(given: argparse.Namespace) -> Scenario:
    """The scenario with what the command line changes in it."""
    from passpmp_ti.sim.scenario import load_scenario

    return load_scenario(given.scenario).changed(_settings(given), object_speed=given.object_speed)


def _settings(given: argparse.Namespace) -> dict[str, Any]:
    """The fields of `Settings` that the command line changes."""
    settings = dict(_assignment(assignment) for assignment in given.set or ())
    return settings if given.cycle is None else settings | {"cycle": given.cycle}


def _assignment(text: str) -> tuple[str, Any]:
    import yaml

    name, sign, value = text.partition("=")
    if not sign or not name.strip():
        raise ValueError(f"--set takes field=value, for example particles=50; got {text!r}")
    try:
        parsed = yaml.safe_load(value)
    except yaml.YAMLError as error:
        raise ValueError(f"--set {text!r}: the value cannot be read; {error}") from error
    return name.strip(), tuple(parsed) if isinstance(parsed, list) else parsed


def _seeds(text: str) -> list[int]:
    first, _, last = text.partition("-")
    try:
        low, high = int(first), int(last or first)
    except ValueError:
        low, high = 0, -1
    if high < low:
        raise argparse.ArgumentTypeError(f"seeds are given as A-B with A <= B; got {text!r}")
    return list(range(low, high + 1))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="passpmp",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Motion planning that is at rest before anything can hit the robot.",
        epilog="example:\n  passpmp run crowded --object-speed 5 --out out/crowded",
    )
    commands = parser.add_subparsers(required=True, metavar="command")

    run = _command(
        commands,
        "run",
        "drive through a scenario",
        _run,
        "passpmp run crowded --object-speed 5 --seed 3 --out out/crowded",
    )
    _scenario_options(run)
    run.add_argument("--seeds", type=_seeds, metavar="A-B", help="several seeds, one after another")
    run.add_argument("--out", metavar="DIR", help="leave video, snapshots, summary and arrays here")
    run.add_argument("--no-video", action="store_true", help="with --out: no video")
    run.add_argument(
        "--planner",
        default="passpmp-pso",
        metavar="NAME",
        help="passpmp-pso (default), passpmp, iss, dwa, mppi or viability; see docs/baselines.md",
    )
    run.add_argument(
        "--certificates", metavar="DIR", help="leave a certificate of each cycle here"
    )
    run.add_argument(
        "--certify-every", type=int, default=1, metavar="N", help="of each n-th cycle (default: 1)"
    )

    region = _command(
        commands,
        "map",
        "draw the braking-ICS region at a scenario's start",
        _map,
        "passpmp map crowded --speed 10 --heading 30 --out out/map.png",
    )
    _scenario_options(region)
    region.add_argument(
        "--speed", type=float, required=True, metavar="V", help="of the states [m/s]"
    )
    region.add_argument(
        "--heading",
        type=float,
        metavar="DEG",
        help="of the states [deg]; the robot's at its start if left out",
    )
    region.add_argument(
        "--time",
        type=float,
        default=0.0,
        metavar="S",
        help="of the scan, after the start [s] (default: 0)",
    )
    region.add_argument(
        "--out", default="map.png", metavar="FILE", help="picture (default: map.png)"
    )

    bench = _command(
        commands, "bench", "measure speed and memory, beside others", _bench, command.EXAMPLE
    )
    command.add_options(bench)
    _scenario_changes(bench)

    compare = _command(
        commands,
        "compare",
        "drive the same worlds in several safety modes, and write a page about it",
        _compare,
        comparing.EXAMPLE,
    )
    comparing.add_options(compare)
    _scenario_changes(compare)

    benchmarking.add_options(
        _command(
            commands,
            "benchmark",
            "drive worlds for which others have published results",
            benchmarking.run,
            benchmarking.EXAMPLE,
        )
    )

    reproducing.add_options(
        _command(
            commands,
            "reproduce",
            "run the paper's tables and figures again, and put ours beside them",
            reproducing.run,
            reproducing.EXAMPLE,
        )
    )

    driving.add_options(
        _command(
            commands,
            "drive",
            "drive a robot, or a wheelchair in MuJoCo, through the whole chain, lidars to wheels",
            driving.run,
            driving.EXAMPLE,
        )
    )
    doctor.add_options(
        _command(
            commands,
            "doctor",
            "say what is installed, reachable and fast enough",
            doctor.run,
            doctor.EXAMPLE,
        )
    )

    _attack_options(
        _command(
            commands,
            "attack",
            "let movers hunt the robot, and count what they achieve",
            _attack,
            "passpmp attack --robot both --cycles 100000 --workers 2 --out out/attack",
        )
    )
    faults = _command(
        commands,
        "faults",
        "put faults of sensors, clocks and the planner into running cycles, or break premises",
        _faults,
        "passpmp faults --times 1000 --workers 2 --out out/faults",
    )
    faults.add_argument(
        "--robot", choices=("car", "wheelchair", "both"), default="both", help="(default: both)"
    )
    faults.add_argument(
        "--times", type=int, default=10, metavar="N", help="of each kind and robot (default: 10)"
    )
    faults.add_argument(
        "--premises", action="store_true", help="break premises instead of putting in faults"
    )
    faults.add_argument(
        "--workers", type=int, metavar="K", help="processes at once (default: one a CPU)"
    )
    faults.add_argument("--seed", type=int, default=1, metavar="N", help="(default: 1)")
    faults.add_argument("--out", metavar="DIR", help="leave the tables and the counts here")

    verify = _command(
        commands,
        "verify",
        "check certificates by a verifier that shares nothing with the planner",
        _verify,
        "passpmp verify out/certificates/*.json",
    )
    verify.add_argument("files", nargs="+", metavar="FILE", help="a certificate")
    _command(
        commands, "scenarios", "list the scenarios that come along", _scenarios, "passpmp scenarios"
    )
    return parser


def _attack_options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--robot", choices=("car", "wheelchair", "both"), default="both", help="(default: both)")
    amount = parser.add_mutually_exclusive_group()
    amount.add_argument("--episodes", type=int, metavar="N", help="per robot")
    amount.add_argument("--cycles", type=int, metavar="N", help="per robot; episodes are finished")
    add(
        "--kinds",
        metavar="A,B",
        help="intercept, ambush, rim, cut-in, crowd, shadow, mixed, walkers (default: all but"
        " walkers)",
    )
    add("--workers", type=int, metavar="K", help="processes at once (default: one a CPU)")
    add("--seed", type=int, default=0, metavar="N", help="of the first episode (default: 0)")
    add("--duration", type=float, default=45.0, metavar="S", help="of an episode [s] (default: 45)")
    add("--out", default="out/attack", metavar="DIR", help="(default: out/attack)")
    add("--resume", action="store_true", help="go on with what DIR holds")
    add(
        "--set", action="append", metavar="FIELD=VALUE", help="a field of Settings; may be repeated"
    )
    add(
        "--cheat-speed",
        type=float,
        default=1.0,
        metavar="F",
        help="a check of the harness: movers F times as fast as declared",
    )
    add("--replay", metavar="FILE", help="carry out one written episode again and draw it")
    add("--no-video", action="store_true", help="with --replay: draw nothing")


def _command(
    commands: Any, name: str, what: str, action: Any, example: str
) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=what,
        description=what[0].upper() + what[1:] + ".",
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(action=action)
    return parser


def _scenario_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenario", help="a shipped name (see `passpmp scenarios`) or a file")
    _scenario_changes(parser)


def _scenario_changes(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of movers, noise and planner (default: 0)"
    )
    parser.add_argument(
        "--object-speed",
        type=float,
        metavar="V",
        help="bound on the speed of objects [m/s]; faster movers are slowed down",
    )
    parser.add_argument("--cycle", type=float, metavar="S", help="length of a planning cycle [s]")
    parser.add_argument(
        "--set",
        action="append",
        metavar="FIELD=VALUE",
        help="any other field of Settings; may be repeated",
    )


if __name__ == "__main__":
    sys.exit(main())
