"""The `passpmp` command: parsing and printing; what it does lives elsewhere."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from passpmp_ti.sim.scenario import Scenario
    from passpmp_ti.viz.outcome import Outcome
    from passpmp_ti.viz.report import Progress

BAD_INPUT, INTERRUPTED = 2, 130
"""Exit codes."""

# Heavy imports stand inside the subcommands: `passpmp --help` answers at once.


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    given = _parser().parse_args(arguments)
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
    if given.out:
        Path(given.out).mkdir(parents=True, exist_ok=True)
    summaries: list[Mapping[str, Any]] = []
    interrupted = False
    for seed in seeds:
        progress = Progress()
        out = None
        if given.out:
            out = Path(given.out) if len(seeds) == 1 else Path(given.out) / f"seed-{seed}"
        try:
            summaries.append(_drive(scenario, seed, progress, out, not given.no_video))
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
    return INTERRUPTED if interrupted else 0


def _drive(
    scenario: Scenario, seed: int, progress: Progress, out: Path | None, video: bool
) -> Mapping[str, Any]:
    """One episode, watched; what was seen is written even if it is cut short."""
    from passpmp_ti.sim.episode import simulate

    _start()
    if out is None:
        return simulate(scenario, seed=seed, on_cycle=progress.see).summary()
    from passpmp_ti.viz.outcome import Outcome

    settings = scenario.settings
    detail = f"seed {seed} · objects ≤ {settings.object_speed:.3g} m/s · cycle {settings.cycle:g} s"
    with Outcome(out, scenario.name, detail, video=video) as outcome:
        episode = simulate(scenario, seed=seed, on_cycle=_both(progress, outcome))
        return outcome.finish(episode)


def _both(progress: Progress, outcome: Outcome) -> Any:
    def see(info: Any) -> None:
        progress.see(info)
        outcome.see(info)

    return see


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


def _bench_cycle(given: argparse.Namespace) -> int:
    scenario = _scenario(given)
    from passpmp_ti.bench.cycle import measure_cycle
    from passpmp_ti.viz.report import cycle_report

    _start()
    found = measure_cycle(scenario, given.cycles, given.seed)
    print(cycle_report(found))
    if given.json:
        Path(given.json).write_text(json.dumps(found, indent=2) + "\n")
    return 0


def _scenarios(_: argparse.Namespace) -> int:
    import yaml

    from passpmp_ti.sim.scenario import SHIPPED, shipped
    from passpmp_ti.viz.report import table

    # only the one line: a scenario may need data that is not here
    files = [(name, yaml.safe_load((SHIPPED / f"{name}.yaml").read_text())) for name in shipped()]
    print(table([(name, str(file["description"])) for name, file in files], left=2))
    return 0


def _start() -> None:
    """Start the kernels; Taichi greets on standard output, which belongs to the results."""
    from passpmp_ti import backend

    with contextlib.redirect_stdout(io.StringIO()):
        backend.init()


def _scenario(given: argparse.Namespace) -> Scenario:
    """The scenario with what the command line changes in it."""
    from passpmp_ti.sim.scenario import load_scenario

    settings: dict[str, Any] = {}
    for assignment in given.set or ():
        name, value = _assignment(assignment)
        settings[name] = value
    if given.cycle is not None:
        settings["cycle"] = given.cycle
    return load_scenario(given.scenario).changed(settings, object_speed=given.object_speed)


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

    bench = commands.add_parser(
        "bench",
        help="measure",
        epilog="example:\n  passpmp bench cycle",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    measures = bench.add_subparsers(required=True, metavar="measure")
    cycle = _command(
        measures,
        "cycle",
        "time of a planning cycle, scan to trajectory",
        _bench_cycle,
        "passpmp bench cycle --cycles 200 --json cycle.json",
    )
    _scenario_options(cycle, default="crowded")
    cycle.add_argument(
        "--cycles",
        type=int,
        default=1000,
        metavar="N",
        help="how many are measured (default: 1000)",
    )
    cycle.add_argument("--json", metavar="FILE", help="write the figures there")

    _command(
        commands, "scenarios", "list the scenarios that come along", _scenarios, "passpmp scenarios"
    )
    return parser


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


def _scenario_options(parser: argparse.ArgumentParser, default: str | None = None) -> None:
    if default is None:
        parser.add_argument("scenario", help="a shipped name (see `passpmp scenarios`) or a file")
    else:
        parser.add_argument(
            "scenario",
            nargs="?",
            default=default,
            help=f"a shipped name or a file (default: {default})",
        )
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
